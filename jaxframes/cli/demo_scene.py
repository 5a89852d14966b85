"""The demonstration's scene: the Solar System, a ground station, a lunar orbiter and its antenna that tracks the station."""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxframes.edges import Edge, Fixed, Prescribed, Revolute
from jaxframes.spatial import Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.tree import FrameTree, State, TreeBuilder

STATION = (40.4314, -4.2481, 865.0)
"""Geodetic latitude and longitude (deg) and height (m) of the station: near the Madrid deep-space complex."""

START = "2026-03-01T00:00:00"
DAYS = 28.0

_MOON_GM = 4.9028001e12  # m3/s2, DE440
_SEMI_MAJOR, _ECCENTRICITY = 4.0e6, 0.45  # m
_PLANE = (0.0, 1.3, 0.4)  # roll, pitch, yaw (rad) of the orbit's plane in J2000 axes


def build_tree(tables: Mapping[str, Edge]) -> FrameTree:
    """Return the scene's tree; ``tables`` hold the edges that ship with the package."""
    b = TreeBuilder(root="ssb")
    b.add("sun", parent="ssb", edge=tables["sun"])
    b.add("mars", parent="ssb", edge=tables["mars"])
    b.add("emb", parent="ssb", edge=tables["emb"])
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("itrf93", parent="earth", edge=tables["itrf93"])
    latitude, longitude, height = STATION
    site = Transform.from_geodetic(jnp.deg2rad(latitude), jnp.deg2rad(longitude), height)
    b.add("station", parent="itrf93", edge=Fixed(site))
    b.add("moon", parent="earth", edge=tables["moon"])
    b.add("craft", parent="moon", edge=Prescribed())
    b.add("azimuth", parent="craft", edge=Revolute(axis=(0, 0, 1), placement=Transform.from_translation((0.0, 0.0, 1.2))))
    b.add("antenna", parent="azimuth", edge=Revolute(axis=(0, -1, 0), placement=Transform.from_translation((0.3, 0.0, 0.2))))
    return b.build()


def orbit(time: Epoch) -> Motion:
    """Return the motion of the craft relative to the Moon: a Kepler ellipse; x radial, z along the orbit's normal.

    Position, velocity and acceleration are those of the two-body problem (Kepler's equation by Newton's method), the attitude
    follows the true anomaly with its rate h/r2 and acceleration -2 rdot h/r3.
    """
    a, e = _SEMI_MAJOR, _ECCENTRICITY
    n = (_MOON_GM / a**3) ** 0.5
    mean = n * (time - Epoch.from_tdb(START))
    eccentric = mean + e * jnp.sin(mean)
    for _ in range(7):
        eccentric = eccentric - (eccentric - e * jnp.sin(eccentric) - mean) / (1 - e * jnp.cos(eccentric))
    cos_e, sin_e = jnp.cos(eccentric), jnp.sin(eccentric)
    b = a * (1 - e**2) ** 0.5
    r = a * (1 - e * cos_e)
    zero = jnp.zeros_like(r)
    position = jnp.stack([a * (cos_e - e), b * sin_e, zero], -1)
    velocity = jnp.stack([-a * sin_e, b * cos_e, zero], -1) * (n * a / r)[..., None]
    acceleration = -_MOON_GM * position / (r**3)[..., None]
    turn = n * a * b / r**2
    bend = -2 * turn * (n * a**2 * e * sin_e / r) / r
    plane = Rotation.from_rpy(*_PLANE)
    attitude = plane @ Rotation.rot_z(jnp.arctan2(position[..., 1], position[..., 0]))
    return Motion(
        Transform(attitude, plane @ position),
        SpatialVelocity(plane @ jnp.stack([zero, zero, turn], -1), plane @ velocity),
        SpatialAcceleration(plane @ jnp.stack([zero, zero, bend], -1), plane @ acceleration),
    )


def pointing(line_of_sight: Motion) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return gimbal angles [..., 2] (azimuth, elevation) that point at a target, with their first and second derivatives.

    The motion of the target relative to the craft gives the line of sight and its derivatives; the angles are then
    differentiated twice along d + d' s + d'' s2 / 2 at s = 0.
    """
    d, d1, d2 = line_of_sight.transform.translation, line_of_sight.velocity.linear, line_of_sight.acceleration.linear

    def angles(s: jax.Array) -> jax.Array:
        x, y, z = (d + d1 * s + d2 * (s * s / 2)).T
        return jnp.stack([jnp.arctan2(y, x), jnp.arctan2(z, jnp.hypot(x, y))], -1)

    def rates(s: jax.Array) -> tuple[jax.Array, jax.Array]:
        return jax.jvp(angles, (s,), (jnp.ones_like(s),))

    zero = jnp.zeros((), d.dtype)
    (q, qd), (_, qdd) = jax.jvp(rates, (zero,), (jnp.ones_like(zero),))
    return q, qd, qdd


def tracking_state(tree: FrameTree, time: Epoch) -> State:
    """Return the scene's state at a batch of epochs [n]: the craft on its orbit, the antenna pointed at the station."""
    flight = orbit(time)
    state = tree.set_motion(tree.state(time=time), "craft", flight.transform, flight.velocity, flight.acceleration)
    q, qd, qdd = pointing(tree.motion(state, of="station", relative_to="craft"))
    return state.replace(q=q, qd=qd, qdd=qdd)


class Samples(NamedTuple):
    """The antenna's motion relative to the station, in the station's east-north-up axes, and what follows from it; [n]."""

    motion: Motion
    range: jax.Array
    range_rate: jax.Array
    elevation: jax.Array


@jax.jit
def evaluate(tree: FrameTree, time: Epoch) -> Samples:
    """Return position, velocity and acceleration of the antenna relative to the station at a batch of epochs [n]."""
    motion = tree.motion(tracking_state(tree, time), of="antenna", relative_to="station")
    position = motion.transform.translation
    distance = jnp.linalg.norm(position, axis=-1)
    rate = jnp.sum(position * motion.velocity.linear, -1) / distance
    return Samples(motion, distance, rate, jnp.arcsin(position[..., 2] / distance))
