"""The border between arrays ``[..., k]`` and components: the only places where one is made from the other.

Three rules keep XLA fast whatever a user does with a result. Arrays are assembled by selects over the last axis, never by a
stack; they leave through a fence that the CPU compiler does not fuse across; and they are taken apart with a derivative that
is again an assembly, never a pad or a concatenate.
"""

import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import Component


def assemble(components: Sequence[Component], shape: tuple[int, ...] | None = None, dtype: Any = None) -> jax.Array:
    """Return the array ``[..., k]`` of k components, by selects, behind a fence.

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
    k = len(components)
    if not arrays:
        return jnp.broadcast_to(jnp.asarray(np.array(components), dtype), (*shape, k))
    index = lax.broadcasted_iota(jnp.int32, (*shape, k), len(shape))
    out = _spread(components[-1], shape, dtype, k)
    for i in range(k - 2, -1, -1):
        out = jnp.where(index == i, _spread(components[i], shape, dtype, k), out)
    return fence(out)


def _spread(component: Component, shape: tuple[int, ...], dtype: Any, k: int) -> jax.Array:
    """Return a component as an array ``[*shape, k]`` that repeats it along the last axis."""
    if not isinstance(component, jax.Array):
        return jnp.full((*shape, k), component, dtype)
    full = component.astype(dtype)
    if full.ndim < len(shape):
        full = lax.expand_dims(full, range(len(shape) - full.ndim))
    return jnp.broadcast_to(full[..., None], (*shape, k))


def fence(array: jax.Array) -> jax.Array:
    """Return the array unchanged, behind a boundary that XLA:CPU does not fuse across.

    Without it, consumers such as ``concatenate`` evaluate the whole producer once per use on CPU. A product with the identity
    is exact, differentiable and batches; ``lax.optimization_barrier`` is removed before fusion there. Other platforms fuse
    well and get nothing. One non-finite component makes its whole row NaN.
    """
    return lax.platform_dependent(array, cpu=_times_identity, default=_unchanged)


def _times_identity(array: jax.Array) -> jax.Array:
    return lax.dot_general(
        array,
        np.eye(array.shape[-1], dtype=array.dtype),
        (((array.ndim - 1,), (0,)), ((), ())),
        precision=lax.Precision.HIGHEST,
    )


def _unchanged(array: jax.Array) -> jax.Array:
    return array


@jax.custom_jvp
def take_apart(array: jax.Array) -> tuple[jax.Array, ...]:
    """Return the k components of an array ``[..., k]``; the transpose is an assembly, never a pad."""
    return tuple(array[..., i] for i in range(array.shape[-1]))


@take_apart.defjvp
def _take_apart_jvp(primals: tuple[jax.Array], tangents: tuple[jax.Array]) -> tuple[tuple[jax.Array, ...], tuple[jax.Array, ...]]:
    (array,), (tangent,) = primals, tangents
    return take_apart(array), tuple(_selected(tangent, i) for i in range(array.shape[-1]))


@functools.partial(jax.custom_jvp, nondiff_argnums=(1,))
def column(array: jax.Array, index: int) -> jax.Array:
    """Return one component of an array ``[..., k]``; the transpose is a select, never a pad."""
    return lax.index_in_dim(array, index, array.ndim - 1, keepdims=False)


@column.defjvp
def _column_jvp(index: int, primals: tuple[jax.Array], tangents: tuple[jax.Array]) -> tuple[jax.Array, jax.Array]:
    (array,), (tangent,) = primals, tangents
    return column(array, index), _selected(tangent, index)


def _selected(array: jax.Array, index: int) -> jax.Array:
    """Return one component by a select and a sum: the transpose is a select again."""
    here = lax.broadcasted_iota(jnp.int32, array.shape, array.ndim - 1) == index
    return jnp.sum(jnp.where(here, array, jnp.zeros_like(array)), -1)


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
