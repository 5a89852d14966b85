"""Joints whose coordinates hold a quaternion: the ball joint and the free one."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Inputs
from jaxframes.edges.joint import Joint, joint_family
from jaxframes.numerics.components import V3, ZERO, Component, Quat, cross, quat_from, quat_mul, quat_norm2, rotate
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Rotation, Transform, Twist


def unit(q: tuple[Component, ...]) -> Quat:
    """Return four coordinates as a unit quaternion; the division is part of what is differentiated."""
    norm2 = quat_norm2(Quat(*q))
    length: Any = np.sqrt(norm2) if isinstance(norm2, np.ndarray) else jnp.sqrt(jnp.asarray(norm2))
    return Quat(*(c / length for c in q))


def _rotation(q: jax.Array) -> Rotation:
    return Rotation.from_quaternion_wxyz(q[..., :4])


class QuaternionJoint(Joint):
    """What the two share: no limits, and a unit quaternion in the first four coordinates."""

    is_manifold: ClassVar[bool] = True

    def __init__(self, placement: Transform | None = None, velocity_limits: Any = None, effort_limits: Any = None, active: bool = True):
        super().__init__(placement, None, velocity_limits, effort_limits, active)

    def arguments(self) -> dict[str, Any]:
        return {name: value for name, value in super().arguments().items() if name != "limits"}

    def neutral(self) -> tuple[float, ...]:
        return (1.0,) + (0.0,) * (self.nq - 1)

    def angles(self) -> tuple[bool, ...]:
        return (False,) * self.nq

    def project(self, q: jax.Array) -> jax.Array:
        return jnp.concatenate([_rotation(q).wxyz, q[..., 4:]], -1)

    def random(self, key: jax.Array, q: jax.Array) -> jax.Array:
        turned = jax.random.normal(key, (*q.shape[:-1], 4), q.dtype)
        return self.project(jnp.concatenate([turned, q[..., 4:]], -1))


@joint_family("ball")
class Ball(QuaternionJoint):
    """A free rotation about a point: ``parent_T_child = placement @ Rot(q)`` with a quaternion of four stored numbers.

    q = (w, x, y, z), normalised inside every query, so unnormalised numbers are fine and derivatives with respect to them are
    exact; a zero quaternion gives NaN. qd = (wx, wy, wz) is the angular velocity of the child relative to the parent in the
    axes of the **child** (rad/s), as in Pinocchio and MuJoCo; qdd is its derivative. State size 4, mobility 3.

    Attributes:
        placement: Pose of the joint in the parent at the identity.
        limits: Infinite [8]: a quaternion has none.
        velocity_limits: Largest rates [3] in rad/s.
        effort_limits: Largest torques [3] in N m.
        active: Whether the joint is driven (static).
    """

    nq: ClassVar[int] = 4
    nv: ClassVar[int] = 3

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        rotation, translation = inputs.pose(self.placement)
        turned = quat_mul(rotation, unit(inputs.q))
        w = rotate(turned, V3(*inputs.qd)) if order > 0 else ZERO
        alpha = rotate(turned, V3(*inputs.qdd)) if order > 1 else ZERO
        return (Rigid(turned, translation, angular=w, angular2=alpha),)

    def coordinate_rates(self, q: tuple[Component, ...], qd: tuple[Component, ...]) -> tuple[Component, ...]:
        """Return dq/dt = q (0, qd) / 2, which keeps the norm of q."""
        return tuple(quat_mul(Quat(*q), quat_from(0.0, V3(*qd) * 0.5)))

    def integrate(self, q: jax.Array, step: jax.Array) -> jax.Array:
        """Return q exp(step)."""
        return (_rotation(q) @ Rotation.from_rotation_vector(step)).normalize().wxyz

    def difference(self, q0: jax.Array, q1: jax.Array) -> jax.Array:
        """Return log(q0* q1), of length at most pi."""
        return (_rotation(q0).inverse() @ _rotation(q1)).to_rotation_vector()


@joint_family("free")
class Free(QuaternionJoint):
    """All six directions: ``parent_T_child = placement @ Trans(p) @ Rot(q)``, with seven stored numbers.

    q = (w, x, y, z, px, py, pz): quaternion before position as everywhere in jaxframes, and normalised as in ``Ball``.
    qd = (wx, wy, wz, vx, vy, vz): angular, then linear velocity of the child's origin, both in the axes of the **child** (the
    body twist; Pinocchio's free-flyer has the same two vectors, linear first). qdd is the derivative of these six numbers, so the
    classical linear acceleration in the child's axes is qdd[3:] + w x v. State size 7, mobility 6.

    Attributes:
        placement: Pose of the joint in the parent at the identity.
        limits: Infinite [14].
        velocity_limits: Largest rates [6] in rad/s and m/s.
        effort_limits: Largest torques and forces [6].
        active: Whether the joint is driven (static).
    """

    nq: ClassVar[int] = 7
    nv: ClassVar[int] = 6

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        rotation, translation = inputs.pose(self.placement)
        turned = quat_mul(rotation, unit(inputs.q[:4]))
        translation = translation + rotate(rotation, V3(*inputs.q[4:]))
        zero = Rigid(turned, translation)
        if order == 0:
            return (zero,)
        body_w, body_v = V3(*inputs.qd[:3]), V3(*inputs.qd[3:])
        w, v = rotate(turned, body_w), rotate(turned, body_v)
        if order == 1:
            return (Rigid(turned, translation, w, v),)
        body_a = V3(*inputs.qdd[3:]) + cross(body_w, body_v)
        return (Rigid(turned, translation, w, v, rotate(turned, V3(*inputs.qdd[:3])), rotate(turned, body_a)),)

    def coordinate_rates(self, q: tuple[Component, ...], qd: tuple[Component, ...]) -> tuple[Component, ...]:
        """Return dq/dt = q (0, w) / 2 and dp/dt = R(q) v."""
        turn = quat_mul(Quat(*q[:4]), quat_from(0.0, V3(*qd[:3]) * 0.5))
        return (*turn, *rotate(unit(q[:4]), V3(*qd[3:])))

    def integrate(self, q: jax.Array, step: jax.Array) -> jax.Array:
        """Return the pose moved along the screw of a constant body twist: T exp(step)."""
        moved = Transform(_rotation(q), q[..., 4:]).retract(Twist(linear=step[..., 3:], angular=step[..., :3]))
        return jnp.concatenate([moved.rotation.normalize().wxyz, moved.translation], -1)

    def difference(self, q0: jax.Array, q1: jax.Array) -> jax.Array:
        """Return log(T0^-1 T1) as (angular, linear)."""
        twist = Transform(_rotation(q1), q1[..., 4:]).relative_to(Transform(_rotation(q0), q0[..., 4:])).log()
        return jnp.concatenate([twist.angular, twist.linear], -1)
