"""Lifting: a function written on components becomes one on arrays: batched, a stage of its program, compiled once when called eagerly."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.errors import ShapeError
from jaxframes.numerics.components import V3, Quat
from jaxframes.staging.arrays import common_float
from jaxframes.staging.columns import assemble, take_apart
from jaxframes.staging.stages import stage

Kind = Callable[..., Any] | None
"""What the last axis of an argument or result is: ``V3``, ``Quat``, ``tuple`` (any length), or ``None`` for no such axis."""


def lift(*kinds: Kind, out: Kind | tuple[Kind, ...]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that turns a function of components into a function of arrays.

    The function made takes array-likes: ``[..., 3]`` for a ``V3``, ``[..., 4]`` for a ``Quat``, ``[..., k]`` for a ``tuple``,
    ``[...]`` for ``None``. Leading axes broadcast as in NumPy, everything is promoted to one float dtype, and all of it is one
    stage. Called eagerly it is compiled once for each set of shapes.

    Args:
        kinds: The kind of every argument.
        out: The kind of the result, or a tuple of kinds for a function that returns a tuple.

    The function made raises ``ShapeError`` where the last axis of an argument does not fit its kind, or leading axes do not broadcast.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.partial(jax.jit, inline=True)
        @functools.wraps(function)
        def on_arrays(*arrays: jax.Array) -> Any:
            for a, kind in zip(arrays, kinds, strict=True):
                _check(function, a, kind)
            batches = [a.shape[: a.ndim - (kind is not None)] for a, kind in zip(arrays, kinds, strict=True)]
            shape, dtype = _broadcast(function, batches), arrays[0].dtype

            def on_arrays(*arrays: jax.Array) -> Any:
                parts = (_split(a, kind, batch, len(shape)) for a, kind, batch in zip(arrays, kinds, batches, strict=True))
                result = function(*parts)
                if isinstance(out, tuple):
                    return tuple(_join(r, kind, shape, dtype) for r, kind in zip(result, out, strict=True))
                return _join(result, out, shape, dtype)

            return stage(on_arrays)(*arrays)

        @functools.wraps(function)
        def on_array_likes(*values: Any) -> Any:
            return on_arrays(*common_float(*values))

        return on_array_likes

    return decorate


def _broadcast(function: Callable[..., Any], batches: list[tuple[int, ...]]) -> tuple[int, ...]:
    try:
        return jnp.broadcast_shapes(*batches)
    except ValueError:
        found = " and ".join(map(str, dict.fromkeys(batches)))
        raise ShapeError(f"{function.__name__.strip('_')}: batch shapes {found} do not broadcast") from None


def _check(function: Callable[..., Any], array: jax.Array, kind: Kind) -> None:
    wanted = {V3: 3, Quat: 4}.get(kind)  # type: ignore[call-overload]
    if kind is not None and (array.ndim == 0 or wanted not in (None, array.shape[-1])):
        raise ShapeError(f"{function.__name__.strip('_')}: an array of shape [..., {wanted or 'k'}] is needed; found {array.shape}")


def _split(array: jax.Array, kind: Kind, batch: tuple[int, ...], rank: int) -> Any:
    if 0 < len(batch) < rank:
        array = lax.expand_dims(array, range(rank - len(batch)))
    if kind is None:
        return array
    return take_apart(array) if kind is tuple else kind(*take_apart(array))


def _join(result: Any, kind: Kind, shape: tuple[int, ...], dtype: Any) -> jax.Array:
    if kind is not None:
        return assemble(tuple(result), shape, dtype)
    return jnp.full(shape, result, dtype) if isinstance(result, float) else jnp.broadcast_to(result, shape)
