"""The operations of Rotation on arrays: each is a function of components, lifted."""

import functools
import itertools
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.errors import FrameError, ShapeError
from jaxframes.numerics import smooth
from jaxframes.numerics.components import V3, Quat, cross, dot, quat_conj, quat_from, rotate_inverse, select
from jaxframes.numerics.components import rotate as rotate_components
from jaxframes.numerics.lift import lift
from jaxframes.numerics.smooth import Entry
from jaxframes.numerics.trig import sin_cos
from jaxframes.spatial import so3
from jaxframes.spatial.refusals import matrix_of
from jaxframes.staging.arrays import as_float


def from_euler(sequence: str, angles: Any) -> jax.Array:
    """Return the quaternions [..., 4] of turns about the axes that a sequence names; see ``Rotation.from_euler``."""
    intrinsic = _sequence(sequence)
    angles = as_float(angles)
    if len(sequence) == 1 and (angles.ndim == 0 or angles.shape[-1] != 1):
        angles = angles[..., None]
    if angles.ndim == 0 or angles.shape[-1] != len(sequence):
        raise ShapeError(f"from_euler: {sequence!r} takes angles [..., {len(sequence)}]; found {angles.shape}")
    return _from_euler(sequence.lower() if intrinsic else sequence[::-1])(angles if intrinsic else angles[..., ::-1])


def to_euler(sequence: str, wxyz: Any) -> jax.Array:
    """Return the angles [..., 3] of quaternions about the axes that a sequence names; see ``Rotation.to_euler``."""
    intrinsic = _sequence(sequence)
    if len(sequence) != 3:
        raise FrameError(f"to_euler: a sequence of three letters is needed, as 'ZYX' or 'xyz'; found {sequence!r}")
    angles = _to_euler(sequence.lower() if intrinsic else sequence[::-1])(wxyz)
    return angles if intrinsic else angles[..., ::-1]


def _sequence(sequence: str) -> bool:
    """Return whether a sequence of Euler angles is intrinsic (upper case), refusing what is no sequence."""
    same_case = sequence.isupper() or sequence.islower()
    known = 1 <= len(sequence) <= 3 and set(sequence.lower()) <= set("xyz")
    if not (known and same_case) or any(a == b for a, b in itertools.pairwise(sequence)):
        raise FrameError(
            f"{sequence!r} is no sequence of Euler angles: one to three of the letters XYZ (axes that move) or xyz (axes that stay), "
            "neighbours different, as 'ZXZ' or 'xyz'"
        )
    return sequence.isupper()


@functools.cache
def _from_euler(axes: str) -> Any:
    return lift(tuple, out=Quat)(functools.wraps(from_euler)(functools.partial(so3.from_axes, axes)))


@functools.cache
def _to_euler(axes: str) -> Any:
    return lift(Quat, out=tuple)(functools.wraps(to_euler)(functools.partial(so3.to_axes, axes)))


normalized = lift(Quat, out=Quat)(so3.normalized)
exp = lift(V3, out=Quat)(so3.exp)
log = lift(Quat, out=V3)(so3.log)
angle = lift(Quat, out=None)(so3.angle)
to_matrix = lift(Quat, out=tuple)(so3.to_matrix)
from_matrix = lift(tuple, out=Quat)(so3.from_matrix)
slerp = lift(Quat, Quat, None, out=Quat)(so3.slerp)
slerp_long = lift(Quat, Quat, None, out=Quat)(so3.slerp_long)
compose = lift(Quat, Quat, out=Quat)(so3.product)
distance = lift(Quat, Quat, out=None)(so3.distance)
canonical = lift(Quat, out=Quat)(so3.upper)
from_mrp = lift(V3, out=Quat)(so3.from_mrp)
to_mrp = lift(Quat, out=V3)(so3.to_mrp)
conjugate = lift(Quat, out=Quat)(quat_conj)
rotate = lift(Quat, V3, out=V3)(rotate_components)
rotate_back = lift(Quat, V3, out=V3)(rotate_inverse)
about_x = lift(None, out=Quat)(so3.about_x)
about_y = lift(None, out=Quat)(so3.about_y)
about_z = lift(None, out=Quat)(so3.about_z)
from_rpy = lift(None, None, None, out=Quat)(so3.from_rpy)
from_zyz = lift(None, None, None, out=Quat)(so3.from_zyz)
to_rpy = lift(Quat, out=(None, None, None))(so3.to_rpy)
to_zyz = lift(Quat, out=(None, None, None))(so3.to_zyz)
_left = lift(V3, out=tuple)(so3.left_jacobian)
_left_inv = lift(V3, out=tuple)(so3.left_jacobian_inv)


def left_jacobian(vector: Any) -> jax.Array:
    """Return J_l [..., 3, 3] of rotation vectors [..., 3]: exp(v + dv) = exp(J_l dv) exp(v) to first order."""
    return matrix_of(_left(vector))


def right_jacobian(vector: Any) -> jax.Array:
    """Return J_r [..., 3, 3] of rotation vectors [..., 3]: exp(v + dv) = exp(v) exp(J_r dv) to first order."""
    return left_jacobian(-as_float(vector))


def left_jacobian_inv(vector: Any) -> jax.Array:
    """Return the inverse of J_l [..., 3, 3] of rotation vectors [..., 3]; regular at 0 and at pi, pole at length 2 pi."""
    return matrix_of(_left_inv(vector))


def right_jacobian_inv(vector: Any) -> jax.Array:
    """Return the inverse of J_r [..., 3, 3] of rotation vectors [..., 3]; regular at 0 and at pi, pole at length 2 pi."""
    return left_jacobian_inv(-as_float(vector))


@lift(Quat, out=Quat)
def normalized_xyzw(xyzw: Quat) -> Quat:
    """Return the unit quaternion of one given scalar last."""
    x, y, z, w = xyzw
    return so3.normalized(Quat(w, x, y, z))


@lift(Quat, out=tuple)
def to_xyzw(q: Quat) -> tuple[Entry, ...]:
    """Return the quaternion scalar last."""
    return q.x, q.y, q.z, q.w


@lift(V3, V3, V3, out=Quat)
def from_rows(x: V3, y: V3, z: V3) -> Quat:
    """Return the quaternion of a matrix given by its rows."""
    return so3.from_matrix((*x, *y, *z))


@lift(V3, V3, V3, out=Quat)
def from_columns(x: V3, y: V3, z: V3) -> Quat:
    """Return the quaternion of a matrix given by its columns."""
    return so3.from_matrix((x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z))


@lift(V3, None, out=Quat)
def from_unit_axis_angle(axis: V3, turn: Entry) -> Quat:
    """Return (cos(a/2), axis sin(a/2))."""
    s, c = sin_cos(turn * 0.5)
    return quat_from(c, axis * s)


@lift(V3, None, out=Quat)
def from_axis_angle(axis: V3, turn: Entry) -> Quat:
    """Return the rotation about an axis of any length; a zero axis turns nothing."""
    nothing = (axis.x == 0) & (axis.y == 0) & (axis.z == 0)
    unit, _ = smooth.normalize((select(nothing, 1.0, axis.x), axis.y, axis.z))
    s, c = sin_cos(select(nothing, 0.0, turn) * 0.5)
    return quat_from(c, V3(*unit) * s)


@lift(Quat, out=(None, V3))
def to_axis_angle(q: Quat) -> tuple[Entry, V3]:
    """Return the angle in [0, pi] and the unit axis; z for the identity."""
    q = so3.upper(q)
    nothing = (q.x == 0) & (q.y == 0) & (q.z == 0)
    axis, _ = smooth.normalize(tuple(select(nothing, c, component) for c, component in zip((0.0, 0.0, 1.0), q.vector, strict=True)))
    return so3.angle(q), V3(*axis)


@lift(Quat, None, out=Quat)
def power(q: Quat, exponent: Entry) -> Quat:
    """Return the rotation about the same axis by so many times the angle."""
    return so3.exp(so3.log(q) * exponent)


@lift(V3, V3, out=Quat)
def between(start: V3, end: V3) -> Quat:
    """Return the smallest rotation from one direction to another: (1 + a . b, a x b), normalised.

    Both are written with h = a + b, as h . h / 2 and a x h: near half a turn they would be differences, and h is exact there.
    """
    a, b = (V3(*smooth.normalize(tuple(v))[0]) for v in (start, end))
    h = a + b
    slack = 4 * smooth.rounding(a.x)
    opposite = (jnp.abs(h.x) <= slack) & (jnp.abs(h.y) <= slack) & (jnp.abs(h.z) <= slack)
    w = select(opposite, 0.0, 0.5 * dot(h, h))
    h = V3(*(select(opposite, p, c) for p, c in zip(_perpendicular(a), h, strict=True)))
    return so3.normalized(quat_from(w, cross(a, h)))


def _perpendicular(a: V3) -> V3:
    """Return a vector perpendicular to a: its product with the coordinate axis farthest from it."""
    x, y, z = (jnp.abs(c) for c in a)
    by_x, by_y = (x <= y) & (x <= z), y <= z
    zero = jnp.zeros_like(x)

    def pick(p: Entry, q: Entry, r: Entry) -> Entry:
        return select(by_x, p, select(by_y, q, r))

    return V3(pick(zero, -a.z, a.y), pick(a.z, zero, -a.x), pick(-a.y, a.x, zero))


def _column(m: tuple[Entry, ...], k: int) -> V3:
    return V3(m[k], m[3 + k], m[6 + k])


@lift(Quat, out=V3)
def unit_x(q: Quat) -> V3:
    """Return the first column."""
    return _column(so3.to_matrix(q), 0)


@lift(Quat, out=V3)
def unit_y(q: Quat) -> V3:
    """Return the second column."""
    return _column(so3.to_matrix(q), 1)


@lift(Quat, out=V3)
def unit_z(q: Quat) -> V3:
    """Return the third column."""
    return _column(so3.to_matrix(q), 2)
