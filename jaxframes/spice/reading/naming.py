"""Bodies and frames by name or id, as the kernels loaded know them; with errors that suggest what was meant."""

from dataclasses import dataclass
from typing import Any

from jaxframes.errors import NoPathError, UnknownAxesError, UnknownBodyError, suggest
from jaxframes.spice.reading.process import KernelProcess
from jaxframes.spice.reading.segments import Segment
from jaxframes.tables.naif_ids import NAMES, NO_FRAMES, same_as_j2000

SSB = tuple(name for name, number in NAMES.items() if number == 0)
INERTIAL, PCK, CK, TK, DYNAMIC, SWITCH = 1, 2, 3, 4, 5, 6
CLASSES = {INERTIAL: "inertial", PCK: "PCK", CK: "CK", TK: "fixed offset (TK)", DYNAMIC: "dynamic", SWITCH: "switch"}
"""SPICE's classes of frames, and what they are called."""


@dataclass(frozen=True)
class FrameFacts:
    """What SPICE knows of a frame.

    Attributes:
        id: Its id.
        name: Its name.
        center: Id of the body that it belongs to.
        frame_class: Its class, one of ``CLASSES``.
        class_id: Its id within the class.
    """

    id: int
    name: str
    center: int
    frame_class: int
    class_id: int

    @property
    def class_name(self) -> str:
        """Name of the class."""
        return CLASSES.get(self.frame_class, "?")


class Names:
    """Looks up bodies and frames in the kernels of a process.

    Attributes:
        process: The process.
        segments: The segments of binary SPK and PCK files, in order of loading: later ones win.
    """

    process: KernelProcess
    segments: list[Segment]

    def body(self, body: str | int, role: str) -> int:
        """Return the id of a body by name or id.

        Raises:
            UnknownBodyError: If it is unknown; suggests what was meant.
        """
        label = _filled(body, role, "body", "'EARTH' or 399", UnknownBodyError)
        if label.strip().upper() in SSB:
            return 0
        found = self.process.call("body", label, doing=f"looking up {body!r}")
        if found is None:
            held = {b for s in self.segments if s.kind == "SPK" for b in (s.body, s.center)}
            names = self.process.call("body_names", sorted(held | set(range(1000))), doing="listing bodies")
            raise UnknownBodyError(f"{role} = {body!r} is no body known to SPICE.{suggest(label.upper(), names)} An id number works too.")
        return int(found)

    def body_name(self, body: int) -> str:
        """Return the name of a body, or its number as text."""
        return "SSB" if body == 0 else self.process.call("body_name", body, doing=f"naming body {body}")

    def find_body(self, label: str) -> int | None:
        """Return the id of a body by name or by a number as text, None if it is unknown."""
        return 0 if label.upper() in SSB else self.process.call("body", label, doing=f"looking up {label!r}")

    def find_frame(self, label: str | int) -> FrameFacts | None:
        """Return a frame by name or id, None if it is unknown."""
        found = self.process.call("frame", str(label), doing=f"looking up frame {label!r}")
        return None if found is None else FrameFacts(**found)

    def all_frames(self) -> list[FrameFacts]:
        """Return all frames, built in and defined by text kernels."""
        return [FrameFacts(**found) for found in self.process.call("all_frames", doing="listing frames")]

    def frame(self, frame: str | int, role: str = "frame") -> FrameFacts:
        """Return a frame by name or id; ICRF, ICRS, GCRF, GCRS and EME2000 are J2000.

        Raises:
            UnknownAxesError: If it is unknown; suggests what was meant.
        """
        label = _filled(frame, role, "frame", "'J2000' or 'ITRF93'", UnknownAxesError)
        found = self.find_frame(label)
        if found is None and same_as_j2000(label):
            found = self.find_frame("J2000")
        if found is None:
            listed = self.all_frames()
            oriented = {f.class_id for f in listed if f.frame_class == PCK}
            lost = sorted({s.body for s in self.segments if s.kind == "PCK"} - oriented)
            hint = f" The binary PCK files loaded orient class ids {lost}, which no frame is defined for: load their frame kernel (.tf)."
            meant = NO_FRAMES.get(label.strip().upper())
            remedy = f" {meant}." if meant else suggest(label.upper(), [f.name for f in listed])
            raise UnknownAxesError(f"{frame!r} is no frame known to SPICE or to the kernels loaded.{remedy}{hint if lost else ''}")
        return found

    def inertial_frame(self, frame: str, role: str) -> FrameFacts:
        """Return an inertial frame by name or id.

        Raises:
            UnknownAxesError: If it is unknown.
            NoPathError: If it turns.
        """
        found = self.frame(frame, role)
        if found.frame_class != INERTIAL:
            raise NoPathError(
                f"{role} = {frame!r} is a {found.class_name} frame, which turns; tables have inertial axes, as 'J2000'. "
                f"Add the orientation as an edge of its own: kernels.orientation(frame={frame!r}, relative_to='J2000')."
            )
        return found


def _filled(given: Any, role: str, kind: str, examples: str, error: type[Exception]) -> str:
    """Return a name or an id as text, which CSPICE takes only if there is some."""
    label = str(given)
    if not label.strip():
        raise error(f"{role} = {given!r} is empty: give the name or the id of a {kind}, such as {examples}.")
    return label
