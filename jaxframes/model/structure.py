"""Questions about a tree's structure: answered on the host from static arrays, without JAX."""

import functools
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.errors import TopologyError, UnknownJointError, suggest
from jaxframes.model import parameters
from jaxframes.model.properties import thaw
from jaxframes.model.topology import Topology
from jaxframes.staging.arrays import default_float, is_concrete, widest


class Structure:
    """What a tree can say of itself without a state. Every name that is not in the tree is an UnknownFrameError.

    Attachable frames count as hanging on the parent that they were declared on; ``path`` and ``common_ancestor`` refuse to
    cross them, because what they hang on is data in a state.
    """

    frame_edges: tuple[Edge, ...]
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
        return self.frame_edges[frame - 1]

    def numbers(self, frames: Sequence[int]) -> tuple[Any, ...]:
        """Return the numbers of the edges above frames, all of one family, leaf by leaf: arrays [..., n_frames, k]."""
        if not self.is_known:
            return parameters.stack([self._edge(frame) for frame in frames])
        locations = self.topology.locations
        group, rows = locations[frames[0]][0], np.array([locations[frame][1] for frame in frames])
        whole = self._known_family(group)
        return (
            whole
            if len(rows) == len(self.topology.members[group]) and np.all(np.diff(rows) == 1)
            else tuple(a[..., rows, :] for a in whole)
        )

    def _known_family(self, group: int) -> tuple[Any, ...]:
        """Return the stacked numbers of a family, all known, as NumPy arrays; they are stacked once."""
        if group not in self._stacked:
            self._stacked[group] = parameters.stack([self._edge(frame) for frame in self.topology.members[group]])
        return self._stacked[group]

    @functools.cached_property
    def _stacked(self) -> dict[int, tuple[Any, ...]]:
        return {}

    @functools.cached_property
    def families(self) -> tuple[Any, ...]:
        """The numbers of a tree that is known, family by family: stacked arrays, or one edge where its edges do not stack."""

        def family(group: int, stacked: bool) -> Any:
            return tuple(map(jnp.asarray, self._known_family(group))) if stacked else jax.tree.map(jnp.asarray, self.together(group))

        return tuple(family(group, stacked) for group, stacked in enumerate(self.topology.stacked))

    def together(self, group: int) -> Edge:
        """Return the edges of a family that does not stack as one edge: the edge itself where there is one."""
        edges = [self._edge(frame) for frame in self.topology.members[group]]
        if len(edges) == 1:
            return edges[0].bare()
        return self.held(f"family {group}", lambda: edges[0].together(edges)) if self.is_known else edges[0].together(edges)

    def held(self, key: str, make: Callable[[], Any]) -> Any:
        """Return what a function makes, which the tree keeps under a key: made once, gone with the tree."""
        if key not in self._held:
            self._held[key] = make()
        return self._held[key]

    @functools.cached_property
    def _held(self) -> dict[str, Any]:
        return {}

    @functools.cached_property
    def distinct_edges(self) -> tuple[Edge, ...]:
        """The edges, each once: a large tree may be made of a few that stand above many frames."""
        return tuple({id(edge): edge for edge in self.frame_edges}.values())

    @functools.cached_property
    def is_known(self) -> bool:
        """Whether all numbers of the tree are known, outside any trace."""
        return all(map(is_concrete, jax.tree.leaves(self.distinct_edges)))

    @functools.cached_property
    def dtype(self) -> Any:
        """Float dtype of the tree's numbers: JAX's default where it has none."""
        return float_dtype(self.distinct_edges)

    @functools.cached_property
    def batch_shape(self) -> tuple[int, ...]:
        """Batch axes of the tree's own numbers, broadcast: () unless some edges hold a batch of numbers."""
        leaves = jax.tree.leaves([edge for edge in self.distinct_edges if edge.stacks])
        return np.broadcast_shapes(*{np.shape(leaf)[:-1] for leaf in leaves})

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


def float_dtype(leaves: Any) -> Any:
    """Return the promoted float dtype of a pytree's leaves, or JAX's default where there is none."""
    dtypes = {leaf.dtype for leaf in jax.tree.leaves(leaves) if jnp.issubdtype(leaf.dtype, jnp.floating)}
    return widest(*dtypes) if dtypes else default_float()
