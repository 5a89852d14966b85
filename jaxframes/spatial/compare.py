"""Comparison of values within a tolerance: the library's classes have no ``==`` of their own."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import ShapeError
from jaxframes.spatial.rotation import Rotation
from jaxframes.staging.arrays import common_float
from jaxframes.time.epoch import Epoch

_DEFAULT = {"float64": 1e-9, "float32": 1e-5}


def allclose(a: Any, b: Any, *, rtol: float | None = None, atol: float | None = None) -> jax.Array:
    """Return whether two values are the same within a tolerance, as one boolean array; batch axes broadcast.

    Each vector of ``a`` may differ from that of ``b`` by ``atol + rtol * |b|``, both measured by their largest components. The two
    signs of a rotation's quaternion are the same. Epochs may be ``atol`` seconds apart, whatever their date. NaN is close to nothing.

    Args:
        a: A value type, an array ``[..., k]``, or any tree of them.
        b: The same kind of thing.
        rtol: Relative tolerance. Default: 1e-9 in 64 bits, 1e-5 in 32.
        atol: Absolute tolerance. Default: as ``rtol``.

    Raises:
        ShapeError: The two are not of one structure.
    """
    first, first_tree = jax.tree.flatten(a, is_leaf=_is_one)
    second, second_tree = jax.tree.flatten(b, is_leaf=_is_one)
    if first_tree != second_tree or any(_kind(x) is not _kind(y) for x, y in zip(first, second, strict=True)):
        raise ShapeError(f"allclose needs two values of one kind; found {type(a).__name__} and {type(b).__name__}")
    result = jnp.ones((), bool)
    for x, y in zip(first, second, strict=True):
        if isinstance(x, Rotation):
            x, y = _same_rank(*common_float(x.wxyz, y.wxyz))
            opposite = jnp.sum(x * y, -1, keepdims=True) < 0
            result = result & _close(jnp.where(opposite, -x, x), y, rtol, atol)
        elif isinstance(x, Epoch):
            apart = jnp.asarray(x - y)
            result = result & _close(apart, jnp.zeros_like(apart), rtol, atol)
        else:
            result = result & _close(*_same_rank(*common_float(x, y)), rtol, atol)
    return result


def _kind(value: Any) -> type | None:
    """Return the type of what is compared as one, None for an array."""
    return type(value) if _is_one(value) else None


def _is_one(value: Any) -> bool:
    return isinstance(value, (Rotation, Epoch))


def _same_rank(x: jax.Array, y: jax.Array) -> tuple[jax.Array, jax.Array]:
    shape = np.broadcast_shapes(x.shape, y.shape)
    return jnp.broadcast_to(x, shape), jnp.broadcast_to(y, shape)


def _close(x: jax.Array, y: jax.Array, rtol: float | None, atol: float | None) -> jax.Array:
    default = _DEFAULT.get(np.dtype(x.dtype).name, 1e-2)
    rtol, atol = (default if t is None else t for t in (rtol, atol))
    size = jnp.max(jnp.abs(y), -1, keepdims=True) if y.ndim else jnp.abs(y)
    return jnp.all(jnp.abs(x - y) <= atol + rtol * size)
