"""Spans of time that an edge covers, kept exactly: coverage codes, and NaN outside of them."""

from fractions import Fraction
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import EdgeError
from jaxframes.numerics.components import select
from jaxframes.staging.arrays import is_concrete
from jaxframes.time.epoch import Epoch
from jaxframes.time.seconds import split_exact

Span: TypeAlias = tuple[Fraction | None, Fraction | None]
"""First and last instant, exact seconds past J2000 TDB; None where there is none."""


def exact_span(start: Any, stop: Any, family_name: str) -> Span:
    """Return the exact instants between which an edge holds.

    Args:
        start: First instant: an ``Epoch``, seconds past J2000 TDB or text that names its scale; None for none.
        stop: Last instant, likewise.
        family_name: Name of the family, for messages.

    Raises:
        EdgeError: The start lies after the stop, or an instant is a batch.
    """
    first = None if start is None else _exact(start, f"{family_name}(start=...)")
    last = None if stop is None else _exact(stop, f"{family_name}(stop=...)")
    if first is not None and last is not None and first > last:
        raise EdgeError(f"{family_name}: its start, {float(first)} s past J2000 TDB, lies after its stop, {float(last)} s; swap them")
    return first, last


def _exact(value: Any, what: str) -> Fraction:
    epoch = Epoch.from_text(value) if isinstance(value, str) else Epoch.from_et(value)
    if epoch.shape:
        raise EdgeError(f"{what} takes one instant, found a batch of shape {epoch.shape}")
    if not is_concrete(epoch.hi):
        raise EdgeError(f"{what} is static, so it cannot be traced")
    if not np.isfinite(np.asarray(epoch.hi)):
        raise EdgeError(f"{what} takes a finite instant, found {value!r}")
    return Fraction(float(epoch.hi)) + Fraction(float(epoch.lo))


def _before_and_after(span: Span, hi: jax.Array, lo: jax.Array) -> tuple[jax.Array | None, jax.Array | None]:
    """Return where epochs lie before and after a span."""
    ends = [None if end is None else split_exact(end, hi.dtype) for end in span]
    past = [None if end is None else (hi - end[0]) + (lo - end[1]) for end in ends]
    return None if past[0] is None else past[0] < 0, None if past[1] is None else past[1] > 0


def codes_of_span(span: Span, time: Any) -> jax.Array:
    """Return -1 where an ``Epoch`` lies before a span, 0 inside, +1 after: int32 [...]."""
    hi, lo = jnp.asarray(time.hi), jnp.asarray(time.lo)
    before, after = _before_and_after(span, hi, lo)
    code = jnp.zeros(jnp.broadcast_shapes(hi.shape, lo.shape), jnp.int32)
    for where, value in ((before, -1), (after, 1)):
        code = code if where is None else jnp.where(where, jnp.int32(value), code)
    return code


def factor_within(span: Span, hi: jax.Array, lo: jax.Array) -> jax.Array | None:
    """Return 1 within a span and NaN outside, to multiply with: so the NaN is in derivatives too. None for a span without ends."""
    outside = [where for where in _before_and_after(span, hi, lo) if where is not None]
    if not outside:
        return None
    any_outside = outside[0] if len(outside) == 1 else outside[0] | outside[1]
    return select(any_outside, np.array(np.nan, hi.dtype), np.ones((), hi.dtype))
