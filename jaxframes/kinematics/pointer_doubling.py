"""Pointer doubling over many links at once: each component an array over the links, so the program stays small."""

from collections.abc import Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.kinematics.context import Context
from jaxframes.numerics.components import Component
from jaxframes.numerics.rigid import AT_REST, Rigid, compose

Many = TypeVar("Many")


def place(
    context: Context, links: tuple[int, ...], rows: dict[int, int], inside: dict[int, dict[int, Rigid]]
) -> tuple[dict[int, Rigid], dict[int, jax.Array]]:
    """Return where each link's root is in the anchor, and whether it arrives there, for links that hang on each other.

    Args:
        context: Tree, state and order.
        links: The attachable frames, roots of their components.
        rows: Row of each attachable frame in the state.
        inside: Motions of the candidates in their components' roots (or in the anchor).
    """
    topology, shape, dtype = context.topology, context.shape, context.dtype
    frames = sorted({c for link in links for c in topology.candidates[rows[link]]})
    table = stack_components([inside[topology.static_components[c]][c] for c in frames], shape, dtype)
    held = [context.attachment(rows[link]) for link in links]
    parents = jnp.stack([jnp.broadcast_to(parent, shape) for parent, _ in held], -1)
    position, member, code = _lookups(context, links, rows, frames)
    clipped = jnp.clip(parents, 0, len(topology.names) - 1)
    parent_row = jnp.asarray(position)[clipped]
    known = jnp.asarray(member)[np.arange(len(links)), clipped] & (clipped == parents)
    motion = compose(take_motions(table, parent_row), stack_components([m for _, m in held], shape, dtype), context.order)
    motion = jax.tree.map(lambda rest, c: c if isinstance(c, float) else _with_first(c, rest), AT_REST, motion)
    pointer, valid = _with_first(jnp.asarray(code)[parent_row], 0), _with_first(known, True)
    for _ in range((len(links) - 1).bit_length()):
        motion = compose(take_motions(motion, pointer), motion, context.order)
        valid = valid & jnp.take_along_axis(valid, pointer, -1)
        pointer = jnp.take_along_axis(pointer, pointer, -1)
    arrived = valid & (pointer == 0)
    roots = {link: jax.tree.map(lambda c, i=i: c if isinstance(c, float) else c[..., i], motion) for i, link in enumerate(links, 1)}
    return roots, {link: arrived[..., i] for i, link in enumerate(links, 1)}


def _lookups(context: Context, links: tuple[int, ...], rows: dict[int, int], frames: list[int]) -> tuple[np.ndarray, ...]:
    """Return static tables: place of a frame among the candidates, who may hang on whom, and the link that a candidate is on."""
    topology, count = context.topology, len(context.topology.names)
    position, member = np.zeros(count, np.int32), np.zeros((len(links), count), bool)
    position[frames] = np.arange(len(frames))
    for i, link in enumerate(links):
        member[i, list(topology.candidates[rows[link]])] = True
    number = {0: 0, **{link: i for i, link in enumerate(links, 1)}}
    return position, member, np.array([number[topology.static_components[c]] for c in frames], np.int32)


def _with_first(values: jax.Array, first: Any) -> jax.Array:
    """Return values [..., n] with one more in front: what belongs to the anchor itself."""
    return jnp.concatenate([jnp.full((*values.shape[:-1], 1), first, values.dtype), values], -1)


def stack_components(motions: Sequence[Many], shape: tuple[int, ...], dtype: Any) -> Many:
    """Return motions (or other structures of components) as one with components [*shape, n]; a number that all share stays a number."""

    def join(*parts: Component) -> Component:
        first = parts[0]
        if isinstance(first, float) and all(isinstance(p, float) and p == first for p in parts):
            return first
        return jnp.stack([jnp.broadcast_to(jnp.asarray(p, dtype), shape) for p in parts], -1)

    return jax.tree.map(join, *motions)


def take_motions(motions: Rigid, index: jax.Array) -> Rigid:
    """Return the motions at an index [..., k] of the last axis of components [..., n]."""
    return jax.tree.map(lambda c: c if isinstance(c, float) else jnp.take_along_axis(c, index, -1), motions)
