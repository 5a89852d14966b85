"""How far the kernels orient a frame: the coverage of all that it hangs on, as far as that is said without asking at instants."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxframes.errors import NoPathError
from jaxframes.spice.clock import clock_of
from jaxframes.spice.frame_classes import CK, DYNAMIC, INERTIAL, PCK, SWITCH, anchored
from jaxframes.spice.knots import serving
from jaxframes.spice.paths import Span
from jaxframes.spice.segments import coverage

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
