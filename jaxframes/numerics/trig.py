"""Sine and cosine as one pair: polynomials that XLA:CPU vectorises, native functions on other platforms.

XLA:CPU calls the scalar library functions for sin and cos, which cost more than all the rest of a joint. The pair here
reduces the angle by multiples of pi/2 in three or four parts (Cody and Waite 1980) and evaluates the minimax polynomials of fdlibm
(Sun Microsystems 1993, ``k_sin.c`` and ``k_cos.c``) or Cephes (Moshier 1992, ``sinf.c``). Errors are below 2 ulp for angles up to
``REACH``; larger ones get the library's functions, in a branch that runs only where a batch holds one.
"""

import functools
from collections.abc import Sequence
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
    return sin_cos_all((x,))[0]


def sin_cos_all(angles: Sequence[Component]) -> list[tuple[Component, Component]]:
    """Return (sin x, cos x) of several components, worked out together: one branch of the program serves all of them."""
    found = iter(_pairs(tuple(x for x in angles if not isinstance(x, float))))
    return [(float(np.sin(x)), float(np.cos(x))) if isinstance(x, float) else next(found) for x in angles]


Pairs = tuple[tuple[jax.Array, jax.Array], ...]


@jax.custom_jvp
def _pairs(angles: tuple[jax.Array, ...]) -> Pairs:
    if not angles or any(x.dtype.name not in REACH for x in angles):
        return _library(*angles)
    return lax.platform_dependent(*angles, cpu=_guarded, default=_library)


@_pairs.defjvp
def _pairs_jvp(primals: Any, tangents: Any) -> tuple[Pairs, Pairs]:
    found = _pairs(*primals)
    return found, tuple((c * dx, -s * dx) for (s, c), dx in zip(found, tangents[0], strict=True))


@jax.custom_batching.custom_vmap
def _guarded(*angles: jax.Array) -> Pairs:
    """Return the pairs of a whole batch. The rare case is one branch for all: told apart for each element, both would run.

    The branch also keeps sines and cosines in memory of their own, computed once; fused into the frames of a path and their
    derivatives they would be computed anew for each (measured: gradients take one and a half times as long).
    """
    # A NaN, as an epoch outside a table gives, is not beyond reach: it must not slow the rest of its batch down.
    far = functools.reduce(jnp.logical_or, (jnp.any(jnp.abs(x) > REACH[x.dtype.name]) for x in angles))
    return lax.cond(far, lambda *xs: tuple(map(_either, xs)), lambda *xs: tuple(map(_polynomials, xs)), *angles)


@_guarded.def_vmap
def _guarded_vmap(axis_size: int, in_batched: Any, *angles: jax.Array) -> Any:
    return _guarded(*angles), tuple((one, one) for one in in_batched)


def _either(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the library's pair beyond reach and the polynomials' within: no sample depends on its neighbours."""
    far = jnp.abs(x) > REACH[x.dtype.name]
    (s, c), (near_s, near_c) = _library(x)[0], _polynomials(x)
    return jnp.where(far, s, near_s), jnp.where(far, c, near_c)


def _library(*angles: jax.Array) -> Pairs:
    return tuple((jnp.sin(x), jnp.cos(x)) for x in angles)


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
