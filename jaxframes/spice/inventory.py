"""What kernels hold, and what trees they make: the half of ``Kernels`` that lists and places."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from jaxframes.errors import CoverageError, NoPathError, SpiceError, UnknownBodyError, suggest
from jaxframes.spice.edge_source_kernels import KernelSource
from jaxframes.spice.extraction.text_pck import has_text_pck
from jaxframes.spice.options import Tolerance
from jaxframes.spice.reading.clocks import clock_of, read_leap_seconds
from jaxframes.spice.reading.frame_chain import CK, CLASSES, DYNAMIC, INERTIAL, PCK, SWITCH, anchored
from jaxframes.spice.reading.naming import SSB, Names
from jaxframes.spice.reading.segments import coverage
from jaxframes.tables.instants import Instant
from jaxframes.tables.naif_ids import J2000, labelled
from jaxframes.tables.placing import place
from jaxframes.time.calendar import tdb_text
from jaxframes.time.scales import LeapSeconds
from jaxframes.tree.builder import TreeBuilder
from jaxframes.tree.frame_tree import FrameTree


@dataclass(frozen=True)
class Listing:
    """A table of what kernels hold: ``rows`` to read, ``print`` to look at.

    Attributes:
        columns: What the entries of a row are.
        rows: One tuple for each line; instants are exact seconds past J2000 TDB, None where there is no end.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[tuple[Any, ...]]:
        return iter(self.rows)

    def __str__(self) -> str:
        """Return the table as aligned text, instants as TDB calendar dates."""
        lines = [self.columns, *(tuple(map(_entry, row)) for row in self.rows)]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        return "\n".join("  ".join(entry.ljust(width) for entry, width in zip(line, widths, strict=True)).rstrip() for line in lines)


def _entry(value: Any) -> str:
    if value is None:
        return "every instant"
    return tdb_text(value) if isinstance(value, Fraction) else str(value)


def _several(given: Any, role: str) -> Iterable[Any]:
    """Return names, ids or pairs one by one, of which a user may give one alone."""
    if isinstance(given, (str, int, np.integer)):
        return [given]
    if not isinstance(given, Iterable) or isinstance(given, bytes):
        raise SpiceError(f"{role} = {given!r}: give a name or an id, or a list of them.")
    return given


def _pair(given: Sequence[Any]) -> Sequence[Any]:
    if len(given) != 2:
        raise SpiceError(f"frames = [..., {given!r}, ...]: give names or ids of frames, or pairs (body, frame).")
    return given


class Inventory(Names):
    """What ``Kernels`` says of its content, and the trees that it makes of it."""

    _process: Any
    _segments: Any
    _text: Any

    def bodies(self: Any) -> Listing:
        """Return the bodies that SPK files hold, with the span and the center of each of their segments: id, name, start, stop, center."""
        found = dict.fromkeys((s.body, s.center) for s in self._segments if s.kind == "SPK")
        rows = [
            (body, self._name(body), *span, self._name(center))
            for body, center in sorted(found)
            for span in coverage(s for s in self._segments if (s.kind, s.body, s.center) == ("SPK", body, center))
        ]
        return Listing(("id", "body", "start", "stop", "relative to"), tuple(rows))

    def frames(self: Any) -> Listing:
        """Return the frames that the kernels loaded define or orient: id, name, class, center.

        Frames that SPICE has built in are listed if there are data for them; inertial ones always work and are left out.
        """
        rows = []
        for frame in self._process.call("all_frames", doing="listing frames"):
            if frame["class"] == INERTIAL or not self._has_data(frame):
                continue
            rows.append((frame["id"], frame["name"], CLASSES.get(frame["class"], "?"), self._name(frame["center"])))
        return Listing(("id", "frame", "class", "center"), tuple(sorted(rows)))

    def _has_data(self: Any, frame: dict[str, Any]) -> bool:
        """Whether data for a frame are loaded, as far as that is said without looking at instants."""
        if frame["class"] == PCK:
            binary = any(s.kind == "PCK" and s.body == frame["class_id"] for s in self._segments)
            return binary or has_text_pck(self, frame["class_id"])
        try:
            anchored(self, frame)
        except NoPathError:
            return False
        return True

    def coverage(self: Any, of: str | int) -> Listing:
        """Return the spans that the kernels cover a body or a frame in, like NAIF's ``brief``: id, name, start, stop, file.

        Args:
            of: Body or frame by name or id. A name that both go by (as spacecraft and their attitudes may) gives the rows of both,
                those of the body first; an id is that of a body where there are data of it, else that of a frame.

        Raises:
            UnknownBodyError: If it is neither.
            CoverageError: If the kernels hold no data of it.
            MissingKernelError: If the kernel of the clock that its C-kernels count in is not loaded.
        """
        columns = ("id", "name", "start", "stop", "file")
        label = str(of).strip()
        body = 0 if label.upper() in SSB else self._process.call("body", label, doing=f"looking up {of!r}") if label else None
        axes = self._process.call("frame", label, doing=f"looking up {of!r}") if label else None
        if body is None and axes is None:
            names = [*self._process.call("frame_names", doing="listing frames"), *(row[1] for row in self.bodies())]
            raise UnknownBodyError(f"{of!r} is neither a body nor a frame known to the kernels loaded.{suggest(label.upper(), names)}")
        name = label if body is None else self._name(int(body))
        rows = [] if body is None else self._spans("SPK", int(body), int(body), name)
        is_number, why = label.lstrip("+-").isdigit(), ""
        if axes is not None and not (rows and is_number):
            try:
                rows += self._frame_spans(axes)
            except (CoverageError, NoPathError) as error:
                if not rows and body is None:
                    raise
                why = f" {error}"
        if not rows:
            known = labelled(name, int(body or 0))
            raise CoverageError(f"No SPK segment of {known} is loaded; kernels.bodies() lists those that are.{why}")
        return Listing(columns, tuple(rows))

    def _spans(self: Any, kind: str, key: int, number: int, name: str) -> list[tuple[Any, ...]]:
        own = [s for s in self._segments if (s.kind, s.body) == (kind, key)]
        files = dict.fromkeys(s.path for s in own)
        return [(number, name, *span, Path(path).name) for path in files for span in coverage(s for s in own if s.path == path)]

    def _frame_spans(self: Any, axes: dict[str, Any]) -> list[tuple[Any, ...]]:
        number, name = axes["id"], axes["name"]
        anchor = anchored(self, axes).axes
        if anchor["class"] == INERTIAL:
            return [(number, name, None, None, "built in" if axes["class"] == INERTIAL else "fixed offset")]
        if anchor["class"] == PCK:
            rows = self._spans("PCK", anchor["class_id"], number, name)
            if has_text_pck(self, anchor["class_id"]):
                rows.append((number, name, None, None, "text PCK"))
            if rows:
                return rows
        if anchor["class"] == CK:
            rows = []
            segments = self._process.call("ck_segments", doing="listing the segments of the C-kernels")
            paths = dict.fromkeys(s["path"] for s in segments if s["instrument"] == anchor["class_id"])
            if paths:
                clock_of(self, anchor["class_id"])  # says which kernel is missing
            for path in paths:
                windows = self._process.call("ck_windows", path, anchor["class_id"], False, doing=f"reading the coverage of {path}")
                rows += [(number, name, Fraction(a), Fraction(b), Path(path).name) for a, b in windows]
            if rows:
                return rows
        if anchor["class"] in (DYNAMIC, SWITCH):
            return [(number, name, None, None, f"{CLASSES[anchor['class']]}: where what defines it has data")]
        raise CoverageError(
            f"No kernel loaded orients {name} (class {CLASSES.get(axes['class'], '?')}); kernels.frames() lists those that are."
        )

    def leap_seconds(self: Any) -> LeapSeconds:
        """Return the table of the leap-seconds kernel loaded, for ``Epoch.from_utc`` and its kin (MissingKernelError without one)."""
        return read_leap_seconds(self)

    def tree(
        self: Any,
        *,
        bodies: str | int | Sequence[str | int] = (),
        frames: str | int | Sequence[str | int | tuple[str | int, str | int | None]] = (),
        start: Instant | None = None,
        stop: Instant | None = None,
        ck: str = "smooth",
        bridge: float | None = None,
        tolerance: Tolerance | None = None,
    ) -> FrameTree:
        """Return a tree of bodies and frames, ready to be queried: any of them relative to any other.

        The root ``"SSB"`` is the Solar System barycentre with J2000 axes. Each body is a frame with J2000 axes under its SPICE name
        (``"EARTH"``), below the body that its segments are relative to; the bodies between are there too. Each frame is below
        the body that is its centre, or the frame that it is fixed to or that its C-kernel turns it against, under its SPICE name
        (``"ITRF93"``).
        So an edge between two SPICE frames is R(o from J2000), positions in J2000, R(J2000 from p).

        Args:
            bodies: Bodies by name or id; one alone needs no list.
            frames: SPICE frames by name or id, placed at the body that is their centre; or pairs (body, frame), placed at this body, as
                ``add_spice(body=, frame=)`` does: frame None or 999999 is the default frame. One name or id alone needs no list.
            start: Start of the coverage, as in ``translation``. Default: from where the kernels have data, whatever the size.
            stop: End of the coverage.
            ck: How C-kernels are read between their knots, as in ``orientation``.
            bridge: For C-kernels of type 1, as in ``orientation``.
            tolerance: For what has to be fitted, the errors to meet: angle and rate for dynamic and switch frames and C-kernels of types
                4 to 6; position and velocity for bodies whose SPK segments are not polynomials, turn, or change their centre (the
                edge is then from the nearest body that all these centres hang on). What can be had exactly stays exact.

        Raises:
            SpiceError: If ``bodies`` or ``frames`` are neither a name, nor an id, nor a list.
            UnknownBodyError: If a body is unknown.
            UnknownAxesError: If a frame is unknown.
            NoPathError: If the kernels do not connect them, or something has to be fitted and there is no tolerance.
            CoverageError: If the kernels do not cover the span.
            ToleranceError: If a fit cannot be as good, or the tolerance says nothing about it.
        """
        builder, source = TreeBuilder(root="SSB"), KernelSource(self, start, stop, ck, bridge, tolerance)
        builder.set_properties("SSB", {"spice_body": 0, "spice_frame": J2000, "spice_body_name": "SSB", "spice_frame_name": "J2000"})
        for body in _several(bodies, "bodies"):
            place(builder, source, body, J2000)
        for frame in _several(frames, "frames"):
            place(builder, source, *(_pair(frame) if isinstance(frame, (tuple, list)) else (self._axes(frame)["center"], frame)))
        return builder.build()

    def add_to_tree(
        self,
        builder: TreeBuilder,
        *,
        body: str | int,
        frame: str | int | None,
        start: Instant | None = None,
        stop: Instant | None = None,
        ck: str = "smooth",
        bridge: float | None = None,
        tolerance: Tolerance | None = None,
    ) -> str:
        """Find or add the frame of a body in a builder; see ``TreeBuilder.add_spice``."""
        return place(builder, KernelSource(self, start, stop, ck, bridge, tolerance), body, frame)
