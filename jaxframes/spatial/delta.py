"""KDL's small motions: add a rate over a time, take the difference, integrate a twist; each says how it differs from the exact one."""

from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar, overload

import jax
import numpy as np

from jaxframes.numerics.components import V3, Quat, quat_conj, quat_mul, rotate
from jaxframes.numerics.lift import lift
from jaxframes.numerics.smooth import Entry
from jaxframes.spatial import so3
from jaxframes.spatial.rotation import Rotation
from jaxframes.spatial.transform import Transform
from jaxframes.spatial.twist import Twist
from jaxframes.spatial.value import LinearValue, Value

L = TypeVar("L", bound=LinearValue)
Vector: TypeAlias = jax.Array | np.ndarray | Sequence[float]


@lift(Quat, V3, None, out=Quat)
def _rotated_by_rate(q: Quat, w: V3, dt: Entry) -> Quat:
    return quat_mul(so3.exp(w * dt), q)


@lift(V3, V3, None, out=V3)
def _moved(p: V3, v: V3, dt: Entry) -> V3:
    return p + v * dt


@lift(Quat, Quat, None, out=V3)
def _turn(a: Quat, b: Quat, dt: Entry) -> V3:
    v = rotate(a, so3.log(quat_mul(quat_conj(a), b)))
    return V3(v.x / dt, v.y / dt, v.z / dt)


@lift(V3, V3, None, out=V3)
def _rate(a: V3, b: V3, dt: Entry) -> V3:
    v = b - a
    return V3(v.x / dt, v.y / dt, v.z / dt)


@lift(Quat, V3, V3, V3, None, out=(Quat, V3))
def _integrated(q: Quat, p: V3, v: V3, w: V3, dt: Entry) -> tuple[Quat, V3]:
    return quat_mul(q, so3.exp(w * dt)), p + rotate(q, v * dt)


@overload
def add_delta(x: Rotation, dx: Any, dt: Any = 1.0) -> Rotation: ...
@overload
def add_delta(x: Transform, dx: Twist, dt: Any = 1.0) -> Transform: ...
@overload
def add_delta(x: L, dx: L, dt: Any = 1.0) -> L: ...
@overload
def add_delta(x: Vector, dx: Any, dt: Any = 1.0) -> jax.Array: ...
def add_delta(x: Any, dx: Any, dt: Any = 1.0) -> Any:
    """Return x after the constant rate ``dx`` has acted for ``dt`` [...] seconds.

    A ``Rotation`` takes an angular velocity [..., 3] along base axes: exp(w dt) R. A ``Transform`` takes a ``Twist`` along base axes
    whose linear part is the velocity of the origin: (exp(w dt) R, p + v dt), not a screw motion; see ``Transform.retract``.
    ``Twist``, ``Wrench``, the spatial velocities and accelerations and plain vectors [..., 3] take their own kind: x + dx dt.
    """
    if isinstance(x, Rotation):
        return Rotation(_rotated_by_rate(x.wxyz, dx, dt))
    if isinstance(x, Transform):
        return Transform(Rotation(_rotated_by_rate(x.rotation.wxyz, dx.angular, dt)), _moved(x.translation, dx.linear, dt))
    if isinstance(x, LinearValue):
        return x + dx * dt
    if isinstance(x, Value):
        raise TypeError(f"add_delta does not take a {type(x).__name__}")
    return _moved(x, dx, dt)


@overload
def diff(a: Rotation, b: Rotation, dt: Any = 1.0) -> jax.Array: ...
@overload
def diff(a: Transform, b: Transform, dt: Any = 1.0) -> Twist: ...
@overload
def diff(a: L, b: L, dt: Any = 1.0) -> L: ...
@overload
def diff(a: Vector, b: Any, dt: Any = 1.0) -> jax.Array: ...
def diff(a: Any, b: Any, dt: Any = 1.0) -> Any:
    """Return the constant rate from a to b in ``dt`` [...] seconds, so that b is ``add_delta(a, rate, dt)``.

    Rotations give an angular velocity [..., 3] along base axes, R_a log(R_a' R_b) / dt, of angle at most pi. Transforms give a ``Twist``
    along base axes of that and the velocity of the origin, which is not the logarithm of SE(3): see ``Transform.log``.
    """
    if type(a) is not type(b) and (isinstance(a, Value) or isinstance(b, Value)):
        raise TypeError(f"diff needs two values of one type; found {type(a).__name__} and {type(b).__name__}")
    if isinstance(a, Rotation):
        return _turn(a.wxyz, b.wxyz, dt)
    if isinstance(a, Transform):
        linear = _rate(a.translation, b.translation, dt)
        return Twist(linear=linear, angular=_turn(a.rotation.wxyz, b.rotation.wxyz, dt))
    if isinstance(a, LinearValue):
        return (b - a) / dt
    if isinstance(a, Value):
        raise TypeError(f"diff does not take a {type(a).__name__}")
    return _rate(a, b, dt)


def integrate_body_first_order(pose: Transform, twist: Twist, dt: Any) -> Transform:
    """Return the pose after a twist along its own axes at its own origin has acted for ``dt`` [...] seconds, as KDL integrates.

    The rotation is exact, the origin moves along the straight line R v dt: an error of second order in ``dt`` for each step.
    ``pose.retract(twist * dt)`` is the exact motion. Negative ``dt`` runs backwards.
    """
    q, p = _integrated(pose.rotation.wxyz, pose.translation, twist.linear, twist.angular, dt)
    return Transform(Rotation(q), p)
