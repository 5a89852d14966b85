"""Placing frames in a tree by SPICE ids: finding the one for a body and a frame, or hanging it where it belongs."""

import abc
import contextlib
import itertools
from collections.abc import Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any, Protocol

from jaxframes.edges.base import Edge
from jaxframes.errors import CoverageError, DuplicateNameError, NoPathError, UnknownBodyError
from jaxframes.tables.info import Info
from jaxframes.tables.instants import span_text
from jaxframes.tables.naif_ids import INERTIAL, J2000, body_named, labelled, name_of
from jaxframes.tables.table_edge import TableEdge

DEFAULT_FRAME = 999999
"""Asks for the default frame of a body, as None does; as a number or as text."""
BODY, FRAME, CHECK = "spice_body", "spice_frame", "spice_check"
Key = tuple[int, int]
"""The ids of a body and of a frame."""


class TreeInMaking(Protocol):
    """What placing needs of a ``TreeBuilder``, which is made of layers above this one."""

    @property
    def root(self) -> str:
        """Name of the root frame."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Frame names in order of declaration."""
        ...

    def frames(self) -> Iterable[tuple[str, str | None, Edge | None, Mapping[str, Any]]]:
        """Return (name, parent, edge, properties) of each frame."""
        ...

    def add(self, name: str, *, parent: str, edge: Edge, properties: Mapping[str, Any] | None = None) -> None:
        """Add a frame below an existing one."""

    def remove(self, name: str) -> None:
        """Remove a frame, and what hangs on it."""


class EdgeSource(abc.ABC):
    """Where edges between SPICE frames come from: kernels, or tables made before."""

    asked: tuple[Fraction | None, Fraction | None]
    """The span that edges are asked to cover, None where they are not."""

    @abc.abstractmethod
    def body(self, body: str | int) -> tuple[int, str]:
        """Return the id and name of a body."""

    @abc.abstractmethod
    def frame(self, body: int, frame: str | int | None) -> tuple[int, str]:
        """Return the id and name of a frame; the default frame of a body for None."""

    @abc.abstractmethod
    def centered(self, body: int, frame: int) -> bool:
        """Whether a body is the centre of a frame."""

    @abc.abstractmethod
    def base(self, frame: int) -> tuple[int, str]:
        """Return the frame that an orientation edge of a frame starts from."""

    @abc.abstractmethod
    def chain(self, body: int, there: Collection[int]) -> list[int]:
        """Return a body and the bodies that its position is given relative to, link by link, by way of one that is there if possible."""

    @abc.abstractmethod
    def own_axes(self, body: int) -> tuple[int, str] | None:
        """Return the id and name of the turning frame that the positions of a body are given in, as those of stations; None for J2000."""

    @abc.abstractmethod
    def translation(self, target: int, center: int, axes: str = "J2000") -> Edge:
        """Return the edge from a body to another, both with these axes."""

    @abc.abstractmethod
    def orientation(self, frame: tuple[int, str], base: tuple[int, str]) -> Edge:
        """Return the edge from a frame to another."""


class OffersEdges(abc.ABC):
    """What ``TreeBuilder.add_spice`` takes besides tables: open kernels."""

    @abc.abstractmethod
    def edge_source(self, *args: Any, **options: Any) -> EdgeSource:
        """Return the source of edges with the options that a user gives."""


def place(builder: TreeInMaking, source: EdgeSource, body: str | int, frame: str | int | None) -> str:
    """Return the name of the frame for a body and a SPICE frame in a builder, added if it is not there.

    A body whose positions are given in turning axes, such as a station, hangs on the frame that has them, at its centre. Another frame
    with turning axes hangs on the inertial frame (J2000) of its body, or on the frame that it is fixed to; an inertial frame
    hangs on that of the next body on the way to the Solar System barycentre that is there, with the bodies between added too.
    """
    body_id, body_name = source.body(body)
    wanted = source.frame(body_id, None if str(frame).strip() == str(DEFAULT_FRAME) else frame)
    before = set(builder.names)
    try:
        return _place(builder, source, (body_id, body_name), wanted)
    except BaseException:
        for name in [name for name in builder.names if name not in before]:
            if name in builder.names:  # not gone with one that it hung on
                builder.remove(name)
        raise


def _place(builder: TreeInMaking, source: EdgeSource, body: tuple[int, str], frame: tuple[int, str]) -> str:
    known = {key: name for name, key in reversed(spice_ids(builder, source).items())}
    key = body[0], frame[0]
    if key in known:
        _check_span(builder, source, known[key])
        return known[key]
    if frame == source.own_axes(body[0]):
        center = source.chain(body[0], ())[1]
        parent = _place(builder, source, source.body(center), frame)
        return _add(builder, body[1], parent, source.translation(body[0], center, frame[1]), body, frame)
    if frame[0] == J2000:
        return _place_inertial(builder, source, body, known)
    base = source.base(frame[0])
    parent = _place(builder, source, body, base)
    wanted = frame[1] if source.centered(body[0], frame[0]) else f"{frame[1]} @ {body[1]}"
    return _add(builder, wanted, parent, source.orientation(frame, base), body, frame)


def _check_span(builder: TreeInMaking, source: EdgeSource, name: str) -> None:
    """Raise CoverageError if tables that a known frame hangs on do not cover the span asked for."""
    held = {frame: (parent, edge) for frame, parent, edge, _ in builder.frames()}
    at: str | None = name
    while at is not None:
        parent, edge = held[at]
        info = edge.info if isinstance(edge, TableEdge) else None
        if info is not None and info.start:
            have = Fraction(info.start), Fraction(info.stop)
            low, high = (end if asked is None else asked for asked, end in zip(source.asked, have, strict=True))
            if low < have[0] or high > have[1]:
                raise CoverageError(
                    f"frame {at!r} is in the tree already, with a table that covers {span_text(*have)}, not {span_text(low, high)}: leave "
                    "start= and stop= out to use it, or build another tree."
                )
        at = parent


def _place_inertial(builder: TreeInMaking, source: EdgeSource, body: tuple[int, str], known: dict[Key, str]) -> str:
    """Add the J2000 frame of a body."""
    turned = next((name for (at, axes), name in known.items() if at == body[0] and 1 < axes <= len(INERTIAL)), None)
    if turned is not None:
        axes = next(axes for (at, axes), name in known.items() if name == turned)
        edge = source.orientation((J2000, "J2000"), (axes, INERTIAL[axes - 1]))
        return _add(builder, body[1], turned, edge, body, (J2000, "J2000"))
    inertial = {at for at, axes in known if 1 <= axes <= len(INERTIAL)}
    chain = source.chain(body[0], inertial)
    there = next((i for i, center in enumerate(chain) if i and center in inertial), None)
    if there is None:
        root = next((key for key, name in known.items() if name == builder.root), None)
        if root is None or root[1] != J2000:
            raise NoPathError(
                f"No frame of the tree is one that {labelled(body[1], body[0])} can hang on. "
                "Name the root 'SSB' or after a body, or say what it is: "
                f"builder.set_properties({builder.root!r}, {{{BODY!r}: 0, {FRAME!r}: 1}}), with the ids of its body and frame."
            )
        chain, there = [body[0], root[0]], 1
    parent = _place(builder, source, source.body(chain[there]), (J2000, "J2000"))
    for lower, upper in reversed(list(itertools.pairwise(chain[: there + 1]))):
        parent = _add(builder, source.body(lower)[1], parent, source.translation(lower, upper), source.body(lower), (J2000, "J2000"))
    return parent


def _add(builder: TreeInMaking, wanted: str, parent: str, edge: Edge, body: tuple[int, str], frame: tuple[int, str]) -> str:
    name = wanted if wanted not in builder.names else f"{wanted} ({body[0]}, {frame[0]})"
    if name in builder.names:
        raise DuplicateNameError(f"frames {wanted!r} and {name!r} exist already and are not {frame[1]} of {body[1]}; rename one of them")
    facts = {BODY: body[0], FRAME: frame[0], f"{BODY}_name": body[1], f"{FRAME}_name": frame[1]}
    builder.add(name, parent=parent, edge=edge, properties=facts)
    return name


def spice_ids(builder: TreeInMaking, source: EdgeSource) -> dict[str, Key]:
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
        info = edge.info if isinstance(edge, TableEdge) else None
        if parent is None or info is None or info.kind != "translation" or info.axes not in INERTIAL:
            continue
        axes = INERTIAL.index(info.axes) + 1
        found.setdefault(parent, (info.relative_id, axes))
        found.setdefault(name, (info.of_id, axes))
    if builder.root not in found:
        with contextlib.suppress(NoPathError, UnknownBodyError):
            found[builder.root] = source.body(builder.root)[0], J2000
    for name, parent, edge, _ in frames:
        info = edge.info if isinstance(edge, TableEdge) else None
        if name in found or parent not in found or info is None or info.kind == "translation":
            continue
        if found[parent][1] == info.relative_id:
            found[name] = found[parent][0], info.of_id
    return {name: found[name] for name in builder.names if name in found}


def misplaced(frames: Iterable[tuple[str, str | None, Edge | None, Mapping[str, Any]]]) -> Iterator[str]:
    """Yield a sentence for each table that hangs on another frame than it starts from, as far as names, properties and tables tell.

    Args:
        frames: (name, parent, edge, properties) of each frame. A frame whose property ``spice_check`` is False is left out.
    """
    held = list(frames)
    tables: dict[str, Info] = {name: edge.info for name, _, edge, _ in held if isinstance(edge, TableEdge)}
    known: dict[str, tuple[int | None, int | None, str]] = {}
    for name, parent, _, facts in held if tables else ():
        if BODY in facts:
            known[name] = int(facts[BODY]), int(facts.get(FRAME, J2000)), "its properties say"
        elif name in tables:
            info = tables[name]
            own_body, own_axes = (info.of_id, _axes_id(info)) if info.kind == "translation" else (None, info.of_id)
            known[name] = own_body, own_axes, "its own table says"
        elif parent is None and (body := body_named(name)) is not None:
            known[name] = body, J2000, "its name says"
    for name, parent, _, facts in held:
        if name not in tables or parent is None or facts.get(CHECK) is False:
            continue
        info = tables[name]
        start_body, start_axes = (info.relative_id, _axes_id(info)) if info.kind == "translation" else (None, info.relative_id)
        body, axes, why = known.setdefault(parent, (start_body, start_axes, f"the table of {name!r} says"))
        if _differ(body, start_body) or _differ(axes, start_axes):
            start = f"{info.relative_to} in {info.axes}" if info.kind == "translation" else info.relative_to
            parts = [] if body is None else [f"body {labelled(name_of(body), body)}"]
            there = " and ".join(parts if axes is None else [*parts, f"SPICE frame {axes}"])
            yield (
                f"frame {name!r}: its table is {info.of} from {start}, and it hangs on {parent!r}, which is {there}, as {why}: "
                f"hang it on the frame that it starts from, or tell with properties={{{CHECK!r}: False}} that it is right"
            )


def _axes_id(info: Info) -> int | None:
    return INERTIAL.index(info.axes) + 1 if info.axes in INERTIAL else None


def _differ(one: int | None, other: int | None) -> bool:
    return one is not None and other is not None and one != other
