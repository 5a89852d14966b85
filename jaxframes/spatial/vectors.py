"""Functions of plain 3-vectors [..., 3] that PyKDL's Vector has, without its tolerances: nothing small is taken for zero."""

from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.numerics import components, smooth
from jaxframes.numerics.components import V3, select
from jaxframes.numerics.lift import lift
from jaxframes.numerics.smooth import Entry


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


def norm(vector: Any) -> jax.Array:
    """Return the length [...] of vectors [..., 3], free of overflow and underflow; at zero its derivatives are set to 0."""
    return _norm(vector)


def normalize(vector: Any) -> tuple[jax.Array, jax.Array]:
    """Return (unit vectors [..., 3], their former lengths [...]); zero gives ((1, 0, 0), 0), with derivatives 0."""
    return _normalize(vector)


def cross(a: Any, b: Any) -> jax.Array:
    """Return the vector product [..., 3] of vectors [..., 3]."""
    return _cross(a, b)


def dot(a: Any, b: Any) -> jax.Array:
    """Return the scalar product [...] of vectors [..., 3]."""
    return _dot(a, b)


def equal(a: Any, b: Any, eps: Any = 1e-6) -> jax.Array:
    """Return whether all components of vectors [..., 3] differ by less than ``eps`` (absolute, as in KDL), as booleans [...]."""
    return _farthest(a, b, eps) > 0.5
