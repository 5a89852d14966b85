"""Exact instants on the host: everything here is a ``Fraction`` of seconds past J2000 TDB."""

from fractions import Fraction
from typing import Any, Protocol, TypeAlias, runtime_checkable

import jax
import numpy as np

from jaxframes.errors import FrameError, SpiceError
from jaxframes.numerics import host_two_part
from jaxframes.staging.arrays import default_float, on_device
from jaxframes.time.calendar import tdb_text
from jaxframes.time.scales import SHIPPED_LEAP_SECONDS

DAY = 86400


@runtime_checkable
class TwoPart(Protocol):
    """An instant in two parts, such as ``jf.Epoch``: hi + lo seconds past J2000 TDB."""

    @property
    def hi(self) -> Any:
        """The large part."""

    @property
    def lo(self) -> Any:
        """The small part."""


Instant: TypeAlias = str | float | Fraction | TwoPart
"""What a user may give as an instant: calendar text with its time scale, seconds past J2000 TDB, or an epoch in two parts."""


def exact_seconds(value: Instant, name: str = "instant") -> Fraction:
    """Return an instant as exact seconds past J2000 TDB.

    Args:
        value: Calendar text as ``jf.Epoch.from_text`` reads it (``"2026-01-01"``, ``"2026-01-01T12:30:00.5 UTC"``), seconds past J2000
            TDB, or an object with parts ``hi`` and ``lo`` (``jf.Epoch``).
        name: What the value is, for the message.

    Raises:
        SpiceError: If the value is none of these, is not finite, or is a batch of epochs.
    """
    if isinstance(value, str):
        try:
            return SHIPPED_LEAP_SECONDS.tdb_of_text(value)
        except FrameError as error:
            raise SpiceError(f"{name}: {error}. Far years are given in seconds past J2000 TDB.") from error
    parts = (value.hi, value.lo) if isinstance(value, TwoPart) else (value,)
    try:
        return sum((part if isinstance(part, Fraction) else Fraction(float(part)) for part in parts), Fraction(0))
    except (TypeError, ValueError, OverflowError) as error:
        raise SpiceError(
            f"{name} = {value!r} is no instant: give calendar text such as '2026-01-01T12:00 UTC', seconds past J2000 TDB, or a jf.Epoch."
        ) from error


def span_text(start: Fraction, stop: Fraction) -> str:
    """Return a span as calendar text with the ET seconds in brackets."""
    return f"{tdb_text(start)} .. {tdb_text(stop)} TDB (ET {float(start)!r} .. {float(stop)!r})"


def reference_day(start: Fraction) -> int:
    """Return the last whole day past J2000 at or before an instant, in seconds.

    A table counts its time from such a day: a whole number of days is exact as one float32 within 68 years of J2000 and as two
    always, so a float32 table loses nothing by its reference.
    """
    return (start // DAY) * DAY


def two_parts(exact: Fraction) -> tuple[float, float]:
    """Return the nearest double and the nearest double to the rest."""
    high = float(exact)
    return high, float(exact - Fraction(high))


def split(high: Any, low: Any, dtype: np.dtype) -> tuple[Any, Any]:
    """Return a two-part number (float64) as two parts of a dtype whose sum is as near as they can come."""
    high, low = np.asarray(high, np.float64), np.asarray(low, np.float64)
    with np.errstate(invalid="ignore"):
        total = high + low
        first = total.astype(dtype)
        # What one part cannot hold: the rounding to the dtype, and the rounding of the sum itself.
        rest = (high - first.astype(np.float64)) + low
    return first, np.where(np.isfinite(total), rest, 0.0).astype(dtype)


def pairs(*values: Fraction) -> jax.Array:
    """Return exact numbers as two parts each, one array of the default float dtype."""
    dtype = np.dtype(default_float())
    parts = [split(*two_parts(value), dtype) for value in values]
    return on_device(np.array(parts, dtype).reshape(-1))


def past_reference(reference: Any, high: np.ndarray, low: np.ndarray) -> host_two_part.Pair:
    """Return instants as two float64 parts, seconds past J2000 TDB, from times past a reference that is itself in two parts [2]."""
    start = np.asarray(reference, np.float64)
    return host_two_part.add((high, low), (np.full_like(high, start[0]), np.full_like(high, start[1])))
