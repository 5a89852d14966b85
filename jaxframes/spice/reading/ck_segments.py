"""C-kernel segments of types 1 to 3 as intervals in each of which the attitude turns about one axis."""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from typing import Self

import numpy as np

from jaxframes.errors import NoPathError
from jaxframes.numerics import host_quaternions
from jaxframes.spice.reading.naming import FrameFacts
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segments import CkSegment, damaged

KNOTS = (1, 2, 3)
DIRECTORY = 100
MOST = 1e30  # a clock's ticks are the largest numbers here
GRACE = Fraction(1, 10**5)
"""A gap starts so many seconds after the data end, and ends as long before they go on: the last and the first instant belong to the data,
also as epochs of two float32."""


CONTRADICTION = 1.5
"""So many times what noise, jumps and the motion itself explain is a contradiction between rates and attitudes."""
RATE_DIGITS, ATTITUDE_DIGITS = 1e-6, 1e-8
"""Rates are taken to be good to so many parts of themselves, attitudes to so many radians."""


@dataclass(frozen=True)
class Intervals:
    """Intervals in time order, none overlapping; the pose o_T_p with o the segment's base frame.

    Attributes:
        start: Encoded ticks [n].
        stop: Encoded ticks [n].
        q: Quaternion at the start [n, 4].
        rotation_vector: Rotation vector over the interval, in o axes [n, 3].
        w0: Angular velocity at the start, in o axes [n, 3].
        w1: Angular velocity at the end [n, 3].
        even: Whether the rotation is at an even rate by definition [n]: type 2, all of whose attitudes the kernel gives.
        rank: Place of the segment in order of loading [n]: of two intervals that meet, the higher serves the instant at which they do.
    """

    start: np.ndarray
    stop: np.ndarray
    q: np.ndarray
    rotation_vector: np.ndarray
    w0: np.ndarray
    w1: np.ndarray
    even: np.ndarray
    rank: np.ndarray

    def take(self, which: np.ndarray) -> Self:
        """Return some of the intervals."""
        return type(self)(*(getattr(self, f.name)[which] for f in fields(self)))

    def cut(self, low: np.ndarray, high: np.ndarray) -> Self:
        """Return the intervals cut to [low, high]: on the same arc, rates interpolated linearly."""
        width = self.stop - self.start
        a, b = np.maximum(low, self.start), np.minimum(high, self.stop)
        u0, u1 = ((a - self.start) / width)[:, None], ((b - self.start) / width)[:, None]
        q = host_quaternions.multiply(host_quaternions.from_rotation_vector(self.rotation_vector * u0), self.q)
        slope = self.w1 - self.w0
        w0, w1 = self.w0 + slope * u0, self.w0 + slope * u1
        return type(self)(a, b, q, self.rotation_vector * (u1 - u0), w0, w1, self.even, self.rank)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return several runs of intervals as one, in time order."""
        whole = cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))
        return whole.take(np.argsort(whole.start, kind="stable"))

    def windows(self) -> list[tuple[float, float]]:
        """Return the spans of ticks that the intervals cover, merged where they touch."""
        breaks = np.flatnonzero(self.start[1:] > self.stop[:-1])
        return list(zip(self.start[[0, *(breaks + 1)]], self.stop[[*breaks, -1]], strict=True))


def segments_serving(pool: KernelPool, of: FrameFacts) -> list[CkSegment]:
    """Return the C-kernel segments of a frame in order of loading: later ones win.

    Raises:
        NoPathError: If none is loaded.
    """
    found = pool.ck_segments(of.class_id)
    if not found:
        raise NoPathError(f"No C-kernel segment for {of.name} (CK id {of.class_id}) is loaded: load the C-kernel (.bc) of this frame.")
    return found


def read_intervals(pool: KernelPool, segment: CkSegment, seconds_a_tick: float, bridge: float | None) -> Intervals:
    """Return a segment's intervals.

    Args:
        pool: The kernels.
        segment: The segment, of type 1, 2 or 3.
        seconds_a_tick: Length of a tick (to interpolate rates and bridge instances, not to date them).
        bridge: For type 1: instances up to so many seconds apart are joined.

    Raises:
        NoPathError: If the segment is of type 1 and nothing says which instances may be joined.
        BadKernelError: If the segment is damaged.
    """
    size = segment.last - segment.first + 1
    words = pool.words(segment, segment.first, segment.last)
    if not (np.abs(words) < MOST).all():
        raise damaged(segment, "its words are not all numbers of a plausible size")
    if segment.type == 2:
        return _spins(segment, words)
    width = 7 if segment.has_rates else 4
    starts = np.zeros(0)
    if segment.type == 3:
        tail = words[-2:]
        n, m = int(tail[1]), int(tail[0])
        whole = (width + 1) * n + (n - 1) // DIRECTORY + m + (m - 1) // DIRECTORY + 2
        if n < 1 or m < 1 or (n, m) != (tail[1], tail[0]) or whole != size:
            raise damaged(segment, f"{tail[1]:g} records and {tail[0]:g} intervals do not fill its {size} words")
        at = (width + 1) * n + (n - 1) // DIRECTORY
        starts = words[at : at + m]
    else:
        n = int(words[-1])
        if n < 1 or n != words[-1] or (width + 1) * n + (n - 1) // DIRECTORY + 1 != size:
            raise damaged(segment, f"{words[-1]:g} records do not fill its {size} words")
        if bridge is None:
            raise NoPathError(
                f"{segment.describe()} has attitudes at {n} instants only: SPICE has none in between. Give bridge=, the longest time in "
                "seconds between two of them over which to interpolate."
            )
    packets, ticks = words[: width * n].reshape(n, width), words[width * n : (width + 1) * n]
    if not (np.diff(ticks) > 0).all():
        raise damaged(segment, "its times are not in order")
    if segment.type == 3:
        joined = np.searchsorted(starts, ticks[:-1], "right") == np.searchsorted(starts, ticks[1:], "right")
    else:
        joined = np.diff(ticks) * seconds_a_tick <= float(bridge or 0.0)
    q = _poses(segment, packets[:, :4])
    vector = host_quaternions.vector_of(host_quaternions.multiply(q[1:], host_quaternions.conjugate(q[:-1])))
    w0, w1 = (packets[:-1, 4:], packets[1:, 4:]) if segment.has_rates else (np.zeros_like(vector), np.zeros_like(vector))
    even, rank = np.zeros(n - 1, bool), np.zeros(n - 1)
    found = Intervals(ticks[:-1], ticks[1:], q[:-1], vector, w0, w1, even, rank).take(np.flatnonzero(joined))
    return found if segment.has_rates else with_own_rates(found, seconds_a_tick)


def _spins(segment: CkSegment, words: np.ndarray) -> Intervals:
    """Return the intervals of a type 2 segment: a constant spin each, at the rate of the clock that the segment itself states."""
    n = round((len(words) * DIRECTORY + 1) / (10 * DIRECTORY + 1))
    if n < 1 or 10 * n + (n - 1) // DIRECTORY != len(words):
        raise damaged(segment, f"{n} intervals do not fill its {len(words)} words")
    packets = words[: 8 * n].reshape(n, 8)
    start, stop, rate = words[8 * n : 9 * n], words[9 * n : 10 * n], packets[:, 4:7]
    if not (stop > start).all() or not (start[1:] >= stop[:-1]).all():
        raise damaged(segment, "its intervals are not in order")
    vector = rate * ((stop - start) * packets[:, 7])[:, None]
    return Intervals(start, stop, _poses(segment, packets[:, :4]), vector, rate, rate, np.ones(n, bool), np.zeros(n))


def _poses(segment: CkSegment, spice: np.ndarray) -> np.ndarray:
    """Return quaternions of o_T_p: SPICE stores those that take base coordinates to the instrument's."""
    size = np.linalg.norm(np.clip(spice, -1e3, 1e3), axis=1, keepdims=True)
    if not ((size > 0.5) & (size < 2.0)).all():
        raise damaged(segment, "its quaternions are not of unit length")
    return host_quaternions.conjugate(spice / size)


def with_own_rates(intervals: Intervals, seconds_a_tick: float) -> Intervals:
    """Return intervals with rates estimated from their attitudes: parabolas through the mean rates on both sides of a knot.

    At the ends of a run of intervals the parabola next to it goes on; an interval alone turns evenly.
    """
    length = ((intervals.stop - intervals.start) * seconds_a_tick)[:, None]
    mean = intervals.rotation_vector / length
    at_start, at_end = mean.copy(), mean.copy()
    both = np.flatnonzero(intervals.stop[:-1] == intervals.start[1:])
    h0, h1 = length[both], length[both + 1]
    knot = (mean[both] * h1 + mean[both + 1] * h0) / (h0 + h1)
    at_end[both], at_start[both + 1] = knot, knot
    first = np.setdiff1d(both, both + 1)
    last = np.setdiff1d(both + 1, both)
    at_start[first], at_end[last] = 2 * mean[first] - at_end[first], 2 * mean[last] - at_start[last]
    return replace(intervals, w0=at_start, w1=at_end)


def rate_contradiction(intervals: Intervals, seconds_a_tick: float) -> float:
    """Return by how much, in rad over an interval, recorded rates contradict the attitudes; 0 where they belong together.

    Over an interval the mean of the rates at its ends is that of the attitudes but for what the motion, noise or a jump makes of it, which
    show in how rates and mean rates change from one interval to the next. What is far beyond both, in three intervals and more, is none of
    these: rates of zero, in other axes, in degrees.
    """
    length = (intervals.stop - intervals.start) * seconds_a_tick
    mean = intervals.rotation_vector / length[:, None]
    apart = np.linalg.norm((intervals.w0 + intervals.w1) / 2 - mean, axis=1) * length
    touch = intervals.stop[:-1] == intervals.start[1:]
    change = np.where(touch, np.linalg.norm(mean[1:] - mean[:-1], axis=1), np.nan)
    beside = np.fmax(np.append(np.nan, change), np.append(change, np.nan))  # NaN where an interval has no neighbour to tell it by
    allowed = CONTRADICTION * length * (beside + np.linalg.norm(intervals.w1 - intervals.w0, axis=1))
    floor = RATE_DIGITS * length * np.linalg.norm(mean, axis=1) + ATTITUDE_DIGITS
    odd = apart > allowed + floor
    return float(apart[odd].max()) if odd.sum() >= 3 else 0.0


def layered(runs: Sequence[tuple[CkSegment, Intervals]], low: float, high: float) -> tuple[Intervals | None, list[CkSegment]]:
    """Return the intervals that serve a span of ticks, and the segments they are of: later segments win where several have data.

    Args:
        runs: Segments in order of loading with their intervals.
        low: Start of the span, ticks.
        high: End of the span.
    """
    free = [(low, high)]
    parts: list[Intervals] = []
    used: list[CkSegment] = []
    for rank, (segment, intervals) in reversed(list(enumerate(runs))):
        # Few of the spans that are still free touch a segment: there may be thousands of both.
        i = bisect_right(free, segment.begin, key=lambda span: span[1])
        j = bisect_left(free, segment.end, lo=i, key=lambda span: span[0])
        left: list[tuple[float, float]] = []
        before = len(parts)
        for a, b in free[i:j]:
            a1, b1 = max(a, segment.begin), min(b, segment.end)
            first, last = np.searchsorted(intervals.stop, a1, "right"), np.searchsorted(intervals.start, b1, "left")
            if first >= last:
                left.append((a, b))
                continue
            chosen = intervals.take(np.arange(first, last))
            chosen = replace(chosen, rank=np.full(last - first, float(rank)))
            if chosen.start[0] < a1 or chosen.stop[-1] > b1:
                chosen = chosen.cut(np.full(last - first, a1), np.full(last - first, b1))
            parts.append(chosen)
            at = a
            for c, d in chosen.windows():
                left += [(at, c)] if c > at else []
                at = d
            left += [(at, b)] if b > at else []
        free[i:j] = left
        if len(parts) > before:
            used.append(segment)
    return (Intervals.joined(parts) if parts else None), used[::-1]
