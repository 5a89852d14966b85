"""Grouping: edges of one family stored as stacked arrays, and put together again one by one."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics.boundary import as_float, is_concrete
from jaxframes.tree.edges.base import Edge

Parameters = tuple[tuple[jax.Array, ...], ...]
"""For every group of edges, the leaves of the group; stacked ones are ``[..., n_edges, k]``."""


def group_edges(edges: Sequence[Edge]) -> tuple[Parameters, tuple[Any, ...], tuple[bool, ...], tuple[tuple[int, int], ...]]:
    """Sort edges into groups of equal structure and stack their parameters.

    A tree of thousands of edges then has a handful of leaves: a compiled call is dispatched as fast as one with few
    arguments, and arithmetic over all edges of a kind needs no gathering first.

    Returns:
        The parameters of each group, the pytree definition of its edges, whether it is stacked, and (group, row) of each edge.
    """
    found: dict[Any, int] = {}
    members: list[list[tuple[Any, ...]]] = []
    definitions: list[Any] = []
    stacked: list[bool] = []
    locations: list[tuple[int, int]] = []
    for position, edge in enumerate(edges):
        raw, definition = jax.tree.flatten(edge)
        leaves = tuple(strong(leaf) for leaf in raw)
        key = (definition, tuple((leaf.shape, leaf.dtype) for leaf in leaves)) if edge.stacks else position
        if key not in found:
            found[key] = len(members)
            members.append([])
            definitions.append(definition)
            stacked.append(edge.stacks)
        group = found[key]
        locations.append((group, len(members[group])))
        members[group].append(leaves)
    parameters = tuple(
        tuple(_stack(column) for column in zip(*rows, strict=True)) if on else rows[0] for rows, on in zip(members, stacked, strict=True)
    )
    return parameters, tuple(definitions), tuple(stacked), tuple(locations)


def strong(leaf: Any) -> jax.Array:
    """Return a parameter as a JAX array: floats with a strong dtype, integers as they are."""
    if jnp.issubdtype(jnp.result_type(leaf), jnp.integer):
        return jnp.asarray(leaf)
    return as_float(leaf)


def _stack(column: tuple[jax.Array, ...]) -> jax.Array:
    if all(is_concrete(leaf) for leaf in column):
        return jnp.asarray(np.stack([np.asarray(leaf) for leaf in column], axis=-2))
    return jnp.stack(column, axis=-2)


def edge_at(parameters: Parameters, definitions: tuple[Any, ...], stacked: tuple[bool, ...], location: tuple[int, int]) -> Edge:
    """Return one edge. Parameters whose numbers are known stay known (as NumPy arrays), also inside a trace."""
    group, row = location
    leaves = parameters[group]
    if stacked[group]:
        leaves = tuple((np.asarray(leaf) if is_concrete(leaf) else leaf)[..., row, :] for leaf in leaves)
    return jax.tree.unflatten(definitions[group], leaves)


def with_edge(
    parameters: Parameters, definitions: tuple[Any, ...], location: tuple[int, int], stacked: bool, edge: Edge
) -> Parameters | None:
    """Return the parameters with one edge replaced, or None if the new edge has another structure."""
    group, row = location
    raw, definition = jax.tree.flatten(edge)
    if definition != definitions[group]:
        return None
    if not stacked:
        fresh = tuple(strong(leaf) for leaf in raw)
    else:
        pairs = zip(parameters[group], (strong(leaf) for leaf in raw), strict=True)
        fresh = tuple(_with_row(old, row, new) for old, new in pairs)
    return (*parameters[:group], fresh, *parameters[group + 1 :])


def _with_row(old: jax.Array, row: int, new: jax.Array) -> jax.Array:
    batch = jnp.broadcast_shapes(old.shape[:-2], new.shape[:-1])
    full = jnp.broadcast_to(old, (*batch, *old.shape[-2:]))
    return full.at[..., row, :].set(jnp.broadcast_to(new, (*batch, new.shape[-1])).astype(old.dtype))
