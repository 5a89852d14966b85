"""By depth level: the motions of all frames relative to the root, each component an array over the frames of a level.

The program grows with the depth of a tree and the number of its edge families, not with the number of its frames. Frames
are the first axis, batch axes follow: the parents of a level are then whole rows, and arithmetic runs along the batch.
"""

import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.kinematics.context import Context
from jaxframes.numerics.boundary import assemble, take_apart
from jaxframes.numerics.components import Component
from jaxframes.numerics.rigid import AT_REST, Rigid, compose
from jaxframes.numerics.steps import append
from jaxframes.tree.edges.base import Edge, Inputs

FEWEST = 256
"""Trees of at least so many frames go by level; smaller ones are unrolled, which runs faster on large batches."""


def applies(context: Context, relative_to: int) -> bool:
    """Return whether all frames relative to one are worked out by level: many frames, relative to the root, nothing attachable."""
    topology = context.topology
    return relative_to == 0 and len(topology.names) >= FEWEST and not topology.attachables


def all_frames(context: Context) -> Rigid:
    """Return the motions of all frames in the root as components [n_frames, *batch], in order of declaration."""
    topology = context.topology
    members = _members(context)
    local = {group: _local(context, group, frames) for group, frames in members.items()}
    row = {frame: (group, i) for group, frames in members.items() for i, frame in enumerate(frames)}
    levels = [[0]]
    for frame in range(1, len(topology.names)):
        depth = topology.depths[frame]
        if depth == len(levels):
            levels.append([])
        levels[depth].append(frame)
    done = [jax.tree.map(lambda c: _full(c, 1, context), AT_REST)]
    for above, level in itertools.pairwise(levels):
        level.sort(key=lambda frame: row[frame])
        place = {frame: i for i, frame in enumerate(above)}
        parents = _rows(done[-1], [place[topology.parents[frame]] for frame in level])
        done.append(
            materialized(compose(parents, _level(local, [row[frame] for frame in level], context), context.order), len(level), context)
        )
    order = np.argsort([frame for level in levels for frame in level])
    return _rows(_joined(done, [len(level) for level in levels], context), list(order))


def _members(context: Context) -> dict[int, list[int]]:
    found: dict[int, list[int]] = {}
    for frame, (group, _) in enumerate(context.topology.locations):
        if group >= 0:
            found.setdefault(group, []).append(frame)
    return found


def _local(context: Context, group: int, frames: list[int]) -> Rigid:
    """Return the motions of a family's edges relative to their parents, components [n_edges, *batch] or known numbers."""
    if not context.topology.stacked[group]:
        motion = AT_REST
        for step in context.steps(frames[0]):
            motion = append(motion, step, context.order)
        return jax.tree.map(lambda c: c if isinstance(c, float) else _full(c, 0, context)[None], motion)
    for frame in frames:
        context.check(frame)
    edge = _family(context, group)
    inputs = [context.inputs(frame) for frame in frames]
    together = _together(inputs, context)
    motion = AT_REST
    for step in edge.steps(together, context.order):
        motion = append(motion, step, context.order)
    return materialized(motion, len(frames), context)


def _family(context: Context, group: int) -> Edge:
    """Return all edges of a family as one, the frames as the first axis of every parameter."""

    def first(leaf: jax.Array) -> jax.Array:
        moved = jnp.moveaxis(jnp.asarray(leaf), -2, 0)
        missing = len(context.shape) - (moved.ndim - 2)
        return lax.expand_dims(moved, range(1, 1 + missing)).astype(context.dtype)

    topology = context.topology
    return jax.tree.unflatten(topology.groups[group], [first(leaf) for leaf in context.tree.parameters[group]])


def _together(inputs: list[Inputs], context: Context) -> Inputs:
    """Return what several edges read as one, each component [n_edges, *batch]."""
    one = inputs[0]
    time = None if one.time is None else tuple(jnp.asarray(part)[None] for part in one.time)
    rest = [x._replace(time=None, batch_rank=0) for x in inputs]
    joined = jax.tree.map(lambda *parts: _stack(parts, context), *rest)
    return joined._replace(time=time, batch_rank=len(context.shape) + 1)


def _stack(parts: tuple[Component, ...], context: Context) -> Any:
    if all(isinstance(p, (int, float)) and p == parts[0] for p in parts):
        return parts[0]
    return jnp.stack([_full(p, 0, context) for p in parts])


def _full(component: Component, leading: int, context: Context) -> jax.Array:
    """Return a component broadcast to the batch, with a leading axis of one if asked."""
    array = jnp.asarray(component, context.dtype)
    return jnp.broadcast_to(array, (*((1,) * leading), *context.shape))


def _level(local: dict[int, Rigid], rows: list[tuple[int, int]], context: Context) -> Rigid:
    """Return the local motions of one level's frames, which are sorted by family."""
    parts, counts = [], []
    for group in dict.fromkeys(group for group, _ in rows):
        mine = [i for g, i in rows if g == group]
        parts.append(_rows(local[group], mine))
        counts.append(len(mine))
    return _joined(parts, counts, context)


def _rows(motion: Rigid, rows: list[int]) -> Rigid:
    """Return some rows of components [n, *batch]: a slice where they follow each other, else a gather of whole rows."""
    first, count = rows[0], len(rows)
    run = list(rows) == list(range(first, first + count))

    def pick(component: Component) -> Component:
        if not isinstance(component, jax.Array) or (run and count == component.shape[0]):
            return component
        return component[first : first + count] if run else jnp.take(component, np.array(rows, np.int32), axis=0)

    return jax.tree.map(pick, motion)


def _joined(motions: list[Rigid], counts: list[int], context: Context) -> Rigid:
    """Return motions one after the other along the frames' axis; a number that all share stays a number."""

    def join(*parts: Component) -> Component:
        if all(isinstance(p, float) and p == parts[0] for p in parts):
            return parts[0]
        full = [jnp.broadcast_to(jnp.asarray(p, context.dtype), (n, *context.shape)) for p, n in zip(parts, counts, strict=True)]
        return full[0] if len(full) == 1 else jnp.concatenate(full)

    return jax.tree.map(join, *motions)


def materialized(motion: Rigid, count: int, context: Context) -> Rigid:
    """Return a motion whose components are computed once, behind a fence, however many consumers follow."""
    leaves, structure = jax.tree.flatten(motion)
    arrays = [i for i, leaf in enumerate(leaves) if not isinstance(leaf, float)]
    if not arrays:
        return motion
    whole = assemble(tuple(leaves[i] for i in arrays), (count, *context.shape), context.dtype)
    for i, component in zip(arrays, take_apart(whole), strict=True):
        leaves[i] = component
    return jax.tree.unflatten(structure, leaves)


def as_arrays(motion: Rigid, context: Context) -> tuple[jax.Array, ...]:
    """Return the parts of a motion as arrays [*batch, n_frames, k]."""
    count = len(context.topology.names)
    shape = (*context.shape, count)

    def last(component: Component) -> Component:
        return component if isinstance(component, float) else jnp.moveaxis(jnp.broadcast_to(component, (count, *context.shape)), 0, -1)

    parts = (motion.rotation, motion.translation, motion.angular, motion.linear, motion.angular2, motion.linear2)
    return tuple(assemble(tuple(last(c) for c in part), shape, context.dtype) for part in parts[: 2 + 2 * context.order])
