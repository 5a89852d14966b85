"""Frames that read other frames: who reads whom as indices, and no ring among them."""

from collections.abc import Mapping
from dataclasses import dataclass

from jaxframes.edges.base import Edge
from jaxframes.errors import TopologyError, UnknownFrameError, suggest

Reads = tuple[tuple[int, int, bool], ...]
"""Motions that an edge needs: index of the frame, of its observer, and whether one derivative more is needed."""


@dataclass(frozen=True)
class Hanging:
    """What hangs on what, by name.

    Attributes:
        parents: Parent of each frame, None for the root.
        candidates: Frames that may be the parent of each attachable frame.
    """

    parents: Mapping[str, str | None]
    candidates: Mapping[str, tuple[str, ...]]

    def above(self, frame: str | None) -> list[str]:
        """Return a frame and its ancestors, up to the root or to a frame whose parent is data."""
        line = []
        while frame is not None:
            line.append(frame)
            frame = None if frame in self.candidates else self.parents[frame]
        return line

    def edges_between(self, a: str, b: str) -> set[str]:
        """Return the edges, by the frames below them, that the motion of one frame relative to another may depend on."""
        lines = [self.above(a), self.above(b)]
        if lines[0][-1] == lines[1][-1]:  # nothing that is data stands between them
            return set(lines[0]) ^ set(lines[1])
        links, ahead = set[str](), [line[-1] for line in lines]
        while ahead:
            top = ahead.pop()
            if top in self.candidates and top not in links:
                links.add(top)
                more = [self.above(candidate) for candidate in self.candidates[top]]
                lines += more
                ahead += [line[-1] for line in more]
        roots = [set(line) for line in lines if line[-1] not in self.candidates]
        shared = set.intersection(*roots) if roots else set[str]()
        return (set().union(*map(set, lines)) - shared) | links


def reading(hanging: Hanging, edges: Mapping[str, Edge], index: Mapping[str, int]) -> tuple[Reads, ...]:
    """Return what each frame's edge reads.

    Args:
        hanging: What hangs on what.
        edges: Edge above each frame.
        index: Index of each frame.

    Raises:
        UnknownFrameError: A frame that is read does not exist.
        TopologyError: Frames need each other, in a ring.
    """
    pairs: dict[str, list[tuple[str, str, bool]]] = {}
    for name, edge in edges.items():
        for read in edge.reads:
            for other in (read.of, read.relative_to):
                if other is not None and other not in index:
                    raise UnknownFrameError(f"frame {name!r} reads the motion of {other!r}, which does not exist.{suggest(other, index)}")
            parent = hanging.parents[name]
            assert parent is not None
            pairs.setdefault(name, []).append((read.of, parent if read.relative_to is None else read.relative_to, read.further))
    needs = {name: _needs(hanging, own, set(pairs)) for name, own in pairs.items()}
    _refuse_rings(needs)
    return tuple(tuple((index[of], index[seen_from], more) for of, seen_from, more in pairs.get(name, ())) for name in index)


def _needs(hanging: Hanging, pairs: list[tuple[str, str, bool]], derived: set[str]) -> set[str]:
    """Return the frames that read others among the edges that some motions depend on."""
    return set().union(*(hanging.edges_between(of, seen_from) for of, seen_from, _ in pairs)) & derived


def _refuse_rings(needs: Mapping[str, set[str]]) -> None:
    done: set[str] = set()

    def visit(name: str, line: list[str]) -> None:
        if name in line:
            ring = " -> ".join([*line[line.index(name) :], name])
            raise TopologyError(
                f"frames that need each other: {ring}; each reads a motion along a path that crosses the next. Hang one of them elsewhere, "
                "or let it read other frames (Attachable(candidates=...) restricts what attachable frames may hang on)"
            )
        if name not in done:
            for other in sorted(needs[name]):
                visit(other, [*line, name])
            done.add(name)

    for name in needs:
        visit(name, [])
