"""A tree as the argument of a compiled query: few arrays, and simple numbers folded into the program."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.kinematics.plan import by_level
from jaxframes.model.compile import LARGE
from jaxframes.model.families import PartlyBatched, float_dtype, rows_of
from jaxframes.model.structure import Structure
from jaxframes.model.topology import Topology
from jaxframes.staging.arrays import is_concrete
from jaxframes.staging.traced_inputs import Known


@jax.tree_util.register_pytree_node_class
class StackedTree(Structure):
    """The same tree, its numbers stored by family: a compiled call takes a handful of arrays instead of some for each frame.

    Attributes:
        stacks: For each family its arrays [..., n_edges, k], or what few edges with batch axes make of them; where its edges do not
            stack, one edge (of many, or the only one).
        topology: As in ``FrameTree``.
    """

    def __init__(self, families: tuple[Any, ...], topology: Topology):
        self.stacks, self.topology = families, topology

    def tree_flatten(self) -> tuple[tuple[Any, ...], Topology]:
        """Return the arrays, and the topology (for JAX)."""
        return (self.stacks,), self.topology

    @classmethod
    def tree_unflatten(cls, topology: Topology, children: Any) -> "StackedTree":
        """Return the tree of some arrays (for JAX)."""
        (stacks,) = children
        return cls(stacks, topology)

    def edge_of(self, frame: int) -> Edge:
        """Return the edge above a frame given by its index, which is not the root's."""
        group, row = self.topology.locations[frame]
        if not self.topology.stacked[group]:
            edge = self.stacks[group]
            return edge if len(self.topology.members[group]) == 1 else edge.alone(row)
        return jax.tree.unflatten(self.topology.groups[group], [_row_of(leaf, row) for leaf in self.stacks[group]])

    def family(self, group: int) -> tuple[Any, ...]:
        """Return the numbers of all edges of a family that stacks, leaf by leaf."""
        return self.stacks[group]

    def together(self, group: int) -> Edge:
        """Return the edges of a family that does not stack as one edge."""
        return self.stacks[group]

    def numbers(self, frames: Sequence[int]) -> tuple[Any, ...]:
        """Return the numbers of the edges above frames, all of one family, leaf by leaf: arrays [..., n_frames, k]."""
        locations = self.topology.locations
        group, rows = locations[frames[0]][0], np.array([locations[frame][1] for frame in frames])
        return tuple(rows_of(leaf, rows) for leaf in self.stacks[group])

    @property
    def is_known(self) -> bool:
        """Whether all numbers of the tree are known, outside any trace."""
        return self.held("is_known", lambda: all(map(is_concrete, jax.tree.leaves(self.stacks))))

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Batch axes of the tree's own numbers."""
        return self.held("batch_shape", self._batch_shape)

    def _batch_shape(self) -> tuple[int, ...]:
        families = list(zip(self.stacks, self.topology.stacked, strict=True))
        others = {edge.batch_shape for edge, on in families if not on}
        return np.broadcast_shapes(*{_batch_of(leaf) for leaves, on in families if on for leaf in leaves}, *others)

    @property
    def dtype(self) -> Any:
        """Float dtype of the tree's numbers."""
        return self.held("dtype", lambda: float_dtype(self.stacks))


def _row_of(leaf: Any, row: int) -> Any:
    return leaf.row(row) if isinstance(leaf, PartlyBatched) else leaf[..., row, :]


def _batch_of(leaf: Any) -> tuple[int, ...]:
    return leaf.batch_shape if isinstance(leaf, PartlyBatched) else np.shape(leaf)[:-2]


def stacked_tree(tree: Structure) -> StackedTree:
    """Return a tree with its numbers stored by family, traced or known (then as NumPy arrays)."""
    if isinstance(tree, StackedTree):
        return tree
    kinds = zip(tree.topology.stacked, tree.topology.members, strict=True)
    return StackedTree(tuple(tree.family(i) if on else tree.together(i) for i, (on, members) in enumerate(kinds)), tree.topology)


class Plan:
    """How a tree is put together of arguments: its structure, and the numbers that are part of the program; hashable, equal by value."""

    def __init__(self, structure: Any, known: tuple[Known | None, ...]):
        self._structure, self._known = structure, known
        self._hash = hash((structure, known))

    def tree(self, arrays: Sequence[Any]) -> Structure:
        """Return the tree of the arrays that are not known."""
        rest = iter(arrays)
        return jax.tree.unflatten(self._structure, [next(rest) if known is None else known.array for known in self._known])

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Plan) and (self._structure, self._known) == (other._structure, other._known))


def as_arguments(tree: Structure) -> tuple[Any, Plan | None]:
    """Return what a compiled query takes of a tree: arguments, and the plan by which they become the tree.

    Axes along coordinates, identities and zeros are part of the plan: they fold away, and a tree that differs in other numbers runs the
    same program. A large tree is stacked by family; one whose numbers are traced is taken as it is.
    """
    if not tree.is_known:
        return tree, None
    if len(tree.names) >= LARGE or (by_level(tree.topology) and not all(tree.topology.stacked)):
        return tree.held("stacked", lambda: jax.tree.map(jnp.asarray, stacked_tree(tree))), None
    return tree.held("arguments", lambda: _folded(tree))


def _folded(tree: Structure) -> tuple[tuple[Any, ...], Plan]:
    leaves, structure = jax.tree.flatten(tree)
    known = tuple(Known(tuple(np.asarray(x).tolist()), np.dtype(x.dtype).name) if _is_simple(x) else None for x in leaves)
    return tuple(leaf for leaf, number in zip(leaves, known, strict=True) if number is None), Plan(structure, known)


def _is_simple(leaf: Any) -> bool:
    """Return whether all numbers of a leaf are zeros or ones of either sign."""
    return np.ndim(leaf) == 1 and bool(np.isin(np.asarray(leaf), (-1.0, 0.0, 1.0)).all())
