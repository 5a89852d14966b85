"""Questions about a tree's structure: answered on the host from static arrays, without JAX."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from jaxframes.errors import TopologyError, UnknownJointError, suggest
from jaxframes.tree import grouping
from jaxframes.tree.edges.base import Edge
from jaxframes.tree.properties import thaw
from jaxframes.tree.topology import Topology


class Structure:
    """What a tree can say of itself without a state. Every name that is not in the tree is an UnknownFrameError.

    Attachable frames count as hanging on the parent that they were declared on; ``path`` and ``common_ancestor`` refuse to
    cross them, because what they hang on is data in a state.
    """

    parameters: grouping.Parameters
    topology: Topology

    @property
    def names(self) -> tuple[str, ...]:
        """Frame names in order of declaration, the root first."""
        return self.topology.names

    @property
    def root(self) -> str:
        """Name of the root frame."""
        return self.topology.names[0]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of their coordinates in ``q``."""
        return self.topology.joint_names

    def joint_of(self, name: str) -> str | None:
        """Return the name of the edge above a frame: its joint, a fixed joint's too; None where it has none (UnknownFrameError)."""
        return self.topology.edge_names[self.topology.index(name)]

    def frame_of(self, joint: str) -> str:
        """Return the frame below a joint, a fixed one or one that follows another too (UnknownJointError)."""
        found = self.topology.edge_index
        if joint not in found:
            raise UnknownJointError(f"the tree has no joint {joint!r}.{suggest(str(joint), found)}")
        return self.names[found[joint]]

    @property
    def nq(self) -> int:
        """Number of stored joint coordinates."""
        return self.topology.nq

    @property
    def nv(self) -> int:
        """Number of joint rates (the mobility)."""
        return self.topology.nv

    @property
    def properties(self) -> Mapping[str, Mapping[str, Any]]:
        """Facts kept with each frame: read-only, static, empty where none were given."""
        known = dict(self.topology.properties)
        return MappingProxyType({name: thaw(known.get(name, ())) for name in self.names})

    @property
    def edges(self) -> Mapping[str, Edge]:
        """The edge above each frame but the root, by the frame's name."""
        return MappingProxyType({name: self._edge(i) for i, name in enumerate(self.names) if i})

    def edge(self, name: str) -> Edge:
        """Return the edge between a frame and its parent (TopologyError for the root, which has none)."""
        return self._edge(self._below_root(name, "so it has no edge"))

    def _edge(self, frame: int) -> Edge:
        t = self.topology
        return grouping.edge_at(self.parameters, t.groups, t.stacked, t.locations[frame])

    def _below_root(self, name: str, consequence: str) -> int:
        frame = self.topology.index(name)
        if frame == 0:
            raise TopologyError(f"{name!r} is the root: it hangs on nothing, {consequence}")
        return frame

    def lookup(self, name: str) -> tuple[str, ...]:
        """Return the frames with a name: always one, because names are unique (UnknownFrameError lists close names)."""
        return (self.names[self.topology.index(name)],)

    def parent(self, name: str) -> str:
        """Return the name of a frame's parent (TopologyError for the root)."""
        return self.names[self.topology.parents[self._below_root(name, "so it has no parent")]]

    def children(self, name: str) -> tuple[str, ...]:
        """Return the names of a frame's children in order of declaration."""
        return self.topology.names_of(self.topology.children[self.topology.index(name)])

    def depth(self, name: str) -> int:
        """Return the number of edges between the root and a frame."""
        return self.topology.depths[self.topology.index(name)]

    def ancestors(self, name: str) -> tuple[str, ...]:
        """Return a frame's ancestors from its parent up to the root; empty for the root."""
        return self.topology.names_of(self.topology.ancestors(self.topology.index(name)))[1:]

    def subtree(self, name: str) -> tuple[str, ...]:
        """Return a frame and all frames below it, in order of declaration."""
        return self.topology.names_of(self.topology.subtree(self.topology.index(name)))

    def common_ancestor(self, a: str, b: str) -> str:
        """Return the deepest frame that both frames descend from (a frame descends from itself)."""
        return self.names[self.topology.common_ancestor(self.topology.index(a), self.topology.index(b))]

    def is_ancestor(self, a: str, b: str, strict: bool = False) -> bool:
        """Return whether ``b`` descends from ``a``; a frame counts as its own ancestor unless ``strict``."""
        first, second = self.topology.index(a), self.topology.index(b)
        return first in self.topology.ancestors(second) and not (strict and first == second)

    def path(self, *, of: str, relative_to: str) -> tuple[tuple[str, int], ...]:
        """Return the edges between two frames, from ``relative_to`` to ``of``.

        Each is the name of the edge's child frame with +1 where it is walked from parent to child, -1 where backwards.
        """
        up, down = self.topology.route(self.topology.index(of), self.topology.index(relative_to))
        names = self.names
        return (*((names[i], -1) for i in reversed(up)), *((names[i], 1) for i in down))
