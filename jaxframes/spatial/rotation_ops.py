"""The operations of Rotation on arrays: each is a function of components, lifted."""

from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.numerics import smooth
from jaxframes.numerics.components import V3, Quat, cross, dot, quat_conj, quat_from, quat_mul, rotate_inverse, select
from jaxframes.numerics.components import rotate as rotate_components
from jaxframes.numerics.lift import lift
from jaxframes.numerics.smooth import Entry
from jaxframes.numerics.trig import sin_cos
from jaxframes.spatial import so3
from jaxframes.staging.arrays import as_float, common_float

_EXACT = lax.Precision.HIGHEST


def mean(quaternions: jax.Array, weights: Any, axis: int) -> jax.Array:
    """Return the chordal mean [..., 4] of unit quaternions over one batch axis; see ``Rotation.mean``."""
    q = as_float(quaternions)
    if weights is not None:
        q, w = common_float(q, weights)
        w = jnp.broadcast_to(w, q.shape[:-1])
    else:
        w = jnp.ones(q.shape[:-1], q.dtype)
    axis = axis + q.ndim - 1 if axis < 0 else axis
    q, w = jnp.moveaxis(q, axis, -2), jnp.moveaxis(w, axis, -1)
    moment = jnp.einsum("...n,...ni,...nj->...ij", w, q, q, precision=_EXACT)
    vector = _dominant(moment)
    # the sign of an eigenvector is free: take the one near the first rotation
    sign = jnp.where(jnp.sum(vector * q[..., 0, :], -1, keepdims=True) < 0, -1.0, 1.0)
    return vector * lax.stop_gradient(sign).astype(vector.dtype)


@jax.custom_jvp
def _dominant(m: jax.Array) -> jax.Array:
    """Return the unit eigenvector of the largest eigenvalue of symmetric matrices [..., 4, 4]."""
    return jnp.linalg.eigh(m)[1][..., :, -1]


@_dominant.defjvp
def _dominant_jvp(primals: tuple[jax.Array], tangents: tuple[jax.Array]) -> tuple[jax.Array, jax.Array]:
    """Solve (l I - M + l v v^T) dv = (dM - v v^T dM) v: it needs l to be simple, not the others (unlike eigh's own rule)."""
    (m,), (dm,) = primals, tangents
    v = _dominant(m)
    moved = jnp.einsum("...ij,...j->...i", m, v, precision=_EXACT)
    value = jnp.sum(v * moved, -1)[..., None, None]
    outer = v[..., :, None] * v[..., None, :]
    pushed = jnp.einsum("...ij,...j->...i", (dm + jnp.swapaxes(dm, -1, -2)) * 0.5, v, precision=_EXACT)
    pushed = pushed - v * jnp.sum(v * pushed, -1, keepdims=True)
    system = value * (jnp.eye(4, dtype=m.dtype).reshape((1,) * (m.ndim - 2) + (4, 4)) + outer) - m
    return v, jnp.linalg.solve(system, pushed[..., None])[..., 0]


normalized = lift(Quat, out=Quat)(so3.normalized)
exp = lift(V3, out=Quat)(so3.exp)
log = lift(Quat, out=V3)(so3.log)
angle = lift(Quat, out=None)(so3.angle)
to_matrix = lift(Quat, out=tuple)(so3.to_matrix)
from_matrix = lift(tuple, out=Quat)(so3.from_matrix)
slerp = lift(Quat, Quat, None, out=Quat)(so3.slerp)
compose = lift(Quat, Quat, out=Quat)(quat_mul)
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
left_jacobian = lift(V3, out=tuple)(so3.left_jacobian)
left_jacobian_inv = lift(V3, out=tuple)(so3.left_jacobian_inv)


@lift(V3, out=tuple)
def right_jacobian(v: V3) -> tuple[Entry, ...]:
    """Return J_r(v) = J_l(-v)."""
    return so3.left_jacobian(-v)


@lift(V3, out=tuple)
def right_jacobian_inv(v: V3) -> tuple[Entry, ...]:
    """Return the inverse of J_r(v)."""
    return so3.left_jacobian_inv(-v)


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


@lift(Quat, Quat, out=None)
def distance(a: Quat, b: Quat) -> Entry:
    """Return the angle between two rotations."""
    return so3.angle(quat_mul(quat_conj(a), b))


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
