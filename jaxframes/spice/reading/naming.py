"""Bodies and frames by name or id, as the kernels loaded know them; with errors that suggest what was meant."""

from typing import Any

from jaxframes.errors import NoPathError, UnknownAxesError, UnknownBodyError, suggest
from jaxframes.spice.reading.frame_chain import CLASSES, INERTIAL, PCK
from jaxframes.tables.naif_ids import NAMES

SSB = tuple(name for name, number in NAMES.items() if number == 0)


class Names:
    """The part of ``Kernels`` that looks up bodies and frames."""

    _process: Any
    _segments: Any

    def _body(self, body: str | int, role: str) -> int:
        label = _filled(body, role, "body", "'EARTH' or 399", UnknownBodyError)
        if label.strip().upper() in SSB:
            return 0
        found = self._process.call("body", label, doing=f"looking up {body!r}")
        if found is None:
            held = {b for s in self._segments if s.kind == "SPK" for b in (s.body, s.center)}
            names = self._process.call("body_names", sorted(held | set(range(1000))), doing="listing bodies")
            raise UnknownBodyError(f"{role} = {body!r} is no body known to SPICE.{suggest(label.upper(), names)} An id number works too.")
        return int(found)

    def _name(self, body: int) -> str:
        return "SSB" if body == 0 else self._process.call("body_name", body, doing=f"naming body {body}")

    def _axes(self, frame: str, role: str = "frame") -> dict[str, Any]:
        label = _filled(frame, role, "frame", "'J2000' or 'ITRF93'", UnknownAxesError)
        found = self._process.call("frame", label, doing=f"looking up {frame!r}")
        if found is None:
            listed = self._process.call("all_frames", doing="listing frames")
            oriented = {f["class_id"] for f in listed if f["class"] == PCK}
            lost = sorted({s.body for s in self._segments if s.kind == "PCK"} - oriented)
            hint = f" The binary PCK files loaded orient class ids {lost}, which no frame is defined for: load their frame kernel (.tf)."
            raise UnknownAxesError(
                f"{frame!r} is no frame known to SPICE or to the kernels loaded."
                f"{suggest(label.upper(), [f['name'] for f in listed])}{hint if lost else ''}"
            )
        return found

    def _inertial(self, frame: str, role: str) -> dict[str, Any]:
        found = self._axes(frame, role)
        if found["class"] != INERTIAL:
            kind = CLASSES.get(found["class"], "?")
            raise NoPathError(
                f"{role} = {frame!r} is a {kind} frame, which turns; tables have inertial axes, as 'J2000'. "
                f"Add the orientation as an edge of its own: kernels.orientation(frame={frame!r}, relative_to='J2000')."
            )
        return found


def _filled(given: Any, role: str, kind: str, examples: str, error: type[Exception]) -> str:
    """Return a name or an id as text, which CSPICE takes only if there is some."""
    label = str(given)
    if not label.strip():
        raise error(f"{role} = {given!r} is empty: give the name or the id of a {kind}, such as {examples}.")
    return label
