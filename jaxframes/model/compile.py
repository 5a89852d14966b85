"""Compiling a tree: frames as they are declared become stacked parameters and a static topology."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import jax
import jax.numpy as jnp

from jaxframes.edges.attachable import Attachable
from jaxframes.edges.base import Edge
from jaxframes.edges.mimic import sources
from jaxframes.errors import DuplicateNameError, TopologyError, UnknownFrameError, suggest
from jaxframes.model.families import families, strengthened
from jaxframes.model.properties import Properties
from jaxframes.model.reading import Hanging, reading
from jaxframes.model.structure import Structure
from jaxframes.model.topology import Topology

LARGE = 65
"""Trees of at least so many frames are handed to compiled queries with their numbers stacked by family, and go by level with attachable
frames too."""


@dataclass
class Declared:
    """Frames as they are declared, each before those that hang on it; the root is the first.

    Attributes:
        parents: Parent of each frame, None for the root.
        edges: Edge above each frame but the root.
        edge_names: Name of the edge above a frame, where it has one; in the order of the joints' coordinates.
        properties: Facts kept with a frame, where there are some.
    """

    parents: dict[str, str | None]
    edges: dict[str, Edge] = field(default_factory=dict)
    edge_names: dict[str, str] = field(default_factory=dict)
    properties: dict[str, Properties] = field(default_factory=dict)

    @classmethod
    def of(cls, tree: Structure) -> "Declared":
        """Return the frames of a tree."""
        topology, names = tree.topology, tree.names
        ordered = dict(zip((names[frame] for frame in topology.joint_frames), topology.joint_names, strict=True))
        rest = {name: edge for name, edge in zip(names, topology.edge_names, strict=True) if edge is not None and name not in ordered}
        parents = {name: names[parent] if parent >= 0 else None for name, parent in zip(names, topology.parents, strict=True)}
        return cls(parents, dict(tree.edges), {**ordered, **rest}, tree.frozen_properties())

    def part(self, names: Iterable[str]) -> "Declared":
        """Return some of the frames, in the order given; the first is the root of the part."""
        kept = list(names)
        inside = set(kept[1:])
        return Declared(
            {name: self.parents[name] if name in inside else None for name in kept},
            {name: self.edges[name] for name in kept[1:]},
            {frame: name for frame, name in self.edge_names.items() if frame in inside},
            {name: self.properties[name] for name in kept if name in self.properties},
        )

    def renamed(self, rename: Callable[[str], str]) -> "Declared":
        """Return the frames and edges under other names (DuplicateNameError where two would have one)."""
        for names, what in ((list(self.parents), "frames"), (list(self.edge_names.values()), "joints")):
            found: dict[str, str] = {}
            for name in names:
                other = found.setdefault(rename(name), name)
                if other != name:
                    raise DuplicateNameError(f"{what} {other!r} and {name!r} would both be called {rename(name)!r}; give another prefix")
        return Declared(
            {rename(name): None if parent is None else rename(parent) for name, parent in self.parents.items()},
            {rename(name): edge.renamed(rename) for name, edge in self.edges.items()},
            {rename(frame): rename(name) for frame, name in self.edge_names.items()},
            {rename(name): held for name, held in self.properties.items()},
        )


def compile_frames(declared: Declared) -> tuple[tuple[Edge, ...], Topology]:
    """Return the edges of a tree, whose numbers are its parameters, and its topology.

    Raises:
        UnknownFrameError: A candidate of an attachable frame, or a frame that an edge reads, does not exist.
        UnknownJointError: A joint that is followed does not exist.
        TopologyError: Joints follow each other in a ring, frames need each other, or an attachable frame could never hang on one of its
            candidates.
        EdgeError: A joint that is followed has no such coordinate.
    """
    names, held_edges = tuple(declared.parents), declared.edges
    index = {name: i for i, name in enumerate(names)}
    given = {id(edge): edge for edge in held_edges.values()}
    strong = {key: strengthened(edge) for key, edge in given.items()}
    edges = [strong[id(held_edges[name])] for name in names[1:]]
    if len(given) < len(edges) < LARGE:  # one edge above several frames: each gets arrays of its own, so that the tree can be donated
        edges = [jax.tree.map(jnp.copy, edge) for edge in edges]
    groups, stacked, locations = families(edges)
    joints = [name for name in declared.edge_names if held_edges[name].nq]
    prescribed, held = [-1], 0
    for edge in edges:
        prescribed.append(held if edge.is_prescribed else -1)
        held += edge.is_prescribed
    attachables, candidates = _attachables(declared, index)
    topology = Topology(
        names=names,
        parents=tuple(-1 if parent is None else index[parent] for parent in declared.parents.values()),
        groups=groups,
        stacked=stacked,
        locations=((-1, -1), *locations),
        coordinates=_coordinates(names, held_edges, joints),
        joint_names=tuple(declared.edge_names[name] for name in joints),
        joint_frames=tuple(index[name] for name in joints),
        prescribed=tuple(prescribed),
        attachables=attachables,
        candidates=candidates,
        properties=tuple((name, declared.properties[name]) for name in names if name in declared.properties),
        edge_names=tuple(declared.edge_names.get(name) for name in names),
        sources=sources(held_edges, declared.edge_names, index),
        reads=reading(_hanging(declared, names, attachables, candidates), held_edges, index),
    )
    return tuple(edges), topology


def _hanging(declared: Declared, names: tuple[str, ...], attachables: tuple[int, ...], candidates: tuple[tuple[int, ...], ...]) -> Hanging:
    """Return what hangs on what, or may, by name."""
    allowed = {names[frame]: tuple(names[c] for c in own) for frame, own in zip(attachables, candidates, strict=True)}
    return Hanging(declared.parents, allowed)


def _coordinates(names: Iterable[str], edges: Mapping[str, Edge], joints: list[str]) -> tuple[tuple[int, int, int, int], ...]:
    """Return (first q, nq, first qd, nv) of each frame's edge; joints take their places in the order given."""
    starts, first_q, first_v = {}, 0, 0
    for name in joints:
        edge = edges[name]
        starts[name] = (first_q, edge.nq, first_v, edge.nv)
        first_q, first_v = first_q + edge.nq, first_v + edge.nv
    return tuple(starts.get(name, (0, 0, 0, 0)) for name in names)


def _attachables(declared: Declared, index: Mapping[str, int]) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
    """Return the attachable frames and, for each, the frames that may be its parent."""
    attachable = {name: edge for name, edge in declared.edges.items() if isinstance(edge, Attachable)}
    component: dict[str, str] = {}
    for name, parent in declared.parents.items():
        component[name] = name if parent is None or name in attachable else component[parent]
    found = []
    for name, edge in attachable.items():
        allowed = [other for other in index if component[other] != name] if edge.candidates is None else list(edge.candidates)
        for other in allowed:
            if other not in index:
                raise UnknownFrameError(f"frame {name!r}: its candidate {other!r} does not exist.{suggest(other, index)}")
            if component[other] == name:
                raise TopologyError(f"frame {name!r}: its candidate {other!r} always hangs on it: that would be a cycle")
        first = declared.parents[name]
        if first not in allowed:
            raise TopologyError(f"frame {name!r} starts on {first!r}, which is not among its candidates {allowed}; name it there too")
        found.append(tuple(sorted(index[other] for other in allowed)))
    return tuple(index[name] for name in attachable), tuple(found)
