"""Calendar text on the host: dates and times of uniform scales to exact seconds past J2000 noon, and back."""

import datetime
import re
from fractions import Fraction
from typing import NamedTuple

from jaxframes.errors import FrameError

J2000 = datetime.date(2000, 1, 1)
NOON = 43200
DAY = 86400
_CALENDAR = re.compile(r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d)(\.\d+)?)?)?\s*([A-Za-z]+|\+00:00)?")
ZONES = {"TDB": ("TDB",), "TT": ("TT", "TDT"), "TAI": ("TAI",), "UTC": ("UTC", "Z", "+00:00")}
"""What may stand after a date, for each time scale."""


class Calendar(NamedTuple):
    """A date and time taken apart: days past 2000-01-01, then hours, minutes and seconds as written."""

    day: int
    hour: int
    minute: int
    second: int
    fraction: Fraction

    @property
    def of_day(self) -> Fraction:
        """Seconds since the start of the day."""
        return self.hour * 3600 + self.minute * 60 + self.second + self.fraction


def read(text: str, scale: str) -> Calendar:
    """Return the parts of a date such as ``2026-03-01`` or ``2026-03-01T12:00:00.125``, optionally followed by its time scale.

    Seconds up to 60 are taken: whether the sixtieth exists is for the scale to say.

    Raises:
        FrameError: The text is no such date, or names another scale.
    """
    match = _CALENDAR.fullmatch(text.strip())
    zone = (match.group(8) or "").upper() if match else ""
    if match is None or (zone and zone not in ZONES[scale]):
        allowed = " or ".join(ZONES[scale])
        raise FrameError(f"{text!r} is no {scale} date; write it as 2026-03-01 or 2026-03-01T12:00:00.125 (optionally with {allowed})")
    year, month, day, hour, minute, second = (int(g or 0) for g in match.groups()[:6])
    try:
        date = datetime.date(year, month, day)
    except ValueError as error:
        raise FrameError(f"{text!r} is no {scale} date: {error}") from None
    if hour > 23 or minute > 59 or second > 60:
        raise FrameError(f"{text!r} is no {scale} date: there is no {hour:02d}:{minute:02d}:{second:02d}")
    return Calendar((date - J2000).days, hour, minute, second, Fraction(match.group(7) or 0))


def scale_of(text: str) -> str:
    """Return the time scale that a date names behind it; TDB for a date without a time of day that names none.

    Raises:
        FrameError: The text is no date, or has a time of day and no scale: UTC and TDB are 69 s apart.
    """
    match = _CALENDAR.fullmatch(text.strip())
    if match is None:
        raise FrameError(f"{text!r} is no date; write it as 2026-03-01, 2026-03-01T12:00:00.125 TDB or 2026-03-01T12:00:00.125 UTC")
    zone = (match.group(8) or "").upper()
    if not zone and match.group(4):
        date = text.strip()
        raise FrameError(f"{text!r} names no time scale, and UTC and TDB are 69 s apart: write '{date} TDB' or '{date} UTC'")
    if not zone:
        return "TDB"
    for scale, names in ZONES.items():
        if zone in names:
            return scale
    known = ", ".join(name for names in ZONES.values() for name in names)
    raise FrameError(f"{text!r} names no time scale that is known; after a date may stand {known}")


def uniform_seconds(text: str, scale: str) -> Fraction:
    """Return the exact seconds past J2000 noon of a date in a scale whose days all have 86400 seconds (FrameError)."""
    parts = read(text, scale)
    if parts.second > 59:
        raise FrameError(f"{text!r} is no {scale} date: only UTC has leap seconds")
    return parts.day * DAY + parts.of_day - NOON


def checked_digits(digits: int) -> int:
    """Return how many decimals of a second to write (FrameError unless it is a whole number from 0 to 30)."""
    if isinstance(digits, bool) or not isinstance(digits, int) or not 0 <= digits <= 30:
        raise FrameError(f"digits is how many decimals of a second to write, a whole number from 0 to 30, found {digits!r}")
    return digits


def uniform_text(seconds: Fraction, digits: int, otherwise: str) -> str:
    """Return the date of exact seconds past J2000 noon, rounded; ``otherwise`` names the scale where the calendar ends (FrameError)."""
    digits = checked_digits(digits)
    ticks = round(seconds * 10**digits) + NOON * 10**digits
    day, rest = divmod(ticks, DAY * 10**digits)
    written = date_text(day)
    return f"{otherwise} {float(seconds):.{digits}f} s" if written is None else f"{written}T{clock_text(rest, digits)}"


def date_text(day: int) -> str | None:
    """Return a day past 2000-01-01 as a date, None where the calendar of four-digit years ends."""
    try:
        return (J2000 + datetime.timedelta(days=day)).isoformat()
    except OverflowError:
        return None


def clock_text(ticks: int, digits: int) -> str:
    """Return a time of day given in parts of 10**digits to the second; the 86400th second is written 23:59:60."""
    second, fraction = divmod(ticks, 10**digits)
    minutes = min(second // 60, 1439)
    text = f"{minutes // 60:02d}:{minutes % 60:02d}:{second - minutes * 60:02d}"
    return text + (f".{fraction:0{digits}d}" if digits else "")


def tdb_seconds(text: str) -> Fraction:
    """Return the exact seconds past J2000 TDB of calendar text in TDB (FrameError)."""
    return uniform_seconds(text, "TDB")


def tdb_text(seconds: Fraction, digits: int = 3) -> str:
    """Return calendar text in TDB of exact seconds past J2000, rounded to ``digits`` decimals of a second."""
    return uniform_text(seconds, digits, "ET")
