"""Frames of a tree by SPICE ids: finding the one for a body and a frame, or hanging it where it belongs."""

import contextlib
import itertools
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from jaxframes.errors import DuplicateNameError, EdgeError, NoPathError, UnknownBodyError, suggest
from jaxframes.tree.builder import TreeBuilder
from jaxframes.tree.edges.base import Edge

J2000 = 1
DEFAULT_FRAME = 999999
"""Asks for the default frame of a body, as None does."""
INERTIAL = (
    *("J2000", "B1950", "FK4", "DE-118", "DE-96", "DE-102", "DE-108", "DE-111", "DE-114", "DE-122", "DE-125", "DE-130"),
    *("GALACTIC", "DE-200", "DE-202", "MARSIAU", "ECLIPJ2000", "ECLIPB1950", "DE-140", "DE-142", "DE-143"),
)
"""Names of the inertial frames that SPICE has built in; their ids are 1, 2, 3, ..."""
BODY, FRAME = "spice_body", "spice_frame"
Key = tuple[int, int]
"""The ids of a body and of a frame."""


class Source(Protocol):
    """Where edges between SPICE frames come from: kernels, or tables made before."""

    def body(self, body: str | int) -> tuple[int, str]:
        """Return the id and name of a body."""
        ...

    def frame(self, body: int, frame: str | int | None) -> tuple[int, str]:
        """Return the id and name of a frame; the default frame of a body for None."""
        ...

    def centered(self, body: int, frame: int) -> bool:
        """Whether a body is the centre of a frame."""
        ...

    def base(self, frame: int) -> tuple[int, str]:
        """Return the frame that an orientation edge of a frame starts from."""
        ...

    def chain(self, body: int) -> list[int]:
        """Return a body and the bodies that its position is given relative to, link by link."""
        ...

    def translation(self, target: int, center: int) -> Edge:
        """Return the edge from a body to another, axes J2000."""
        ...

    def orientation(self, frame: tuple[int, str], base: tuple[int, str]) -> Edge:
        """Return the edge from a frame to another."""
        ...


def place(builder: TreeBuilder, source: Source, body: str | int, frame: str | int | None) -> str:
    """Return the name of the frame for a body and a SPICE frame in a builder, added if it is not there.

    A frame with turning axes hangs on the inertial frame (J2000) of its body, or on the frame that it is fixed to; an inertial frame
    hangs on that of the next body on the way to the Solar System barycentre that is there, with the bodies between added too.
    """
    body_id, body_name = source.body(body)
    return _place(builder, source, (body_id, body_name), source.frame(body_id, None if frame == DEFAULT_FRAME else frame))


def _place(builder: TreeBuilder, source: Source, body: tuple[int, str], frame: tuple[int, str]) -> str:
    known = {key: name for name, key in reversed(identities(builder, source).items())}
    key = body[0], frame[0]
    if key in known:
        return known[key]
    if frame[0] == J2000:
        return _place_inertial(builder, source, body, known)
    base = source.base(frame[0])
    parent = _place(builder, source, body, base)
    wanted = frame[1] if source.centered(body[0], frame[0]) else f"{frame[1]} @ {body[1]}"
    return _add(builder, wanted, parent, source.orientation(frame, base), body, frame)


def _place_inertial(builder: TreeBuilder, source: Source, body: tuple[int, str], known: dict[Key, str]) -> str:
    """Add the J2000 frame of a body."""
    turned = next((name for (at, axes), name in known.items() if at == body[0] and 1 < axes <= len(INERTIAL)), None)
    if turned is not None:
        axes = next(axes for (at, axes), name in known.items() if name == turned)
        edge = source.orientation((J2000, "J2000"), (axes, INERTIAL[axes - 1]))
        return _add(builder, body[1], turned, edge, body, (J2000, "J2000"))
    chain = source.chain(body[0])
    there = next((i for i, center in enumerate(chain) if i and any((center, axes) in known for axes in range(1, len(INERTIAL) + 1))), None)
    if there is None:
        root = next((key for key, name in known.items() if name == builder.root), None)
        if root is None or root[1] != J2000:
            raise NoPathError(
                f"No frame of the tree is one that {body[1]} ({body[0]}) can hang on. "
                "Name the root 'SSB' or after a body, or say what it is: "
                f"builder.set_properties({builder.root!r}, {{{BODY!r}: 0, {FRAME!r}: 1}}), with the ids of its body and frame."
            )
        chain, there = [body[0], root[0]], 1
    parent = _place(builder, source, source.body(chain[there]), (J2000, "J2000"))
    for lower, upper in reversed(list(itertools.pairwise(chain[: there + 1]))):
        parent = _add(builder, source.body(lower)[1], parent, source.translation(lower, upper), source.body(lower), (J2000, "J2000"))
    return parent


def _add(builder: TreeBuilder, wanted: str, parent: str, edge: Edge, body: tuple[int, str], frame: tuple[int, str]) -> str:
    name = wanted if wanted not in builder.names else f"{wanted} ({body[0]}, {frame[0]})"
    if name in builder.names:
        raise DuplicateNameError(f"frames {wanted!r} and {name!r} exist already and are not {frame[1]} of {body[1]}; rename one of them")
    facts = {BODY: body[0], FRAME: frame[0], f"{BODY}_name": body[1], f"{FRAME}_name": frame[1]}
    builder.add(name, parent=parent, edge=edge, properties=facts)
    return name


def identities(builder: TreeBuilder, source: Source) -> dict[str, Key]:
    """Return the (body id, frame id) of the frames of a builder that have one.

    They say so themselves (properties ``spice_body`` and ``spice_frame``), or tables tell: a table of the Moon from the Earth in J2000
    hangs between (399, 1) and (301, 1). A root that nothing tells about is the body that it is named after, in J2000.
    """
    found: dict[str, Key] = {}
    frames = list(builder.frames())
    for name, _, _, facts in frames:
        if BODY in facts and FRAME in facts:
            found[name] = int(facts[BODY]), int(facts[FRAME])
    for name, parent, edge, _ in frames:
        info = getattr(edge, "info", None)
        if parent is None or info is None or info.kind != "translation" or info.axes not in INERTIAL:
            continue
        axes = INERTIAL.index(info.axes) + 1
        found.setdefault(parent, (info.relative_id, axes))
        found.setdefault(name, (info.of_id, axes))
    if builder.root not in found:
        with contextlib.suppress(NoPathError, UnknownBodyError):
            found[builder.root] = source.body(builder.root)[0], J2000
    for name, parent, edge, _ in frames:
        info = getattr(edge, "info", None)
        if name in found or parent not in found or info is None or info.kind == "translation":
            continue
        if found[parent][1] == info.relative_id:
            found[name] = found[parent][0], info.of_id
    return {name: found[name] for name in builder.names if name in found}


class TableSource:
    """Tables made before as the source of edges: what is not among them cannot be placed."""

    def __init__(self, tables: Mapping[str, Any] | Iterable[Any]):
        """Take tables by name, or one after the other."""
        held = list(tables.values()) if isinstance(tables, Mapping) else list(tables)
        strange = [t for t in held if not hasattr(t, "info")]
        if strange:
            raise EdgeError(f"add_spice takes jf.spice.Kernels or tables, found a {type(strange[0]).__name__}")
        self._moves = [t for t in held if t.info.kind == "translation" and t.info.axes == "J2000"]
        self._turns = [t for t in held if t.info.kind != "translation"]

    def body(self, body: str | int) -> tuple[int, str]:
        """See ``Source``."""
        known = {0: "SSB"} | {i: n for t in self._moves for i, n in ((t.info.relative_id, t.info.relative_to), (t.info.of_id, t.info.of))}
        known |= {t.info.center: str(t.info.center) for t in self._turns if t.info.center not in (None, *known)}
        for number, name in known.items():
            if body == number or (isinstance(body, str) and body.strip().upper() in (name, str(number))):
                return number, name
        raise NoPathError(f"No table of {body!r} is among those given.{suggest(str(body).upper(), list(known.values()))}")

    def frame(self, body: int, frame: str | int | None) -> tuple[int, str]:
        """See ``Source``."""
        known = dict(enumerate(INERTIAL, 1)) | {t.info.of_id: t.info.of for t in self._turns}
        if frame is None:
            own = [t.info for t in self._turns if t.info.center == body]
            if body < 10 or not own:
                return J2000, "J2000"
            if len(own) > 1:
                names = ", ".join(info.of for info in own)
                raise NoPathError(f"Several tables orient frames of body {body}: {names}. Name one: frame={own[0].of!r}.")
            return own[0].of_id, own[0].of
        for number, name in known.items():
            if frame == number or (isinstance(frame, str) and frame.strip().upper() in (name, str(number))):
                return number, name
        raise NoPathError(f"No table of the frame {frame!r} is among those given.{suggest(str(frame).upper(), list(known.values()))}")

    def centered(self, body: int, frame: int) -> bool:
        """See ``Source``."""
        return any(t.info.of_id == frame and t.info.center in (None, body) for t in self._turns)

    def base(self, frame: int) -> tuple[int, str]:
        """See ``Source``."""
        info = next((t.info for t in self._turns if t.info.of_id == frame), None)
        if info is None:
            raise NoPathError(
                f"No table orients frame {INERTIAL[frame - 1]}: tables are in J2000 axes; ask for that, and turn with jf.edges.Fixed."
            )
        return info.relative_id, info.relative_to

    def chain(self, body: int) -> list[int]:
        """See ``Source``."""
        chain = [body]
        while True:
            centers = [t.info.relative_id for t in self._moves if t.info.of_id == chain[-1] and t.info.relative_id not in chain]
            if not centers:
                return chain
            chain.append(centers[0])

    def translation(self, target: int, center: int) -> Edge:
        """See ``Source``."""
        for table in self._moves:
            if (table.info.of_id, table.info.relative_id) == (target, center):
                return table
        held = "; ".join(f"{t.info.of} from {t.info.relative_to}" for t in self._moves) or "none"
        raise NoPathError(f"No table of body {target} from {center} in J2000 is among those given ({held}).")

    def orientation(self, frame: tuple[int, str], base: tuple[int, str]) -> Edge:
        """See ``Source``."""
        for table in self._turns:
            if (table.info.of_id, table.info.relative_id) == (frame[0], base[0]):
                return table
        raise NoPathError(f"No table orients {frame[1]} relative to {base[1]} among those given.")
