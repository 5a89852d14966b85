"""Axes from two vectors, with exact angular velocity and acceleration: the vectors' derivatives pushed through one small function."""

import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import V3, cross, dot, select

Axes = tuple[str, str]
"""Which axis lies along the primary vector, and which in the half plane of the secondary one: ``x``, ``y``, ``z``, or ``-x`` and so on."""
LEAST_SINE = 16
"""Sine of the angle between two vectors, in roundings, below which they count as parallel."""


def child_axes(axes: Axes, primary: V3, secondary: V3) -> tuple[V3, V3, V3]:
    """Return the child's axes x, y, z in the parent's; NaN as a whole where the vectors are parallel, or one of them is zero.

    Args:
        axes: Which axis is which.
        primary: A vector, of any length; one axis lies along it.
        secondary: Another one; the other axis lies in the half plane that it spans with the first.
    """
    (p, first), (s, second) = (("xyz".index(name[-1]), -1.0 if name[0] == "-" else 1.0) for name in axes)
    even = (s - p) % 3 == 1
    a, b = _unit(primary), _unit(secondary)
    normal = cross(a, b)
    square = jnp.asarray(dot(normal, normal))
    least = (LEAST_SINE * float(np.finfo(square.dtype).eps)) ** 2
    third = normal * (lax.rsqrt(select(square > least, square, float("nan"))) * (first * second * (1.0 if even else -1.0)))
    along = a * first + _times_zero(third)
    other = cross(third, along) if even else cross(along, third)
    found = {p: along, s: other, 3 - p - s: third}
    return found[0], found[1], found[2]


def _times_zero(vector: V3) -> V3:
    """Return zeros that are NaN where a vector is."""
    return V3(*(jnp.asarray(c) * 0 for c in vector))


def _unit(vector: V3) -> V3:
    return vector * lax.rsqrt(jnp.asarray(dot(vector, vector)))


def with_rates(axes: Axes, primary: Sequence[V3], secondary: Sequence[V3]) -> tuple[tuple[V3, V3, V3], list[V3]]:
    """Return the child's axes, then angular velocity and acceleration as far as derivatives of both vectors are given.

    w = sum e_i x e_i' / 2 and alpha = sum e_i x e_i'' / 2: no inverse, no angle, no branch. All components are arrays of one shape.

    Args:
        axes: Which axis is which.
        primary: The vector and its derivatives by time, in the parent's axes: one, two or three.
        secondary: The other one, likewise.
    """
    place = functools.partial(child_axes, axes)
    moving = lambda v, dv: jax.jvp(place, v, dv)  # noqa: E731
    vectors = list(zip(primary, secondary, strict=True))
    if len(vectors) == 1:
        return place(*vectors[0]), []
    if len(vectors) == 2:
        found, rates = moving(*vectors)
        return found, [_half_sum(found, rates)]
    (found, rates), (_, rates2) = jax.jvp(moving, (vectors[0], vectors[1]), (vectors[1], vectors[2]))
    return found, [_half_sum(found, rates), _half_sum(found, rates2)]


def _half_sum(axes: tuple[V3, V3, V3], rates: tuple[V3, V3, V3]) -> V3:
    parts = [cross(axis, rate) for axis, rate in zip(axes, rates, strict=True)]
    return (parts[0] + parts[1] + parts[2]) * 0.5
