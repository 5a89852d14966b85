"""Where CSPICE has an orientation: the stretches of a span that a fitted table can cover, and what is missing of it."""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxframes.errors import CoverageError, NoPathError
from jaxframes.spice.ck import segments_of
from jaxframes.spice.clock import clock_of
from jaxframes.spice.frame_classes import CK, INERTIAL, PCK, SWITCH, anchored
from jaxframes.spice.knots import GRACE
from jaxframes.spice.paths import Span, open_ends, uncovered
from jaxframes.spice.process import CspiceError
from jaxframes.spice.segments import coverage
from jaxframes.spice.times import exact_seconds, span_text

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels
    from jaxframes.spice.orient import Request

PROBES = 513  # epochs at which it is asked where there are data at all
SHRINK = Fraction(1, 10**6)  # seconds at both ends of a C-kernel's windows where CSPICE, which rounds them, may have no answer
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
    windows, files, known = _windows(kernels, of)
    if windows is None:
        if low is None or high is None:
            raise CoverageError(f"{of['name']} has no coverage of its own: give start= and stop=.")
        windows = [Stretch.whole(low, high)]
    asked = (windows[0].start if low is None else low, windows[-1].stop if high is None else high)
    cuts = _switches(kernels, of) if of["class"] == SWITCH else []
    out: list[Stretch] = []
    each = max(PROBES // len(windows), 9)
    for window in (_clipped(w, *asked) for w in windows):
        if window.last - window.first <= 4 * SHRINK:
            continue
        edges = [window.first, *(c for c in cuts if window.first < c < window.last), window.last]
        for c, d in pairwise(edges):
            # A switch happens between two doubles: leave the instant itself to the stretch that it starts.
            found = _valid(kernels, request, c, d - (SHRINK if d != window.last else 0), each)
            out += [replace(s, start=window.start) if s.first == window.first else s for s in found]
            if found and found[-1].last == window.last:
                out[-1] = replace(out[-1], stop=window.stop)
    have = [(s.start, s.stop) for s in out]
    missing = [gap for gap in open_ends(have, asked) if gap[1] - gap[0] > SHRINK]
    if missing:
        what = f"orientation of {of['name']} relative to {request.base['name']}"
        raise uncovered(what, _joined(have), missing, asked, _reason(kernels, request, missing[0]))
    out[0], out[-1] = replace(out[0], start=min(out[0].start, asked[0])), replace(out[-1], stop=max(out[-1].stop, asked[1]))
    if not known:  # CSPICE follows the chain: what it read of the files loaded is not known
        files = [Path(path) for path in kernels._process.call("binary_files", doing="listing the kernels")]
    return out, files


def _windows(kernels: "Kernels", of: dict[str, Any]) -> tuple[list[Stretch] | None, list[Path], bool]:
    """Return the windows of a frame's own data, None if these say none; the files of the data, and whether those are all there are."""
    anchor = anchored(kernels, of).axes
    if anchor["class"] == PCK:
        own = [s for s in kernels._segments if s.kind == "PCK" and s.body == anchor["class_id"]]
        windows = [Stretch.whole(a, b) for a, b in coverage(own)] or None
        return windows, [Path(s.path) for s in own], True
    if anchor["class"] != CK:
        return None, [], False
    clock_of(kernels, anchor["class_id"])  # says which kernel is missing
    names = dict.fromkeys(s.path for s in segments_of(kernels, anchor["class_id"]))
    if not names:
        raise NoPathError(
            f"No C-kernel segment for {anchor['name']} (CK id {anchor['class_id']}) is loaded: load the C-kernel (.bc) of this frame."
        )
    spans: list[Span] = []
    for path in names:
        found = kernels._process.call("ck_windows", path, anchor["class_id"], doing=f"reading the coverage of {Path(path).name}")
        spans += [(Fraction(a), Fraction(b)) for a, b in found]
    if not spans:
        raise CoverageError(f"The C-kernels loaded have no angular velocities for {anchor['name']}, which CSPICE needs to give its rates.")
    windows = [Stretch(a, b, a + SHRINK, b - SHRINK) for a, b in _joined(spans)]
    inertial = all(base is not None and base["class"] == INERTIAL for base in _bases(kernels, anchor))
    return windows, [Path(name) for name in names], inertial


def _clipped(window: Stretch, low: Fraction, high: Fraction) -> Stretch:
    start, stop = max(window.start, low), min(window.stop, high)
    return Stretch(start, stop, max(window.first, start), min(window.last, stop))


def _bases(kernels: "Kernels", of: dict[str, Any]) -> list[dict[str, Any] | None]:
    """Return the frames that a CK frame's segments are relative to."""
    frames = {s.frame for s in segments_of(kernels, of["class_id"])}
    return [kernels._process.call("frame", str(frame), doing=f"looking up frame {frame}") for frame in sorted(frames)]


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
        if not (np.abs(inside - outside) > float(SHRINK)).any():
            break
        ok = there(middle)
        inside, outside = np.where(ok, middle, inside), np.where(ok, outside, middle)
    edges = [start] * bool(good[0]) + [Fraction(float(x)) for x in inside] + [stop] * bool(good[-1])
    return [Stretch.whole(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 4 * SHRINK]


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


def _joined(spans: list[Span]) -> list[Span]:
    """Return spans merged where they touch."""
    out: list[Span] = []
    for a, b in sorted(spans):
        if out and a <= out[-1][1] + 2 * SHRINK:
            out[-1] = (out[-1][0], max(b, out[-1][1]))
        else:
            out.append((a, b))
    return out
