"""Sine and cosine as one pair: polynomials that XLA:CPU vectorises, native functions on other platforms.

XLA:CPU calls the scalar library functions for sin and cos, which cost more than all the rest of a joint. The pair here
reduces the angle by multiples of pi/2 in three or four parts (Cody and Waite 1980) and evaluates the minimax polynomials of fdlibm
(Sun Microsystems 1993, ``k_sin.c`` and ``k_cos.c``) or Cephes (Moshier 1992, ``sinf.c``). Errors are below 2 ulp for angles up to
``REACH``; a batch that holds a larger one is worked by the library functions as a whole.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import Component

REACH = {"float32": 8.0e3, "float64": 8.0e5}
"""Largest angle (rad) that the polynomials take, for each dtype: beyond it the reduction loses bits."""

_HALF_PI = {
    "float32": (1.5703125, 4.837512969970703125e-4, 7.549533620476723e-08, 2.563344151594519e-12),
    "float64": (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
}
_SIN = {
    "float32": (-1.9515295891e-4, 8.3321608736e-3, -1.6666654611e-1),
    "float64": (
        1.58962301576546568e-10,
        -2.50507477628578073e-8,
        2.75573136213857245e-6,
        -1.98412698295895386e-4,
        8.33333333332211859e-3,
        -1.66666666666666307e-1,
    ),
}
_COS = {
    "float32": (2.443315711809948e-5, -1.388731625493765e-3, 4.166664568298827e-2),
    "float64": (
        -1.13585365213876817e-11,
        2.08757008419747316e-9,
        -2.75573141792967388e-7,
        2.48015872888517045e-5,
        -1.38888888888730564e-3,
        4.16666666666665930e-2,
    ),
}


def sin_cos(x: Component) -> tuple[Component, Component]:
    """Return (sin x, cos x) of a component; each is the other's derivative, so gradients cost nothing more."""
    if isinstance(x, float):
        return float(np.sin(x)), float(np.cos(x))
    return _sin_cos(x)


@jax.custom_jvp
def _sin_cos(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    if x.dtype.name not in REACH:
        return _library(x)
    return lax.platform_dependent(x, cpu=_guarded, default=_library)


@_sin_cos.defjvp
def _sin_cos_jvp(primals: tuple[jax.Array], tangents: tuple[jax.Array]) -> Any:
    (x,), (dx,) = primals, tangents
    s, c = _sin_cos(x)
    return (s, c), (c * dx, -s * dx)


def _library(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    return jnp.sin(x), jnp.cos(x)


@jax.custom_batching.custom_vmap
def _guarded(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the pair of a whole batch; one branch for all, because a branch for each element would compute both."""
    # A NaN, as an epoch outside a table gives, goes through the polynomials: it must not slow the rest of its batch down.
    return lax.cond(jnp.any(jnp.abs(x) > REACH[x.dtype.name]), _library, _polynomials, x)


@_guarded.def_vmap
def _guarded_vmap(axis_size: int, in_batched: Any, x: jax.Array) -> Any:
    return _guarded(x), (True, True)


def _polynomials(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    name, number = x.dtype.name, np.dtype(x.dtype).type
    k = jnp.round(x * number(2 / np.pi))
    r = x
    for part in _HALF_PI[name]:
        r = r - k * number(part)
    z = r * r
    s, c = (_horner(table[name], z) for table in (_SIN, _COS))
    s, c = r + r * z * s, 1 - number(0.5) * z + z * z * c
    quadrant = k.astype(jnp.int32) & 3
    odd = (quadrant & 1) == 1
    s, c = jnp.where(odd, c, s), jnp.where(odd, s, c)
    return jnp.where(quadrant >= 2, -s, s), jnp.where((quadrant == 1) | (quadrant == 2), -c, c)


def _horner(coefficients: tuple[float, ...], z: jax.Array) -> jax.Array:
    number = np.dtype(z.dtype).type
    total = jnp.full_like(z, number(coefficients[0]))
    for coefficient in coefficients[1:]:
        total = total * z + number(coefficient)
    return total
