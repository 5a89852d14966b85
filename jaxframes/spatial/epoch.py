"""Epoch: an instant as seconds past J2000 TDB in two parts, so that nothing is lost to rounding."""

import datetime
import re
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError
from jaxframes.numerics.boundary import as_float, default_float, is_concrete
from jaxframes.numerics.eft import fast_two_sum, two_sum
from jaxframes.spatial.utc import utc_seconds
from jaxframes.spatial.value import tag

_J2000 = datetime.datetime(2000, 1, 1, 12)
_CALENDAR = re.compile(r"(\d{4})-(\d\d)-(\d\d)(?:[T ](\d\d):(\d\d)(?::(\d\d)(\.\d+)?)?)?(?:\s*TDB)?")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class Epoch:
    """An instant: ``hi + lo`` seconds past J2000 (2000-01-01T12:00:00) in barycentric dynamical time, TDB.

    One 64-bit number of seconds in 2026 is spaced 1.2e-7 s, in which the Moon moves 0.1 mm and the Earth 3.6 mm; one 32-bit
    number is spaced 64 s. Two parts resolve 1e-23 s and 4e-6 s. ``hi`` and ``lo`` have one shape [...]; both are leaves, and
    the derivative of anything with respect to either is its time derivative. Durations are plain seconds.

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
        """
        if isinstance(seconds, Epoch):
            return seconds
        if isinstance(seconds, (int, Fraction)) and not isinstance(seconds, bool):
            return cls._from_exact(Fraction(seconds))
        if seconds is None or isinstance(seconds, (str, bool)):
            raise FrameError(f"an epoch is seconds past J2000 TDB, found {seconds!r}; for a date use Epoch.from_tdb or Epoch.from_utc")
        return cls(*_two_parts(seconds, None))

    @classmethod
    def from_parts(cls, hi: Any, lo: Any) -> "Epoch":
        """Return the epoch ``hi + lo`` seconds past J2000 TDB of two arrays of one shape [...], e.g. whole and fraction."""
        return cls(*two_sum(as_float(hi), as_float(lo)))

    @classmethod
    def from_tdb(cls, text: str) -> "Epoch":
        """Return the epoch of a calendar date in TDB, such as ``2026-03-01`` or ``2026-03-01T12:00:00.125`` (exact).

        Raises:
            FrameError: The text is no such date.
        """
        return cls._from_exact(tdb_seconds(text))

    @classmethod
    def from_utc(cls, text: str) -> "Epoch":
        """Return the epoch of a calendar date in UTC, such as ``2026-03-01T00:00:00`` (leap seconds ship with the package).

        Raises:
            FrameError: The text is no such date, or lies before 1972.
        """
        return cls._from_exact(utc_seconds(text))

    @classmethod
    def _from_exact(cls, seconds: Fraction) -> "Epoch":
        number = np.dtype(default_float()).type
        hi = number(float(seconds))
        return cls(jnp.asarray(hi), jnp.asarray(number(float(seconds - Fraction(float(hi))))))

    @property
    def et(self) -> jax.Array:
        """Seconds past J2000 TDB in one number, [...]: rounded to the spacing of the dtype."""
        return self.hi + self.lo

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape."""
        return jnp.broadcast_shapes(jnp.shape(self.hi), jnp.shape(self.lo))

    def __add__(self, seconds: Any) -> "Epoch":
        """Return the epoch a duration later; the rounding error of the high part moves to the low part."""
        if isinstance(seconds, Epoch):
            raise FrameError("two epochs cannot be added; add a duration in seconds, or subtract the epochs")
        coarse, fine = _two_parts(seconds, self.hi.dtype)
        hi, error = two_sum(*_same_rank(self.hi, coarse))
        low, rest = _same_rank(*_same_rank(hi, self.lo)[1:], fine)
        return Epoch(*fast_two_sum(hi, error + (low + rest)))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        """Return the duration since another epoch in seconds [...], or the epoch a duration earlier."""
        if not isinstance(other, Epoch):
            return self + (-other)
        a, b = _same_rank(self.hi, other.hi)
        c, d = _same_rank(self.lo, other.lo)
        s, e = two_sum(a, -b)
        return s + (e + (c - d))

    def __getitem__(self, index: Any) -> "Epoch":
        hi, lo = _same_rank(self.hi, self.lo)
        return Epoch(hi[index], lo[index])

    def replace(self, **changes: Any) -> "Epoch":
        """Return a copy with the fields given replaced."""
        return replace(self, **changes)

    def to_tdb(self, digits: int = 3) -> str:
        """Return one epoch as calendar text in TDB, rounded to ``digits`` decimals of a second (host only)."""
        return tdb_text(Fraction(float(self.hi)) + Fraction(float(self.lo)), digits)

    def __repr__(self) -> str:
        if isinstance(self.hi, (jax.Array, np.ndarray)) and is_concrete(self.hi):
            if np.ndim(self.hi) == 0 and np.isfinite(self.hi):
                return f"Epoch({self.to_tdb(6)} TDB)"
            return f"Epoch(shape={np.shape(self.hi)})"
        return f"Epoch(hi={self.hi!r}, lo={self.lo!r})"


def _two_parts(seconds: Any, dtype: Any) -> tuple[jax.Array, jax.Array]:
    """Return a number of seconds in two parts; numbers of the host and integers are split, so that none of their digits is lost."""
    if isinstance(seconds, jax.Array) and jnp.issubdtype(seconds.dtype, jnp.integer):
        coarse = (seconds >> 12) << 12
        parts = coarse, seconds - coarse
        return tuple(part.astype(dtype or default_float()) for part in parts)  # pyright: ignore[reportReturnType]
    if isinstance(seconds, jax.Array) and not (seconds.weak_type and is_concrete(seconds)):
        hi = as_float(seconds) if dtype is None else as_float(seconds).astype(dtype)
        return hi, jnp.zeros_like(hi)
    exact, kind = np.asarray(seconds, np.float64), np.dtype(dtype or default_float())
    hi = exact.astype(kind)
    return jnp.asarray(hi), jnp.asarray((exact - hi.astype(np.float64)).astype(kind))


def _same_rank(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    shape = jnp.broadcast_shapes(a.shape, b.shape)
    return jnp.broadcast_to(a, shape), jnp.broadcast_to(b, shape)


def tdb_seconds(text: str) -> Fraction:
    """Return the exact seconds past J2000 TDB of calendar text in TDB.

    Raises:
        FrameError: The text is no such date.
    """
    match = _CALENDAR.fullmatch(text.strip())
    if match is None:
        raise FrameError(f"{text!r} is no TDB date; write it as 2026-03-01 or 2026-03-01T12:00:00.125 (optionally with TDB)")
    year, month, day, hour, minute, second = (int(g or 0) for g in match.groups()[:6])
    try:
        whole = datetime.datetime(year, month, day, hour, minute, second) - _J2000
    except ValueError as error:
        raise FrameError(f"{text!r} is no TDB date: {error}") from None
    return Fraction(whole.days * 86400 + whole.seconds) + Fraction(match.group(7) or 0)


def tdb_text(seconds: Fraction, digits: int = 3) -> str:
    """Return calendar text in TDB of exact seconds past J2000, rounded to ``digits`` decimals of a second."""
    ticks = round(seconds * 10**digits)
    whole, fraction = divmod(ticks, 10**digits)
    days, rest = divmod(whole, 86400)
    try:
        stamp = _J2000 + datetime.timedelta(days=days, seconds=rest)
    except OverflowError:
        return f"ET {float(seconds):.{digits}f} s"
    return stamp.strftime(f"{stamp.year:04d}-%m-%dT%H:%M:%S") + (f".{fraction:0{digits}d}" if digits else "")
