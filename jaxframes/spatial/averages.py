"""Means of rotations, and rotations that fit best: eigenvectors of symmetric 4 by 4 matrices, with their derivatives."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.errors import ShapeError
from jaxframes.numerics.lift import lift
from jaxframes.numerics.smooth import Entry
from jaxframes.spatial.rotation_ops import canonical
from jaxframes.staging.arrays import as_float, common_float

_EXACT = lax.Precision.HIGHEST


def mean(quaternions: jax.Array, weights: Any, axis: int | Sequence[int]) -> jax.Array:
    """Return the chordal mean [..., 4] of unit quaternions over batch axes; see ``Rotation.mean``."""
    q = as_float(quaternions)
    axes = _axes(axis, q.shape[:-1])
    if weights is not None:
        q, w = common_float(q, weights)
        w = _weights(w, q.shape[:-1])
    else:
        w = jnp.ones(q.shape[:-1], q.dtype)
    q, w = _last(q, axes, 1), _last(w, axes, 0)
    vector, _ = dominant(jnp.einsum("...n,...ni,...nj->...ij", w, q, q, precision=_EXACT))
    # the sign of an eigenvector is free: take the one near the first rotation
    sign = jnp.where(jnp.sum(vector * q[..., 0, :], -1, keepdims=True) < 0, -1.0, 1.0)
    return vector * lax.stop_gradient(sign).astype(vector.dtype)


def translation_mean(translations: jax.Array, weights: Any, axis: int | Sequence[int]) -> jax.Array:
    """Return the weighted mean [..., 3] of vectors over batch axes."""
    p = as_float(translations)
    axes = _axes(axis, p.shape[:-1])
    if weights is None:
        return jnp.mean(p, axes)
    p, w = common_float(p, weights)
    w = _last(_weights(w, p.shape[:-1]), axes, 0)
    total = jnp.einsum("...n,...ni->...i", w, _last(p, axes, 1), precision=_EXACT)
    return total / jnp.sum(w, -1, keepdims=True)


def _axes(axis: int | Sequence[int], shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return batch axes counted from the front, refusing those that there are not and those along which there is nothing."""
    axes = (axis,) if isinstance(axis, int) else tuple(axis)
    wrong = [a for a in axes if not -len(shape) <= a < len(shape)]
    if wrong or not axes:
        raise ShapeError(f"mean: a batch of shape {shape} has no axis {wrong[0] if wrong else axes}; a mean needs a batch axis")
    axes = tuple(a % len(shape) for a in axes)
    if len(set(axes)) < len(axes):
        raise ShapeError(f"mean: axis {axis} names one axis twice")
    if not all(shape[a] for a in axes):
        raise ShapeError(f"mean: nothing stands along axis {axis} of a batch of shape {shape}, so it has no mean")
    return axes


def _weights(weights: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    try:
        return jnp.broadcast_to(lax.expand_dims(weights, range(len(shape) - weights.ndim)), shape)
    except ValueError:
        raise ShapeError(f"weights of shape {weights.shape} do not broadcast to the shape {shape} of what they weigh") from None


def _last(array: jax.Array, axes: tuple[int, ...], own: int) -> jax.Array:
    """Return an array with batch axes moved behind the others and joined to one, before its own axes."""
    kept = array.ndim - own - len(axes)
    moved = jnp.moveaxis(array, axes, tuple(range(kept, kept + len(axes))))
    return moved.reshape(*moved.shape[:kept], -1, *moved.shape[kept + len(axes) :])


@jax.custom_jvp
def dominant(m: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the unit eigenvector of the largest eigenvalue of symmetric matrices [..., 4, 4], and how far the next one is below it."""
    values, vectors = jnp.linalg.eigh(m)
    return vectors[..., :, -1], values[..., -1] - values[..., -2]


@dominant.defjvp
def _dominant_jvp(primals: tuple[jax.Array], tangents: tuple[jax.Array]) -> tuple[tuple[jax.Array, jax.Array], tuple[jax.Array, jax.Array]]:
    """Solve (l I - M + l v v^T) dv = (dM - v v^T dM) v: it needs l to be simple, not the others (unlike eigh's own rule)."""
    (m,), (dm,) = primals, tangents
    v, gap = dominant(m)
    moved = jnp.einsum("...ij,...j->...i", m, v, precision=_EXACT)
    value = jnp.sum(v * moved, -1)[..., None, None]
    outer = v[..., :, None] * v[..., None, :]
    pushed = jnp.einsum("...ij,...j->...i", (dm + jnp.swapaxes(dm, -1, -2)) * 0.5, v, precision=_EXACT)
    pushed = pushed - v * jnp.sum(v * pushed, -1, keepdims=True)
    system = value * (jnp.eye(4, dtype=m.dtype).reshape((1,) * (m.ndim - 2) + (4, 4)) + outer) - m
    return (v, gap), (jnp.linalg.solve(system, pushed[..., None])[..., 0], jnp.zeros_like(gap))


def nearest(nine: jax.Array) -> jax.Array:
    """Return the quaternions [..., 4] that make trace(R^T M) largest, for matrices [..., 9]; NaN where several do."""
    davenport = _davenport(nine)
    davenport = davenport.reshape(*davenport.shape[:-1], 4, 4)
    size = lax.stop_gradient(jnp.max(jnp.abs(davenport), (-2, -1), keepdims=True))
    vector, gap = dominant(davenport / jnp.where(size > 0, size, jnp.ones_like(size)))
    sound = jnp.where(gap > 64 * jnp.finfo(nine.dtype).eps, 1.0, jnp.nan).astype(nine.dtype)
    return canonical(vector * sound[..., None])


@lift(tuple, out=tuple)
def _davenport(m: tuple[Entry, ...]) -> tuple[Entry, ...]:
    """Return the sixteen entries of the symmetric K with q^T K q = trace(R(q)^T M) (Davenport; Keat 1977), scalar first."""
    a, b, c, d, e, f, g, h, i = m
    p, q, r, u, v, s = h - f, c - g, d - b, h + f, c + g, d + b
    return (a + e + i, p, q, r, p, a - e - i, s, v, q, s, e - a - i, u, r, v, u, i - a - e)


def align_vectors(in_a: Any, in_b: Any, weights: Any) -> jax.Array:
    """Return the quaternions [..., 4] of the rotations that best take vectors [..., n, 3] in b to those in a; see ``Rotation``."""
    a, b, w = common_float(in_a, in_b, 1.0 if weights is None else weights)
    for vectors in (a, b):
        if vectors.ndim < 2 or vectors.shape[-1] != 3:
            raise ShapeError(f"align_vectors: vectors [..., n, 3] are needed; found {vectors.shape}")
    try:
        shape = jnp.broadcast_shapes(a.shape[:-1], b.shape[:-1])
    except ValueError:
        shape = ()
    if a.shape[-2] != b.shape[-2] or not shape:
        raise ShapeError(f"align_vectors: both sets are the same vectors, one by one; found {a.shape} and {b.shape}")
    a, b = (jnp.broadcast_to(lax.expand_dims(x, range(len(shape) + 1 - x.ndim)), (*shape, 3)) for x in (a, b))
    moment = jnp.einsum("...n,...ni,...nj->...ij", _weights(w, shape), a, b, precision=_EXACT)
    return nearest(moment.reshape(*moment.shape[:-2], 9))
