"""Turns: the fraction of a turn that a spin has made, from a rate and a time in two parts each, without losing the whole turns' digits.

A planet turns thousands of times between the reference epoch and now. Rate times time, rounded to one number, has then lost the digits of
the whole turns. Here each factor is cut into a high and a low half, so that the products of halves are exact, and whole turns are taken
out of each product before anything is added. Cut by masking bits, not by Dekker's multiplication: compilers may fuse a product
with the sum that follows it, which spoils the latter and leaves exact products as they are.
"""

from typing import Any

import jax
import numpy as np
from jax import lax

_CUT: dict[str, tuple[Any, Any]] = {
    "float64": (np.int64, ~((1 << 27) - 1)),
    "float32": (np.int32, ~((1 << 12) - 1)),
}
"""For each dtype, integers of its width and the mask that keeps its upper half: products of halves are exact."""


@jax.custom_jvp
def turned(rate_hi: jax.Array, rate_lo: jax.Array, time_hi: jax.Array, time_lo: jax.Array) -> jax.Array:
    """Return rate times time modulo 2, about zero, in turns; all arguments of one dtype, broadcast.

    The error is that of a number near one, as long as there are fewer whole turns than the dtype counts exactly. The derivative is
    that of the product: a whole turn counts as constant.
    """
    a, a_low = _halves(rate_hi)
    b, b_low = _halves(time_hi)
    coarse = _fraction(a * b) + (_fraction(a * b_low) + _fraction(a_low * b))
    return _fraction(coarse + ((a_low * b_low) + (rate_lo * time_hi + rate_hi * time_lo)))


@turned.defjvp
def _turned_jvp(primals: tuple[jax.Array, ...], tangents: tuple[jax.Array, ...]) -> tuple[jax.Array, jax.Array]:
    rate_hi, rate_lo, time_hi, time_lo = primals
    d_rate, d_time = tangents[0] + tangents[1], tangents[2] + tangents[3]
    return turned(*primals), (rate_hi + rate_lo) * d_time + (time_hi + time_lo) * d_rate


def _halves(x: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the upper half of a number's bits and the rest; their sum is the number."""
    kind, mask = _CUT[x.dtype.name]
    upper = lax.bitcast_convert_type(lax.bitcast_convert_type(x, kind) & kind(mask), x.dtype)
    return upper, x - upper


def _fraction(x: jax.Array) -> jax.Array:
    """Return a number modulo 2, between -1 and 1: exact. Two turns, not one: half the angle makes a quaternion, which keeps its sign."""
    two = x.dtype.type(2)
    return x - two * lax.round(x / two, lax.RoundingMethod.TO_NEAREST_EVEN)
