"""Times of samples, on the host: intervals, segments between breaks, the index of intervals, weights that depend on times only."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from jaxframes.edges.spans import exact_span
from jaxframes.errors import EdgeError, FrameError
from jaxframes.numerics import host_two_part
from jaxframes.staging.arrays import default_float, is_concrete
from jaxframes.tables.index import AFTER_END, build_index
from jaxframes.tables.instants import reference_day, split
from jaxframes.time.epoch import EPOCH, Epoch
from jaxframes.time.seconds import host_pair


@dataclass(frozen=True)
class SampleTimes:
    """Times of samples with what follows from them.

    Attributes:
        past: Times in two parts past the reference, s [n] each.
        reference: Whole days past J2000 TDB, s.
        segments: First sample and the one after the last of each part without a break in between.
        left: For each record the sample where it starts; for a gap the last sample before it.
        gaps: Which records stand for a gap, bool [n_records].
        rows: ``[n_records, 3]``: middle of each record in two parts and half its length, NaN for gaps.
        index: Arrays that find a record, as ``tables.index`` makes them.
        compares: Most records that begin within one cell of the index.
    """

    past: host_two_part.Pair
    reference: int
    segments: tuple[tuple[int, int], ...]
    left: np.ndarray
    gaps: np.ndarray
    rows: np.ndarray
    index: dict[str, np.ndarray]
    compares: int

    @property
    def span(self) -> tuple[Fraction, Fraction]:
        """First and last time past the reference, exactly."""
        high, low = self.past
        return tuple(Fraction(high[i]) + Fraction(low[i]) for i in (0, -1))  # pyright: ignore[reportReturnType]


def sample_times(times: Any, longest_gap: float | None) -> SampleTimes:
    """Return the times of samples with what follows from them.

    Args:
        times: ``Epoch`` [n] or seconds past J2000 TDB [n], ascending; two equal ones are a break, from which on the later sample counts.
        longest_gap: Longest interval between two samples that is interpolated, s; longer ones are gaps. None: all are.

    Raises:
        EdgeError: They are traced, not finite, fewer than two, not in order, more than two at one instant, or alone at a break.
    """
    high, low = _two_parts(times)
    if high.ndim != 1 or len(high) < 2:
        raise EdgeError(f"Sampled(times=...) takes two or more instants along one axis [n], found shape {high.shape}")
    if not np.isfinite(high).all():
        raise EdgeError(f"Sampled: times[{int(np.flatnonzero(~np.isfinite(high))[0])}] is not finite")
    reference = int(reference_day(Fraction(high[0]) + Fraction(low[0])))
    past = host_two_part.add((high, low), (np.full_like(high, -float(reference)), np.zeros_like(high)))
    kept_high, kept_low = split(*past, np.dtype(default_float()))  # what the edge keeps of them is what everything follows from
    past = host_two_part.two_sum(kept_high.astype(np.float64), kept_low.astype(np.float64))
    steps = host_two_part.add((past[0][1:], past[1][1:]), (-past[0][:-1], -past[1][:-1]))[0]
    if (steps < 0).any():
        i = int(np.flatnonzero(steps < 0)[0])
        raise EdgeError(f"Sampled: times[{i + 1}] lies {-steps[i]:.9g} s before times[{i}]; sort the samples by time")
    if ((steps[1:] == 0) & (steps[:-1] == 0)).any():
        i = int(np.flatnonzero((steps[1:] == 0) & (steps[:-1] == 0))[0])
        raise EdgeError(
            f"Sampled: times[{i}] to times[{i + 2}] are one instant; two samples at one instant are a break, three are too many"
        )
    if longest_gap is not None and not longest_gap > 0:
        raise EdgeError(f"Sampled(longest_gap=...) is a length of time in s above zero, found {longest_gap!r}")
    is_gap = np.zeros(len(steps), bool) if longest_gap is None else steps > longest_gap
    breaks = np.flatnonzero((steps == 0) | is_gap) + 1
    segments = tuple(zip([0, *breaks.tolist()], [*breaks.tolist(), len(high)], strict=True))
    for first, last in segments:
        if last - first < 2:
            raise EdgeError(f"Sampled: times[{first}] stands alone between two breaks (equal times, or gaps); it needs a neighbour")
    kept = np.flatnonzero(steps > 0)
    rows, index, compares = _indexed(past, kept, is_gap[kept])
    return SampleTimes(past, reference, segments, kept, is_gap[kept], rows, index, compares)


def narrowed(times: SampleTimes, start: Any, stop: Any) -> tuple[Fraction, Fraction]:
    """Return the first and last instant covered, exact seconds past the reference.

    Args:
        times: Times of the samples.
        start: First instant, an ``Epoch``, seconds past J2000 TDB or text; None for that of the first sample.
        stop: Last instant, likewise.

    Raises:
        EdgeError: They lie outside of the samples, or the start after the stop.
    """
    first, last = times.span
    given = [None if end is None else end - times.reference for end in exact_span(start, stop, "Sampled")]
    low, high = (own if end is None else end for own, end in zip((first, last), given, strict=True))
    for name, end in (("start", low), ("stop", high)):
        if not first <= end <= last:
            raise EdgeError(f"Sampled({name}=...) lies {float(max(first - end, end - last)):.9g} s outside of the samples; leave it out")
    return low, high


def _two_parts(times: Any) -> host_two_part.Pair:
    if not all(map(is_concrete, (times.hi, times.lo) if isinstance(times, Epoch) else (times,))):
        raise EdgeError("Sampled(times=...) are known numbers: they cannot be traced; positions and attitudes can")
    if isinstance(times, Epoch):
        hi, lo = np.broadcast_arrays(np.asarray(times.hi, np.float64), np.asarray(times.lo, np.float64))
        return host_two_part.two_sum(hi, lo)
    try:
        return host_pair(np.asarray(times) if not isinstance(times, (list, tuple)) else times, EPOCH)
    except FrameError as error:
        raise EdgeError(f"Sampled(times=...): {error}") from None


def _indexed(past: host_two_part.Pair, kept: np.ndarray, gaps: np.ndarray) -> tuple[np.ndarray, dict[str, np.ndarray], int]:
    """Return the rows and the index of records between samples; a gap starts after the sample before it, which still counts."""
    high, low = past
    start, end = (high[kept], low[kept]), (high[kept + 1], low[kept + 1])
    middle = host_two_part.add((start[0] / 2, start[1] / 2), (end[0] / 2, end[1] / 2))
    half = host_two_part.add((end[0] / 2, end[1] / 2), (-start[0] / 2, -start[1] / 2))[0]
    rows = np.stack([*middle, np.where(gaps, np.nan, half)], 1)
    shift = np.where(gaps, float(AFTER_END), 0.0)
    starts = host_two_part.add(start, (shift, np.zeros_like(shift)))
    index, compares = build_index(starts, Fraction(high[-1]) + Fraction(low[-1]))
    return rows, index, compares


def spline_bands(times: SampleTimes, ends: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the equations of the rates of a C2 cubic spline, segment by segment (de Boor 1978, chapter IV).

    Args:
        times: The times.
        ends: ``"not-a-knot"`` or ``"natural"``.

    Returns:
        The three diagonals ``[n, 3]``, and by what the differences of neighbouring samples i-2 .. i+1 enter the right side ``[n, 4]``.
    """
    count = len(times.past[0])
    bands, sides = np.zeros((count, 3)), np.zeros((count, 4))
    bands[:, 1] = 1.0
    high, low = times.past
    steps = host_two_part.add((high[1:], low[1:]), (-high[:-1], -low[:-1]))[0]
    for first, last in times.segments:
        h = steps[first : last - 1]
        rows, right = bands[first:last], sides[first:last]  # right[i] multiplies differences i-2, i-1, i, i+1
        inner = slice(1, -1)
        rows[inner] = np.stack([h[1:], 2 * (h[1:] + h[:-1]), h[:-1]], 1)
        right[inner, 1], right[inner, 2] = 3 * h[1:] / h[:-1], 3 * h[:-1] / h[1:]
        if len(h) == 1:  # a straight line
            right[0, 2], right[1, 1] = 1 / h[0], 1 / h[0]
        elif ends == "natural":
            rows[0], rows[-1] = (0.0, 2.0, 1.0), (1.0, 2.0, 0.0)
            right[0, 2], right[-1, 1] = 3 / h[0], 3 / h[-1]
        elif len(h) == 2:  # a parabola
            rows[0], rows[-1] = (0.0, 1.0, 1.0), (1.0, 1.0, 0.0)
            right[0, 2], right[-1, 1] = 2 / h[0], 2 / h[1]
        else:
            a, b = h[0] + h[1], h[-1] + h[-2]
            rows[0], rows[-1] = (0.0, h[1], a), (b, h[-2], 0.0)
            right[0, 2], right[0, 3] = (h[0] + 2 * a) * h[1] / a / h[0], h[0] ** 2 / a / h[1]
            right[-1, 0], right[-1, 1] = h[-1] ** 2 / b / h[-2], (2 * b + h[-1]) * h[-2] / b / h[-1]
    return bands, sides


def lagrange_weights(times: SampleTimes, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of Lagrange's polynomials through neighbouring samples, as Chebyshev coefficients on each interval.

    Each interval takes the ``points`` samples about it, as many on either side where the segment has them (one more before it where their
    number is odd). Sums in extended precision: in double alone the error would be a thousand times as large.

    Args:
        times: The times.
        points: Samples that each polynomial goes through.

    Returns:
        ``[n_records, points * points]`` (coefficient by coefficient), and the first sample of each interval ``[n_records]``.

    Raises:
        EdgeError: A segment has fewer samples.
    """
    high, low = times.past
    first = np.zeros(len(times.left), int)
    for start, stop in times.segments:
        inside = (times.left >= start) & (times.left < stop)
        if stop - start < points:
            raise EdgeError(
                f"Sampled(method='lagrange', points={points}): {stop - start} samples from times[{start}] on up to a break; give fewer"
            )
        first[inside] = np.clip(times.left[inside] - (points - 1) // 2, start, stop - points)
    wide = np.longdouble
    at = first[:, None] + np.arange(points)
    half = np.where(times.gaps, 1.0, times.rows[:, 2]).astype(wide)
    s = ((high[at].astype(wide) - times.rows[:, :1]) + (low[at].astype(wide) - times.rows[:, 1:2])) / half[:, None]
    k = np.arange(points, dtype=wide)
    turns = (2 * k + 1) / (2 * wide(points)) * wide(np.pi)
    nodes = np.cos(turns)
    basis = np.ones((len(first), points, points), wide)  # of each sample's polynomial, at each node
    for j in range(points):
        for other in range(points):
            if other != j:
                basis[:, j] *= (nodes - s[:, other, None]) / (s[:, j] - s[:, other])[:, None]
    terms = np.cos(k[:, None] * turns) * (2 / wide(points))
    terms[0] /= 2
    weights = np.einsum("mk,rjk->rmj", terms, basis)
    return weights.reshape(len(first), -1).astype(np.float64), first
