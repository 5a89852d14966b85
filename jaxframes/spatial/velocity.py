"""SpatialVelocity and SpatialAcceleration: how one frame moves relative to another, angular part first."""

from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from jaxframes.errors import ShapeError
from jaxframes.numerics.batch import tag
from jaxframes.numerics.components import V3, cross
from jaxframes.numerics.lift import lift
from jaxframes.spatial.value import LinearValue
from jaxframes.staging.arrays import as_float


def _halves(vector: Any) -> tuple[jax.Array, jax.Array]:
    vector = as_float(vector)
    if vector.ndim == 0 or vector.shape[-1] != 6:
        raise ShapeError(f"[angular, linear] is an array of shape [..., 6]; found {vector.shape}")
    return vector[..., :3], vector[..., 3:]


def as_vector(angular: Any, linear: Any) -> jax.Array:
    """Return [angular, linear] as one array [..., 6]."""
    return _six(angular, linear)


@lift(V3, V3, out=tuple)
def _six(a: V3, b: V3) -> tuple[Any, ...]:
    return (*a, *b)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False)
class SpatialVelocity(LinearValue):
    """The velocity of a frame b relative to a frame a, as an observer fixed in a sees it.

    ``angular`` [..., 3] in rad/s is the angular velocity of b, ``linear`` [..., 3] in m/s the velocity of b's origin; both are
    resolved along the axes of a, unless ``change_base`` said otherwise. Without ``change_base`` the linear part is the time
    derivative of the translation of ``a_T_b``.
    """

    angular: jax.Array
    linear: jax.Array
    kind: str = tag("SpatialVelocity")
    _names: ClassVar[tuple[str, str]] = ("angular", "linear")

    @classmethod
    def from_vector(cls, vector: Any) -> "SpatialVelocity":
        """Return the velocity of arrays [..., 6] in the order [angular, linear]."""
        return cls(*_halves(vector))

    def as_vector(self) -> jax.Array:
        """Return [angular, linear] as one array [..., 6]."""
        return as_vector(self.angular, self.linear)

    def at_point(self, displacement: Any) -> "SpatialVelocity":
        """Return the velocity of another point fixed in b, ``displacement`` [..., 3] away from the present one in the same axes."""
        return SpatialVelocity(jnp.asarray(self.angular), _moved(self.angular, self.linear, displacement))

    def cross_motion(self, other: Any) -> Any:
        """Return the motion cross product v x m (Featherstone's crm) with a velocity or acceleration at the same point.

        Both must refer to one point and one set of axes: angular w x m_w, linear w x m_v + v x m_w.
        """
        return type(other)(*_cross_motion(self.angular, self.linear, other.angular, other.linear))

    def cross_force(self, wrench: Any) -> Any:
        """Return the force cross product v x* f (Featherstone's crf) with a ``Wrench`` about the same point.

        Torque w x t + v x f, force w x f.
        """
        torque, force = _cross_force(self.angular, self.linear, wrench.torque, wrench.force)
        return type(wrench)(force=force, torque=torque)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False)
class SpatialAcceleration(LinearValue):
    """The acceleration of a frame b relative to a frame a, as an observer fixed in a sees it: classical, not Featherstone's.

    ``angular`` [..., 3] in rad/s^2 is the derivative of the angular velocity, ``linear`` [..., 3] in m/s^2 the second derivative
    of the coordinates of b's origin in a. Featherstone's spatial acceleration has another linear part: see
    ``Motion.spatial_acceleration_featherstone``. After ``change_base`` to moving axes it is no longer the derivative of the
    velocity in those axes.
    """

    angular: jax.Array
    linear: jax.Array
    kind: str = tag("SpatialAcceleration")
    _names: ClassVar[tuple[str, str]] = ("angular", "linear")

    @classmethod
    def from_vector(cls, vector: Any) -> "SpatialAcceleration":
        """Return the acceleration of arrays [..., 6] in the order [angular, linear]."""
        return cls(*_halves(vector))

    def as_vector(self) -> jax.Array:
        """Return [angular, linear] as one array [..., 6]."""
        return as_vector(self.angular, self.linear)

    def at_point(self, displacement: Any, angular_velocity: Any) -> "SpatialAcceleration":
        """Return the acceleration of another point fixed in b, ``displacement`` [..., 3] away in the same axes.

        It depends on the angular velocity [..., 3] of b: a + alpha x d + w x (w x d).
        """
        linear = _bent(self.angular, self.linear, displacement, angular_velocity)
        return SpatialAcceleration(jnp.asarray(self.angular), linear)


@lift(V3, V3, V3, out=V3)
def _moved(w: V3, v: V3, d: V3) -> V3:
    return v + cross(w, d)


@lift(V3, V3, V3, V3, out=V3)
def _bent(alpha: V3, a: V3, d: V3, w: V3) -> V3:
    return a + cross(alpha, d) + cross(w, cross(w, d))


@lift(V3, V3, V3, V3, out=(V3, V3))
def _cross_motion(w: V3, v: V3, mw: V3, mv: V3) -> tuple[V3, V3]:
    return cross(w, mw), cross(w, mv) + cross(v, mw)


@lift(V3, V3, V3, V3, out=(V3, V3))
def _cross_force(w: V3, v: V3, torque: V3, force: V3) -> tuple[V3, V3]:
    return cross(w, torque) + cross(v, force), cross(w, force)
