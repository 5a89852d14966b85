"""Segments of binary kernels: their summaries, and which one serves which part of a span."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from jaxframes.errors import BadKernelError, NoPathError
from jaxframes.tables.index import AFTER_END

CHEBYSHEV_TYPES = {"SPK": (2, 3), "PCK": (2,)}
EXTRACTED = {"SPK": "2, 3, 8, 9, 12, 13 and 20", "PCK": "2"}
"""Types of segments that are read exactly."""
MOST = 1e15  # km, km/s or rad: a number beyond it (a hundred light years) is damage


@dataclass(frozen=True)
class Segment:
    """One segment of a binary SPK or PCK file. Times in ET seconds; addresses count double-precision words from one."""

    kind: str
    path: str
    handle: int
    body: int
    center: int
    frame: int
    type: int
    begin: float
    end: float
    first: int
    last: int
    directory: tuple[float, ...] | None
    name: str

    @property
    def series(self) -> int:
        """How many Chebyshev series a record holds: three, or six where velocities have their own."""
        return 6 if (self.kind, self.type) == ("SPK", 3) else 3

    def describe(self) -> str:
        """Return a short text for messages."""
        return f"segment {self.name!r} (type {self.type}, id {self.body}) of {Path(self.path).name}"

    def grid(self) -> tuple[float, float, int, int]:
        """Return (first record's start, record length, words a record, records) of a Chebyshev segment.

        Raises:
            NoPathError: If the segment is of a type that is not read.
            BadKernelError: If the numbers do not fit the segment's size: a damaged or truncated file.
        """
        if self.type not in CHEBYSHEV_TYPES[self.kind]:
            raise NoPathError(
                f"{self.describe()} is of a type that is not extracted: exact are {self.kind} types {EXTRACTED[self.kind]}. Load a kernel "
                "with another segment after it, or give tolerance=jf.spice.Tolerance(...) to have a table fitted to what SPICE computes."
            )
        damage = self._damage()
        if damage:
            raise damaged(self, damage)
        init, length, size, count = self.directory or (0.0, 0.0, 0.0, 0.0)
        return init, length, int(size), int(count)

    def _damage(self) -> str:
        if self.directory is None:
            return "the file ends before the segment does"
        init, length, size, count = self.directory
        if not all(math.isfinite(w) for w in self.directory) or size != int(size) or count != int(count):
            return f"its directory reads {self.directory}"
        if count < 1 or length <= 0 or size < 2 + self.series or (size - 2) % self.series:
            return f"it says {count:g} records of {size:g} words and {length:g} s"
        if self.last - self.first + 1 != size * count + 4:
            return f"{count:g} records of {size:g} words do not fill its {self.last - self.first + 1} words"
        slack = length * 1e-6
        if not (init - slack <= self.begin <= self.end <= init + length * count + slack):
            return f"its records cover ET {init:.3f} .. {init + length * count:.3f}, its summary says {self.begin:.3f} .. {self.end:.3f}"
        return ""


@dataclass(frozen=True)
class CkSegment:
    """One segment of a C-kernel; begin and end are encoded ticks of the clock."""

    path: str
    handle: int
    instrument: int
    frame: int
    type: int
    has_rates: bool
    begin: float
    end: float
    first: int
    last: int
    name: str

    def describe(self) -> str:
        """Return a short text for messages."""
        return f"segment {self.name!r} (CK type {self.type}, id {self.instrument}) of {Path(self.path).name}"


def damaged(segment: Segment | CkSegment, damage: str) -> BadKernelError:
    """Return the error to raise over a segment that contradicts itself."""
    return BadKernelError(f"{segment.describe()} is damaged or cut off: {damage}. Fetch the file again, or load another one after it.")


@dataclass(frozen=True)
class Piece:
    """A segment in the part of a span that it serves; of two that meet, the one of higher rank serves the instant at which they do."""

    segment: Segment
    start: Fraction
    stop: Fraction
    rank: int = 0


def open_starts(pieces: Sequence[Piece]) -> list[bool]:
    """Return for each of consecutive pieces whether its first instant belongs to the one before: SPICE takes segments as closed."""
    return [False, *(a.rank > b.rank and a.stop == b.start for a, b in pairwise(pieces))]


@dataclass(frozen=True)
class Records:
    """Records that serve one part of a span, in time order.

    Attributes:
        coefficients: ``[n, series, terms]``, in the kernel's unit (km, km/s or rad).
        middle: Middle of each record, ET seconds, as stored.
        radius: Half length, seconds, as stored.
        origin: Exact start of the first record, by the segment's directory.
        step: Exact length of a record.
        start: Instant from which the first record serves.
        stop: Instant up to which the last one serves.
        inner: Instants between the records where these are of unequal length; None where they are ``step`` long.
        apart: By how much SPICE's own velocities differ from the derivatives of its positions, m/s.
        open_start: Whether the instant ``start`` itself belongs to the records before.
    """

    coefficients: np.ndarray
    middle: np.ndarray
    radius: np.ndarray
    origin: Fraction
    step: Fraction
    start: Fraction
    stop: Fraction
    inner: tuple[Fraction, ...] | None = None
    apart: float = 0.0
    open_start: bool = False

    def starts(self) -> list[Fraction]:
        """Return the exact instant from which each record serves."""
        start = self.start + (AFTER_END if self.open_start else 0)
        if self.inner is not None:
            return [start, *self.inner]
        return [start, *(self.origin + i * self.step for i in range(1, len(self.middle)))]


def select(segments: Iterable[Segment], start: Fraction, stop: Fraction) -> tuple[list[Piece], list[tuple[Fraction, Fraction]]]:
    """Return which segment serves which part of a span, in time order, and the gaps that none serves.

    Args:
        segments: Segments of one body, in order of loading; as in SPICE the last one that covers an instant wins, both ends included.
        start: Start of the span.
        stop: End of the span.
    """
    pieces: list[Piece] = []
    gaps = [(start, stop)]
    for rank, segment in reversed(list(enumerate(segments))):
        begin, end = Fraction(segment.begin), Fraction(segment.end)
        left: list[tuple[Fraction, Fraction]] = []
        # Few of the gaps touch a segment: there may be thousands of both.
        i = bisect_left(gaps, begin, key=lambda gap: gap[1])
        j = bisect_right(gaps, end, lo=i, key=lambda gap: gap[0])
        for a, b in gaps[i:j]:
            low, high = max(a, begin), min(b, end)
            if low == high and a < b:
                left.append((a, b))
                continue
            pieces.append(Piece(segment, low, high, rank))
            left += [(a, low)] if a < low else []
            left += [(high, b)] if high < b else []
        gaps[i:j] = left
        if not gaps:
            break
    return sorted(pieces, key=lambda piece: piece.start), gaps


def kept_ends(segments: Iterable[Segment], start: Fraction, stop: Fraction) -> set[Fraction]:
    """Return the instants within a span that the segment that ends there keeps, and not the one that starts there."""
    listed = list(segments)
    found = set[Fraction]()
    for body in {s.body for s in listed}:
        pieces, _ = select([s for s in listed if s.body == body], start, stop)
        found |= {piece.start for piece, is_open in zip(pieces, open_starts(pieces), strict=True) if is_open}
    return found


def coverage(segments: Iterable[Segment]) -> list[tuple[Fraction, Fraction]]:
    """Return the spans that a body's segments cover, merged where they touch."""
    merged: list[tuple[Fraction, Fraction]] = []
    for begin, end in sorted((Fraction(s.begin), Fraction(s.end)) for s in segments):
        if merged and begin <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((begin, end))
    return merged
