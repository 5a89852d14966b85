"""Motions as arrays: between what computations hold and the values that users hold."""

from collections.abc import Iterable, Sequence

import jax
from jax import lax

from jaxframes.numerics.components import V3, Quat
from jaxframes.numerics.packed import Packed
from jaxframes.numerics.rigid import Rigid
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.staging.columns import take_apart


def motion_of(arrays: Iterable[jax.Array]) -> Rigid:
    """Return a motion from the arrays of a ``Motion``: quaternion, translation, and the four halves of its derivatives."""
    quat, *vectors = (take_apart(array) for array in arrays)
    return Rigid(Quat(*quat), *(V3(*v) for v in vectors))


def halves(array: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the two halves of an array of a motion: quaternion and translation, or angular and linear."""
    size = array.shape[-1] - 3
    return tuple(lax.slice_in_dim(array, a, b, axis=array.ndim - 1) for a, b in ((0, size), (size, size + 3)))  # pyright: ignore[reportReturnType]


def named(arrays: Packed) -> Motion:
    """Return arrays of a motion as the value that users hold; what is not there is None."""
    return of_halves([half for array in arrays for half in halves(array)])


def of_halves(parts: Sequence[jax.Array]) -> Motion:
    """Return the value that users hold of quaternion, translation and the halves of its derivatives, as far as they are there."""
    transform = Transform(Rotation(parts[0]), parts[1])
    velocity = SpatialVelocity(parts[2], parts[3]) if len(parts) > 2 else None
    acceleration = SpatialAcceleration(parts[4], parts[5]) if len(parts) > 4 else None
    return Motion(transform, velocity, acceleration)  # pyright: ignore[reportArgumentType]
