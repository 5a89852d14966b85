"""Sine and cosine as one pair: polynomials that XLA:CPU vectorises, native functions on other platforms.

XLA:CPU calls the scalar library functions for sin and cos, which cost more than all the rest of a joint. The pair here
reduces the angle by multiples of pi/2 in three or four parts (Cody and Waite 1980) and evaluates the minimax polynomials of fdlibm
(Sun Microsystems 1993, ``k_sin.c`` and ``k_cos.c``) or Cephes (Moshier 1992, ``sinf.c``). Errors are below 2 ulp for angles up to
``REACH``; larger ones get the library's functions, in a branch that runs only where a batch holds one.
"""

import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import Component, select
from jaxframes.numerics.layout import aligned
from jaxframes.numerics.operation import Arrays, anywhere, changes_of, elementwise, run
from jaxframes.numerics.stages import by_platform, stage

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


Pair = tuple[Component, Component]
Half = Callable[[Component], Pair]
"""A function that gives sine and cosine of a component."""


def sin_cos(x: Component) -> Pair:
    """Return (sin x, cos x) of a component; each is the other's derivative, so gradients cost nothing more."""
    return sin_cos_all((x,))[0]


def sin_cos_all(angles: Sequence[Component]) -> list[Pair]:
    """Return (sin x, cos x) of several components, worked out together: one branch of the program serves all of them."""
    unknown = [x for x in angles if not isinstance(x, float | int)]
    sines, cosines = sin_cos_of(lambda *xs: xs, *unknown) if unknown else ((), ())
    pair = given_pairs(sines, cosines)
    return [_known(x) if isinstance(x, float | int) else pair(x) for x in angles]


Angles = Callable[..., Sequence[jax.Array]]


def sin_cos_of(angles: Angles, *operands: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the sines and the cosines [n, ...] of the n angles that a function makes of arrays; their shapes broadcast."""
    operation = _SinesCosines(angles)
    return tuple(run(operation, *operands) if operands else operation.compute())  # pyright: ignore[reportReturnType]


class _SinesCosines:
    """The operation."""

    def __init__(self, angles: Angles):
        self._angles = angles

    def _stacked(self, *operands: jax.Array) -> jax.Array:
        return lax.concatenate([lax.expand_dims(x, (0,)) for x in aligned(*self._angles(*operands))], 0)

    def compute(self, *operands: jax.Array) -> Arrays:
        return guarded(lambda pair, x: pair(x), lambda x: (x,), stage(self._stacked)(*operands))

    def results(self, *operands: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return [jax.eval_shape(self._stacked, *operands)] * 2

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        (s, c), change = run(self, *primals), changes_of(self._stacked, primals, tangents)
        return (s, c), (c * change, -s * change)

    def mapped(self, count: int, axes: Sequence[int | None], *operands: jax.Array) -> Arrays:
        return elementwise(self)(count, axes, *operands)


def given_pairs(sines: Any, cosines: Any, first: int = 0) -> Half:
    """Return the function that gives sines and cosines [n, ...] worked out before, in the order in which they are asked for.

    Args:
        sines: The sines.
        cosines: The cosines.
        first: Which one is the first that is asked for.
    """
    rest = itertools.count(first)

    def pair(x: Component) -> Pair:
        i = next(rest)
        return _given(x, *(lax.index_in_dim(part, i, 0, keepdims=False) for part in (sines, cosines)))

    return pair


@jax.custom_jvp
def _given(x: jax.Array, s: jax.Array, c: jax.Array) -> tuple[jax.Array, jax.Array]:
    return s, c


@_given.defjvp
def _given_jvp(primals: Any, tangents: Any) -> Any:
    _, s, c = primals
    return (s, c), (c * tangents[0], -s * tangents[0])


def guarded(program: Callable[..., Any], angles: Callable[..., Sequence[Component]], *operands: jax.Array) -> Any:
    """Return ``program(pair, *operands)`` as a stage, where ``pair`` gives sine and cosine in the way that serves all angles.

    On CPU that is by polynomials, unless a batch holds an angle beyond their reach: the program has a branch for either case. The rare
    case is one branch for the whole batch, also under ``vmap``; told apart for each element, both would run.

    Args:
        program: What is computed.
        angles: Returns, of the same operands, the angles whose sine and cosine are asked for.
        operands: What it is computed of.
    """

    def on_cpu(*operands: jax.Array) -> Any:
        arrays = [x for x in angles(*operands) if not isinstance(x, float | int)]
        if any(x.dtype.name not in REACH for x in arrays):
            return stage(functools.partial(program, _library))(*operands)
        if not arrays:
            return stage(functools.partial(program, _polynomials))(*operands)
        # A NaN, as an epoch outside a table gives, is not beyond reach: it must not slow the rest of its batch down.
        far = functools.reduce(jnp.logical_or, (jnp.abs(x) > REACH[x.dtype.name] for x in arrays))
        return lax.cond(anywhere(far), functools.partial(program, _either), functools.partial(program, _polynomials), *operands)

    return by_platform(*operands, cpu=on_cpu, default=functools.partial(program, _library))


def _known(x: float) -> Pair:
    return float(np.sin(x)), float(np.cos(x))


def _either(x: Component) -> Pair:
    """Return the library's pair beyond reach and the polynomials' within: no sample depends on its neighbours."""
    if isinstance(x, float | int):
        return _known(x)
    far = jnp.abs(x) > REACH[x.dtype.name]
    (s, c), (near_s, near_c) = _library(x), _polynomials(x)
    return select(far, s, near_s), select(far, c, near_c)


def _library(x: Component) -> Pair:
    return _known(x) if isinstance(x, float | int) else (jnp.sin(x), jnp.cos(x))


def _polynomials(x: Component) -> Pair:
    if isinstance(x, float | int):
        return _known(x)
    name, number = x.dtype.name, np.dtype(x.dtype).type
    k = lax.round(x * number(2 / np.pi), lax.RoundingMethod.TO_NEAREST_EVEN)
    r = x
    for part in _HALF_PI[name]:
        r = r - k * number(part)
    z = r * r
    s, c = (_horner(table[name], z) for table in (_SIN, _COS))
    s, c = r + r * z * s, 1 - number(0.5) * z + z * z * c
    quadrant = k.astype(jnp.int32) & 3
    odd = (quadrant & 1) == 1
    s, c = select(odd, c, s), select(odd, s, c)
    return select(quadrant >= 2, -s, s), select((quadrant == 1) | (quadrant == 2), -c, c)


def _horner(coefficients: tuple[float, ...], z: jax.Array) -> jax.Array:
    number = np.dtype(z.dtype).type
    total = jnp.full_like(z, number(coefficients[0]))
    for coefficient in coefficients[1:]:
        total = total * z + number(coefficient)
    return total
