"""Inventory: what kernels hold, as tables to look at: bodies, frames, coverage, leap seconds."""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from jaxframes.errors import CoverageError, MissingKernelError, NoPathError, UnknownBodyError, suggest
from jaxframes.spice.extraction.text_pck import has_text_pck
from jaxframes.spice.reading.clocks import clock_of, read_leap_seconds
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.kernel_files import ELSEWHERE
from jaxframes.spice.reading.naming import CK, DYNAMIC, INERTIAL, PCK, SWITCH, FrameFacts
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segments import coverage
from jaxframes.tables.naif_ids import labelled
from jaxframes.tables.records import METRES
from jaxframes.time.calendar import tdb_text
from jaxframes.time.scales import LeapSeconds


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


class Inventory:
    """What ``Kernels`` says of its content."""

    _pool: KernelPool

    def bodies(self) -> Listing:
        """Return the bodies that SPK files hold, with the span and the center of each of their segments: id, name, start, stop, center."""
        found = dict.fromkeys((s.body, s.center) for s in self._pool.segments if s.kind == "SPK")
        rows = [
            (body, self._pool.body_name(body), *span, self._pool.body_name(center))
            for body, center in sorted(found)
            for span in coverage(s for s in self._pool.segments if (s.kind, s.body, s.center) == ("SPK", body, center))
        ]
        return Listing(("id", "body", "start", "stop", "relative to"), tuple(rows))

    def frames(self) -> Listing:
        """Return the frames that the kernels loaded define or orient: id, name, class, center.

        Frames that SPICE has built in are listed if there are data for them; inertial ones always work and are left out.
        """
        rows = []
        for frame in self._pool.all_frames():
            if frame.frame_class == INERTIAL or not self._has_data(frame):
                continue
            rows.append((frame.id, frame.name, frame.class_name, self._pool.body_name(frame.center)))
        return Listing(("id", "frame", "class", "center"), tuple(sorted(rows)))

    def _has_data(self, frame: FrameFacts) -> bool:
        """Whether data for a frame are loaded, as far as that is said without looking at instants."""
        if frame.frame_class == PCK:
            return bool(self._pool.pck_segments(frame.class_id)) or has_text_pck(self._pool, frame.class_id)
        try:
            anchored(self._pool, frame)
        except NoPathError:
            return False
        return True

    def radii(self, body: str | int) -> tuple[float, float, float]:
        """Return the radii of a body's ellipsoid, m, as text PCK files give them: two of the equator, and that of the poles.

        Args:
            body: Body by name or id.

        Raises:
            UnknownBodyError: If it is unknown.
            MissingKernelError: If no kernel loaded gives them.
        """
        a, b, c = self._constants(body, "RADII", 3)
        return a * METRES, b * METRES, c * METRES

    def gm(self, body: str | int) -> float:
        """Return the gravitational parameter of a body, m3/s2, as a text PCK such as NAIF's gm_de440.tpc gives it.

        Args:
            body: Body by name or id.

        Raises:
            UnknownBodyError: If it is unknown.
            MissingKernelError: If no kernel loaded gives it.
        """
        (value,) = self._constants(body, "GM", 1)
        return value * METRES**3

    def _constants(self, body: str | int, what: str, count: int) -> list[float]:
        number = self._pool.body(body, "body")
        name = f"BODY{number}_{what}"
        found = self._pool.numbers([name], doing=f"reading {name}")[name]
        if found is None or len(found) != count:
            held = "" if found is None else f" (it holds {len(found)} numbers, not {count})"
            raise MissingKernelError(
                f"No kernel loaded gives {name}{held}: load a text PCK (.tpc) that does, such as pck00011.tpc (radii) or gm_de440.tpc "
                f"(GM), from {ELSEWHERE}/pck."
            )
        return found

    def coverage(self, of: str | int) -> Listing:
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
        body = self._pool.find_body(label) if label else None
        frame = self._pool.find_frame(label) if label else None
        if body is None and frame is None:
            names = [*(f.name for f in self._pool.all_frames()), *(row[1] for row in self.bodies())]
            raise UnknownBodyError(f"{of!r} is neither a body nor a frame known to the kernels loaded.{suggest(label.upper(), names)}")
        name = label if body is None else self._pool.body_name(int(body))
        rows = [] if body is None else self._spans("SPK", int(body), int(body), name)
        is_number, why = label.lstrip("+-").isdigit(), ""
        if frame is not None and not (rows and is_number):
            try:
                rows += self._frame_spans(frame)
            except (CoverageError, NoPathError) as error:
                if not rows and body is None:
                    raise
                why = f" {error}"
        if not rows:
            known = labelled(name, int(body or 0))
            raise CoverageError(f"No SPK segment of {known} is loaded; kernels.bodies() lists those that are.{why}")
        return Listing(columns, tuple(rows))

    def _spans(self, kind: str, key: int, number: int, name: str) -> list[tuple[Any, ...]]:
        own = [s for s in self._pool.segments if (s.kind, s.body) == (kind, key)]
        files = dict.fromkeys(s.path for s in own)
        return [(number, name, *span, Path(path).name) for path in files for span in coverage(s for s in own if s.path == path)]

    def _frame_spans(self, frame: FrameFacts) -> list[tuple[Any, ...]]:
        number, name = frame.id, frame.name
        anchor = anchored(self._pool, frame).frame
        if anchor.frame_class == INERTIAL:
            return [(number, name, None, None, "built in" if frame.frame_class == INERTIAL else "fixed offset")]
        if anchor.frame_class == PCK:
            rows = self._spans("PCK", anchor.class_id, number, name)
            if has_text_pck(self._pool, anchor.class_id):
                rows.append((number, name, None, None, "text PCK"))
            if rows:
                return rows
        if anchor.frame_class == CK:
            paths = dict.fromkeys(s.path for s in self._pool.ck_segments(anchor.class_id))
            if paths:
                clock_of(self._pool, anchor.class_id)  # says which kernel is missing
            rows = [
                (number, name, *span, Path(path).name) for path in paths for span in self._pool.ck_windows(path, anchor.class_id, False)
            ]
            if rows:
                return rows
        if anchor.frame_class in (DYNAMIC, SWITCH):
            return [(number, name, None, None, f"{anchor.class_name}: where what defines it has data")]
        raise CoverageError(f"No kernel loaded orients {name} (class {frame.class_name}); kernels.frames() lists those that are.")

    def leap_seconds(self) -> LeapSeconds:
        """Return the table of the leap-seconds kernel loaded, for ``Epoch.from_utc`` and its kin (MissingKernelError without one)."""
        return read_leap_seconds(self._pool)
