"""Rotations as components: exponential, logarithm, Jacobians, and conversions from and to matrices."""

import functools
import math
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jaxframes.numerics import smooth
from jaxframes.numerics.components import V3, Quat, cross, dot, quat_conj, quat_from, quat_mul, renormalized, select
from jaxframes.numerics.smooth import Entry
from jaxframes.numerics.trig import sin_cos

Nine = Sequence[Entry]
"""The nine entries of a matrix, row by row."""


def normalized(q: Quat) -> Quat:
    """Return q over its norm (safe from overflow); a zero quaternion gives NaN, in its gradient too."""
    unit, length = smooth.normalize(tuple(q))
    sound = select(length == 0, float("nan"), 1.0).astype(jnp.asarray(length).dtype)
    return Quat(*(part * sound for part in unit))


def product(a: Quat, b: Quat) -> Quat:
    """Return the product of two unit quaternions, unit to rounding: without the Newton step errors of the norm double in each square."""
    return renormalized(quat_mul(a, b))


def exp(v: V3) -> Quat:
    """Return the quaternion of a rotation vector: (cos(a/2), v sin(a/2)/a)."""
    c, s = smooth.cos_sinc(dot(v, v) * 0.25)
    return quat_from(c, v * (s * 0.5))


def log(q: Quat) -> V3:
    """Return the rotation vector, of length at most pi to rounding; of q and -q the one that ``upper`` says is taken."""
    q = upper(q)
    u = q.vector
    return u * (2.0 * smooth.arc(dot(u, u), q.w))


def upper(q: Quat) -> Quat:
    """Return q or -q: the one with w > 0, or, where w is zero to rounding, with the largest of x, y, z positive.

    There, at half a turn, rounding alone would decide. Of components equal to rounding the last counts as the largest.
    """
    slack = 4.0 * smooth.rounding(q.w)
    x, y, z = (jnp.abs(c) for c in q.vector)
    largest = select(x > jnp.maximum(y, z) + slack, q.x, select(y > z + slack, q.y, q.z))
    leading = select(jnp.abs(q.w) <= slack, largest, q.w)
    sign = select(leading < 0, -1.0, 1.0)
    return Quat(*(c * sign for c in q))


def angle(q: Quat) -> Entry:
    """Return the angle of rotation in [0, pi]."""
    return 2.0 * smooth.atan2(smooth.norm(tuple(q.vector)), jnp.abs(q.w))


def distance(a: Quat, b: Quat) -> Entry:
    """Return the angle in [0, pi] between two rotations; 0 with derivatives 0 where they are equal.

    With d = b - a, or a + b for the other sign, the vector part of a* b is a_w d_v - d_w a_v - a_v x d_v: at equality exactly zero, where
    the products themselves leave a residue that has a direction.
    """
    w = a.w * b.w + dot(a.vector, b.vector)
    sign = select(w < 0, -1.0, 1.0)
    d = Quat(*(y * sign - x for x, y in zip(a, b, strict=True)))
    u = d.vector * a.w - a.vector * d.w - cross(a.vector, d.vector)
    return 2.0 * smooth.atan2(smooth.norm(tuple(u)), jnp.abs(w))


def to_matrix(q: Quat) -> tuple[Entry, ...]:
    """Return the nine entries of the rotation matrix of a unit quaternion."""
    w, x, y, z = q
    x2, y2, z2 = 2.0 * x, 2.0 * y, 2.0 * z
    xx, yy, zz, xy, xz, yz = x * x2, y * y2, z * z2, x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return (1.0 - (yy + zz), xy - wz, xz + wy, xy + wz, 1.0 - (xx + zz), yz - wx, xz - wy, yz + wx, 1.0 - (xx + yy))


def from_matrix(m: Nine) -> Quat:
    """Return the unit quaternion of a rotation matrix (Shepperd 1978, with one square root for all four cases).

    With the largest of w, x, y, z (w whenever the trace is positive) called c, the four products 4 c (w, x, y, z) are sums of
    entries; normalising them gives the quaternion. w > 0 in the first case, the largest of x, y, z is positive in the others. NaN where
    the determinant is not positive.
    """
    a, b, c, d, e, f, g, h, i = m
    by_w, by_x, by_y = a + e + i > 0, (a > e) & (a > i), e > i

    def pick(w: Entry, x: Entry, y: Entry, z: Entry) -> Entry:
        return select(by_w, w, select(by_x, x, select(by_y, y, z)))

    p, q, r = h - f, c - g, d - b
    u, v, s = h + f, c + g, d + b
    w = pick(1.0 + (a + e + i), p, q, r)
    x = pick(p, 1.0 + a - (e + i), s, v)
    y = pick(q, s, 1.0 + e - (a + i), u)
    z = pick(r, v, u, 1.0 + i - (a + e))
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    sound = select(determinant > 0, 1.0, float("nan")).astype(jnp.asarray(w).dtype)  # a reflection is NaN, its gradient too
    return Quat(*(part * sound for part in smooth.normalize((w, x, y, z))[0]))


def skew(v: V3) -> tuple[Entry, ...]:
    """Return the nine entries of the matrix of v x."""
    zero = jnp.zeros_like(v.x)
    return (zero, -v.z, v.y, v.z, zero, -v.x, -v.y, v.x, zero)


def _polynomial(v: V3, first: Entry, second: Entry) -> tuple[Entry, ...]:
    """Return the nine entries of I + first [v]x + second [v]x^2."""
    a, b = v * first, v * second
    xx, yy, zz, xy, xz, yz = v.x * b.x, v.y * b.y, v.z * b.z, v.x * b.y, v.x * b.z, v.y * b.z
    diagonal = (1.0 - (yy + zz), 1.0 - (xx + zz), 1.0 - (xx + yy))
    return (diagonal[0], xy - a.z, xz + a.y, xy + a.z, diagonal[1], yz - a.x, xz - a.y, yz + a.x, diagonal[2])


def left_jacobian(v: V3) -> tuple[Entry, ...]:
    """Return J_l of a rotation vector: d exp(v) = [J_l dv]x exp(v)."""
    square = dot(v, v)
    return _polynomial(v, smooth.versine(square), smooth.cubic_remainder(square))


def left_jacobian_inv(v: V3) -> tuple[Entry, ...]:
    """Return the inverse of J_l; pole at |v| = 2 pi."""
    return _polynomial(v, -0.5, smooth.half_cotangent_remainder(dot(v, v)))


def apply_left_jacobian(v: V3, u: V3) -> V3:
    """Return J_l(v) u."""
    square = dot(v, v)
    once = cross(v, u)
    return u + once * smooth.versine(square) + cross(v, once) * smooth.cubic_remainder(square)


def apply_left_jacobian_inv(v: V3, u: V3) -> V3:
    """Return J_l(v)^-1 u."""
    once = cross(v, u)
    return u - once * 0.5 + cross(v, once) * smooth.half_cotangent_remainder(dot(v, v))


def slerp(a: Quat, b: Quat, t: Entry) -> Quat:
    """Return the rotation at fraction t of the shortest way from a to b, at constant rate."""
    return product(a, exp(log(quat_mul(quat_conj(a), b)) * t))


def slerp_long(a: Quat, b: Quat, t: Entry) -> Quat:
    """Return the rotation at fraction t of the long way from a to b: the rotation vector less a whole turn about its axis."""
    v = log(quat_mul(quat_conj(a), b))
    nothing = (v.x == 0) & (v.y == 0) & (v.z == 0)
    axis, _ = smooth.normalize((v.x, v.y, select(nothing, 1.0, v.z)))
    return product(a, exp((v - V3(*axis) * (2.0 * np.pi)) * t))


def from_mrp(p: V3) -> Quat:
    """Return the quaternion of modified Rodrigues parameters: (1 - p.p, 2 p) / (1 + p.p)."""
    square = dot(p, p)
    over = 1.0 / (1.0 + square)
    return quat_from((1.0 - square) * over, p * (2.0 * over))


def to_mrp(q: Quat) -> V3:
    """Return the modified Rodrigues parameters of length at most 1: the vector part over 1 + w."""
    q = upper(q)
    return q.vector * (1.0 / (1.0 + q.w))


LOCKED = 1e-12
"""How near to +-pi/2 a pitch in 64 bits is gimbal lock (rad), as in KDL: roll and yaw are known to 1e-4 there."""


def about_x(angle: Entry) -> Quat:
    """Return the rotation about x."""
    s, c = sin_cos(angle * 0.5)
    return Quat(c, s, 0.0, 0.0)


def about_y(angle: Entry) -> Quat:
    """Return the rotation about y."""
    s, c = sin_cos(angle * 0.5)
    return Quat(c, 0.0, s, 0.0)


def about_z(angle: Entry) -> Quat:
    """Return the rotation about z."""
    s, c = sin_cos(angle * 0.5)
    return Quat(c, 0.0, 0.0, s)


def from_rpy(roll: Entry, pitch: Entry, yaw: Entry) -> Quat:
    """Return Rz(yaw) Ry(pitch) Rx(roll)."""
    return quat_mul(quat_mul(about_z(yaw), about_y(pitch)), about_x(roll))


def from_zyz(first: Entry, second: Entry, third: Entry) -> Quat:
    """Return Rz(first) Ry(second) Rz(third)."""
    return quat_mul(quat_mul(about_z(first), about_y(second)), about_z(third))


def to_rpy(q: Quat) -> tuple[Entry, Entry, Entry]:
    """Return (roll, pitch, yaw) with pitch in [-pi/2, pi/2]; at gimbal lock roll = 0."""
    w, x, y, z = q
    # the distances are sqrt(2) times the cosine and the sine of pi/4 + pitch/2
    lost = max(4.0 * smooth.rounding(w), LOCKED * math.sqrt(0.5))
    difference, plus = _polar(w + y, z - x, lost)
    total, minus = _polar(w - y, z + x, lost)
    difference = select(plus == 0.0, total, difference)
    total = select(minus == 0.0, difference, total)
    pitch = smooth.atan2(2.0 * (w * y - x * z), plus * minus)
    return wrapped(total - difference), pitch, wrapped(total + difference)


def to_zyz(q: Quat) -> tuple[Entry, Entry, Entry]:
    """Return (first, second, third) with the second in [0, pi]; where it is 0 or pi, third = 0."""
    lost = 2.0 * smooth.rounding(q.w)
    total, upright = _polar(q.w, q.z, lost)
    difference, tilted = _polar(q.y, -q.x, lost)
    difference = select(tilted == 0.0, total, difference)
    total = select(upright == 0.0, difference, total)
    return wrapped(total + difference), 2.0 * smooth.atan2(tilted, upright), wrapped(total - difference)


def from_axes(axes: str, angles: Sequence[Entry]) -> Quat:
    """Return the product of turns about the axes named, each about an axis that those before it have moved."""
    about = {"x": about_x, "y": about_y, "z": about_z}
    turns = [about[axis](angle) for axis, angle in zip(axes, angles, strict=True)]
    return functools.reduce(product, turns)


def to_axes(axes: str, q: Quat) -> tuple[Entry, Entry, Entry]:
    """Return the angles of turns about three axes, each about an axis that those before it have moved.

    The axes are renamed so that they read z, y, z or z, y, x. What is then called x is opposite to the axis that was where the renaming is
    a reflection; a turn about it changes its sign, one about the others does not.
    """
    first, second = axes[0], axes[1]
    other = ({"x", "y", "z"} - {first, second}).pop()
    sign = 1.0 if second + first in ("yz", "zx", "xy") else -1.0  # other x second = first, for a right-handed renaming
    part = dict(zip("xyz", q.vector, strict=True))
    renamed = Quat(q.w, part[other] * sign, part[second], part[first])
    if axes[2] == first:
        return to_zyz(renamed)
    x, y, z = to_rpy(renamed)
    return z, y, x * sign


def _polar(x: Entry, y: Entry, lost: float) -> tuple[Entry, Entry]:
    """Return (angle, distance) of a point in a plane; (0, 0) with derivatives 0 at distances up to ``lost``."""
    free = jnp.maximum(jnp.abs(x), jnp.abs(y)) <= lost
    x, y = select(free, 1.0, x), select(free, 0.0, y)
    return smooth.atan2(y, x), select(free, 0.0, smooth.norm((x, y)))


def wrapped(angle: Entry) -> Entry:
    """Return an angle in [-2 pi, 2 pi] brought to (-pi, pi] by one turn."""
    turn = 2.0 * np.pi
    return select(angle > np.pi, angle - turn, select(angle <= -np.pi, angle + turn, angle))
