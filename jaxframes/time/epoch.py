"""Epoch: an instant as seconds past J2000 TDB in two parts, so that nothing is lost to rounding."""

import datetime
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError
from jaxframes.numerics.batch import tag
from jaxframes.numerics.two_part import two_sum
from jaxframes.staging.arrays import default_float, is_concrete
from jaxframes.time import calendar, epoch_ranges
from jaxframes.time.calendar import tdb_seconds
from jaxframes.time.scales import SHIPPED_LEAP_SECONDS, LeapSeconds
from jaxframes.time.seconds import Ordered, batch, moved, same_rank, split, split_exact, two_parts

EPOCH = "an epoch is seconds past J2000 TDB (for a date use Epoch.from_tdb, from_utc or from_datetime)"
DURATION = "a duration is seconds, a timedelta or a timedelta64"


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class Epoch(Ordered):
    """An instant: ``hi + lo`` seconds past J2000 (2000-01-01T12:00:00) in barycentric dynamical time, TDB.

    One 64-bit number of seconds in 2026 is spaced 1.2e-7 s, in which the Moon moves 0.1 mm and the Earth 3.6 mm; one 32-bit
    number is spaced 64 s. Two parts resolve 1e-23 s and 4e-6 s. ``hi`` and ``lo`` have one shape [...]; both are leaves, and
    the derivative of anything with respect to either is its time derivative. Durations are plain seconds.

    Batches are indexed, iterated over, reshaped and joined (``jf.stack``, ``jf.concatenate``) as the other values are. ``==``, ``!=``,
    ``<``, ``<=``, ``>`` and ``>=`` compare elementwise and exactly, both parts together, and return booleans [...].

    Example:
        >>> import jaxframes as jf
        >>> t = jf.Epoch.from_tdb("2026-03-01T00:00:00.25")
        >>> float((t + 0.5) - t)
        0.5
    """

    hi: jax.Array
    lo: jax.Array
    kind: str = tag("Epoch")

    @classmethod
    def from_et(cls, seconds: Any) -> "Epoch":
        """Return the epoch of SPICE ephemeris time: seconds past J2000 TDB, [...].

        A Python, NumPy float64 or 64-bit JAX number carries its own spacing (1.2e-7 s in 2026). On the host a 64-bit number
        is split into two parts when JAX runs in 32 bits, so nothing more is lost; a ``Fraction`` or ``int`` is kept exactly.

        Raises:
            FrameError: It is no number of seconds: text, None, or a date such as a ``datetime`` or NumPy ``datetime64``.
        """
        return seconds if isinstance(seconds, Epoch) else cls(*two_parts(seconds, None, EPOCH))

    @classmethod
    def from_parts(cls, hi: Any, lo: Any) -> "Epoch":
        """Return the epoch ``hi + lo`` seconds past J2000 TDB, e.g. whole and fraction, [...] each; both are taken as ``from_et`` does."""
        return cls.from_et(hi) + lo

    @classmethod
    def linspace(cls, start: Any, stop: Any, num: int, *, endpoint: bool = True) -> "Epoch":
        """Return ``num`` epochs evenly spread from one to another, [num, ...]; nothing is lost in their spacing; traceable.

        Args:
            start: First epoch [...], or what ``from_et`` takes.
            stop: Last epoch, which the last one returned is exactly.
            num: How many.
            endpoint: Whether ``stop`` is among them.

        Raises:
            FrameError: ``num`` is no count.
        """
        return epoch_ranges.linspace(cls.from_et(start), cls.from_et(stop), num, endpoint)

    @classmethod
    def arange(cls, start: Any, stop: Any, step: Any) -> "Epoch":
        """Return the epochs start, start + step, ... before ``stop``, [n]: each ``start + i * step``, nothing added up (host only).

        Args:
            start: First epoch, or what ``from_et`` takes.
            stop: Where to end; not among them.
            step: Seconds, a ``Fraction``, ``timedelta`` or ``timedelta64``; not zero.

        Raises:
            FrameError: The step is no duration or zero, or an end is a batch or traced.
        """
        return epoch_ranges.arange(cls.from_et(start), cls.from_et(stop), step)

    @classmethod
    def from_text(cls, text: str | Sequence[Any], *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch of a date that names its scale: ``2026-03-01T12:00:00 UTC``, ``... TDB``, ``... TT`` or ``... TAI``.

        A date without a time of day is TDB where it names none. All that takes an instant as text reads it so: kernels, tables, commands.

        Args:
            text: The date; nested sequences of them give a batch [...].
            leap_seconds: As in ``from_utc``.

        Raises:
            FrameError: The text is no date, or has a time of day and no scale: UTC and TDB are 69 s apart.
        """
        return cls._read(text, "an instant", (leap_seconds or SHIPPED_LEAP_SECONDS).tdb_of_text)

    @classmethod
    def from_tdb(cls, text: str | Sequence[Any]) -> "Epoch":
        """Return the epoch of a date in TDB: ``2026-03-01``, ``2026-03-01T12:00:00.125``, ``2026-060T12:00`` or ``JD 2461101.0`` (exact).

        Args:
            text: The date; nested sequences of them give a batch [...]. So in all readers of text here.

        Raises:
            FrameError: The text is no such date.
        """
        return cls._read(text, "TDB", tdb_seconds)

    @classmethod
    def from_tt(cls, text: str | Sequence[Any], *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch of a calendar date in terrestrial time, TT. ``leap_seconds`` only gives the formula of TDB - TT (FrameError)."""
        table = leap_seconds or SHIPPED_LEAP_SECONDS
        return cls._read(text, "TT", lambda date: table.tdb_of_tt(calendar.uniform_seconds(date, "TT")))

    @classmethod
    def from_tai(cls, text: str | Sequence[Any], *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch of a calendar date in atomic time, TAI, which is TT - 32.184 s (FrameError)."""
        table = leap_seconds or SHIPPED_LEAP_SECONDS
        return cls._read(text, "TAI", lambda date: table.tdb_of_tt(calendar.uniform_seconds(date, "TAI") + table.tt_minus_tai))

    @classmethod
    def from_utc(cls, text: str | Sequence[Any], *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch of a date in UTC; leap seconds (``23:59:60``) are read.

        Args:
            text: ``2026-03-01T12:00:00``, ``2026-060T12:00`` (day of the year), ``JD 2461101.0`` (in days of 86400 s), optionally with
                ``UTC``, ``Z`` or an offset such as ``+02:00`` behind it. UTC is never taken as a number of seconds: such a count skips or
                repeats leap seconds.
            leap_seconds: The table to read it by, e.g. ``kernels.leap_seconds()``. Default: the one that ships with the package,
                ``jf.SHIPPED_LEAP_SECONDS``, whose ``as_of`` states its date.

        Raises:
            FrameError: The text is no such date, or lies before 1972.
        """
        return cls._read(text, "UTC", (leap_seconds or SHIPPED_LEAP_SECONDS).tdb_of_utc)

    @classmethod
    def from_datetime(cls, moment: Any, *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch of a date: an aware datetime is converted to UTC, a naive one is taken to be UTC (never local time).

        Args:
            moment: A ``datetime.datetime`` or NumPy ``datetime64``, which is UTC; sequences and arrays of them give a batch [...].
            leap_seconds: As in ``from_utc``.

        Raises:
            FrameError: It is no datetime, or lies before 1972.
        """
        table, dates = leap_seconds or SHIPPED_LEAP_SECONDS, np.asarray(moment) if isinstance(moment, np.generic) else moment
        if isinstance(dates, np.ndarray) and dates.dtype.kind == "M":
            hi, lo = split(*table.tdb_of_datetimes(dates), default_float())
            return cls(jnp.asarray(hi), jnp.asarray(lo))
        found, shape = batch(dates, (datetime.datetime, np.datetime64), "Epoch.from_datetime takes a datetime.datetime or a datetime64")
        return cls._from_exact([table.tdb_of_datetime(date) for date in found], shape)

    @classmethod
    def from_tt_parts(cls, hi: Any, lo: Any = 0.0, *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch ``hi + lo`` seconds past J2000 TT (2000-01-01T12:00:00 TT) of arrays [...]; traceable."""
        table, given = leap_seconds or SHIPPED_LEAP_SECONDS, cls.from_parts(hi, lo)
        return cls(*table.tdb_parts(given.hi, given.lo))

    @classmethod
    def from_tai_parts(cls, hi: Any, lo: Any = 0.0, *, leap_seconds: LeapSeconds | None = None) -> "Epoch":
        """Return the epoch ``hi + lo`` seconds past 2000-01-01T12:00:00 TAI of arrays [...]; traceable."""
        table, given = leap_seconds or SHIPPED_LEAP_SECONDS, cls.from_parts(hi, lo)
        return cls(*table.tdb_parts(*table.tai_parts(given.hi, given.lo, 1)))

    @classmethod
    def _read(cls, text: Any, scale: str, seconds_of: Callable[[str], Fraction]) -> "Epoch":
        if isinstance(text, str):
            return cls._from_exact([seconds_of(text)])
        wanted = f"{scale} is read from calendar text such as '2026-03-01T00:00:00'"
        if scale == "UTC" and isinstance(text, (int, float, np.number, jax.Array)):
            wanted += " (a count of UTC seconds would skip or repeat leap seconds)"
        if isinstance(text, (datetime.date, np.datetime64)) or getattr(getattr(text, "dtype", None), "kind", "") == "M":
            wanted += ", datetimes by Epoch.from_datetime"
        dates, shape = batch(text, str, wanted)
        return cls._from_exact([seconds_of(date) for date in dates], shape)

    @classmethod
    def _from_exact(cls, seconds: Sequence[Fraction], shape: tuple[int, ...] = ()) -> "Epoch":
        dtype = np.dtype(default_float())
        pairs = np.array([split_exact(one, dtype) for one in seconds], dtype).reshape(*shape, 2)
        return cls(jnp.asarray(pairs[..., 0]), jnp.asarray(pairs[..., 1]))

    @property
    def et(self) -> jax.Array:
        """Seconds past J2000 TDB in one number, [...]: rounded to the spacing of the dtype."""
        return self.hi + self.lo

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape."""
        return jnp.broadcast_shapes(np.shape(self.hi), np.shape(self.lo))

    def __add__(self, seconds: Any) -> "Epoch":
        """Return the epoch a duration later; nothing of it is lost.

        Args:
            seconds: Seconds [...], a ``Fraction``, a ``datetime.timedelta`` or NumPy ``timedelta64`` [...].

        Raises:
            FrameError: It is no duration.
        """
        if isinstance(seconds, Epoch):
            raise FrameError("two epochs cannot be added; add a duration in seconds, or subtract the epochs")
        return Epoch(*moved(self.hi, self.lo, *two_parts(seconds, self.hi.dtype, DURATION)))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        """Return the duration since another epoch in seconds [...], or the epoch a duration earlier."""
        if not isinstance(other, Epoch):
            coarse, fine = two_parts(other, self.hi.dtype, DURATION)
            return Epoch(*moved(self.hi, self.lo, -coarse, -fine))
        a, b = same_rank(self.hi, other.hi)
        c, d = same_rank(self.lo, other.lo)
        s, e = two_sum(a, -b)
        return s + (e + (c - d))

    def __hash__(self) -> int:
        """Return the hash of the instant, if it is one and known: those that are equal have one hash; that of the object else."""
        try:
            return hash(self._exact())
        except (FrameError, TypeError, ValueError):
            return object.__hash__(self)

    @property
    def tt(self) -> tuple[jax.Array, jax.Array]:
        """Seconds past J2000 TT in two parts [...], by the formula of NAIF's leap-seconds kernels; traceable."""
        return SHIPPED_LEAP_SECONDS.tt_parts(*same_rank(self.hi, self.lo))

    @property
    def tai(self) -> tuple[jax.Array, jax.Array]:
        """Seconds past 2000-01-01T12:00:00 TAI in two parts [...]; traceable."""
        return SHIPPED_LEAP_SECONDS.tai_parts(*self.tt, -1)

    def to_tdb(self, digits: int = 3, *, form: str = "calendar") -> str:
        """Return one epoch as text in TDB, rounded to ``digits`` decimals of a second (host only); ``form`` as in ``to_utc``."""
        return calendar.uniform_text(self._exact(), digits, "ET", form)

    def to_tt(self, digits: int = 3, *, form: str = "calendar", leap_seconds: LeapSeconds | None = None) -> str:
        """Return one epoch as text in TT, rounded to ``digits`` decimals of a second (host only); ``form`` as in ``to_utc``."""
        return calendar.uniform_text((leap_seconds or SHIPPED_LEAP_SECONDS).tt_of_tdb(self._exact()), digits, "TT", form)

    def to_tai(self, digits: int = 3, *, form: str = "calendar", leap_seconds: LeapSeconds | None = None) -> str:
        """Return one epoch as text in TAI, rounded to ``digits`` decimals of a second (host only); ``form`` as in ``to_utc``."""
        table = leap_seconds or SHIPPED_LEAP_SECONDS
        return calendar.uniform_text(table.tt_of_tdb(self._exact()) - table.tt_minus_tai, digits, "TAI", form)

    def to_utc(self, digits: int = 3, *, form: str = "calendar", offset: str | None = None, leap_seconds: LeapSeconds | None = None) -> str:
        """Return one epoch as text in UTC, rounded (host only); a leap second reads ``23:59:60``. ``from_utc`` reads all of it back.

        Args:
            digits: Decimals of a second.
            form: ``"calendar"`` for 2026-03-01T12:00:00.000, ``"ordinal"`` for 2026-060T12:00:00.000 (day of the year), ``"julian"`` for
                JD 2461101.000000000, in days of 86400 s.
            offset: Writes the time of a zone, such as ``"+02:00"``, with the offset behind it.
            leap_seconds: As in ``from_utc``.

        Raises:
            FrameError: The epoch lies before 1972 or beyond the calendar, or is a leap second and the form Julian.
        """
        day, ticks = (leap_seconds or SHIPPED_LEAP_SECONDS).utc_of_tdb(self._exact(), digits)
        unit = 10**digits
        leap = ticks >= calendar.DAY * unit
        ticks -= leap * unit
        if offset is not None:
            days, ticks = divmod(ticks + calendar.minutes_of(offset) * 60 * unit, calendar.DAY * unit)
            day += days
        text = calendar.text_of(day, ticks, digits, form, leap)
        if text is None:
            raise FrameError(f"{self!r} lies beyond the calendar of four-digit years; write it as seconds, .et")
        return text + (offset or "")

    def to_datetime(self, *, leap_seconds: LeapSeconds | None = None) -> datetime.datetime:
        """Return one epoch as an aware datetime in UTC, rounded to microseconds (host only).

        Raises:
            FrameError: The epoch lies within a leap second, which a datetime cannot say, or where ``to_utc`` refuses.
        """
        text = self.to_utc(6, leap_seconds=leap_seconds)
        if text[17:19] == "60":
            raise FrameError(f"{text} UTC is a leap second, which a datetime cannot say; use to_utc")
        return datetime.datetime.fromisoformat(text).replace(tzinfo=datetime.UTC)

    def _exact(self) -> Fraction:
        if self.shape or not is_concrete(self.hi) or not np.isfinite(self.hi):
            raise FrameError(f"text is written of one known, finite epoch, found {self!r}; index a batch, and stay outside jit")
        return Fraction(float(self.hi)) + Fraction(float(self.lo))

    def __repr__(self) -> str:
        if isinstance(self.hi, (jax.Array, np.ndarray)) and is_concrete(self.hi):
            if np.ndim(self.hi) == 0 and np.isfinite(self.hi):
                return f"Epoch({self.to_tdb(6)} TDB)"
            return f"Epoch(shape={np.shape(self.hi)})"
        return f"Epoch(hi={self.hi!r}, lo={self.lo!r})"
