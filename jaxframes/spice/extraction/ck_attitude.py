"""Extraction of C-kernel attitudes (CK types 1 to 3): which segments serve, knots in time, gaps."""

import warnings
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from jaxframes.errors import CoverageError, FrameWarning, NoPathError
from jaxframes.numerics import host_quaternions, host_two_part
from jaxframes.spice import accuracy
from jaxframes.spice.assembly import assembled
from jaxframes.spice.options import OrientationRequest
from jaxframes.spice.reading.ck_segments import (
    GRACE,
    KNOTS,
    Intervals,
    layered,
    rate_contradiction,
    read_intervals,
    segments_serving,
    with_own_rates,
)
from jaxframes.spice.reading.clocks import Clock, clock_of
from jaxframes.spice.reading.naming import INERTIAL, FrameFacts
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segment_paths import Span, open_ends, uncovered
from jaxframes.spice.reading.segments import CkSegment
from jaxframes.tables.attitude import MODES, AttitudeTable
from jaxframes.tables.index import AFTER_END, build_index
from jaxframes.tables.instants import exact_seconds, reference_day, span_text
from jaxframes.tables.records import HostRecordTable

BEND = 1e-11
"""Radians that an attitude may be off where the clock's time is taken to be even in TDB."""
ROUNDED = Fraction(1, 10**6)
"""Seconds that an instant asked for may lie outside the data: CSPICE rounds the ends that it tells."""


def attitude(pool: KernelPool, request: OrientationRequest) -> AttitudeTable:
    """Return the edge of a CK frame from segments of types 1 to 3.

    Raises:
        NoPathError: If segments are of other types, or relative to a frame that turns against ``base``.
        CoverageError: If the data do not cover the start and the stop that are given. Gaps between these are kept and reported.
        MissingKernelError: If the clock is not known.
    """
    of, base, ck = request.of, request.base, request.ck
    if ck not in MODES:
        raise NoPathError(f"ck={ck!r}: attitudes between knots are 'smooth' or as 'spice' has them.")
    segments = segments_serving(pool, of)
    clock = clock_of(pool, of.class_id)
    low = exact_seconds(request.start, "start") if request.start is not None else None
    high = exact_seconds(request.stop, "stop") if request.stop is not None else None
    if low is not None and high is not None and low >= high:
        raise CoverageError(f"start lies at or after stop: {span_text(low, high)}. A table needs a span of time.")
    begins, ends = (clock.seconds_of(np.array([getattr(s, name) for s in segments]))[0] for name in ("begin", "end"))
    touching = [
        s for s, b, e in zip(segments, begins, ends, strict=True) if (high is None or b <= float(high)) and (low is None or e >= float(low))
    ]
    others = [s for s in touching if s.type not in KNOTS]
    if others:
        raise NoPathError(
            f"{others[0].describe()} is neither of type 1, 2 nor 3: give tolerance=jf.spice.Tolerance(angle=..., rate=...) "
            "to have a table fitted."
        )
    rotations = {s.frame: _base_rotation(pool, s, of, base) for s in reversed(touching)}
    found = [_read(pool, s, clock, request.bridge, ck) for s in touching]
    runs = [(s, _rotated(intervals, rotations[s.frame])) for s, (intervals, _) in zip(touching, found, strict=True)]
    contradicted = {s: size for s, (_, size) in zip(touching, found, strict=True) if size}
    intervals, used = layered([r for r in runs if len(r[1].start)], -np.inf, np.inf)
    if intervals is None:
        raise _uncovered(of, [], low, high, begins, ends)
    edges, parts = clock.by_cspice(np.array([intervals.start[0], intervals.stop[-1]])), _straight(intervals, clock)
    dated = _dated(intervals, clock)
    have = _covered(*dated[1:])
    intervals, t0, t1 = _within(*dated, low, high)
    if not len(intervals.start):
        raise _uncovered(of, have, low, high, begins, ends)
    # The ends of the data as CSPICE has them, each one double, are within these.
    have[0] = (min(have[0][0], Fraction(edges[0])), have[0][1])
    have[-1] = (have[-1][0], max(have[-1][1], Fraction(edges[1])))
    bounds = (have[0][0] if low is None else low, have[-1][1] if high is None else high)
    if not any(a - ROUNDED <= bounds[0] < b for a, b in have) or not any(a < bounds[1] <= b + ROUNDED for a, b in have):
        raise _uncovered(of, have, low, high, begins, ends)
    measured = _measured(intervals, t0, t1)
    if parts is not None:
        intervals, t0, t1 = _within(*_dated(parts, clock), low, high)
    last = max(_exact(t1, -1), bounds[1])
    reference = reference_day(bounds[0])
    starts, rows, gaps = _rows(intervals, t0, t1, reference, ck)
    index, compares = build_index(starts, last - reference)
    records = HostRecordTable({"rows": rows, **index}, rows.shape[1] - 3, compares)
    facts = {
        "method": f"knots of C-kernels, ck={ck!r}",
        "measured": accuracy.knots(pool, of.name, base.name, records, ck, reference, bounds) + measured,
        "notes": (*_notes(used, gaps), *_contradictions(of, contradicted, used)),
        "segments": tuple(dict.fromkeys(f"{s.describe()}, frame id {s.frame}" for s in used)),
    }
    files = [Path(p) for p in sorted({s.path for s in used})]
    return assembled(pool, AttitudeTable, "knots", request.names, bounds, [records], files, facts, mode=ck)


def _read(pool: KernelPool, segment: CkSegment, clock: Clock, bridge: float | None, ck: str) -> tuple[Intervals, float]:
    """Return a segment's intervals, and by how much its rates contradict its attitudes where they were replaced."""
    a, b = clock.seconds_of(np.array([segment.begin, segment.end]))[0]
    tick = float((b - a) / (segment.end - segment.begin) if segment.end > segment.begin else 1.0)
    intervals = read_intervals(pool, segment, tick, bridge)
    if ck == "spice" or not segment.has_rates or segment.type == 2:
        return intervals, 0.0
    size = rate_contradiction(intervals, tick)
    return (with_own_rates(intervals, tick) if size else intervals), size


def _contradictions(of: FrameFacts, sizes: dict[CkSegment, float], used: list[CkSegment]) -> tuple[str, ...]:
    """Return a note for each segment used whose rates were replaced, and warn of them."""
    notes = [
        f"{s.describe()}: its angular velocities are none of its attitudes (off by up to {sizes[s]:.2g} rad over an interval): replaced by "
        "those of the attitudes"
        for s in used
        if s in sizes
    ]
    if notes:
        more = f" and {len(notes) - 1} more segments" if len(notes) > 1 else ""
        warnings.warn(f"{of.name}: {notes[0]}{more}. ck='spice' takes them as SPICE does.", FrameWarning, stacklevel=5)
    return tuple(notes)


def _base_rotation(pool: KernelPool, segment: CkSegment, of: FrameFacts, base: FrameFacts) -> np.ndarray | None:
    """Return the quaternion that turns a segment's own base frame into the one asked for; None where they are the same."""
    if segment.frame == base.id:
        return None
    own = pool.find_frame(segment.frame)
    if own is None or own.frame_class != INERTIAL or base.frame_class != INERTIAL:
        label = str(segment.frame) if own is None else own.name
        raise NoPathError(
            f"{segment.describe()} orients {of.name} relative to {label}, not {base.name}: ask for relative_to={label!r} and add the "
            f"other orientation as an edge of its own, as kernels.tree(frames=[{of.name!r}]) does, or give "
            "tolerance=jf.spice.Tolerance(angle=..., rate=...) to have the chain fitted."
        )
    return host_quaternions.from_matrices(pool.rotation(own.name, base.name)[None])


def _rotated(intervals: Intervals, by: np.ndarray | None) -> Intervals:
    """Return intervals in another base frame."""
    if by is None:
        return intervals
    rotation = np.broadcast_to(by, intervals.q.shape)
    moved, w0, w1 = (host_quaternions.rotate(rotation, v) for v in (intervals.rotation_vector, intervals.w0, intervals.w1))
    return replace(intervals, q=host_quaternions.multiply(rotation, intervals.q), rotation_vector=moved, w0=w0, w1=w1)


def _dated(intervals: Intervals, clock: Clock) -> tuple[Intervals, host_two_part.Pair, host_two_part.Pair]:
    """Return intervals with the ET of their starts and ends, cut where the clock changes its rate: SPICE interpolates in ticks."""
    parts, starts, ends = [], [], []
    for piece, low, high in clock.pieces():
        a, b = np.searchsorted(intervals.stop, low, "right"), np.searchsorted(intervals.start, high, "left")
        if a < b:
            own = intervals.take(np.arange(a, b))
            if own.start[0] < low or own.stop[-1] > high:
                own = own.cut(np.full(b - a, low), np.full(b - a, high))
            parts.append(own)
            starts.append(clock.seconds_of(own.start, piece))
            ends.append(clock.seconds_of(own.stop, piece))
    t0, t1 = (tuple(np.concatenate([t[k] for t in times]) for k in (0, 1)) for times in (starts, ends))
    whole = type(intervals)(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(intervals)))
    return whole, t0, t1  # pyright: ignore[reportReturnType]


def _within(
    intervals: Intervals, t0: host_two_part.Pair, t1: host_two_part.Pair, low: Fraction | None, high: Fraction | None
) -> tuple[Intervals, host_two_part.Pair, host_two_part.Pair]:
    """Return the intervals that touch a span."""
    keep = np.flatnonzero((t1[0] > (-np.inf if low is None else float(low))) & (t0[0] < (np.inf if high is None else float(high))))
    return intervals.take(keep), (t0[0][keep], t0[1][keep]), (t1[0][keep], t1[1][keep])


def _straight(intervals: Intervals, clock: Clock) -> Intervals | None:
    """Return intervals cut so short that a rotation at an even rate in ticks is one in TDB too; None where they are short enough.

    Clocks count TT, against which TDB wavers by K sin(M) over the year: over a day of a fast spinner that bends 2e-8 rad.
    """
    if clock.terrestrial is None:
        return None
    k, _, _, rate = clock.terrestrial
    width = intervals.stop - intervals.start
    ends = np.array([intervals.start[0], intervals.stop[-1]])
    tick = float(np.diff(clock.seconds_of(ends)[0])[0] / (ends[1] - ends[0]))
    bend = np.linalg.norm(intervals.rotation_vector, axis=1) * width * tick * (k * rate * rate / 8)
    pieces = np.ceil(np.sqrt(bend / BEND)).astype(int).clip(1)
    if (pieces == 1).all():
        return None
    which = np.repeat(np.arange(len(pieces)), pieces)
    step = np.arange(len(which)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    cuts = intervals.start[which] + width[which] * (step / pieces[which])
    until = np.where(step + 1 == pieces[which], intervals.stop[which], np.append(cuts[1:], np.inf))
    return intervals.take(which).cut(cuts, until)


def _rows(
    intervals: Intervals, t0: host_two_part.Pair, t1: host_two_part.Pair, reference: int, ck: str
) -> tuple[host_two_part.Pair, np.ndarray, list[tuple[Fraction, Fraction]]]:
    """Return where each row starts to serve, seconds past the reference, the rows, and the gaps (ET)."""
    past = host_two_part.add(t0, (np.full(len(t0[0]), -float(reference)), np.zeros(len(t0[0]))))
    length = host_two_part.add(t1, (-t0[0], -t0[1]))[0]
    half = np.linalg.norm(intervals.rotation_vector, axis=1) / 2
    axis = np.where(half[:, None] > 0, intervals.rotation_vector / np.where(half > 0, 2 * half, 1.0)[:, None], np.array([1.0, 0.0, 0.0]))
    mean = intervals.rotation_vector / length[:, None]
    if ck == "spice":
        vectors = (intervals.w0, intervals.w1)
    else:
        uneven = ~intervals.even[:, None]  # an even rotation is as it is, in whatever seconds the kernel's rate may be
        vectors = tuple((w - mean) * (length[:, None] / 2) * uneven for w in (intervals.w0, intervals.w1))
    rows = np.concatenate([intervals.q, axis, half[:, None], *vectors, past[0][:, None], past[1][:, None], length[:, None]], 1)
    touch = np.append(False, np.abs(t0[0][1:] - t1[0][:-1]) <= 2 * float(GRACE))
    kept = touch & np.append(False, intervals.rank[:-1] > intervals.rank[1:])  # the instant itself is the earlier interval's
    until = host_two_part.add(t1, (np.full(len(t1[0]), -float(reference)), np.zeros(len(t1[0]))))
    pause = host_two_part.add(until, (np.full(len(t1[0]), float(GRACE)), np.zeros(len(t1[0]))))
    nothing = np.zeros(rows.shape[1])
    nothing[[0, 4]], nothing[-1] = 1.0, np.nan
    empty = np.flatnonzero(t0[0][1:] - t1[0][:-1] > 2 * float(GRACE))
    gaps = [(_exact(until, e) + reference, _exact(past, e + 1) + reference) for e in empty]
    shift = np.where(kept, float(AFTER_END), 0.0)
    shift[empty + 1] = -float(GRACE)
    serve = host_two_part.add(past, (shift, np.zeros(len(shift))))
    starts = tuple(np.insert(own, empty + 1, rest[empty]) for own, rest in zip(serve, pause, strict=True))
    return starts, np.insert(rows, empty + 1, nothing, axis=0), gaps  # pyright: ignore[reportReturnType]


def _measured(intervals: Intervals, t0: host_two_part.Pair, t1: host_two_part.Pair) -> tuple[tuple[str, float], ...]:
    """Return how far the kernel's own rates are from the derivative of slerp, and its jumps where intervals touch."""
    length = (t1[0] - t0[0]) + (t1[1] - t0[1])
    mean = intervals.rotation_vector / length[:, None]
    apart = max(float(np.linalg.norm(w - mean, axis=1).max()) for w in (intervals.w0, intervals.w1))
    end = host_quaternions.multiply(host_quaternions.from_rotation_vector(intervals.rotation_vector), intervals.q)
    touch = np.abs(t0[0][1:] - t1[0][:-1]) <= 2 * float(GRACE)
    gap = host_quaternions.vector_of(host_quaternions.multiply(intervals.q[1:], host_quaternions.conjugate(end[:-1])))[touch]
    step = (intervals.w0[1:] - intervals.w1[:-1])[touch]
    jumps = [float(np.linalg.norm(x, axis=1).max(initial=0.0)) for x in (gap, step)]
    return (
        ("kernel's rates against the derivative of slerp, rad/s", apart),
        ("kernel's own jumps in attitude between intervals, rad", jumps[0]),
        ("kernel's own jumps in rate between intervals, rad/s", jumps[1]),
    )


def _notes(used: list[CkSegment], gaps: list[tuple[Fraction, Fraction]]) -> tuple[str, ...]:
    notes = [f"gap: {span_text(*gap)}" for gap in gaps[:20]]
    notes += [f"{len(gaps)} gaps in all"] if gaps else []
    notes += [f"{s.describe()} has no angular velocities: they are estimated from its attitudes" for s in used if not s.has_rates]
    return tuple(notes)


def _covered(t0: host_two_part.Pair, t1: host_two_part.Pair) -> list[Span]:
    """Return the spans that intervals cover, merged where they touch."""
    breaks = np.flatnonzero(t0[0][1:] - t1[0][:-1] > 2 * float(GRACE))
    first, last = [0, *(breaks + 1)], [*breaks, len(t0[0]) - 1]
    return [(_exact(t0, a), _exact(t1, b)) for a, b in zip(first, last, strict=True)]


def _exact(times: host_two_part.Pair, i: Any) -> Fraction:
    return Fraction(float(times[0][i])) + Fraction(float(times[1][i]))


def _uncovered(
    of: FrameFacts, have: list[Span], low: Fraction | None, high: Fraction | None, begins: np.ndarray, ends: np.ndarray
) -> CoverageError:
    """Return the error for data that do not cover the ends of a span; without any in it, those elsewhere are named."""
    have = have or sorted((Fraction(a), Fraction(b)) for a, b in zip(begins.tolist(), ends.tolist(), strict=True))
    asked = (have[0][0] if low is None else low, have[-1][1] if high is None else high)
    return uncovered(f"orientation of {of.name} (C-kernels)", have, open_ends(have, asked), asked)
