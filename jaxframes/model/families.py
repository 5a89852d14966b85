"""Families: edges that are alike, so that queries over many frames read their numbers as stacked arrays."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.staging.arrays import as_float, default_float, is_concrete, widest


def families(edges: Sequence[Edge]) -> tuple[tuple[Any, ...], tuple[bool, ...], tuple[tuple[int, int], ...]]:
    """Sort edges into families: of equal structure, or of one kind.

    Returns:
        How an edge of each family is put together (a pytree definition; that of the first where its edges do not stack), whether the
        family is stacked, and (family, row) of each edge.
    """
    found: dict[Any, int] = {}
    counts: list[int] = []
    definitions: list[Any] = []
    stacked: list[bool] = []
    locations: list[tuple[int, int]] = []
    known: dict[int, Any] = {}
    for position, edge in enumerate(edges):
        if id(edge) not in known:
            leaves, definition = jax.tree.flatten(edge.bare())
            key = (definition, tuple((np.shape(leaf)[-1:], leaf.dtype.name) for leaf in leaves))
            stacks = edge.stackable and not edge.reads  # what an edge reads of the tree is worked out for it alone
            kind = None if stacks or edge.reads else edge.kind()
            known[id(edge)] = definition, key if stacks else position if kind is None else kind, stacks
        definition, key, stacks = known[id(edge)]
        if key not in found:
            found[key] = len(definitions)
            definitions.append(definition)
            stacked.append(stacks)
            counts.append(0)
        family = found[key]
        locations.append((family, counts[family]))
        counts[family] += 1
    return tuple(definitions), tuple(stacked), tuple(locations)


def strengthened(edge: Edge) -> Edge:
    """Return an edge whose leaves are JAX arrays: floats with a strong dtype, integers as they are."""
    if all(isinstance(leaf, jax.Array) and not leaf.weak_type for leaf in jax.tree.leaves(edge)):
        return edge
    return jax.tree.map(lambda leaf: jnp.asarray(leaf) if jnp.issubdtype(jnp.result_type(leaf), jnp.integer) else as_float(leaf), edge)


def stack(edges: Sequence[Edge]) -> tuple[Any, ...]:
    """Return the leaves of edges of one family stacked, [..., n_edges, k]: NumPy arrays where all numbers are known."""
    rows = [jax.tree.leaves(edge) for edge in edges]
    return tuple(_stack(column) for column in zip(*rows, strict=True))


def _stack(column: tuple[Any, ...]) -> Any:
    known = all(map(is_concrete, column))
    if len({leaf.shape for leaf in column}) > 1:
        column = tuple(np.broadcast_arrays(*map(np.asarray, column)) if known else jnp.broadcast_arrays(*column))
    if known:
        return np.stack([np.asarray(leaf) for leaf in column], axis=-2)
    return jnp.stack(column, axis=-2)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class PartlyBatched:
    """A leaf of a family's edges of which few have batch axes: kept as they are, so that a batch for one is not stored for all.

    Attributes:
        plain: The numbers of the edges without batch axes [n_edges, k], zeros for the others.
        batched: Those of the others, [..., k] each.
        rows: The rows of these.
    """

    plain: Any
    batched: tuple[Any, ...]
    rows: tuple[int, ...] = field(metadata={"static": True})

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """The batch axes of all, broadcast."""
        return np.broadcast_shapes(*(np.shape(leaf)[:-1] for leaf in self.batched))

    def row(self, row: int) -> Any:
        """Return the numbers of one edge [..., k]."""
        return self.batched[self.rows.index(row)] if row in self.rows else self.plain[row]

    def taken(self, rows: np.ndarray) -> jax.Array:
        """Return the numbers of some edges as one array [..., n, k]."""
        array = jnp.asarray(self.plain)[rows]
        among = [(at, self.batched[self.rows.index(row)]) for at, row in enumerate(rows.tolist()) if row in self.rows]
        if among:
            batch = np.broadcast_shapes(*(np.shape(leaf)[:-1] for _, leaf in among))
            array = jnp.broadcast_to(array, (*batch, *array.shape))
        for at, leaf in among:
            array = array.at[..., at, :].set(leaf)
        return array


def stored(edges: Sequence[Edge]) -> tuple[Any, ...]:
    """Return the leaves of edges of one family, stacked as ``stack`` does, or ``PartlyBatched`` where that takes much less memory."""
    rows = [jax.tree.leaves(edge) for edge in edges]
    return tuple(_stored(column) for column in zip(*rows, strict=True))


def rows_of(column: Any, rows: np.ndarray) -> Any:
    """Return some rows of what ``stored`` keeps of a leaf, as one array [..., n, k]; all of them as they are."""
    if isinstance(column, PartlyBatched):
        return column.taken(rows)
    if len(rows) == column.shape[-2] and np.all(np.diff(rows) == 1):
        return column
    return column[..., rows, :] if is_concrete(column) else column.at[..., rows, :].get(mode="promise_in_bounds")


def _stored(column: tuple[Any, ...]) -> Any:
    shapes = [leaf.shape[:-1] for leaf in column]
    if len(set(shapes)) == 1 or not all(isinstance(n, int) for shape in shapes for n in shape):
        return _stack(column)
    if len(column) * math.prod(np.broadcast_shapes(*shapes)) <= 2 * sum(map(math.prod, shapes)):
        return _stack(column)
    rows = tuple(row for row, shape in enumerate(shapes) if shape)
    zeros = np.zeros(column[0].shape[-1], column[0].dtype)
    plain = _stack(tuple(leaf if not shape else zeros for leaf, shape in zip(column, shapes, strict=True)))
    return PartlyBatched(plain, tuple(column[row] for row in rows), rows)


def like(new: Edge, old: Edge) -> Edge | None:
    """Return an edge that may stand in the place of another, with its dtypes; None if it is of another family or its numbers do not fit."""
    raw, definition = jax.tree.flatten(strengthened(new))
    kept = jax.tree.leaves(old)
    if jax.tree.structure(new.bare()) != jax.tree.structure(old.bare()) or [np.shape(a)[-1:] for a in raw] != [
        np.shape(b)[-1:] for b in kept
    ]:
        return None
    return jax.tree.unflatten(definition, [a.astype(b.dtype) for a, b in zip(raw, kept, strict=True)])


def differs(new: Edge, old: Edge) -> str:
    """Return text that says why an edge may not stand in the place of another."""
    if type(new) is not type(old):
        return f"it is {new.describe()}, of another family; build another tree"
    ours, theirs = new.bare(), old.bare()
    for name in (f.name for f in dataclasses.fields(ours) if f.name not in ours.parameter_fields()):
        a, b = getattr(ours, name), getattr(theirs, name)
        if a != b:
            return f"its {name} is {a!r} instead of {b!r}, and programs are compiled for that; build another tree"
    paths = [jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in jax.tree_util.tree_flatten_with_path(new)[0]]
    for path, a, b in zip(paths, jax.tree.leaves(new), jax.tree.leaves(old), strict=False):
        if np.shape(a)[-1:] != np.shape(b)[-1:]:
            return f"its {path} has shape {np.shape(a)} instead of [..., {', '.join(map(str, np.shape(b)[-1:]))}]; build another tree"
    return "its parts differ; build another tree"


def float_dtype(leaves: Any) -> Any:
    """Return the promoted float dtype of a pytree's leaves, or JAX's default where there is none."""
    dtypes = {leaf.dtype for leaf in jax.tree.leaves(leaves) if jnp.issubdtype(leaf.dtype, jnp.floating)}
    return widest(*dtypes) if dtypes else default_float()
