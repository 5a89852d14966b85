"""UTC on the host: leap seconds and the small terms between atomic time and TDB."""

import datetime
import math
import re
from fractions import Fraction

from jaxframes.errors import FrameError

LEAP_SECONDS_AS_OF = "2026-11 (no leap second announced after 2017-01-01; IERS Bulletin C, NAIF naif0012.tls)"

# First UTC day (year, month) on which TAI - UTC has reached 10, 11, 12, ... seconds.
_LEAP_DAYS = (
    *((1972, 1), (1972, 7), (1973, 1), (1974, 1), (1975, 1), (1976, 1), (1977, 1), (1978, 1), (1979, 1), (1980, 1)),
    *((1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7), (1993, 7), (1994, 7)),
    *((1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7), (2015, 7), (2017, 1)),
)
_TT_MINUS_TAI = Fraction(32184, 1000)
_K, _EB, _M0, _M1 = 1.657e-3, 1.671e-2, 6.239996, 1.99096871e-7  # NAIF leap-seconds kernel: DELTET/K, EB, M
_J2000 = datetime.date(2000, 1, 1)
_UTC = re.compile(r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d)(\.\d+)?)?)?(?:\s*(?:Z|UTC|\+00:00))?")


def utc_seconds(text: str) -> Fraction:
    """Return the seconds past J2000 TDB of calendar text in UTC, such as ``2026-03-01T00:00:00.5``; leap seconds are read.

    TDB - TT follows the two-term formula of the NAIF leap-seconds kernel (30 microseconds from the full theory).

    Raises:
        FrameError: The text is no UTC date, or lies before 1972, when UTC had no whole leap seconds.
    """
    match = _UTC.fullmatch(text.strip())
    if match is None:
        raise FrameError(f"{text!r} is no UTC date; write it as 2026-03-01 or 2026-03-01T12:00:00.125 (optionally with Z or UTC)")
    year, month, day, hour, minute, second = (int(g or 0) for g in match.groups()[:6])
    try:
        date = datetime.date(year, month, day)
    except ValueError as error:
        raise FrameError(f"{text!r} is no UTC date: {error}") from None
    days = [datetime.date(y, m, 1) for y, m in _LEAP_DAYS]
    leap_day = date + datetime.timedelta(days=1) in days[1:]
    if date < days[0]:
        raise FrameError(f"{text!r} lies before 1972-01-01, when UTC had no whole leap seconds; use Epoch.from_tdb")
    if hour > 23 or minute > 59 or second > (60 if leap_day and hour == 23 and minute == 59 else 59):
        raise FrameError(f"{text!r} is no UTC date: {hour:02d}:{minute:02d}:{second:02d} does not exist on that day")
    leaps = 9 + sum(date >= d for d in days)
    atomic = Fraction((date - _J2000).days * 86400 + hour * 3600 + minute * 60 + second - 43200) + Fraction(match.group(7) or 0) + leaps
    terrestrial = atomic + _TT_MINUS_TAI
    anomaly = _M0 + _M1 * float(terrestrial)
    return terrestrial + Fraction(_K * math.sin(anomaly + _EB * math.sin(anomaly)))
