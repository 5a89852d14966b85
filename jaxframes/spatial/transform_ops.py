"""The operations of Transform on arrays: each is a function of components, lifted."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from jaxframes.numerics import smooth
from jaxframes.numerics.components import V3, Quat, cross, dot, quat_conj, quat_mul, renormalized, rotate
from jaxframes.numerics.lift import lift
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.rigid import compose as compose_rigid
from jaxframes.numerics.rigid import inverse as inverse_rigid
from jaxframes.numerics.rigid import relative as relative_rigid
from jaxframes.numerics.smooth import Entry
from jaxframes.numerics.trig import sin_cos
from jaxframes.spatial import so3

WGS84_RADIUS = 6378137.0
"""Equatorial radius of the WGS-84 ellipsoid in metres (NIMA TR8350.2)."""
WGS84_FLATTENING = 1 / 298.257223563
"""Flattening of the WGS-84 ellipsoid (NIMA TR8350.2)."""


@lift(Quat, V3, Quat, V3, out=(Quat, V3))
def compose(q1: Quat, p1: V3, q2: Quat, p2: V3) -> tuple[Quat, V3]:
    """Return the product of two poses."""
    both = compose_rigid(Rigid(q1, p1), Rigid(q2, p2), 0)
    return renormalized(both.rotation), both.translation


@lift(Quat, V3, out=(Quat, V3))
def inverse(q: Quat, p: V3) -> tuple[Quat, V3]:
    """Return the inverse of a pose."""
    back = inverse_rigid(Rigid(q, p), 0)
    return back.rotation, back.translation


@lift(Quat, V3, Quat, V3, out=(Quat, V3))
def relative(q1: Quat, p1: V3, q2: Quat, p2: V3) -> tuple[Quat, V3]:
    """Return the second pose relative to the first."""
    both = relative_rigid(Rigid(q1, p1), Rigid(q2, p2), 0)
    return renormalized(both.rotation), both.translation


@lift(Quat, V3, V3, out=V3)
def apply(q: Quat, p: V3, x: V3) -> V3:
    """Return R x + p."""
    return p + rotate(q, x)


@lift(Quat, V3, V3, out=V3)
def inverse_apply(q: Quat, p: V3, x: V3) -> V3:
    """Return R' (x - p)."""
    return rotate(quat_conj(q), x - p)


@lift(V3, V3, None, out=V3)
def lerp(a: V3, b: V3, t: Entry) -> V3:
    """Return a + t (b - a)."""
    return a + (b - a) * t


@lift(Quat, V3, out=tuple)
def to_matrix(q: Quat, p: V3) -> tuple[Entry, ...]:
    """Return the sixteen entries of the homogeneous matrix, row by row."""
    m = so3.to_matrix(q)
    return (*m[:3], p.x, *m[3:6], p.y, *m[6:], p.z, 0.0, 0.0, 0.0, 1.0)


@lift(V3, V3, out=(Quat, V3))
def exp(angular: V3, linear: V3) -> tuple[Quat, V3]:
    """Return the exponential of SE(3): (exp(w), J_l(w) v)."""
    return so3.exp(angular), so3.apply_left_jacobian(angular, linear)


@lift(Quat, V3, out=(V3, V3))
def log(q: Quat, p: V3) -> tuple[V3, V3]:
    """Return the logarithm of SE(3) as (angular, linear)."""
    angular = so3.log(q)
    return angular, so3.apply_left_jacobian_inv(angular, p)


@lift(V3, V3, out=tuple)
def left_jacobian(w: V3, v: V3) -> tuple[Entry, ...]:
    """Return the 36 entries of J_l = [[J, 0], [Q, J]] of the exponential of SE(3), row by row."""
    jacobian = _columns(lambda u: so3.apply_left_jacobian(w, u), w)
    return _blocks(jacobian, _columns(lambda u: _coupling(w, v, u), w))


@lift(V3, V3, out=tuple)
def left_jacobian_inv(w: V3, v: V3) -> tuple[Entry, ...]:
    """Return the 36 entries of the inverse [[J', 0], [-J' Q J', J']], with J' the inverse of J, row by row."""

    def back(u: V3) -> V3:
        return so3.apply_left_jacobian_inv(w, u)

    return _blocks(_columns(back, w), _columns(lambda u: -back(_coupling(w, v, back(u))), w))


def _coupling(w: V3, v: V3, u: V3) -> V3:
    """Return Q u, how a turn u moves the origin (Barfoot 2017, State Estimation for Robotics, equation 7.86)."""
    square = dot(w, w)
    c3, c4, c5 = (smooth.stumpff(k, square) for k in (3, 4, 5))
    v_u, w_u = cross(v, u), cross(w, u)
    wv_u, vw_u, vww_u = cross(w, v_u), cross(v, w_u), cross(v, cross(w, w_u))
    wvw_u = cross(w, vw_u)
    second = cross(w, wv_u) + vww_u - wvw_u * 3.0
    third = cross(w, vww_u) + cross(w, wvw_u)
    return v_u * 0.5 + (wv_u + vw_u + wvw_u) * c3 + second * c4 + third * (0.5 * (c4 - 3.0 * c5))


def _columns(f: Callable[[V3], V3], like: V3) -> list[V3]:
    """Return the columns of a linear map, its values at the coordinate axes."""
    one, zero = jnp.ones_like(like.x), jnp.zeros_like(like.x)
    return [f(u) for u in (V3(one, zero, zero), V3(zero, one, zero), V3(zero, zero, one))]


def _blocks(diagonal: list[V3], lower: list[V3]) -> tuple[Entry, ...]:
    """Return the 36 entries of [[D, 0], [L, D]], row by row, from the columns of both."""
    rows, below = (list(zip(*columns, strict=True)) for columns in (diagonal, lower))
    top = [entry for row in rows for entry in (*row, 0.0, 0.0, 0.0)]
    return (*top, *(entry for left, right in zip(below, rows, strict=True) for entry in (*left, *right)))


@lift(Quat, V3, out=tuple)
def adjoint(q: Quat, p: V3) -> tuple[Entry, ...]:
    """Return the 36 entries of [[R, 0], [[p]x R, R]], row by row."""
    m = so3.to_matrix(q)
    columns = [V3(m[k], m[3 + k], m[6 + k]) for k in range(3)]
    return _blocks(columns, [cross(p, column) for column in columns])


@lift(Quat, V3, V3, V3, out=(V3, V3))
def reverse_velocity(q: Quat, p: V3, w: V3, v: V3) -> tuple[V3, V3]:
    """Return the velocity of the observer as the observed frame sees it."""
    back = inverse_rigid(Rigid(q, p, w, v), 1)
    return back.angular, back.linear


@lift(None, None, None, out=(Quat, V3))
def from_geodetic(latitude: Entry, longitude: Entry, height: Entry) -> tuple[Quat, V3]:
    """Return the pose of the axes (east, north, up) at a place on WGS-84, relative to the Earth-fixed frame."""
    (sin_lat, cos_lat), (sin_lon, cos_lon) = sin_cos(latitude), sin_cos(longitude)
    e2 = WGS84_FLATTENING * (2 - WGS84_FLATTENING)
    normal = WGS84_RADIUS / jnp.sqrt(1 - e2 * sin_lat * sin_lat)
    across = (normal + height) * cos_lat
    place = V3(across * cos_lon, across * sin_lon, (normal * (1 - e2) + height) * sin_lat)
    return quat_mul(so3.about_z(longitude + np.pi / 2), so3.about_x(np.pi / 2 - latitude)), place


@lift(None, None, None, None, out=(Quat, V3))
def from_dh(a: Entry, alpha: Entry, d: Entry, theta: Entry) -> tuple[Quat, V3]:
    """Return Rz(theta) Tz(d) Tx(a) Rx(alpha)."""
    s, c = sin_cos(theta)
    return quat_mul(so3.about_z(theta), so3.about_x(alpha)), V3(a * c, a * s, d)


@lift(None, None, None, None, out=(Quat, V3))
def from_dh_craig1989(a: Entry, alpha: Entry, d: Entry, theta: Entry) -> tuple[Quat, V3]:
    """Return Rx(alpha) Tx(a) Rz(theta) Tz(d)."""
    s, c = sin_cos(alpha)
    return quat_mul(so3.about_x(alpha), so3.about_z(theta)), V3(a, -d * s, d * c)
