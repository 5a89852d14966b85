"""Topology: which frame hangs on which, as static arrays: hashable, and equal by value."""

import functools
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from jaxframes.errors import TopologyError, UnknownFrameError, UnknownJointError, suggest


@dataclass(frozen=True, eq=False)
class Topology:
    """The static part of a tree: names, parents, and where each edge finds its numbers.

    Frames are numbered in order of declaration; the root is frame 0 and every parent comes before its children. Two
    topologies with equal contents are equal and hash alike, so programs compiled for one serve the other.

    Attributes:
        names: Frame names.
        parents: Index of each frame's parent; -1 for the root.
        groups: For every family of edges that are alike, how to put an edge together (a pytree definition).
        stacked: Whether the numbers of each family's edges may be stacked.
        locations: (family, row) of each frame's edge; (-1, -1) for the root.
        coordinates: (first q, nq, first qd, nv) of each frame's edge.
        reads: For each frame the motions that its edge needs: (frame, observer, whether one derivative more is needed).
        edge_names: Name of each frame's edge (a joint's name), or None; a name space of its own.
        sources: For each frame, the frame whose edge has the coordinates that its own edge follows, or -1.
        joint_names: Name of the joint of each edge that has coordinates, in the order of its coordinates.
        joint_frames: Index of the child frame of each of these joints.
        prescribed: Index in the state's prescribed motions of each frame's edge, or -1.
        attachables: Frames whose parent is data; ``parents`` holds the one each starts on.
        candidates: Frames that may be the parent of each of these.
        properties: (frame name, frozen properties) of the frames that were built with some.
        notes: The same for frames whose properties were set later: no part of what makes topologies equal, so no program may read them.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    groups: tuple[Any, ...]
    stacked: tuple[bool, ...]
    locations: tuple[tuple[int, int], ...]
    coordinates: tuple[tuple[int, int, int, int], ...]
    joint_names: tuple[str, ...]
    joint_frames: tuple[int, ...]
    prescribed: tuple[int, ...]
    attachables: tuple[int, ...] = ()
    candidates: tuple[tuple[int, ...], ...] = ()
    properties: tuple[tuple[str, Any], ...] = ()
    edge_names: tuple[str | None, ...] = ()
    sources: tuple[int, ...] = ()
    notes: tuple[tuple[str, Any], ...] = ()
    reads: tuple[tuple[tuple[int, int, bool], ...], ...] = ()

    @functools.cached_property
    def _digest(self) -> bytes:
        parts = (self.names, self.parents, self.stacked, self.locations, self.coordinates, self.joint_names, self.prescribed)
        more = (self.attachables, self.candidates, self.properties, self.edge_names, self.sources, self.joint_frames, self.reads)
        return hashlib.blake2b(repr((parts, more)).encode()).digest()

    @functools.cached_property
    def _hash(self) -> int:
        return hash((self._digest, self.groups))

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, Topology):
            return NotImplemented
        return self._hash == other._hash and self._digest == other._digest and self.groups == other.groups

    @functools.cached_property
    def plain(self) -> "Topology":
        """The topology without what was set later."""
        return replace(self, notes=()) if self.notes else self

    @functools.cached_property
    def keys(self) -> tuple[Any, ...]:
        """Keys, as JAX writes paths, of the edges above all frames but the root."""
        return tuple(map(jax.tree_util.DictKey, self.names[1:]))

    @functools.cached_property
    def index_of(self) -> dict[str, int]:
        """Index of each frame by name."""
        return {name: i for i, name in enumerate(self.names)}

    @functools.cached_property
    def members(self) -> tuple[tuple[int, ...], ...]:
        """For each family, the frames whose edges belong to it, in the order of their rows."""
        found: list[list[int]] = [[] for _ in self.groups]
        for frame, (group, _) in enumerate(self.locations):
            if group >= 0:
                found[group].append(frame)
        return tuple(map(tuple, found))

    @functools.cached_property
    def static_components(self) -> tuple[int, ...]:
        """For each frame, the root of the static part of the tree that it belongs to: the root, or an attachable frame."""
        static_components = list(range(len(self.names)))
        attachable = set(self.attachables)
        for i in range(1, len(self.names)):
            if i not in attachable:
                static_components[i] = static_components[self.parents[i]]
        return tuple(static_components)

    @functools.cached_property
    def depths(self) -> tuple[int, ...]:
        """Number of edges between the root and each frame."""
        depths = [0] * len(self.names)
        for i in range(1, len(self.names)):
            depths[i] = depths[self.parents[i]] + 1
        return tuple(depths)

    @functools.cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Indices of each frame's children, in order of declaration."""
        found: list[list[int]] = [[] for _ in self.names]
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                found[parent].append(i)
        return tuple(map(tuple, found))

    @functools.cached_property
    def joint_index(self) -> dict[str, int]:
        """Index of each joint by name."""
        return {name: i for i, name in enumerate(self.joint_names)}

    @functools.cached_property
    def edge_index(self) -> dict[str, int]:
        """Index of the frame below each edge that has a name, by that name."""
        return {name: i for i, name in enumerate(self.edge_names) if name is not None}

    @property
    def nq(self) -> int:
        """Number of stored coordinates of all joints."""
        return sum(c[1] for c in self.coordinates)

    @property
    def nv(self) -> int:
        """Number of rates of all joints."""
        return sum(c[3] for c in self.coordinates)

    def index(self, name: str) -> int:
        """Return a frame's index.

        Raises:
            UnknownFrameError: No frame has that name; close names are suggested.
        """
        try:
            return self.index_of[name]
        except (KeyError, TypeError):
            if isinstance(name, str):
                below = self.edge_index.get(name)
                other = "" if below is None else f" There is a joint of that name: the frame below it is {self.names[below]!r}."
                raise UnknownFrameError(f"the tree has no frame {name!r}.{other}{suggest(name, self.names)}") from None
            found = f"an array of {name.dtype}{list(name.shape)}" if isinstance(name, (np.ndarray, jax.Array)) else repr(name)
            raise UnknownFrameError(f"a frame is asked for by its name, found {found}; tree.names[i] is the name of frame i") from None

    def joint(self, name: str) -> int:
        """Return a joint's index.

        Raises:
            UnknownJointError: No joint has that name; close names are suggested.
        """
        try:
            return self.joint_index[name]
        except (KeyError, TypeError):
            frame = self.edge_index.get(name, 0) if isinstance(name, str) else 0
            if frame and self.sources[frame] >= 0:
                raise UnknownJointError(f"joint {name!r} follows {self.edge_names[self.sources[frame]]!r}; set that one") from None
            if frame:
                raise UnknownJointError(f"joint {name!r} is fixed: it has no coordinates") from None
            above = self.edge_names[self.index_of[name]] if isinstance(name, str) and name in self.index_of else None
            other = f" There is a frame of that name: the joint above it is {above!r}." if above is not None else ""
            raise UnknownJointError(f"the tree has no joint {name!r}.{other}{suggest(str(name), self.joint_names)}") from None

    def ancestors(self, frame: int) -> Iterator[int]:
        """Yield a frame, its parent, and so on to the root."""
        while frame >= 0:
            yield frame
            frame = self.parents[frame]

    def common_ancestor(self, a: int, b: int) -> int:
        """Return the deepest frame that is an ancestor of both (a frame counts as its own ancestor)."""
        if self.static_components[a] != self.static_components[b]:
            x, y = self.names[a], self.names[b]
            attachable = self.names[self.static_components[a] or self.static_components[b]]
            raise TopologyError(
                f"no static path between {x!r} and {y!r}: what {attachable!r} hangs on is data in the state; "
                f"query it with tree.transform and its like, or ask tree.parent({attachable!r}, state)"
            )
        while a != b:
            if self.depths[a] >= self.depths[b]:
                a = self.parents[a]
            else:
                b = self.parents[b]
        return a

    def down_path(self, ancestor: int, frame: int) -> tuple[int, ...]:
        """Return the frames from below an ancestor down to a frame: each stands for the edge above it.

        Raises:
            TopologyError: The frame does not hang below the ancestor.
        """
        path = []
        at = frame
        while at != ancestor:
            if at < 0:
                raise TopologyError(
                    f"frame {self.names[frame]!r} does not descend from {self.names[ancestor]!r}; "
                    f"its ancestors are {', '.join(repr(self.names[i]) for i in self.ancestors(frame))}"
                )
            path.append(at)
            at = self.parents[at]
        return tuple(reversed(path))

    def route(self, of: int, relative_to: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the edges from the common ancestor down to ``relative_to`` and down to ``of``."""
        ancestor = self.common_ancestor(of, relative_to)
        return self.down_path(ancestor, relative_to), self.down_path(ancestor, of)

    def subtree(self, frame: int) -> tuple[int, ...]:
        """Return a frame and all frames below it, in order of declaration."""
        inside = {frame}
        for i in range(frame + 1, len(self.names)):
            if self.parents[i] in inside:
                inside.add(i)
        return tuple(sorted(inside))

    def names_of(self, frames: Iterable[int]) -> tuple[str, ...]:
        """Return the names of frames given by index."""
        return tuple(self.names[i] for i in frames)
