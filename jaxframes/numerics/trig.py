"""Sine and cosine as one pair: polynomials that XLA:CPU vectorises, native functions on other platforms.

XLA:CPU calls the scalar library functions for sin and cos, which cost more than all the rest of a joint. The pair here reduces the angle
twice, by multiples of a large power of two of pi/2 and then of pi/2 itself, with constants cut into parts of few bits so that products are
exact (Cody and Waite 1980) and differences that keep their rounding (Dekker 1971, fast two-sum). Then it evaluates the minimax
polynomials of fdlibm (Sun Microsystems 1993, ``k_sin.c`` and ``k_cos.c``) or Cephes (Moshier 1992, ``sinf.c``). There is no branch: errors
stay below 1.5 ulp for angles up to ``REACH``, where neighbouring numbers are 1e-4 rad (float64) or 1 rad (float32) apart. Beyond, the
answer is NaN.
"""

import functools
import itertools
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import Component, select
from jaxframes.staging.operation import Arrays, Operation, changes_of, run
from jaxframes.staging.sharding import aligned
from jaxframes.staging.stages import stage

REACH = {"float32": 6.0e6, "float64": 8.0e11}
"""Largest angle (rad) that the reduction takes, for each dtype."""

_LARGE = {"float32": 2.0**11, "float64": 2.0**19}
"""The first reduction is by multiples of so many times pi/2."""
_HALF_PI = {
    "float32": (1.5703125, 4.837512969970703125e-4, 7.549533620476723e-08, 2.563344151594519e-12),
    "float64": (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
}
"""Pi/2 in parts of 12 bits (float32) or 33 bits (float64), and what is left."""
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
    if isinstance(x, float | int):
        return float(np.sin(x)), float(np.cos(x))
    return tuple(run(_SinCos(), x))  # pyright: ignore[reportReturnType]


def numpy_sin_cos(x: Any) -> Any:
    """Return (sin x, cos x) of NumPy numbers: a ``Half`` for arithmetic on the host."""
    return np.sin(x), np.cos(x)


@dataclass(frozen=True)
class _SinCos(Operation):
    """The pair, element by element."""

    def compute(self, *arrays: jax.Array) -> Arrays:
        return jnp.sin(arrays[0]), jnp.cos(arrays[0])

    def compute_on_cpu(self, *arrays: jax.Array) -> Arrays:
        return _polynomials(arrays[0]) if arrays[0].dtype.name in REACH else self.compute(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return [jax.ShapeDtypeStruct(arrays[0].shape, arrays[0].dtype)] * 2

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        s, c = run(self, *primals)
        change = tangents[0]
        return (s, c), (None, None) if change is None else (c * change, -s * change)

    def mapped(self, count: int, axes: tuple[int | None, ...], *arrays: jax.Array) -> Arrays:
        return run(self, *arrays)


Angles = Callable[..., Sequence[jax.Array]]


def sin_cos_of(angles: Angles, *operands: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the sines and the cosines [n, ...] of the n angles that a function makes of arrays; their shapes broadcast.

    Args:
        angles: Makes the angles; hashable and equal by value.
        operands: The arrays.
    """
    return tuple(run(_SinesCosines(angles), *operands))  # pyright: ignore[reportReturnType]


@dataclass(frozen=True)
class _SinesCosines(Operation):
    """Sines and cosines worked out as a stage, for several stages to read."""

    angles: Angles

    def _stacked(self, *operands: jax.Array) -> jax.Array:
        return lax.concatenate([lax.expand_dims(x, (0,)) for x in aligned(*self.angles(*operands))], 0)

    def compute(self, *operands: jax.Array) -> Arrays:
        return stage(lambda *xs: sin_cos(self._stacked(*xs)))(*operands)

    def results(self, *operands: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return [jax.eval_shape(self._stacked, *operands)] * 2

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        (s, c), change = run(self, *primals), changes_of(self._stacked, primals, tangents)
        return (s, c), (c * change, -s * change)


def precomputed_pairs(sines: Any, cosines: Any, first: int = 0) -> Half:
    """Return the function that gives sines and cosines [n, ...] worked out before, in the order in which they are asked for.

    Args:
        sines: The sines.
        cosines: The cosines.
        first: Which one is the first that is asked for.
    """
    rest = itertools.count(first)

    def pair(x: Component) -> Pair:
        i = next(rest)
        return _precomputed(x, *(lax.index_in_dim(part, i, 0, keepdims=False) for part in (sines, cosines)))

    return pair


@jax.custom_jvp
def _precomputed(x: jax.Array, s: jax.Array, c: jax.Array) -> tuple[jax.Array, jax.Array]:
    return s, c


@_precomputed.defjvp
def _precomputed_jvp(primals: Any, tangents: Any) -> Any:
    _, s, c = primals
    return (s, c), (c * tangents[0], -s * tangents[0])


def _polynomials(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    name, number = x.dtype.name, np.dtype(x.dtype).type
    x = select(lax.abs(x) > number(REACH[name]), number(np.nan), x)
    r, lost, rest, _ = _reduced(x, _LARGE[name])
    r, more, least, k = _reduced(r, 1.0)
    # What the first reduction lost may cancel with what is left of the angle: both are exact, so they are added first.
    lost, error = _added(lost)
    r = (r + lost) + (functools.reduce(operator.add, (*error, *more)) - (rest + least))
    z = r * r
    s, c = (_horner(table[name], z) for table in (_SIN, _COS))
    s, c = r + r * z * s, 1 - number(0.5) * z + z * z * c
    quadrant = k.astype(jnp.int32)
    odd = (quadrant & 1) != 0
    s, c = select(odd, c, s), select(odd, s, c)
    return select((quadrant & 2) != 0, -s, s), select(((quadrant + 1) & 2) != 0, -c, c)


def _reduced(x: jax.Array, scale: float) -> tuple[jax.Array, list[jax.Array], jax.Array, jax.Array]:
    """Return x less the nearest whole multiple of ``scale`` pi/2: a number, what its roundings left out, what is to be taken off still.

    The fourth result is the multiple.
    """
    name, number = x.dtype.name, np.dtype(x.dtype).type
    first, *middle, last = (number(part * scale) for part in _HALF_PI[name])
    k = lax.round(x * number(2 / np.pi / scale), lax.RoundingMethod.TO_NEAREST_EVEN)
    r, lost = x - k * first, list[jax.Array]()  # exact
    for part in middle:
        r, error = _less(r, k * part)
        lost.append(error)
    return r, lost, k * last, k


def _added(parts: list[jax.Array]) -> tuple[jax.Array, list[jax.Array]]:
    """Return the sum of one or two numbers, the larger first, and what its rounding leaves out."""
    if len(parts) == 1:
        return parts[0], []
    total, error = _less(parts[0], -parts[1])
    return total, [error]


def _less(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return a - b rounded, and what the rounding leaves out, where a is larger or a whole multiple of the last digit of b.

    Every angle that is reduced is a multiple of the last digit of what is taken off next: the parts of pi/2 are that far apart.
    """
    s = a - b
    return s, (a - s) - b


def _horner(coefficients: tuple[float, ...], z: jax.Array) -> jax.Array:
    number = np.dtype(z.dtype).type
    total = jnp.full_like(z, number(coefficients[0]))
    for coefficient in coefficients[1:]:
        total = total * z + number(coefficient)
    return total
