"""Angles about fixed sequences of axes, as components: quaternions from and to roll-pitch-yaw and ZYZ angles.

Two of the three angles enter a quaternion through half their sum and half their difference, each the angle of one point
in a plane (Bernardes and Viollet 2022). Their distances from the origin give the third angle. Gimbal lock is where one of the
two points is the origin: there the sum or the difference is free, and the documented choice is made.
"""

import math

import jax.numpy as jnp
import numpy as np

from jaxframes.numerics import smooth
from jaxframes.numerics.components import Quat, quat_mul, select
from jaxframes.numerics.smooth import Entry
from jaxframes.numerics.trig import sin_cos

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


def _polar(x: Entry, y: Entry, lost: float) -> tuple[Entry, Entry]:
    """Return (angle, distance) of a point in a plane; (0, 0) with derivatives 0 at distances up to ``lost``."""
    free = jnp.maximum(jnp.abs(x), jnp.abs(y)) <= lost
    x, y = select(free, 1.0, x), select(free, 0.0, y)
    return smooth.atan2(y, x), select(free, 0.0, smooth.norm((x, y)))


def wrapped(angle: Entry) -> Entry:
    """Return an angle in [-2 pi, 2 pi] brought to (-pi, pi] by one turn."""
    turn = 2.0 * np.pi
    return select(angle > np.pi, angle - turn, select(angle <= -np.pi, angle + turn, angle))
