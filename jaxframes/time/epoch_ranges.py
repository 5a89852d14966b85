"""Evenly spaced epochs: each from the start by a product in two parts, so that no spacing is added up."""

from fractions import Fraction
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError
from jaxframes.numerics.two_part import fast_two_sum, two_product, two_sum
from jaxframes.staging.arrays import is_concrete
from jaxframes.time import seconds

STEP = "a step is seconds, a timedelta or a timedelta64, one of them and not zero"
MOST = 10**9


def linspace(start: Any, stop: Any, num: int, endpoint: bool) -> Any:
    """Return what ``Epoch.linspace`` documents, of two epochs."""
    most = min(2 ** (np.finfo(start.hi.dtype).nmant + 1), MOST)  # so that each count is a float of the epochs' dtype
    if isinstance(num, bool) or not isinstance(num, (int, np.integer)) or not 0 <= num <= most:
        raise FrameError(f"num is how many epochs are wanted, a whole number from 0 to {most}, found {num!r}")
    shape = np.broadcast_shapes(start.shape, stop.shape)
    start, stop = start.broadcast_to(shape), stop.broadcast_to(shape)
    dtype = start.hi.dtype
    total, error = two_sum(stop.hi, -start.hi)
    length = fast_two_sum(total, error + (stop.lo - start.lo))
    gaps = max(int(num) - endpoint, 1)
    by = jnp.full(shape, gaps, dtype)
    step = length[0] / by
    product, error = two_product(step, by)
    rest = (((length[0] - product) - error) + length[1]) / by
    count = jnp.arange(num).reshape(num, *[1] * len(shape))
    i = jnp.broadcast_to(count.astype(dtype), (num, *shape))
    step, rest = (jnp.broadcast_to(x, (num, *shape)) for x in (step, rest))
    moved, error = two_product(i, step)
    first = start.broadcast_to((num, *shape))
    hi, lo = seconds.moved(first.hi, first.lo, moved, error + i * rest)
    made = first.replace(hi=hi, lo=lo)
    if not endpoint or num < 2:
        return made
    last = jnp.broadcast_to(count == gaps, (num, *shape))
    ends = stop.broadcast_to((num, *shape))
    return made.replace(hi=jnp.where(last, ends.hi, made.hi), lo=jnp.where(last, ends.lo, made.lo))


def arange(start: Any, stop: Any, step: Any) -> Any:
    """Return what ``Epoch.arange`` documents, of two epochs."""
    ends = [_exact(end) for end in (start, stop)]
    high, low = seconds.host_pair(step, STEP)
    if high.ndim or not np.isfinite(high) or not high:
        raise FrameError(f"{STEP}, found {step!r}")
    exact = seconds.exact(step) or Fraction(float(high)) + Fraction(float(low))
    count = max(-((ends[0] - ends[1]) // exact), 0)
    if count > MOST:
        raise FrameError(f"{count} epochs are more than {MOST}; a step of {float(exact):g} s is too small for the span")
    i = np.arange(int(count), dtype=np.float64)
    moved, error = seconds.product(i, high)
    hi, lo = seconds.split(moved, error + i * low, start.hi.dtype)
    hi, lo = seconds.moved(start.hi, start.lo, jnp.asarray(hi), jnp.asarray(lo))
    return start.replace(hi=hi, lo=lo)


def _exact(epoch: Any) -> Fraction:
    if epoch.shape or not is_concrete(epoch.hi) or not is_concrete(epoch.lo) or not np.isfinite(epoch.et):
        raise FrameError(f"the ends of a range are single epochs, known and finite, found {epoch!r}")
    return Fraction(float(epoch.hi)) + Fraction(float(epoch.lo))
