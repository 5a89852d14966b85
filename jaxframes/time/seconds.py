"""Seconds in two parts: whatever a user may give as a number or a duration, split so that none of its digits is lost."""

import datetime
from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from typing import Any, ClassVar, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError
from jaxframes.numerics.batch import Batched
from jaxframes.numerics.two_part import fast_two_sum, two_sum
from jaxframes.staging.arrays import as_float, common_float, default_float, is_concrete

Pair: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Numbers of the host as unevaluated sums hi + lo of two float64 [...]."""

UNITS = {"W": Fraction(604800), "D": Fraction(86400), "h": Fraction(3600), "m": Fraction(60)} | {
    name: Fraction(1, 10**power) for name, power in (("s", 0), ("ms", 3), ("us", 6), ("ns", 9), ("ps", 12), ("fs", 15), ("as", 18))
}
"""Length in seconds of NumPy's units of time that have one."""


def two_parts(seconds: Any, dtype: Any, refusal: str) -> tuple[jax.Array, jax.Array]:
    """Return seconds in two parts [...] of a dtype; numbers of the host and integers are split, so that none of their digits is lost.

    Args:
        seconds: Numbers [...], a ``Fraction``, ``Decimal``, ``timedelta`` or NumPy ``timedelta64`` [...], or sequences of them.
        dtype: Float dtype of the parts. Default: that of a JAX array of floats, else JAX's own.
        refusal: What is expected, to start the message with.

    Raises:
        FrameError: It is none of these: text, None, truth values and dates are no numbers of seconds.
    """
    if isinstance(seconds, jax.Array):
        kind = seconds.dtype
        if jnp.issubdtype(kind, jnp.integer):
            coarse = (seconds >> 12) << 12
            return tuple(part.astype(dtype or default_float()) for part in (coarse, seconds - coarse))  # pyright: ignore[reportReturnType]
        if not jnp.issubdtype(kind, jnp.floating):
            raise FrameError(f"{refusal}, found an array of {kind}")
        if not (seconds.weak_type and is_concrete(seconds)):
            hi = as_float(seconds) if dtype is None else as_float(seconds).astype(dtype)
            return hi, jnp.zeros_like(hi)
    hi, lo = split(*host_pair(seconds, refusal), dtype or default_float())
    return jnp.asarray(hi), jnp.asarray(lo)


def host_pair(seconds: Any, refusal: str) -> Pair:
    """Return what ``two_parts`` takes, except for traced numbers, as two float64 parts (FrameError)."""
    single = exact(seconds)
    if single is not None:
        return tuple(np.asarray(part) for part in _doubles(single, refusal))  # pyright: ignore[reportReturnType]
    try:
        array = np.asarray(seconds)
    except ValueError as error:  # rows of unequal length
        raise FrameError(f"{refusal}, found {seconds!r}: {error}") from None
    if array.dtype.kind == "f":
        high, low = array.astype(np.float64), np.zeros(array.shape)
        if array.dtype.itemsize > 8:
            np.subtract(array, high, out=low, where=np.isfinite(high), casting="same_kind")
        return high, low
    if array.dtype.kind in "iu":
        return _integers(array)
    if array.dtype.kind == "m":
        return _durations(array, refusal)
    if array.dtype.kind == "O":
        items = [exact(item) for item in array.flat]
        if None not in items:
            pairs = [_doubles(item, refusal) for item in items if item is not None]
            return tuple(np.array([pair[k] for pair in pairs], np.float64).reshape(array.shape) for k in (0, 1))  # pyright: ignore[reportReturnType]
    raise FrameError(f"{refusal}, found {seconds!r}{_remedy(array)}")


def exact(seconds: Any) -> Fraction | None:
    """Return a single number or duration that is exact by its kind, or a Python float, as a fraction; None for anything else."""
    if isinstance(seconds, datetime.timedelta):
        return Fraction(seconds.days * 86400 + seconds.seconds) + Fraction(seconds.microseconds, 10**6)
    if isinstance(seconds, (int, float, Fraction, Decimal)) and not isinstance(seconds, bool):
        try:
            return Fraction(seconds)
        except (ValueError, OverflowError):  # an infinity, or no number
            return None
    return None


def split_exact(seconds: Fraction, dtype: Any) -> tuple[Any, Any]:
    """Return an exact number as two numbers of a dtype."""
    number = np.dtype(dtype).type
    hi = number(float(seconds))
    return hi, number(float(seconds - Fraction(float(hi))))


def _doubles(seconds: Fraction, refusal: str) -> tuple[float, float]:
    try:
        return split_exact(seconds, np.float64)
    except OverflowError:
        raise FrameError(f"{refusal}, found a number beyond 1e308") from None


def split(high: np.ndarray, low: np.ndarray, dtype: Any) -> Pair:
    """Return numbers in two float64 parts as two parts of a dtype whose sum is as near as they can come; infinities have no rest."""
    with np.errstate(invalid="ignore", over="ignore"):
        first = (high + low).astype(dtype)
        rest = (high - first.astype(np.float64)) + low
    return first, np.where(np.isinf(first), 0.0, rest).astype(dtype)


def moved(hi: jax.Array, lo: jax.Array, coarse: jax.Array, fine: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return an instant (hi, lo) a duration (coarse, fine) later, in two parts."""
    hi, error = two_sum(*same_rank(hi, coarse))
    low, rest = same_rank(*same_rank(hi, lo)[1:], fine)
    return fast_two_sum(hi, error + (low + rest))


def same_rank(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return two arrays broadcast to one shape."""
    shape = jnp.broadcast_shapes(jnp.shape(a), jnp.shape(b))
    return jnp.broadcast_to(a, shape), jnp.broadcast_to(b, shape)


def add(a: Pair, b: Pair) -> Pair:
    """Return the sum of numbers in two parts, the high one rounded to nearest."""
    total = a[0] + b[0]
    back = total - a[0]
    rest = ((a[0] - (total - back)) + (b[0] - back)) + (a[1] + b[1])
    high = total + rest
    return high, rest - (high - total)


def product(a: np.ndarray, b: Any) -> Pair:
    """Return the product of two doubles and its rounding error, exactly (Dekker 1971)."""
    (ah, al), (bh, bl) = _halves(a), _halves(b)
    p = a * b
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


def _halves(a: Any) -> tuple[Any, Any]:
    t = 134217729.0 * a  # 2**27 + 1
    high = t - (t - a)
    return high, a - high


def _integers(counts: np.ndarray) -> Pair:
    coarse = (counts >> 12) << 12
    return add((coarse.astype(np.float64), np.zeros(counts.shape)), ((counts - coarse).astype(np.float64), np.zeros(counts.shape)))


def quotient(counts: np.ndarray, by: int) -> Pair:
    """Return integers over an integer that a double holds."""
    hi, lo = _integers(counts)
    q = hi / by
    p, e = product(q, float(by))
    return q, (((hi - p) - e) + lo) / by


def _durations(array: np.ndarray, refusal: str) -> Pair:
    """Return NumPy's durations: whole seconds and the rest apart, so that nothing is rounded before the two parts are."""
    unit, count = np.datetime_data(array.dtype)
    if unit not in UNITS:
        length = "no unit" if unit == "generic" else "years and months, which have no length of their own"
        raise FrameError(f"{refusal}, found a timedelta64 in {length}: {array!r}")
    if np.isnat(array).any():
        raise FrameError(f"{refusal}, found a timedelta64 that is NaT (not a time)")
    step = UNITS[unit] * count
    whole, rest = np.divmod(array.astype(np.int64), step.denominator)
    return add(_integers(whole * step.numerator), quotient(rest * step.numerator, step.denominator))


def _remedy(array: np.ndarray) -> str:
    if array.dtype.kind == "M" or (array.size and isinstance(array.flat[0], datetime.date)):
        return "; a date becomes an epoch by Epoch.from_datetime (UTC)"
    return "; text is read by Epoch.from_text" if array.dtype.kind in "US" else ""


def batch(items: Any, leaf: type[Any] | tuple[type[Any], ...], refusal: str) -> tuple[list[Any], tuple[int, ...]]:
    """Return the leaves of nested sequences in order, and the shape that they have (FrameError if it is ragged)."""
    if isinstance(items, leaf):
        return [items], ()
    if isinstance(items, np.ndarray):
        items = items.tolist()
    if not isinstance(items, Sequence) or isinstance(items, (str, bytes)):
        raise FrameError(f"{refusal}, found {items!r}")
    flat: list[Any] = []
    shapes: list[tuple[int, ...]] = []
    for item in items:
        found, shape = batch(item, leaf, refusal)
        flat += found
        shapes.append(shape)
    if len(set(shapes)) > 1:
        raise FrameError(f"{refusal}; the rows of a batch must be of one length, found {items!r}")
    return flat, (len(items), *(shapes[0] if shapes else ()))


class Ordered(Batched):
    """A number hi + lo [...] that is compared with others of its class: both parts together, booleans [...]; NaN is never equal."""

    own_axes: ClassVar[int] = 0
    hi: jax.Array
    lo: jax.Array

    def _ordered(self, other: Any) -> tuple[jax.Array, ...] | None:
        """Return the parts of both, normalised, so that equal sums have equal parts; None if the other is of another class."""
        if not isinstance(other, type(self)):
            return None
        a, b, c, d = common_float(self.hi, self.lo, other.hi, other.lo)
        (a, b), (c, d) = two_sum(*same_rank(a, b)), two_sum(*same_rank(c, d))
        finite = [jnp.where(jnp.isinf(high), jnp.zeros_like(low), low) for high, low in ((a, b), (c, d))]
        return (*same_rank(a, c), *same_rank(*finite))

    def __eq__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] == found[1]) & (found[2] == found[3])

    def __ne__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] != found[1]) | (found[2] != found[3])

    def __lt__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] < found[1]) | ((found[0] == found[1]) & (found[2] < found[3]))

    def __le__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] < found[1]) | ((found[0] == found[1]) & (found[2] <= found[3]))

    def __gt__(self, other: Any) -> Any:
        return other < self if isinstance(other, type(self)) else NotImplemented

    def __ge__(self, other: Any) -> Any:
        return other <= self if isinstance(other, type(self)) else NotImplemented

    __hash__ = object.__hash__
