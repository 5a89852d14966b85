"""Motion: pose, velocity and acceleration of one frame relative to another, and everything that follows from them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.errors import FrameError
from jaxframes.numerics import rigid
from jaxframes.numerics.batch import tag
from jaxframes.numerics.components import V3, Quat, cross, renormalized, rotate, rotate_inverse
from jaxframes.numerics.lift import lift
from jaxframes.numerics.rigid import Rigid
from jaxframes.spatial import so3
from jaxframes.spatial.rotation import Rotation
from jaxframes.spatial.transform import Transform
from jaxframes.spatial.twist import Twist
from jaxframes.spatial.value import Value
from jaxframes.spatial.velocity import SpatialAcceleration, SpatialVelocity
from jaxframes.staging.arrays import as_float

_KINDS = (Quat, V3, V3, V3, V3, V3)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False)
class Motion(Value):
    """How a frame p moves relative to an observer o at one instant, seen from o and resolved along o's axes.

    ``transform`` is ``o_T_p`` = (R, l); ``velocity`` is [w; v] with dR/dt = [w]x R and v = dl/dt; ``acceleration`` is
    [alpha; a] with alpha = dw/dt and a = dv/dt (classical, not Featherstone's). Closed under ``@`` and ``inverse``.
    """

    transform: Transform
    velocity: SpatialVelocity
    acceleration: SpatialAcceleration
    kind: str = tag("Motion")

    @classmethod
    def identity(cls, batch: Sequence[int] = (), dtype: Any = None) -> "Motion":
        """Return the motion of a frame relative to itself, for a batch shape."""
        return cls(Transform.identity(batch, dtype), SpatialVelocity.zero(batch, dtype), SpatialAcceleration.zero(batch, dtype))

    @classmethod
    def at_rest(cls, transform: Transform) -> "Motion":
        """Return the motion of a frame that keeps its pose."""
        shape, dtype = transform.shape, transform.dtype
        return cls(transform, SpatialVelocity.zero(shape, dtype), SpatialAcceleration.zero(shape, dtype))

    @classmethod
    def from_point(cls, position: Any, velocity: Any = None, acceleration: Any = None) -> "Motion":
        """Return the motion of a point that does not turn, from its coordinates [..., 3] and their derivatives (default: zero)."""
        pose = Transform.from_translation(position)
        zero = jnp.zeros_like(pose.translation)
        v, a = (zero if rate is None else as_float(rate) for rate in (velocity, acceleration))
        return cls(pose, SpatialVelocity(zero, v), SpatialAcceleration(zero, a))

    def _parts(self) -> tuple[Any, ...]:
        pose, v, a = self.transform, self.velocity, self.acceleration
        return pose.rotation.wxyz, pose.translation, v.angular, v.linear, a.angular, a.linear

    def __matmul__(self, other: Any) -> Any:
        """Return the motion of p relative to o from o -> m (self) and m -> p (other), by the theorem of Coriolis."""
        return _motion(_compose(*self._parts(), *other._parts())) if isinstance(other, Motion) else NotImplemented

    def inverse(self) -> "Motion":
        """Return the motion of o relative to p, seen from p and resolved along p's axes."""
        return _motion(_inverse(*self._parts()))

    def relative_to(self, observer: "Motion") -> "Motion":
        """Return ``observer.inverse() @ self``: of two motions relative to one frame, this one as the other sees it."""
        return _motion(_relative(*observer._parts(), *self._parts()))

    # ------------------------------------------------------------------ as other people define it
    def pframe_observed_velocity(self) -> SpatialVelocity:
        """Return the derivative of R' l, p's own view, along p's axes: [R' w; R' (v + l x w)], minus the velocity of o seen from p."""
        return SpatialVelocity(*_pframe_velocity(*self._parts()))

    def pframe_observed_acceleration(self) -> SpatialAcceleration:
        """Return [R' alpha; R' (a + v x w)], along p's axes: what kdFlex calls by this name.

        Its linear part is the derivative of the p-coordinates of the velocity that o observes, R' v. It is *not* the derivative
        of ``pframe_observed_velocity``: see ``pframe_observed_acceleration_full``. It equals ``body_twist_dot``.
        """
        return SpatialAcceleration(*_pframe_acceleration(*self._parts()))

    def pframe_observed_acceleration_full(self) -> SpatialAcceleration:
        """Return the derivative of ``pframe_observed_velocity``: [R' alpha; R' (a - alpha x l - 2 w x v + w x (w x l))]."""
        return SpatialAcceleration(*_pframe_acceleration_full(*self._parts()))

    def body_twist(self) -> Twist:
        """Return the velocity of p's origin that o observes and w, along p's axes: linear R' v, angular R' w."""
        angular, linear = _body_twist(*self._parts())
        return Twist(linear=linear, angular=angular)

    def body_twist_dot(self) -> Twist:
        """Return the time derivative of ``body_twist``, along p's axes: linear R' (a - w x v), angular R' alpha."""
        angular, linear = _pframe_acceleration(*self._parts())
        return Twist(linear=linear, angular=angular)

    def spatial_acceleration_featherstone(self, *, at: str) -> SpatialAcceleration:
        """Return Featherstone's spatial acceleration along o's axes, referred to the origin of o or of p.

        Args:
            at: ``"relative_to"`` (o's origin): linear a - alpha x l - w x v; ``"of"`` (p's origin): linear a - w x v.
        """
        choices: dict[str, Callable[..., Any]] = {"relative_to": _featherstone_at_o, "of": _featherstone_at_p}
        if at not in choices:
            raise FrameError(f"at={at!r} names no origin; it is 'relative_to' (the observer's) or 'of' (the moving frame's)")
        return SpatialAcceleration(*choices[at](*self._parts()))

    def reverse_velocity(self, velocity: SpatialVelocity | None = None) -> SpatialVelocity:
        """Return the velocity of o relative to p, along p's axes, if that of p relative to o were ``velocity`` (default: own)."""
        return self.transform.reverse_velocity(self.velocity if velocity is None else velocity)

    def reverse_acceleration(self, acceleration: SpatialAcceleration | None = None) -> SpatialAcceleration:
        """Return the acceleration of o relative to p, along p's axes, if that of p relative to o were ``acceleration``.

        Uses this motion's pose and velocity: [-R' alpha; -R' (a - alpha x l - 2 w x v + w x (w x l))].
        """
        given = self if acceleration is None else self.replace(acceleration=acceleration)
        return -given.pframe_observed_acceleration_full()

    def to_oframe_observed(self, x: Any, xdot: Any, *, expressed_in: str = "relative_to") -> jax.Array:
        """Return the derivative that o observes of a vector x [..., 3] given along p's axes, with ``xdot`` observed in p.

        Args:
            x: Vector along p's axes.
            xdot: Derivative of its coordinates along p's axes.
            expressed_in: ``"relative_to"`` gives it along o's axes, R (xdot + R' w x x) = d(R x)/dt; ``"of"`` along p's.
        """
        choices: dict[str, Callable[..., Any]] = {"relative_to": _observed_in_o, "of": _observed_in_p}
        if expressed_in not in choices:
            raise FrameError(f"expressed_in={expressed_in!r} names no axes; they are 'relative_to' (the observer's) or 'of'")
        return choices[expressed_in](self.transform.rotation.wxyz, self.velocity.angular, x, xdot)

    def rotvec_rates(self) -> jax.Array:
        """Return [theta_dot; v] [..., 6]: the rate of the rotation vector of ``o_T_p``, J_l^-1(theta) w, and the linear velocity.

        Regular at the identity and at pi, where the rotation vector itself jumps.
        """
        return _rotvec_rates(*self._parts())


def _motion(parts: tuple[Any, ...]) -> Motion:
    q, l, w, v, alpha, a = parts
    return Motion(Transform(Rotation(q), l), SpatialVelocity(w, v), SpatialAcceleration(alpha, a))


def _fields(m: Rigid) -> tuple[Any, ...]:
    return m.rotation, m.translation, m.angular, m.linear, m.angular2, m.linear2


def _product(m: Rigid) -> tuple[Any, ...]:
    return renormalized(m.rotation), *_fields(m)[1:]


@lift(*_KINDS, *_KINDS, out=_KINDS)
def _compose(*parts: Any) -> tuple[Any, ...]:
    return _product(rigid.compose(Rigid(*parts[:6]), Rigid(*parts[6:]), 2))


@lift(*_KINDS, *_KINDS, out=_KINDS)
def _relative(*parts: Any) -> tuple[Any, ...]:
    return _product(rigid.relative(Rigid(*parts[:6]), Rigid(*parts[6:]), 2))


@lift(*_KINDS, out=_KINDS)
def _inverse(*parts: Any) -> tuple[Any, ...]:
    return _fields(rigid.inverse(Rigid(*parts), 2))


@lift(*_KINDS, out=(V3, V3))
def _pframe_velocity(q: Quat, l: V3, w: V3, v: V3, alpha: V3, a: V3) -> tuple[V3, V3]:
    return rotate_inverse(q, w), rotate_inverse(q, v + cross(l, w))


@lift(*_KINDS, out=(V3, V3))
def _pframe_acceleration(q: Quat, l: V3, w: V3, v: V3, alpha: V3, a: V3) -> tuple[V3, V3]:
    return rotate_inverse(q, alpha), rotate_inverse(q, a + cross(v, w))


@lift(*_KINDS, out=(V3, V3))
def _pframe_acceleration_full(*parts: Any) -> tuple[V3, V3]:
    back = rigid.inverse(Rigid(*parts), 2)
    return -back.angular2, -back.linear2


@lift(*_KINDS, out=(V3, V3))
def _body_twist(q: Quat, l: V3, w: V3, v: V3, alpha: V3, a: V3) -> tuple[V3, V3]:
    return rotate_inverse(q, w), rotate_inverse(q, v)


@lift(*_KINDS, out=(V3, V3))
def _featherstone_at_o(q: Quat, l: V3, w: V3, v: V3, alpha: V3, a: V3) -> tuple[V3, V3]:
    return alpha, a - cross(alpha, l) - cross(w, v)


@lift(*_KINDS, out=(V3, V3))
def _featherstone_at_p(q: Quat, l: V3, w: V3, v: V3, alpha: V3, a: V3) -> tuple[V3, V3]:
    return alpha, a - cross(w, v)


@lift(Quat, V3, V3, V3, out=V3)
def _observed_in_o(q: Quat, w: V3, x: V3, xdot: V3) -> V3:
    return rotate(q, xdot) + cross(w, rotate(q, x))


@lift(Quat, V3, V3, V3, out=V3)
def _observed_in_p(q: Quat, w: V3, x: V3, xdot: V3) -> V3:
    return xdot + cross(rotate_inverse(q, w), x)


@lift(*_KINDS, out=tuple)
def _rotvec_rates(q: Quat, l: V3, w: V3, v: V3, alpha: V3, a: V3) -> tuple[Any, ...]:
    return (*so3.apply_left_jacobian_inv(so3.log(q), w), *v)
