"""Arrays: which numbers are known while tracing, and array-likes as arrays of one float dtype."""

import functools
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.staging.internals import is_compiling


def is_concrete(array: Any) -> bool:
    """Whether an array's numbers are known now, outside any trace."""
    return not isinstance(array, jax.core.Tracer)


def default_float() -> Any:
    """Return the default float dtype as JAX is configured now."""
    return jnp.result_type(float)


def widest(*dtypes: Any) -> Any:
    """Return the dtype that holds numbers of several, however strict JAX's implicit promotion is set to be."""
    with jax.numpy_dtype_promotion("standard"):
        return functools.reduce(jnp.promote_types, dtypes)


def on_device(numbers: np.ndarray) -> jax.Array:
    """Return an array of NumPy as one of JAX: outside of ``jit`` handed over as it is, for which ``jnp.asarray`` compiles each shape."""
    return jnp.asarray(numbers) if is_compiling() else jax.device_put(numbers)


def as_float(value: Any) -> jax.Array:
    """Return any array-like of numbers as a JAX array with a strong float dtype."""
    if isinstance(value, jax.Array) and not value.weak_type and jnp.issubdtype(value.dtype, jnp.floating):
        return value
    if isinstance(value, (np.ndarray, float)):  # converted before it becomes an array of JAX: ten times faster
        numbers = np.asarray(value)
        single = jnp.issubdtype(numbers.dtype, jnp.floating) and isinstance(value, np.ndarray) and numbers.dtype != np.float64
        return on_device(numbers if single else numbers.astype(default_float()))
    array = jnp.asarray(value)
    dtype = array.dtype if jnp.issubdtype(array.dtype, jnp.floating) and not array.weak_type else default_float()
    return lax.convert_element_type(array, dtype)


def common_float(*values: Any) -> tuple[jax.Array, ...]:
    """Return array-likes as JAX arrays of their promoted float dtype."""
    arrays = tuple(as_float(v) for v in values)
    dtype = widest(*(a.dtype for a in arrays))
    return tuple(lax.convert_element_type(a, dtype) for a in arrays)


def unit(array: Any) -> Any:
    """Return vectors or quaternions [..., k] at unit length; NumPy arrays where the numbers are known. Zero gives NaN.

    Known numbers that are unit to rounding stay as they are.
    """
    if is_concrete(array):
        known = np.asarray(array)
        length = np.sqrt(np.sum(np.square(known.astype(np.float64)), -1, keepdims=True))
        if np.all(np.abs(length - 1.0) <= 4 * np.finfo(known.dtype).eps):
            return known
        with np.errstate(invalid="ignore"):
            return (known / length).astype(known.dtype)
    return array / lax.sqrt(jnp.sum(array * array, -1, keepdims=True))
