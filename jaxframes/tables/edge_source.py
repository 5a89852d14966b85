"""Tables as the source of the edges of a tree: what is not among them cannot be placed."""

from collections.abc import Collection, Iterable, Mapping
from fractions import Fraction
from typing import Any

from jaxframes.edges.base import Edge
from jaxframes.errors import EdgeError, NoPathError, suggest
from jaxframes.tables.fixed import FixedFrame
from jaxframes.tables.info import Info
from jaxframes.tables.naif_ids import CENTERS, INERTIAL, J2000, body_named, name_of, same_as_j2000
from jaxframes.tables.placing import EdgeSource
from jaxframes.tables.table_edge import TableEdge


class TableSource(EdgeSource):
    """Tables made before as the source of edges: what is not among them cannot be placed.

    The body that a frame belongs to is what its table says, and where it does not say it, what SPICE has built in.
    """

    asked: tuple[Fraction | None, Fraction | None] = (None, None)

    def __init__(self, tables: Mapping[str, Any] | Iterable[Any]):
        """Take tables by name, or one after the other."""
        held = list(tables.values()) if isinstance(tables, Mapping) else list(tables)
        strange = [t for t in held if not isinstance(t, TableEdge)]
        if strange:
            raise EdgeError(f"add_spice takes jf.spice.Kernels or tables, found a {type(strange[0]).__name__}")
        self._translations = [t for t in held if t.info.kind == "translation" and t.info.axes not in INERTIAL[1:]]
        self._orientations = [t for t in held if t.info.kind != "translation"]

    def body(self, body: str | int) -> tuple[int, str]:
        """See ``EdgeSource``."""
        known = {0: "SSB"} | {
            i: n for t in self._translations for i, n in ((t.info.relative_id, t.info.relative_to), (t.info.of_id, t.info.of))
        }
        centers = (center_of(t.info) for t in self._orientations)
        known |= {center: name_of(center) for center in centers if center is not None and center not in known}
        wanted = body.strip().upper() if isinstance(body, str) else body
        other = body_named(body) if isinstance(body, str) else None
        for number, name in known.items():
            if wanted in (number, name.upper(), str(number)) or other == number:
                return number, name
        raise NoPathError(f"No table of {body!r} is among those given.{suggest(str(body).upper(), list(known.values()))}")

    def frame(self, body: int, frame: str | int | None) -> tuple[int, str]:
        """See ``EdgeSource``."""
        known = dict(enumerate(INERTIAL, 1)) | {t.info.of_id: t.info.of for t in self._orientations}
        if frame is None:
            fixed = self.own_axes(body)
            if fixed is not None:
                return fixed
            own = [t.info for t in self._orientations if center_of(t.info) == body and t.info.of_id > len(INERTIAL)]
            if body < 10 or not own:
                return J2000, "J2000"
            if len(own) > 1:
                names = ", ".join(info.of for info in own)
                raise NoPathError(f"Several tables orient frames of body {body}: {names}. Name one: frame={own[0].of!r}.")
            return own[0].of_id, own[0].of
        if same_as_j2000(frame):
            return J2000, "J2000"
        for number, name in known.items():
            if frame == number or (isinstance(frame, str) and frame.strip().upper() in (name, str(number))):
                return number, name
        raise NoPathError(f"No table of the frame {frame!r} is among those given.{suggest(str(frame).upper(), list(known.values()))}")

    def centered(self, body: int, frame: int) -> bool:
        """See ``EdgeSource``."""
        return any(t.info.of_id == frame and center_of(t.info) in (None, body) for t in self._orientations)

    def base(self, frame: int) -> tuple[int, str]:
        """See ``EdgeSource``."""
        info = next((t.info for t in self._orientations if t.info.of_id == frame), None)
        if info is None:
            raise NoPathError(
                f"No table orients frame {INERTIAL[frame - 1]}: tables are in J2000 axes; ask for that, and turn with jf.edges.Fixed."
            )
        return info.relative_id, info.relative_to

    def chain(self, body: int, there: Collection[int]) -> list[int]:
        """See ``EdgeSource``: the shortest way along tables to a body that is there."""
        ways = [[body]]
        for way in ways:  # which grows: breadth first
            if len(way) > 1 and way[-1] in there:
                return way
            ways += [[*way, t.info.relative_id] for t in self._translations if t.info.of_id == way[-1] and t.info.relative_id not in way]
        return ways[-1]

    def own_axes(self, body: int) -> tuple[int, str] | None:
        """See ``EdgeSource``."""
        axes = {t.info.axes for t in self._translations if t.info.of_id == body}
        ids = {t.info.of: t.info.of_id for t in self._orientations}
        named = [(ids[name], name) for name in axes if name not in INERTIAL and name in ids]
        return named[0] if len(named) == len(axes) == 1 else None

    def translation(self, target: int, center: int, axes: str = "J2000") -> Edge:
        """See ``EdgeSource``."""
        for table in self._translations:
            if (table.info.of_id, table.info.relative_id, table.info.axes) == (target, center, axes):
                return table
        held = "; ".join(f"{t.info.of} from {t.info.relative_to}" for t in self._translations) or "none"
        raise NoPathError(
            f"No table of {self.body(target)[1]!r} is among those given: none of body {target} from {center} in {axes} (there are: {held})."
        )

    def orientation(self, frame: tuple[int, str], base: tuple[int, str]) -> Edge:
        """See ``EdgeSource``."""
        for table in self._orientations:
            if (table.info.of_id, table.info.relative_id) == (frame[0], base[0]):
                return table
            if isinstance(table, FixedFrame) and (table.info.relative_id, table.info.of_id) == (frame[0], base[0]):
                return table.inverted()
        raise NoPathError(f"No table orients {frame[1]} relative to {base[1]} among those given.")


def center_of(info: Info) -> int | None:
    """Return the id of the body that a frame belongs to, None where it is not known."""
    return CENTERS.get(info.of_id) if info.center is None else info.center
