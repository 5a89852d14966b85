"""The mean of several rotations, and the derivative of the eigenvector that it is."""

from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

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
