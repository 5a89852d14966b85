"""Columns: components put together to an array [..., k] and taken out of one; each operation's transpose is the other.

They are primitives of their own because of their derivatives. Written with ``stack`` or ``[..., i]``, their transposes are pads and
sums over the last axis, on which XLA:CPU spends several times what the arithmetic between them costs (measured: gradients of a pose
take two, of a motion seven times as long). Here assembling is a chain of selects over the last axis, a column a slice, and the transpose of
either is the other: so a derivative is as few loops as the function itself.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.interpreters import ad, batching, mlir

from jaxframes.staging.arrays import default_float, is_concrete
from jaxframes.staging.internals import Primitive
from jaxframes.staging.sharding import aligned, alike, is_explicit

Component: TypeAlias = jax.Array | float
"""An array over the batch, or a number known while tracing."""


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
    return join_columns(aligned(*(jnp.asarray(c, dtype) for c in components), shape=shape))


def take_apart(array: jax.Array) -> tuple[jax.Array, ...]:
    """Return the k components of an array ``[..., k]``; their cotangents are put together at once."""
    return tuple(_apart.bind(array)) if array.shape[-1] > 1 else (column(array, 0),)


class OnHost(np.ndarray):
    """A NumPy array whose columns stay NumPy arrays: what edges are made of where their motion is worked out without a compiler."""


def parameters(array: jax.Array, batch_rank: int = 0) -> tuple[Component, ...]:
    """Return the components of a parameter ``[..., k]``: Python numbers when they are known, so that zeros and ones fold away.

    Args:
        array: Parameter of an edge; the components of an ``OnHost`` are NumPy arrays.
        batch_rank: Rank to which the batch axes of a batched parameter are padded (on the left).
    """
    if isinstance(array, OnHost):
        return tuple(np.moveaxis(np.asarray(array), -1, 0))  # pyright: ignore[reportReturnType]
    if array.ndim == 1 and is_concrete(array):
        return tuple(float(v) for v in np.asarray(array))
    if 1 < array.ndim <= batch_rank:
        array = lax.expand_dims(array, range(batch_rank + 1 - array.ndim))
    return take_apart(array)


def join_columns(components: Sequence[jax.Array]) -> jax.Array:
    """Return the array [..., k] of k components of one shape and dtype."""
    return _join.bind(*components)


def column(array: jax.Array, index: int) -> jax.Array:
    """Return one component of an array [..., k]."""
    return _take.bind(array, index=index)


def _columns_joined(*components: jax.Array) -> jax.Array:
    k, first = len(components), components[0]
    place = _places(first, k)
    out = _repeated(components[-1], k)
    for i in range(k - 2, -1, -1):
        out = lax.select(lax.eq(place, lax.full_like(place, i)), _repeated(components[i], k), out)
    return out


def _taken(array: jax.Array, *, index: int) -> jax.Array:
    return lax.index_in_dim(array, index, array.ndim - 1, keepdims=False)


def _one_column(component: jax.Array, *, index: int, count: int) -> jax.Array:
    """Return an array [..., count] that holds a component at one place and zeros elsewhere."""
    place, wide = _places(component, count), _repeated(component, count)
    return lax.select(lax.eq(place, lax.full_like(place, index)), wide, lax.full_like(wide, 0))


def _repeated(component: jax.Array, count: int) -> jax.Array:
    return lax.broadcast_in_dim(component, (*component.shape, count), range(component.ndim))


def _places(component: jax.Array, count: int) -> jax.Array:
    """Return the places of the last axis, where those of a sharded component are."""
    place = lax.broadcasted_iota(np.int32, (*component.shape, count), component.ndim)
    return lax.full_like(_repeated(component, count), 0, np.int32) + place if is_explicit(component) else place


def _primitive(name: str, function: Callable[..., jax.Array], transpose: Callable[..., list[Any]]) -> Primitive:
    made = Primitive(name)

    @functools.lru_cache(maxsize=4096)
    def kind(*kinds: Any, **options: Any) -> Any:
        return jax.make_jaxpr(functools.partial(function, **options))(*kinds).out_avals[0]

    @functools.cache
    def compiled(options: tuple[tuple[str, Any], ...]) -> Callable[..., jax.Array]:
        return jax.jit(functools.partial(function, **dict(options)))

    def batched(arguments: Sequence[jax.Array], axes: Sequence[int | None], **options: Any) -> tuple[jax.Array, int]:
        count = next(a.shape[axis] for a, axis in zip(arguments, axes, strict=True) if axis is not None)
        aligned = (
            jnp.broadcast_to(a, (count, *a.shape)) if axis is None else jnp.moveaxis(a, axis, 0)
            for a, axis in zip(arguments, axes, strict=True)
        )
        return made.bind(*alike(*aligned), **options), 0

    made.def_abstract_eval(kind)
    made.def_impl(lambda *arrays, **options: compiled(tuple(options.items()))(*arrays))
    mlir.register_lowering(made, mlir.lower_fun(function, multiple_results=False))
    ad.deflinear2(made, transpose)
    batching.primitive_batchers[made] = batched
    return made


_join = _primitive("join_columns", _columns_joined, lambda ct, *components: [column(ct, i) for i in range(len(components))])
_take = _primitive("take_column", _taken, lambda ct, array, *, index: [_place.bind(ct, index=index, count=array.aval.shape[-1])])
_place = _primitive("place_column", _one_column, lambda ct, component, *, index, count: [column(ct, index)])

_apart = Primitive("take_columns_apart")
_apart.multiple_results = True


def _each(array: jax.Array) -> list[jax.Array]:
    return [_taken(array, index=i) for i in range(array.shape[-1])]


@functools.lru_cache(maxsize=4096)
def _kinds(kind: Any) -> Sequence[Any]:
    return jax.make_jaxpr(_each)(kind).out_avals


def _joined_again(cotangents: Sequence[Any], array: Any) -> list[Any]:
    given = [ct for ct in cotangents if not isinstance(ct, ad.Zero)]
    if not given:
        return [ad.Zero(array.aval)]
    zero = jnp.zeros_like(given[0])
    return [join_columns(alike(*(zero if isinstance(ct, ad.Zero) else ct for ct in cotangents)))]


def _apart_batched(arguments: Sequence[jax.Array], axes: Sequence[int | None]) -> tuple[Sequence[jax.Array], Sequence[int]]:
    (array,), (axis,) = arguments, axes
    found = _apart.bind(jnp.moveaxis(array, axis or 0, 0))
    return found, [0] * len(found)


_apart.def_abstract_eval(_kinds)
_apart.def_impl(jax.jit(_each))
mlir.register_lowering(_apart, mlir.lower_fun(_each))
ad.deflinear2(_apart, _joined_again)
batching.primitive_batchers[_apart] = _apart_batched

PRIMITIVES = (_join, _take, _place, _apart)
"""The primitives: all of them linear."""
