"""Twist and Wrench: a velocity and a load at a reference point, with KDL's rules for changing base and point."""

from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from jaxframes.numerics.batch import tag
from jaxframes.numerics.components import V3, Quat, cross, dot, rotate, rotate_inverse
from jaxframes.numerics.lift import lift
from jaxframes.spatial.value import LinearValue
from jaxframes.spatial.velocity import SpatialVelocity, as_vector, halves


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Twist(LinearValue):
    """The velocity of a rigid body: of a reference point (``linear`` [..., 3], m/s) and angular (``angular`` [..., 3], rad/s).

    Which point and which axes is the user's to know; ``ref_point``, ``change_base`` and ``transform`` change them. Both vectors are
    given by name: KDL has the linear one first, 6-vectors here have the angular one first.
    """

    linear: jax.Array
    angular: jax.Array
    kind: str = tag("Twist")
    _names: ClassVar[tuple[str, str]] = ("linear", "angular")

    @classmethod
    def from_spatial_velocity(cls, velocity: SpatialVelocity, point: Any) -> "Twist":
        """Return the twist, in the axes of the velocity, of the point of the body that is at ``point`` [..., 3].

        ``point`` is counted from the origin of the moving frame, along the same axes: zeros for the twist of that origin,
        ``-translation`` for the twist of the body's point at the observer's origin.
        """
        return cls(linear=_shift(velocity.linear, velocity.angular, point), angular=jnp.asarray(velocity.angular))

    @classmethod
    def from_vector(cls, vector: Any) -> "Twist":
        """Return the twist of arrays [..., 6] in the order [angular, linear]."""
        angular, linear = halves(vector)
        return cls(linear=linear, angular=angular)

    def to_spatial_velocity(self, point: Any) -> SpatialVelocity:
        """Return the velocity of a frame fixed in the body whose origin is at ``point`` [..., 3] from the reference point."""
        return SpatialVelocity(angular=jnp.asarray(self.angular), linear=_shift(self.linear, self.angular, point))

    def as_vector(self) -> jax.Array:
        """Return [angular, linear] as one array [..., 6] (KDL has the other order)."""
        return as_vector(self.angular, self.linear)

    def ref_point(self, displacement: Any) -> "Twist":
        """Return the twist of another point, ``displacement`` [..., 3] from the present one in the same axes: v + w x d."""
        return Twist(linear=_shift(self.linear, self.angular, displacement), angular=jnp.asarray(self.angular))

    def transform(self, pose: Any) -> "Twist":
        """Return the twist with base and reference point moved by ``a_T_b``, from b's origin and axes to a's."""
        linear, angular = _forward(pose.rotation.wxyz, pose.translation, self.linear, self.angular)
        return Twist(linear=linear, angular=angular)

    def inverse_transform(self, pose: Any) -> "Twist":
        """Return the twist with base and reference point moved back by ``a_T_b``, from a's origin and axes to b's."""
        linear, angular = _backward(pose.rotation.wxyz, pose.translation, self.linear, self.angular)
        return Twist(linear=linear, angular=angular)

    def inverse_change_base(self, rotation: Any) -> "Twist":
        """Return the twist along other axes: turned back by ``a_R_b``, from a axes to b axes."""
        return self.change_base(rotation.inverse())

    def dot(self, wrench: "Wrench") -> jax.Array:
        """Return the power [...] of a wrench about the same point in the same axes: v . f + w . t."""
        return _power(self.linear, self.angular, wrench.force, wrench.torque)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Wrench(LinearValue):
    """A load: ``force`` [..., 3] in newtons and ``torque`` [..., 3] in newton metres about a reference point.

    Which point and which axes is the user's to know; ``ref_point``, ``change_base`` and ``transform`` change them. Both vectors are
    given by name: KDL has the force first, 6-vectors here have the torque first.
    """

    force: jax.Array
    torque: jax.Array
    kind: str = tag("Wrench")
    _names: ClassVar[tuple[str, str]] = ("force", "torque")

    @classmethod
    def from_vector(cls, vector: Any) -> "Wrench":
        """Return the wrench of arrays [..., 6] in the order [torque, force]."""
        torque, force = halves(vector)
        return cls(force=force, torque=torque)

    def as_vector(self) -> jax.Array:
        """Return [torque, force] as one array [..., 6]: angular before linear, as everywhere (KDL has the other order)."""
        return as_vector(self.torque, self.force)

    def ref_point(self, displacement: Any) -> "Wrench":
        """Return the wrench about another point, ``displacement`` [..., 3] from the present one in the same axes: t + f x d."""
        return Wrench(force=jnp.asarray(self.force), torque=_shift(self.torque, self.force, displacement))

    def transform(self, pose: Any) -> "Wrench":
        """Return the wrench with base and reference point moved by ``a_T_b``, from b's origin and axes to a's."""
        torque, force = _forward(pose.rotation.wxyz, pose.translation, self.torque, self.force)
        return Wrench(force=force, torque=torque)

    def inverse_transform(self, pose: Any) -> "Wrench":
        """Return the wrench with base and reference point moved back by ``a_T_b``, from a's origin and axes to b's."""
        torque, force = _backward(pose.rotation.wxyz, pose.translation, self.torque, self.force)
        return Wrench(force=force, torque=torque)

    def inverse_change_base(self, rotation: Any) -> "Wrench":
        """Return the wrench along other axes: turned back by ``a_R_b``, from a axes to b axes."""
        return self.change_base(rotation.inverse())

    def dot(self, twist: Twist) -> jax.Array:
        """Return the power [...] of this wrench on a twist of the same point in the same axes: f . v + t . w."""
        return _power(twist.linear, twist.angular, self.force, self.torque)


@lift(V3, V3, V3, out=V3)
def _shift(moment: V3, resultant: V3, d: V3) -> V3:
    """Return the moment (velocity or torque) at a point d away: m + r x d."""
    return moment + cross(resultant, d)


@lift(Quat, V3, V3, V3, out=(V3, V3))
def _forward(q: Quat, p: V3, moment: V3, resultant: V3) -> tuple[V3, V3]:
    turned = rotate(q, resultant)
    return rotate(q, moment) + cross(p, turned), turned


@lift(Quat, V3, V3, V3, out=(V3, V3))
def _backward(q: Quat, p: V3, moment: V3, resultant: V3) -> tuple[V3, V3]:
    return rotate_inverse(q, moment - cross(p, resultant)), rotate_inverse(q, resultant)


@lift(V3, V3, V3, V3, out=None)
def _power(v: V3, w: V3, force: V3, torque: V3) -> jax.Array | float:
    return dot(v, force) + dot(w, torque)
