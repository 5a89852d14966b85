"""Frame coverage: the windows of time in which the kernels orient a frame, by the coverage of all that it hangs on."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np

from jaxframes.errors import CoverageError, NoPathError
from jaxframes.spice.reading.ck_segments import GRACE, segments_serving
from jaxframes.spice.reading.clocks import clock_of
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.naming import CK, DYNAMIC, INERTIAL, PCK, SWITCH, FrameFacts
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import CspiceError
from jaxframes.spice.reading.segment_paths import Span, open_ends, uncovered
from jaxframes.spice.reading.segments import coverage
from jaxframes.tables.instants import Instant, exact_seconds, span_text

PROBES = 513  # epochs at which it is asked where there are data at all
TOUCHING = 3 * GRACE  # windows closer than this have no gap between them
ROUNDED = Fraction(1, 10**6)  # seconds at both ends of a C-kernel's windows where CSPICE, which rounds them, may have no answer


@dataclass(frozen=True)
class FrameCoverage:
    """The coverage of a frame.

    Attributes:
        spans: Where there are data, in time order; None where nothing is known to limit it.
        files: The binary kernels that hold the data.
        whole: Whether these are all that CSPICE reads for it.
        rounded: Whether CSPICE rounds the ends of the spans: those of C-kernels.
    """

    spans: list[Span] | None
    files: tuple[Path, ...]
    whole: bool
    rounded: bool = False

    def both(self, other: "FrameCoverage") -> "FrameCoverage":
        """Return where two frames are oriented."""
        known = [r.spans for r in (self, other) if r.spans is not None]
        spans = None if not known else known[0] if len(known) == 1 else overlap(*known)
        files = tuple(dict.fromkeys([*self.files, *other.files]))
        return FrameCoverage(spans, files, self.whole and other.whole, self.rounded or other.rounded)


def frame_coverage(pool: KernelPool, frame: FrameFacts) -> FrameCoverage:
    """Return the coverage of a frame: the data of C-kernels and binary PCK files on the way from it to an inertial frame.

    Raises:
        NoPathError: If a C-kernel frame on the way has no data, or none that CSPICE's rates can be had from.
        MissingKernelError: If a clock is not known.
    """
    frame = anchored(pool, frame).frame
    if frame.frame_class == PCK:
        own = pool.pck_segments(frame.class_id)
        return FrameCoverage(coverage(own) or None, tuple(dict.fromkeys(Path(s.path) for s in own)), True)
    if frame.frame_class in (DYNAMIC, SWITCH):
        return FrameCoverage(None, (), False)
    if frame.frame_class != CK:
        return FrameCoverage(None, (), True)
    segments = segments_serving(pool, frame)
    clock_of(pool, frame.class_id)  # says which kernel is missing
    files = tuple(dict.fromkeys(Path(s.path) for s in segments))
    spans = [span for file in files for span in pool.ck_windows(file, frame.class_id, True)]
    if not spans:
        raise NoPathError(
            f"The C-kernels of {frame.name} hold no angular velocities, and without them CSPICE has no rates to fit. "
            "Types 1 to 3 need no fit: leave tolerance= out."
        )
    made = FrameCoverage(merged(spans), files, True, True)
    below = [pool.find_frame(base) for base in sorted({s.frame for s in segments})]
    if len(below) == 1 and below[0] is not None:
        return made.both(frame_coverage(pool, below[0]))
    return replace(made, whole=all(base is not None and base.frame_class == INERTIAL for base in below))


def merged(spans: Sequence[Span]) -> list[Span]:
    """Return spans in time order, those joined that touch."""
    out: list[Span] = []
    for a, b in sorted(spans):
        if out and a <= out[-1][1] + 2 * ROUNDED:
            out[-1] = (out[-1][0], max(b, out[-1][1]))
        else:
            out.append((a, b))
    return out


def overlap(first: Sequence[Span], second: Sequence[Span]) -> list[Span]:
    """Return where two runs of spans in time order overlap."""
    out: list[Span] = []
    i = j = 0
    while i < len(first) and j < len(second):
        low, high = max(first[i][0], second[j][0]), min(first[i][1], second[j][1])
        if low < high:
            out.append((low, high))
        if first[i][1] < second[j][1]:
            i += 1
        else:
            j += 1
    return out


@dataclass(frozen=True)
class Window:
    """A coverage window: a span of time with data.

    Attributes:
        start: Where the data start, seconds past J2000 TDB.
        stop: Where they end.
        first: From where on CSPICE is asked.
        last: Up to where.
    """

    start: Fraction
    stop: Fraction
    first: Fraction
    last: Fraction

    @classmethod
    def whole(cls, start: Fraction, stop: Fraction) -> "Window":
        """Return a window that CSPICE is asked about from end to end."""
        return cls(start, stop, start, stop)


def coverage_windows(
    pool: KernelPool, of: FrameFacts, base: FrameFacts, start: Instant | None, stop: Instant | None
) -> tuple[list[Window], list[Path]]:
    """Return the windows within the span where CSPICE has an answer, cut where a frame switches, and the files that hold the data.

    Raises:
        CoverageError: If there are none, or an end of the span that was asked for is not covered; says why, as CSPICE does.
        NoPathError: If no C-kernel of a CK frame is loaded.
    """
    low = exact_seconds(start, "start") if start is not None else None
    high = exact_seconds(stop, "stop") if stop is not None else None
    if low is not None and high is not None and low >= high:
        raise CoverageError(f"start lies at or after stop: {span_text(low, high)}. A table needs a span of time.")
    found = frame_coverage(pool, of).both(frame_coverage(pool, base))
    windows = [_window(*span, found) for span in found.spans or ()]
    if found.spans is None:
        if low is None or high is None:
            raise CoverageError(f"{of.name} has no coverage of its own: give start= and stop=.")
        windows = [Window.whole(low, high)]
    elif not windows:
        raise CoverageError(f"The data of {of.name} and those of {base.name} have no time in common.")
    asked = (windows[0].start if low is None else low, windows[-1].stop if high is None else high)
    cuts = _switches(pool, of) if of.frame_class == SWITCH else []
    out: list[Window] = []
    each = max(PROBES // len(windows), 9)
    for window in (_clipped(w, *asked) for w in windows):
        if window.last - window.first <= 4 * ROUNDED:
            continue
        edges = [window.first, *(c for c in cuts if window.first < c < window.last), window.last]
        for c, d in pairwise(edges):
            # A switch happens between two doubles: leave the instant itself to the window that it starts.
            there = _valid(pool, of, base, c, d - (ROUNDED if d != window.last else 0), each)
            out += [replace(s, start=window.start) if s.first == window.first else s for s in there]
            if there and there[-1].last == window.last:
                out[-1] = replace(out[-1], stop=window.stop)
    have = [(s.start, s.stop) for s in out]
    missing = [gap for gap in open_ends(have, asked) if gap[1] - gap[0] > ROUNDED]
    if missing:
        what = f"orientation of {of.name} relative to {base.name}"
        raise uncovered(what, merged(have) or found.spans or [], missing, asked, _reason(pool, of, base, missing[0]))
    out[0], out[-1] = replace(out[0], start=min(out[0].start, asked[0])), replace(out[-1], stop=max(out[-1].stop, asked[1]))
    if found.whole:
        return out, list(found.files)
    # CSPICE follows the chain: what it read of the files loaded is not known.
    return out, pool.binary_files()


def _window(start: Fraction, stop: Fraction, found: FrameCoverage) -> Window:
    shrink = ROUNDED if found.rounded else 0
    return Window(start, stop, start + shrink, stop - shrink)


def _clipped(window: Window, low: Fraction, high: Fraction) -> Window:
    start, stop = max(window.start, low), min(window.stop, high)
    return Window(start, stop, max(window.first, start), min(window.last, stop))


def _valid(pool: KernelPool, of: FrameFacts, base: FrameFacts, start: Fraction, stop: Fraction, count: int) -> list[Window]:
    """Return the windows between two instants where CSPICE has an answer, found by probing and halving."""

    def there(times: np.ndarray) -> np.ndarray:
        rotations, _ = pool.rotations_or_nan(of.name, base.name, times, doing="looking for orientations")
        return np.asarray(np.isfinite(rotations).all((1, 2)))

    times = np.linspace(float(start), float(stop), count)
    good = there(times)
    if good.all():
        return [Window.whole(start, stop)]
    changes = np.flatnonzero(good[1:] != good[:-1])
    if not good.any():
        return []
    inside, outside = (np.where(good[changes] == flag, times[changes], times[changes + 1]) for flag in (True, False))
    for _ in range(60):
        middle = (inside + outside) / 2
        if not (np.abs(inside - outside) > float(ROUNDED)).any():
            break
        ok = there(middle)
        inside, outside = np.where(ok, middle, inside), np.where(ok, outside, middle)
    edges = [start] * bool(good[0]) + [Fraction(float(x)) for x in inside] + [stop] * bool(good[-1])
    return [Window.whole(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 4 * ROUNDED]


def _reason(pool: KernelPool, of: FrameFacts, base: FrameFacts, gap: Span) -> str:
    """Return what CSPICE says of an instant that it has no orientation for."""
    middle = np.array([float((gap[0] + gap[1]) / 2)])
    try:
        pool.rotations(of.name, base.name, middle, doing="asking for an orientation")
    except CspiceError as error:
        return str(error)
    return ""


def _switches(pool: KernelPool, of: FrameFacts) -> list[Fraction]:
    """Return the instants at which a switch frame changes the frame that it follows."""
    found = []
    for end in ("START", "STOP"):
        for key in (of.id, of.name):
            found += pool.instants(f"FRAME_{key}_{end}")
    return sorted({Fraction(x) for x in found})
