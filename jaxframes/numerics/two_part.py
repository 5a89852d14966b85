"""Error-free sums: the arithmetic of numbers kept in two parts.

XLA does not reassociate sums of variables, but jax 0.10 folds (x + C) - C for constants C. The barriers keep it from that; tests
assert that the sums stay exact under jit with either operand constant.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

Array = Any
"""A NumPy or a JAX array."""
Pair = tuple[jax.Array, jax.Array]
"""A number as the unevaluated sum of two."""


@jax.custom_jvp
def two_sum(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return (s, e) with s = fl(a + b) and s + e = a + b exactly (Knuth 1969); e counts as constant in derivatives."""
    s = lax.optimization_barrier(a + b)
    bb = lax.optimization_barrier(s - a)
    return s, (a - (s - bb)) + (b - bb)


@two_sum.defjvp
def _two_sum_jvp(primals: tuple[jax.Array, jax.Array], tangents: tuple[jax.Array, jax.Array]) -> Any:
    total = tangents[0] + tangents[1]
    return two_sum(*primals), (total, jnp.zeros_like(total))


@jax.custom_jvp
def fast_two_sum(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return (s, e) as ``two_sum`` does, for |a| >= |b| (Dekker 1971)."""
    s = lax.optimization_barrier(a + b)
    return s, b - lax.optimization_barrier(s - a)


@fast_two_sum.defjvp
def _fast_two_sum_jvp(primals: tuple[jax.Array, jax.Array], tangents: tuple[jax.Array, jax.Array]) -> Any:
    total = tangents[0] + tangents[1]
    return fast_two_sum(*primals), (total, jnp.zeros_like(total))


@jax.custom_jvp
def two_product(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return (p, e) with p = fl(a b) and p + e = a b exactly (Dekker 1971); e counts as constant in derivatives."""
    p = lax.optimization_barrier(a * b)
    (ah, al), (bh, bl) = _halves(a), _halves(b)
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@two_product.defjvp
def _two_product_jvp(primals: tuple[jax.Array, jax.Array], tangents: tuple[jax.Array, jax.Array]) -> Any:
    (a, b), (da, db) = primals, tangents
    total = da * b + a * db
    return two_product(a, b), (total, jnp.zeros_like(total))


def _halves(a: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the upper and lower half of the digits of a number (Veltkamp): their products are exact."""
    digits = np.finfo(a.dtype).nmant + 1
    t = lax.optimization_barrier(a * np.array(2.0 ** ((digits + 1) // 2) + 1, a.dtype))
    high = lax.optimization_barrier(t - lax.optimization_barrier(t - a))
    return high, a - high


def add(a: Pair, b: Pair) -> Pair:
    """Return a + b."""
    s, e = two_sum(a[0], b[0])
    return fast_two_sum(s, e + (a[1] + b[1]))


def multiply(a: Pair, b: Pair) -> Pair:
    """Return a * b."""
    p, e = two_product(a[0], b[0])
    return fast_two_sum(p, e + (a[0] * b[1] + a[1] * b[0]))


def divide(a: Pair, b: Pair) -> Pair:
    """Return a / b."""
    q = a[0] / b[0]
    p, e = two_product(q, b[0])
    rest = ((a[0] - p) - e) + (a[1] - q * b[1])
    return fast_two_sum(q, rest / b[0])


def recast_pair(hi: Array, lo: Array, dtype: Any) -> tuple[Array, Array]:
    """Return a number kept in two parts as two parts of another dtype; what the high part loses moves to the low part.

    Takes NumPy arrays or JAX arrays and returns the same kind.
    """
    wide = np.promote_types(hi.dtype, dtype)
    high, low = hi.astype(wide), lo.astype(wide)
    first = (high + low).astype(dtype)
    where = np.where if isinstance(first, np.ndarray) else jnp.where
    finite, zero = np.isfinite(first) if isinstance(first, np.ndarray) else jnp.isfinite(first), np.zeros((), wide)
    rest = where(finite, high, zero) - where(finite, first.astype(wide), zero)  # an end that never comes is infinite, and has no rest
    return first, (rest + low).astype(dtype)


def recast_pairs(values: Any, dtype: Any) -> Any:
    """Return numbers [..., 2 n], two parts each, in another dtype."""
    numpy = np if isinstance(values, np.ndarray) else jnp
    hi, lo = recast_pair(values[..., 0::2], values[..., 1::2], dtype)
    return numpy.stack([hi, lo], -1).reshape(values.shape)


_CUT: dict[str, tuple[Any, Any]] = {
    "float64": (np.int64, ~((1 << 27) - 1)),
    "float32": (np.int32, ~((1 << 12) - 1)),
}
"""For each dtype, integers of its width and the mask that keeps its upper half: products of halves are exact."""


@jax.custom_jvp
def turns_in(rate_hi: jax.Array, rate_lo: jax.Array, time_hi: jax.Array, time_lo: jax.Array) -> jax.Array:
    """Return rate times time modulo 2, about zero, in turns; all arguments of one dtype, broadcast.

    The error is that of a number near one, as long as there are fewer whole turns than the dtype counts exactly. The derivative is
    that of the product: a whole turn counts as constant.
    """
    a, a_low = _masked_halves(rate_hi)
    b, b_low = _masked_halves(time_hi)
    coarse = _fraction(a * b) + (_fraction(a * b_low) + _fraction(a_low * b))
    return _fraction(coarse + ((a_low * b_low) + (rate_lo * time_hi + rate_hi * time_lo)))


@turns_in.defjvp
def _turned_jvp(primals: tuple[jax.Array, ...], tangents: tuple[jax.Array, ...]) -> tuple[jax.Array, jax.Array]:
    rate_hi, rate_lo, time_hi, time_lo = primals
    d_rate, d_time = tangents[0] + tangents[1], tangents[2] + tangents[3]
    return turns_in(*primals), (rate_hi + rate_lo) * d_time + (time_hi + time_lo) * d_rate


def _masked_halves(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the upper half of a number's bits and the rest; their sum is the number."""
    kind, mask = _CUT[x.dtype.name]
    upper = lax.bitcast_convert_type(lax.bitcast_convert_type(x, kind) & kind(mask), x.dtype)
    return upper, x - upper


def _fraction(x: jax.Array) -> jax.Array:
    """Return a number modulo 2, between -1 and 1: exact. Two turns, not one: half the angle makes a quaternion, which keeps its sign."""
    two = x.dtype.type(2)
    return x - two * lax.round(x / two, lax.RoundingMethod.TO_NEAREST_EVEN)
