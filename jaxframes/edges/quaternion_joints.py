"""Joints whose coordinates hold a quaternion: the ball joint and the free one."""

import math
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.joint import Joint, as_magnitude_limits, joint_family
from jaxframes.numerics.components import V3, ZERO, Component, Quat, cross, quat_from, quat_mul, quat_norm2, rotate
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.smooth import cubic_remainder
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Rotation, Transform, Twist


def unit(q: tuple[Component, ...]) -> Quat:
    """Return four coordinates as a unit quaternion; the division is part of what is differentiated."""
    norm2 = quat_norm2(Quat(*q))
    length: Any = np.sqrt(norm2) if isinstance(norm2, np.ndarray) else jnp.sqrt(jnp.asarray(norm2))
    return Quat(*(c / length for c in q))


def _rotation(q: jax.Array) -> Rotation:
    return Rotation.from_quaternion_wxyz(q[..., :4])


def capped_angle(share: jax.Array, limit: float) -> jax.Array:
    """Return the angle below which a share of all rotations lies, of those whose angle is at most a limit.

    Rotations are counted uniformly, so the density of their angle a is 1 - cos a (Haar's measure) and the share (a - sin a) / (limit - sin
    limit); Newton's method from the cubic of small angles, from above after one step.

    Args:
        share: Between 0 and 1 [...].
        limit: Largest angle, from 0 to pi.
    """
    wanted = share * _less_sine(jnp.asarray(limit, share.dtype))
    angle = jnp.cbrt(6.0 * wanted)
    for _ in range(6):
        slope = 2.0 * jnp.square(jnp.sin(angle / 2.0))
        angle = angle - jnp.where(slope > 0, (_less_sine(angle) - wanted) / jnp.where(slope > 0, slope, 1.0), 0.0)
    return jnp.clip(angle, 0.0, limit)


def _less_sine(angle: jax.Array) -> jax.Array:
    """Return a - sin a, without cancellation where the angle is small."""
    return angle * angle * angle * cubic_remainder(angle * angle)


class QuaternionJoint(Joint):
    """What the two share: no limits of single coordinates, and a unit quaternion in the first four."""

    is_manifold: ClassVar[bool] = True

    def __init__(
        self,
        placement: Transform | None = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
    ):
        super().__init__(placement, None, velocity_limits, effort_limits, active, rest)

    def arguments(self) -> dict[str, Any]:
        return {name: value for name, value in super().arguments().items() if name != "limits"}

    def neutral(self) -> tuple[float, ...]:
        return (1.0,) + (0.0,) * (self.nq - 1) if self.rest is None else self.rest

    def angles(self) -> tuple[bool, ...]:
        return (False,) * self.nq

    def project(self, q: jax.Array) -> jax.Array:
        return jnp.concatenate([_rotation(q).wxyz, q[..., 4:]], -1)

    def random(self, key: jax.Array, q: jax.Array) -> jax.Array:
        turned = jax.random.normal(key, (*q.shape[:-1], 4), q.dtype)
        return self.project(jnp.concatenate([turned, q[..., 4:]], -1))


@joint_family("ball", static=("angle_limit",))
class Ball(QuaternionJoint):
    """A free rotation about a point: ``parent_T_child = placement @ Rot(q)`` with a quaternion of four stored numbers.

    q = (w, x, y, z), normalised inside every query, so unnormalised numbers are fine and derivatives with respect to them are
    exact; a zero quaternion gives NaN. qd = (wx, wy, wz) is the angular velocity of the child relative to the parent in the
    axes of the **child** (rad/s), as in Pinocchio and MuJoCo; qdd is its derivative. State size 4, mobility 3.

    Attributes:
        placement: Pose of the joint in the parent at the identity.
        limits: Infinite [8]: the numbers of a quaternion have none.
        angle_limit: Largest angle of the rotation in rad (static), infinite where unlimited: MJCF's ``range`` of a ball. Kept for
            ``tree.clamp``, ``tree.random`` and ``tree.check``, never enforced by a query.
        velocity_limits: Largest rates [3] in rad/s.
        effort_limits: Largest torques [3] in N m.
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: the identity.
    """

    nq: ClassVar[int] = 4
    nv: ClassVar[int] = 3
    angle_limit: float

    def __init__(
        self,
        placement: Transform | None = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
        angle_limit: float | None = None,
    ):
        super().__init__(placement, velocity_limits, effort_limits, active, rest)
        object.__setattr__(self, "angle_limit", as_magnitude_limits(angle_limit, 1, "angle")[0])

    def arguments(self) -> dict[str, Any]:
        given = super().arguments()
        return given if math.isfinite(self.angle_limit) else {name: value for name, value in given.items() if name != "angle_limit"}

    def checked_fact(self, name: str, value: Any) -> Any:
        return as_magnitude_limits(value, 1, "angle")[0] if name == "angle_limit" else super().checked_fact(name, value)

    def bare(self) -> Edge:
        return super().bare().replace(angle_limit=None)

    def clamp(self, q: jax.Array) -> jax.Array:
        """Return the quaternion with its angle brought down to the limit, about the same axis."""
        q = self.project(q)
        if self.angle_limit >= np.pi:
            return q
        w, vector = q[..., :1], q[..., 1:]
        size2 = jnp.sum(vector * vector, -1, keepdims=True)
        outside = (jnp.abs(w) < np.cos(self.angle_limit / 2)) & (size2 > 0)
        size = jnp.sqrt(jnp.where(outside, size2, 1.0))
        least, most = (jnp.asarray(f(self.angle_limit / 2), q.dtype) for f in (np.cos, np.sin))
        return jnp.where(outside, jnp.concatenate([jnp.where(w < 0, -least, least), vector / size * most], -1), q)

    def bounded(self, q: np.ndarray) -> tuple[tuple[str, np.ndarray, np.ndarray, np.ndarray], ...]:
        wxyz = q.astype(np.float64)
        angle = 2 * np.arctan2(np.linalg.norm(wxyz[..., 1:], axis=-1), np.abs(wxyz[..., 0]))
        limit, slack = np.full_like(angle, self.angle_limit), 8 * np.finfo(q.dtype).eps  # a quaternion at the limit rounds
        return (("its angle", np.where(angle <= limit + slack, np.minimum(angle, limit), angle), np.zeros_like(angle), limit),)

    def random(self, key: jax.Array, q: jax.Array) -> jax.Array:
        if self.angle_limit >= np.pi:
            return super().random(key, q)
        for_angle, for_axis = jax.random.split(key)
        angle = capped_angle(jax.random.uniform(for_angle, (*q.shape[:-1], 1), q.dtype), self.angle_limit)
        axis = jax.random.normal(for_axis, (*q.shape[:-1], 3), q.dtype)
        axis = axis / jnp.linalg.norm(axis, axis=-1, keepdims=True)
        return jnp.concatenate([jnp.cos(angle / 2), axis * jnp.sin(angle / 2)], -1)

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
        rest: Coordinates that ``tree.state()`` starts with (static). Default: the identity.
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
