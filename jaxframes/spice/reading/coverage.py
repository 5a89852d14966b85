"""How far the kernels orient a frame: the coverage of all that it hangs on, as far as that is said without asking at instants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxframes.errors import CoverageError, NoPathError
from jaxframes.spice.extraction.ck_attitude import GRACE, serving
from jaxframes.spice.reading.clocks import clock_of
from jaxframes.spice.reading.frame_chain import CK, DYNAMIC, INERTIAL, PCK, SWITCH, anchored
from jaxframes.spice.reading.process import CspiceError
from jaxframes.spice.reading.segment_paths import Span, open_ends, uncovered
from jaxframes.spice.reading.segments import coverage
from jaxframes.tables.instants import exact_seconds, span_text

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

ROUNDED = Fraction(1, 10**6)  # seconds at both ends of a C-kernel's windows where CSPICE, which rounds them, may have no answer


@dataclass(frozen=True)
class Reach:
    """How far a frame is oriented.

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

    def both(self, other: "Reach") -> "Reach":
        """Return where two frames are oriented."""
        known = [r.spans for r in (self, other) if r.spans is not None]
        spans = None if not known else known[0] if len(known) == 1 else overlap(*known)
        files = tuple(dict.fromkeys([*self.files, *other.files]))
        return Reach(spans, files, self.whole and other.whole, self.rounded or other.rounded)


def reach(kernels: "Kernels", axes: dict[str, Any]) -> Reach:
    """Return how far a frame is oriented: the data of C-kernels and binary PCK files on the way from it to an inertial frame.

    Raises:
        NoPathError: If a C-kernel frame on the way has no data, or none that CSPICE's rates can be had from.
        MissingKernelError: If a clock is not known.
    """
    axes = anchored(kernels, axes).axes
    if axes["class"] == PCK:
        own = [s for s in kernels._segments if s.kind == "PCK" and s.body == axes["class_id"]]
        return Reach(coverage(own) or None, tuple(dict.fromkeys(Path(s.path) for s in own)), True)
    if axes["class"] in (DYNAMIC, SWITCH):
        return Reach(None, (), False)
    if axes["class"] != CK:
        return Reach(None, (), True)
    segments = serving(kernels, axes)
    clock_of(kernels, axes["class_id"])  # says which kernel is missing
    files = tuple(dict.fromkeys(Path(s.path) for s in segments))
    spans: list[Span] = []
    for file in files:
        found = kernels._process.call("ck_windows", str(file), axes["class_id"], True, doing=f"reading the coverage of {file.name}")
        spans += [(Fraction(a), Fraction(b)) for a, b in found]
    if not spans:
        raise NoPathError(
            f"The C-kernels of {axes['name']} hold no angular velocities, and without them CSPICE has no rates to fit. "
            "Types 1 to 3 need no fit: leave tolerance= out."
        )
    made = Reach(merged(spans), files, True, True)
    bases = {s.frame for s in segments}
    below = [kernels._process.call("frame", str(base), doing=f"looking up frame {base}") for base in sorted(bases)]
    if len(below) == 1 and below[0] is not None:
        return made.both(reach(kernels, below[0]))
    return replace(made, whole=all(base is not None and base["class"] == INERTIAL for base in below))


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


if TYPE_CHECKING:
    from jaxframes.spice.extraction.orientation import Request
    from jaxframes.spice.kernels import Kernels

PROBES = 513  # epochs at which it is asked where there are data at all
TOUCHING = 3 * GRACE  # stretches closer than this have no gap between them


@dataclass(frozen=True)
class Stretch:
    """A stretch of time with data.

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
    def whole(cls, start: Fraction, stop: Fraction) -> "Stretch":
        """Return a stretch that CSPICE is asked about from end to end."""
        return cls(start, stop, start, stop)


def stretches_of(kernels: "Kernels", request: "Request") -> tuple[list[Stretch], list[Path]]:
    """Return the stretches within the span where CSPICE has an answer, cut where a frame switches, and the files that hold the data.

    Raises:
        CoverageError: If there are none, or an end of the span that was asked for is not covered; says why, as CSPICE does.
        NoPathError: If no C-kernel of a CK frame is loaded.
    """
    of = request.of
    low = exact_seconds(request.start, "start") if request.start is not None else None
    high = exact_seconds(request.stop, "stop") if request.stop is not None else None
    if low is not None and high is not None and low >= high:
        raise CoverageError(f"start lies at or after stop: {span_text(low, high)}. A table needs a span of time.")
    found = reach(kernels, of).both(reach(kernels, request.base))
    windows = [_window(*span, found) for span in found.spans or ()]
    if found.spans is None:
        if low is None or high is None:
            raise CoverageError(f"{of['name']} has no coverage of its own: give start= and stop=.")
        windows = [Stretch.whole(low, high)]
    elif not windows:
        raise CoverageError(f"The data of {of['name']} and those of {request.base['name']} have no time in common.")
    asked = (windows[0].start if low is None else low, windows[-1].stop if high is None else high)
    cuts = _switches(kernels, of) if of["class"] == SWITCH else []
    out: list[Stretch] = []
    each = max(PROBES // len(windows), 9)
    for window in (_clipped(w, *asked) for w in windows):
        if window.last - window.first <= 4 * ROUNDED:
            continue
        edges = [window.first, *(c for c in cuts if window.first < c < window.last), window.last]
        for c, d in pairwise(edges):
            # A switch happens between two doubles: leave the instant itself to the stretch that it starts.
            there = _valid(kernels, request, c, d - (ROUNDED if d != window.last else 0), each)
            out += [replace(s, start=window.start) if s.first == window.first else s for s in there]
            if there and there[-1].last == window.last:
                out[-1] = replace(out[-1], stop=window.stop)
    have = [(s.start, s.stop) for s in out]
    missing = [gap for gap in open_ends(have, asked) if gap[1] - gap[0] > ROUNDED]
    if missing:
        what = f"orientation of {of['name']} relative to {request.base['name']}"
        raise uncovered(what, merged(have) or found.spans or [], missing, asked, _reason(kernels, request, missing[0]))
    out[0], out[-1] = replace(out[0], start=min(out[0].start, asked[0])), replace(out[-1], stop=max(out[-1].stop, asked[1]))
    if found.whole:
        return out, list(found.files)
    # CSPICE follows the chain: what it read of the files loaded is not known.
    return out, [Path(path) for path in kernels._process.call("binary_files", doing="listing the kernels")]


def _window(start: Fraction, stop: Fraction, found: Reach) -> Stretch:
    shrink = ROUNDED if found.rounded else 0
    return Stretch(start, stop, start + shrink, stop - shrink)


def _clipped(window: Stretch, low: Fraction, high: Fraction) -> Stretch:
    start, stop = max(window.start, low), min(window.stop, high)
    return Stretch(start, stop, max(window.first, start), min(window.last, stop))


def _valid(kernels: "Kernels", request: "Request", start: Fraction, stop: Fraction, count: int) -> list[Stretch]:
    """Return the stretches between two instants where CSPICE has an answer, found by probing and halving."""

    def there(times: np.ndarray) -> np.ndarray:
        names = (request.of["name"], request.base["name"])
        rotations, _ = kernels._process.call("turns_where", *names, times, doing="looking for orientations")
        return np.isfinite(rotations).all((1, 2))

    times = np.linspace(float(start), float(stop), count)
    good = there(times)
    if good.all():
        return [Stretch.whole(start, stop)]
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
    return [Stretch.whole(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 4 * ROUNDED]


def _reason(kernels: "Kernels", request: "Request", gap: Span) -> str:
    """Return what CSPICE says of an instant that it has no orientation for."""
    middle = np.array([float((gap[0] + gap[1]) / 2)])
    try:
        kernels._process.call("turns", request.of["name"], request.base["name"], middle, doing="asking for an orientation")
    except CspiceError as error:
        return str(error)
    return ""


def _switches(kernels: "Kernels", of: dict[str, Any]) -> list[Fraction]:
    """Return the instants at which a switch frame changes the frame that it follows."""
    found = []
    for end in ("START", "STOP"):
        for key in (of["id"], of["name"]):
            found += kernels._process.call("instants", f"FRAME_{key}_{end}", doing=f"reading when {of['name']} switches")
    return sorted({Fraction(x) for x in found})
