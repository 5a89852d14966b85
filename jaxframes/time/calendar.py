"""Calendar text on the host: dates and times of uniform scales to exact seconds past J2000 noon, and back."""

import datetime
import re
from fractions import Fraction
from typing import NamedTuple

from jaxframes.errors import FrameError

J2000 = datetime.date(2000, 1, 1)
NOON = 43200
DAY = 86400
JULIAN = Fraction(4903089, 2)
"""Julian date of 2000-01-01T00:00:00: 2451544.5."""
_DATE = re.compile(
    r"(?:(?P<year>\d{4})-(?:(?P<month>\d\d)-(?P<day>\d\d)|(?P<ordinal>\d{3}))"
    r"(?P<clock>[T ](?P<hour>\d\d):(?P<minute>\d\d)(?::(?P<second>\d\d)(?P<fraction>\.\d{1,60})?)?)?"
    r"|JD\s?(?P<julian>\d{1,9}(?:\.\d{1,60})?))"
    r"\s*(?P<zone>[A-Za-z]+|[+-]\d\d:\d\d)?"
)
ZONES = {"TDB": ("TDB",), "TT": ("TT", "TDT"), "TAI": ("TAI",), "UTC": ("UTC", "Z")}
"""What may stand after a date, for each time scale; an offset such as +02:00 is of UTC."""
FORMS = ("calendar", "ordinal", "julian")


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
    """Return the parts of a date, optionally followed by its time scale; of UTC with an offset, those in UTC.

    Dates are ``2026-03-01``, ``2026-060`` (year and day of it), with a time of day ``T12:00:00.125``, or ``JD 2461100.5``. Seconds up to 60
    are taken: whether the sixtieth exists is for the scale to say. A Julian date counts days of 86400 s, in UTC too.

    Raises:
        FrameError: The text is no such date, or names another scale.
    """
    match = _DATE.fullmatch(text.strip())
    zone = (match["zone"] or "").upper() if match else ""
    offset = scale == "UTC" and zone[:1] in ("+", "-")
    if match is None or (zone and zone not in ZONES[scale] and not offset):
        allowed = " or ".join((*ZONES[scale], *(("+02:00",) if scale == "UTC" else ())))
        raise FrameError(f"{shown(text)} is no {scale} date; {HOW}, optionally with {allowed}")
    if match["julian"]:
        day, rest = divmod(Fraction(match["julian"]) - JULIAN, 1)
        minutes, seconds = divmod(rest * DAY, 60)
        return _shifted(Calendar(day, *divmod(int(minutes), 60), int(seconds), seconds % 1), zone if offset else "")
    hour, minute, second = (int(match[name] or 0) for name in ("hour", "minute", "second"))
    try:
        date = datetime.date(int(match["year"]), int(match["month"] or 1), int(match["day"] or 1))
        if match["ordinal"]:
            date = _of_year(date, int(match["ordinal"]))
    except ValueError as error:
        raise FrameError(f"{shown(text)} is no {scale} date: {error}") from None
    if hour > 23 or minute > 59 or second > 60:
        raise FrameError(f"{shown(text)} is no {scale} date: there is no {hour:02d}:{minute:02d}:{second:02d}")
    parts = Calendar((date - J2000).days, hour, minute, second, Fraction(match["fraction"] or 0))
    return _shifted(parts, zone if offset else "")


HOW = "write it as 2026-03-01, 2026-03-01T12:00:00.125, 2026-060T12:00 (day of the year) or JD 2461101.0"


def shown(text: str) -> str:
    """Return text as it stands in messages: in quotes, and not at any length."""
    return repr(text) if len(text) <= 80 else f"{text[:80]!r}... ({len(text)} characters)"


def _of_year(first: datetime.date, ordinal: int) -> datetime.date:
    found = first + datetime.timedelta(days=ordinal - 1)
    if found.year != first.year:
        raise ValueError(f"{first.year} has no day {ordinal}")
    return found


def minutes_of(offset: str) -> int:
    """Return an offset from UTC such as ``+02:00`` in minutes (FrameError)."""
    match = re.fullmatch(r"([+-])(\d\d):(\d\d)", offset) if isinstance(offset, str) else None
    if match is None or int(match[2]) > 23 or int(match[3]) > 59:
        raise FrameError(f"an offset from UTC is written as +02:00 or -05:30, up to 23:59; found {offset!r}")
    return (int(match[2]) * 60 + int(match[3])) * (-1 if match[1] == "-" else 1)


def _shifted(parts: Calendar, offset: str) -> Calendar:
    """Return a date in UTC of one with an offset: hours and minutes move, a sixtieth second stays one."""
    if not offset:
        return parts
    days, minutes = divmod(parts.hour * 60 + parts.minute - minutes_of(offset), 1440)
    return Calendar(parts.day + days, *divmod(minutes, 60), parts.second, parts.fraction)


def scale_of(text: str) -> str:
    """Return the time scale that a date names behind it; TDB for a date without a time of day that names none.

    Raises:
        FrameError: The text is no date, or has a time of day and no scale: UTC and TDB are 69 s apart.
    """
    match = _DATE.fullmatch(text.strip())
    if match is None:
        raise FrameError(f"{shown(text)} is no date; {HOW}, and after a time of day TDB, UTC, TT, TAI or an offset from UTC")
    zone = (match["zone"] or "").upper()
    if not zone and (match["clock"] or match["julian"]):
        date = text.strip()
        raise FrameError(f"{shown(text)} names no time scale, and UTC and TDB are 69 s apart: write '{date} TDB' or '{date} UTC'")
    if not zone:
        return "TDB"
    for scale, names in ZONES.items():
        if zone in names or (scale == "UTC" and zone[:1] in ("+", "-")):
            return scale
    known = ", ".join(name for names in ZONES.values() for name in names)
    raise FrameError(f"{shown(text)} names no time scale that is known; after a date may stand {known} or an offset such as +02:00")


def uniform_seconds(text: str, scale: str) -> Fraction:
    """Return the exact seconds past J2000 noon of a date in a scale whose days all have 86400 seconds (FrameError)."""
    parts = read(text, scale)
    if parts.second > 59:
        raise FrameError(f"{shown(text)} is no {scale} date: only UTC has leap seconds")
    return parts.day * DAY + parts.of_day - NOON


def checked_digits(digits: int) -> int:
    """Return how many decimals of a second to write (FrameError unless it is a whole number from 0 to 30)."""
    if isinstance(digits, bool) or not isinstance(digits, int) or not 0 <= digits <= 30:
        raise FrameError(f"digits is how many decimals of a second to write, a whole number from 0 to 30, found {digits!r}")
    return digits


def uniform_text(seconds: Fraction, digits: int, otherwise: str, form: str = "calendar") -> str:
    """Return the date of exact seconds past J2000 noon, rounded.

    Args:
        seconds: Seconds past noon of 2000-01-01.
        digits: Decimals of a second.
        otherwise: Names the scale where the calendar ends.
        form: As in ``text_of``.

    Raises:
        FrameError: Digits or form are none.
    """
    digits = checked_digits(digits)
    day, rest = divmod(round(seconds * 10**digits) + NOON * 10**digits, DAY * 10**digits)
    written = text_of(day, rest, digits, form)
    return f"{otherwise} {float(seconds):.{digits}f} s" if written is None else written


def text_of(day: int, ticks: int, digits: int, form: str, leap: bool = False) -> str | None:
    """Return a day past 2000-01-01 and a time of day as text, None where the calendar of four-digit years ends.

    Args:
        day: The day.
        ticks: Time of day in parts of 10**digits to the second.
        digits: Decimals of a second.
        form: ``"calendar"`` for 2026-03-01T12:00:00.000, ``"ordinal"`` for 2026-060T12:00:00.000, ``"julian"`` for JD 2461101.00000000.
        leap: Whether it is the second after the one that is given, at the end of its minute: the sixtieth.

    Raises:
        FrameError: There is no such form, or a Julian date cannot say a leap second.
    """
    if form not in FORMS:
        raise FrameError(f"form is one of {', '.join(map(repr, FORMS))}; found {form!r}")
    if form == "julian":
        if leap:
            raise FrameError("a Julian date cannot say a leap second; write it in another form")
        whole = JULIAN + day + Fraction(ticks, DAY * 10**digits)
        units, places = 10 ** (digits + 6), digits + 6  # a unit of the last place is a twelfth of that of a second
        count = round(whole * units)
        return f"JD {count // units}.{count % units:0{places}d}"
    written, clock = date_text(day, form), clock_text(ticks, digits)
    if written is None:
        return None
    return f"{written}T{clock[:6]}60{clock[8:]}" if leap else f"{written}T{clock}"


def date_text(day: int, form: str = "calendar") -> str | None:
    """Return a day past 2000-01-01 as a calendar or ordinal date, None where the calendar of four-digit years ends."""
    try:
        date = J2000 + datetime.timedelta(days=day)
    except OverflowError:
        return None
    return date.isoformat() if form == "calendar" else f"{date.year:04d}-{date.timetuple().tm_yday:03d}"


def clock_text(ticks: int, digits: int) -> str:
    """Return a time of day given in parts of 10**digits to the second."""
    second, fraction = divmod(ticks, 10**digits)
    text = f"{second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d}"
    return text + (f".{fraction:0{digits}d}" if digits else "")


def tdb_seconds(text: str) -> Fraction:
    """Return the exact seconds past J2000 TDB of calendar text in TDB (FrameError)."""
    return uniform_seconds(text, "TDB")


def tdb_text(seconds: Fraction, digits: int = 3) -> str:
    """Return calendar text in TDB of exact seconds past J2000, rounded to ``digits`` decimals of a second."""
    return uniform_text(seconds, digits, "ET")
