"""The border between arrays ``[..., k]`` and components: the only places where one is made from the other."""

import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.columns import column, joined
from jaxframes.numerics.components import Component
from jaxframes.numerics.layout import aligned


def assemble(components: Sequence[Component], shape: tuple[int, ...] | None = None, dtype: Any = None) -> jax.Array:
    """Return the array ``[..., k]`` of k components.

    Args:
        components: k components; their batch shapes broadcast (known numbers fit any).
        shape: Batch shape of the result. Default: the broadcast shape of the components.
        dtype: Dtype of the result. Default: the promoted dtype of the components that are arrays.
    """
    arrays = [c for c in components if isinstance(c, jax.Array)]
    if shape is None:
        shape = jnp.broadcast_shapes(*(c.shape for c in arrays))
    if dtype is None:
        dtype = jnp.result_type(*arrays) if arrays else default_float()
    if not arrays:
        return jnp.broadcast_to(jnp.asarray(np.array(components), dtype), (*shape, len(components)))
    return joined(aligned(*(jnp.asarray(c, dtype) for c in components), shape=shape))


def take_apart(array: jax.Array) -> tuple[jax.Array, ...]:
    """Return the k components of an array ``[..., k]``."""
    return tuple(column(array, i) for i in range(array.shape[-1]))


def is_concrete(array: Any) -> bool:
    """Whether an array's numbers are known now, outside any trace."""
    return not isinstance(array, jax.core.Tracer)


def parameters(array: jax.Array, batch_rank: int = 0) -> tuple[Component, ...]:
    """Return the components of a parameter ``[..., k]``: Python numbers when they are known, so that zeros and ones fold away.

    Args:
        array: Parameter of an edge.
        batch_rank: Rank to which the batch axes of a batched parameter are padded (on the left).
    """
    if array.ndim == 1 and is_concrete(array):
        return tuple(float(v) for v in np.asarray(array))
    if 1 < array.ndim <= batch_rank:
        array = lax.expand_dims(array, range(batch_rank + 1 - array.ndim))
    return take_apart(array)


def default_float() -> Any:
    """Return the default float dtype as JAX is configured now."""
    return jnp.result_type(float)


def as_float(value: Any) -> jax.Array:
    """Return any array-like of numbers as a JAX array with a strong float dtype."""
    if isinstance(value, jax.Array) and not value.weak_type and jnp.issubdtype(value.dtype, jnp.floating):
        return value
    if isinstance(value, (np.ndarray, float)):  # converted before it becomes an array of JAX: ten times faster
        numbers = np.asarray(value)
        single = jnp.issubdtype(numbers.dtype, jnp.floating) and isinstance(value, np.ndarray) and numbers.dtype != np.float64
        return jnp.asarray(numbers if single else numbers.astype(default_float()))
    array = jnp.asarray(value)
    dtype = array.dtype if jnp.issubdtype(array.dtype, jnp.floating) and not array.weak_type else default_float()
    return lax.convert_element_type(array, dtype)


def common_float(*values: Any) -> tuple[jax.Array, ...]:
    """Return array-likes as JAX arrays of their promoted float dtype."""
    arrays = tuple(as_float(v) for v in values)
    dtype = functools.reduce(jnp.promote_types, (a.dtype for a in arrays))
    return tuple(lax.convert_element_type(a, dtype) for a in arrays)
