"""UTC, TAI and TT: leap seconds, and the small terms between atomic time and TDB; on the host exact, under jit by the same formula."""

import datetime
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError
from jaxframes.numerics.two_part import fast_two_sum, two_sum
from jaxframes.time import calendar, seconds
from jaxframes.time.calendar import DAY, NOON

LEAP_SECONDS_AS_OF = "2026-11 (no leap second announced after 2017-01-01; IERS Bulletin C, NAIF naif0012.tls)"

# First UTC day (year, month) on which TAI - UTC has reached 10, 11, 12, ... seconds.
_LEAP_DAYS = (
    *((1972, 1), (1972, 7), (1973, 1), (1974, 1), (1975, 1), (1976, 1), (1977, 1), (1978, 1), (1979, 1), (1980, 1)),
    *((1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7), (1993, 7), (1994, 7)),
    *((1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7), (2015, 7), (2017, 1)),
)


@dataclass(frozen=True)
class LeapSeconds:
    """What ties UTC to TDB: the leap seconds, and the formula for TDB - TT; the content of a NAIF leap-seconds kernel.

    ``SHIPPED_LEAP_SECONDS`` comes with the package; ``Kernels.leap_seconds()`` gives that of a kernel.

    Attributes:
        starts: (first day, TAI - UTC in whole seconds from then on), days past 2000-01-01, in time order.
        tt_minus_tai: Seconds, exact (DELTET/DELTA_T_A).
        k: Amplitude of TDB - TT, s (DELTET/K).
        eb: Eccentricity in E = M + EB sin M (DELTET/EB).
        m0: M at J2000, rad (DELTET/M).
        m1: Rate of M, rad/s.
        as_of: Where the table comes from, and what it knows.
    """

    starts: tuple[tuple[int, int], ...]
    tt_minus_tai: Fraction
    k: float
    eb: float
    m0: float
    m1: float
    as_of: str

    def tdb_minus_tt(self, tt: Any) -> Any:
        """Return TDB - TT in seconds at seconds past J2000 TT: K sin E, E = M + EB sin M (30 microseconds from the full theory)."""
        sin = math.sin if isinstance(tt, float) else np.sin if isinstance(tt, np.ndarray) else jnp.sin
        anomaly = self.m0 + self.m1 * tt
        return self.k * sin(anomaly + self.eb * sin(anomaly))

    def tdb_of_tt(self, tt: Fraction) -> Fraction:
        """Return exact seconds past J2000 TDB of exact seconds past J2000 TT."""
        return tt + Fraction(self.tdb_minus_tt(float(tt)))

    def tt_of_tdb(self, tdb: Fraction) -> Fraction:
        """Return seconds past J2000 TT of exact seconds past J2000 TDB, by fixed-point steps: right to 1e-17 s."""
        tt = float(tdb)
        for _ in range(3):
            tt = float(tdb) - self.tdb_minus_tt(tt)
        return tdb - Fraction(self.tdb_minus_tt(tt))

    def tt_parts(self, hi: Any, lo: Any) -> tuple[Any, Any]:
        """Return seconds past J2000 TT in two parts of seconds past J2000 TDB in two parts; traceable."""
        tdb = hi + lo
        small = self.tdb_minus_tt(tdb)
        # The second step of the fixed point: the first is off by 6e-13 s, this one by 2e-22 s.
        return _sum(hi, lo, -self.tdb_minus_tt(tdb - small))

    def tdb_parts(self, hi: Any, lo: Any) -> tuple[Any, Any]:
        """Return seconds past J2000 TDB in two parts of seconds past J2000 TT in two parts; traceable."""
        return _sum(hi, lo, self.tdb_minus_tt(hi + lo))

    def tai_parts(self, hi: Any, lo: Any, sign: int) -> tuple[Any, Any]:
        """Return TAI (sign -1) of TT, or TT (+1) of TAI, in two parts each; traceable."""
        offset, rest = seconds.split_exact(sign * self.tt_minus_tai, hi.dtype)
        return _sum(*_sum(hi, lo, offset), rest)

    def tdb_of_utc(self, text: str) -> Fraction:
        """Return the exact seconds past J2000 TDB of text in UTC, leap seconds included; dates as ``Epoch.from_utc`` reads them.

        Raises:
            FrameError: The text is no UTC date, or lies before the first entry of the table.
        """
        date = calendar.read(text, "UTC")
        if date.day < self.starts[0][0]:
            raise FrameError(f"{calendar.shown(text)} lies before {self._first()}, when UTC had no whole leap seconds; use Epoch.from_tdb")
        leap_day = any(date.day + 1 == start for start, _ in self.starts[1:])
        if date.second > 59 and not (leap_day and (date.hour, date.minute) == (23, 59)):
            clock = f"{date.hour:02d}:{date.minute:02d}:{date.second:02d}"
            raise FrameError(f"{calendar.shown(text)} is no UTC date: {clock} does not exist on that day")
        offset = next(offset for start, offset in reversed(self.starts) if date.day >= start)
        return self.tdb_of_tt(date.day * DAY + date.of_day - NOON + offset + self.tt_minus_tai)

    def tdb_of_text(self, text: str) -> Fraction:
        """Return the exact seconds past J2000 TDB of a date that names its scale: ``2026-03-01T12:00:00 UTC``, ``TDB``, ``TT``, ``TAI``.

        A date without a time of day is TDB where it names none.

        Raises:
            FrameError: The text is no date, or has a time of day and no scale.
        """
        scale = calendar.scale_of(text)
        if scale == "UTC":
            return self.tdb_of_utc(text)
        found = calendar.uniform_seconds(text, scale)
        return found if scale == "TDB" else self.tdb_of_tt(found + (self.tt_minus_tai if scale == "TAI" else 0))

    def tdb_of_datetime(self, date: Any) -> Fraction:
        """Return the exact seconds past J2000 TDB of a ``datetime``, taken to be UTC where it is naive, or a ``datetime64``, which is UTC.

        Raises:
            FrameError: It lies before the first entry of the table, or is no time.
        """
        if isinstance(date, np.datetime64):
            hi, lo = self.tdb_of_datetimes(np.asarray(date))
            return Fraction(float(hi)) + Fraction(float(lo))
        utc = date if date.tzinfo is None else date.astimezone(datetime.UTC).replace(tzinfo=None)
        return self.tdb_of_utc(utc.isoformat())

    def tdb_of_datetimes(self, dates: np.ndarray) -> seconds.Pair:
        """Return seconds past J2000 TDB, two float64 parts [...], of NumPy datetimes [...] (UTC) (FrameError)."""
        if np.isnat(dates).any():
            raise FrameError("a datetime64 is NaT (not a time)")
        unit = np.datetime_data(dates.dtype)[0]
        fine = unit if unit in ("ms", "us", "ns", "ps", "fs", "as") else "s"
        a_second = seconds.UNITS[fine].denominator
        count, rest = np.divmod(dates.astype(f"M8[{fine}]").astype(np.int64), a_second)
        day = count // DAY - (calendar.J2000 - datetime.date(1970, 1, 1)).days
        which = np.searchsorted([start for start, _ in self.starts], day, "right") - 1
        early = np.broadcast_to(dates, day.shape)[which < 0]
        if early.size:
            raise FrameError(f"{early.flat[0]} lies before {self._first()}, when UTC had no whole leap seconds; use Epoch.from_tdb")
        offset = np.array([offset for _, offset in self.starts])[which]
        tt = seconds.add(seconds.host_pair(day * DAY + count % DAY - NOON + offset, ""), seconds.quotient(rest, a_second))
        tt = seconds.add(tt, seconds.host_pair(self.tt_minus_tai, ""))
        return seconds.add(tt, (self.tdb_minus_tt(tt[0]), np.zeros(day.shape)))

    def _first(self) -> str | None:
        return calendar.date_text(self.starts[0][0])

    def utc_of_tdb(self, tdb: Fraction, digits: int) -> tuple[int, int]:
        """Return the UTC day past 2000-01-01 and the time of day in parts of 10**digits to the second, rounded.

        Within a leap second the time of day is at or past 86400 s.

        Raises:
            FrameError: The instant lies before the first entry of the table.
        """
        unit = 10 ** calendar.checked_digits(digits)
        ticks = round((self.tt_of_tdb(tdb) - self.tt_minus_tai) * unit)
        for i in range(len(self.starts) - 1, -1, -1):
            start, offset = self.starts[i]
            if ticks >= (start * DAY - NOON + offset) * unit:
                day, rest = divmod(ticks - (offset - NOON) * unit, DAY * unit)
                # The leap second before the next entry still belongs to the day before it.
                return (day - 1, rest + DAY * unit) if i + 1 < len(self.starts) and day >= self.starts[i + 1][0] else (day, rest)
        raise FrameError(f"an epoch before {self._first()} has no UTC with whole leap seconds; write it in TDB, TT or TAI")


SHIPPED_LEAP_SECONDS = LeapSeconds(
    tuple(((datetime.date(year, month, 1) - calendar.J2000).days, 10 + i) for i, (year, month) in enumerate(_LEAP_DAYS)),
    Fraction(32184, 1000),
    *(1.657e-3, 1.671e-2, 6.239996, 1.99096871e-7),  # NAIF leap-seconds kernel: DELTET/K, EB, M
    LEAP_SECONDS_AS_OF,
)


def _sum(hi: Any, lo: Any, small: Any) -> tuple[Any, Any]:
    """Return hi + lo + small in two parts."""
    total, error = two_sum(hi, jnp.broadcast_to(jnp.asarray(small, hi.dtype), jnp.shape(hi)))
    return fast_two_sum(total, error + lo)
