"""KDL's functions: vectors, small motions, comparison and the shift matrix; of arrays [..., 3] and of the value types.

They are here for those who port PyKDL code. Nothing small is taken for zero unless ``eps`` says so, every result has derivatives, and
where KDL approximates, the exact operation is named.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias, TypeVar, overload

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics import components, smooth
from jaxframes.numerics.components import V3, Quat, quat_conj, quat_mul, rotate, select
from jaxframes.numerics.lift import lift
from jaxframes.numerics.smooth import Entry
from jaxframes.spatial import so3
from jaxframes.spatial.rotation import Rotation
from jaxframes.spatial.transform import Transform
from jaxframes.spatial.twist import Twist, Wrench
from jaxframes.spatial.value import LinearValue, Value

L = TypeVar("L", bound=LinearValue)
Vector: TypeAlias = jax.Array | np.ndarray | Sequence[float]


@lift(V3, out=None)
def _norm(v: V3) -> Entry:
    return smooth.norm(tuple(v))


@lift(V3, out=(V3, None))
def _normalize(v: V3) -> tuple[V3, Entry]:
    nothing = (v.x == 0) & (v.y == 0) & (v.z == 0)
    unit, length = smooth.normalize(tuple(select(nothing, c, component) for c, component in zip((1.0, 0.0, 0.0), v, strict=True)))
    return V3(*unit), select(nothing, 0.0, length)


_cross = lift(V3, V3, out=V3)(components.cross)
_dot = lift(V3, V3, out=None)(components.dot)


@lift(V3, V3, None, out=None)
def _farthest(a: V3, b: V3, eps: Entry) -> Entry:
    largest = jnp.abs(a.x - b.x)
    for p, q in ((a.y, b.y), (a.z, b.z)):
        largest = jnp.maximum(largest, jnp.abs(p - q))
    return select(largest < eps, 1.0, 0.0)


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


@lift(V3, out=tuple)
def _phi(r: V3) -> tuple[Any, ...]:
    one, zero, s = jnp.ones_like(r.x), jnp.zeros_like(r.x), so3.skew(r)
    rows = []
    for i in range(3):
        rows += [one if i == j else zero for j in range(3)] + list(s[3 * i : 3 * i + 3])
    for i in range(3):
        rows += [zero] * 3 + [one if i == j else zero for j in range(3)]
    return tuple(rows)


def norm(vector: Any) -> jax.Array:
    """Return the length [...] of vectors [..., 3], free of overflow and underflow; at zero its derivatives are set to 0."""
    return _norm(vector)


def normalize(vector: Any) -> tuple[jax.Array, jax.Array]:
    """Return (unit vectors [..., 3], their former lengths [...]); zero gives ((1, 0, 0), 0), with derivatives 0."""
    return _normalize(vector)


def cross(a: Any, b: Any) -> jax.Array:
    """Return the vector product [..., 3] of vectors [..., 3]: what ``v1 * v2`` is in KDL."""
    return _cross(a, b)


def dot(a: Any, b: Any) -> jax.Array:
    """Return the scalar product [...] of vectors [..., 3], or the power of a ``Wrench`` on a ``Twist``, in either order.

    Raises:
        TypeError: One is a value type and the two are no twist and wrench.
    """
    if isinstance(a, Twist) and isinstance(b, Wrench):
        return a.dot(b)
    if isinstance(a, Wrench) and isinstance(b, Twist):
        return a.dot(b)
    if isinstance(a, Value) or isinstance(b, Value):
        raise TypeError(f"dot takes two vectors, or a Twist and a Wrench; found {type(a).__name__} and {type(b).__name__}")
    return _dot(a, b)


def equal(a: Any, b: Any, eps: Any = 1e-6) -> jax.Array:
    """Return whether all numbers of two values differ by less than ``eps``, which is absolute, as booleans [...].

    Args:
        a: Vectors [..., 3], or a value type; rotations are compared by the elements of their matrices, as in KDL.
        b: The same kind of thing; batch axes broadcast.
        eps: The bound [...]; a difference of ``eps`` itself is too large.

    Raises:
        TypeError: The two are not of one type.
    """
    if type(a) is not type(b) and (isinstance(a, Value) or isinstance(b, Value)):
        raise TypeError(f"equal needs two values of one type; found {type(a).__name__} and {type(b).__name__}")
    result = jnp.ones((), bool)
    for x, y in zip(_vectors(a), _vectors(b), strict=True):
        result = result & (_farthest(x, y, eps) > 0.5)
    return result


def _vectors(value: Any) -> list[Any]:
    """Return the vectors [..., 3] that a value is compared by."""
    if isinstance(value, Rotation):
        matrix = value.to_matrix()
        return [matrix[..., i] for i in range(3)]
    if isinstance(value, Value):
        return [part for leaf in jax.tree.leaves(value, is_leaf=lambda x: isinstance(x, Rotation)) for part in _vectors(leaf)]
    return [value]


@overload
def add_delta(x: Rotation, dx: Any, dt: Any = 1.0) -> Rotation: ...
@overload
def add_delta(x: Transform, dx: Twist, dt: Any = 1.0) -> Transform: ...
@overload
def add_delta(x: L, dx: L, dt: Any = 1.0) -> L: ...
@overload
def add_delta(x: Vector, dx: Any, dt: Any = 1.0) -> jax.Array: ...
def add_delta(x: Any, dx: Any, dt: Any = 1.0) -> Any:
    """Return x after the constant rate ``dx`` has acted for ``dt`` seconds (KDL's ``addDelta``).

    Args:
        x: A ``Rotation``; a ``Transform``; a ``Twist``, ``Wrench``, spatial velocity or acceleration; or vectors [..., 3].
        dx: For a rotation an angular velocity [..., 3] along base axes: exp(w dt) R. For a transform a ``Twist`` along base axes whose
            linear part is the velocity of the origin: (exp(w dt) R, p + v dt), not a screw motion; see ``Transform.retract``. Else the
            same kind as ``x``: x + dx dt.
        dt: Seconds [...].
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
    """Return the constant rate from a to b in ``dt`` seconds, so that b is ``add_delta(a, rate, dt)``.

    Args:
        a: A ``Rotation``; a ``Transform``; a ``Twist``, ``Wrench``, spatial velocity or acceleration; or vectors [..., 3].
        b: The same kind of thing.
        dt: Seconds [...].

    Returns:
        For rotations an angular velocity [..., 3] along base axes, R_a log(R_a' R_b) / dt, of angle at most pi. For transforms a ``Twist``
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
    """Return the pose after a twist along its own axes at its own origin has acted for ``dt`` [...] seconds (KDL's ``Frame.Integrate``).

    The rotation is exact, the origin moves along the straight line R v dt: an error of second order in ``dt`` for each step.
    ``pose.retract(twist * dt)`` is the exact motion. Negative ``dt`` runs backwards. KDL takes a frequency, 1 / dt.

    Args:
        pose: Where it starts.
        twist: Velocity of the origin and angular velocity, along the pose's own axes.
        dt: Seconds [...].
    """
    q, p = _integrated(pose.rotation.wxyz, pose.translation, twist.linear, twist.angular, dt)
    return Transform(Rotation(q), p)


def phi(displacement: Any) -> jax.Array:
    """Return the shift matrices [[I, [r]x], [0, I]] [..., 6, 6] of displacements r [..., 3], for [angular, linear] order.

    ``phi(r)^T [w; v]`` is the velocity of the point r away: [w; v + w x r]; ``phi(r) [torque; force]`` moves a wrench from that
    point back: [torque + r x force; force] (Jain 2011).
    """
    entries = _phi(displacement)
    return entries.reshape(*entries.shape[:-1], 6, 6)
