"""Motions as arrays: between the components that computations are written in and the values that users hold."""

from collections.abc import Iterable
from typing import Any

import jax

from jaxframes.numerics.boundary import assemble, take_apart
from jaxframes.numerics.components import V3, Quat
from jaxframes.numerics.extension import parts_of
from jaxframes.numerics.rigid import Rigid
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform

Arrays = tuple[jax.Array, ...]
"""The parts of a motion as arrays [..., 4 or 3]: pose, then velocity, then acceleration, as far as the order goes."""


def arrays_of(motion: Rigid, shape: tuple[int, ...], order: int, dtype: Any) -> Arrays:
    """Return the parts of a motion that an order asks for as fenced arrays [*shape, k]."""
    return tuple(assemble(tuple(part), shape, dtype) for part in parts_of(motion, order))


def motion_of(arrays: Iterable[jax.Array]) -> Rigid:
    """Return a motion from its parts as arrays."""
    quat, *vectors = (take_apart(array) for array in arrays)
    return Rigid(Quat(*quat), *(V3(*v) for v in vectors))


def named(parts: Arrays) -> Motion:
    """Return two, four or six arrays as the value that users hold; what is not there is None."""
    transform = Transform(Rotation(parts[0]), parts[1])
    velocity = SpatialVelocity(parts[2], parts[3]) if len(parts) > 2 else None
    acceleration = SpatialAcceleration(parts[4], parts[5]) if len(parts) > 4 else None
    return Motion(transform, velocity, acceleration)  # pyright: ignore[reportArgumentType]
