"""Changing what an attachable frame hangs on: pure, with the new parent a number that may be traced."""

from dataclasses import replace

import jax
import jax.numpy as jnp

from jaxframes.kinematics.arrays import named
from jaxframes.kinematics.attachments import is_one_of, nan_unless, static_components_of
from jaxframes.kinematics.derived import context_of
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.numerics.components import renormalized
from jaxframes.numerics.packed import Kind, Packed
from jaxframes.numerics.rigid import relative
from jaxframes.staging.stages import stage


def attach(tree: Structure, state: State, to: jax.Array, *, frame: int, keep: str) -> State:
    """Return a state in which an attachable frame hangs on another one.

    Args:
        tree: The tree.
        state: Where everything is now.
        to: Index of the new parent, int32 [...].
        frame: Index of the attachable frame.
        keep: ``relative`` keeps the numbers of the motion relative to the parent, ``world`` the pose (then at rest on the new
            parent), ``motion`` the pose, velocity and, where every edge has one, acceleration.
    """
    row = tree.topology.attachables.index(frame)
    held = state.attachments
    assert held is not None
    if keep == "relative":
        return replace(state, attachments=replace(held, links=_put(held.links, row, to, 0)))
    order = 0 if keep == "world" else 2 if all(tree.edge_of(members[0]).supports_accelerations for members in tree.topology.members) else 1
    context = context_of(tree, state, order)
    candidates = tree.topology.candidates[row]
    static_components = static_components_of(context, (frame, *candidates))
    rank, shape = len(context.shape), jnp.broadcast_shapes(context.shape, to.shape)
    aligned = to if to.ndim in (0, rank) else to.reshape((1,) * max(rank - to.ndim, 0) + to.shape)

    def work() -> Packed:
        placed = static_components.placed()
        parent_motion, good = placed.motion_of_traced(aligned, candidates)
        here = placed.nan_where_invalid(nan_unless(relative(parent_motion, placed.motion(frame), order), good, context.dtype), frame)
        # The pose is stored and later composed again: without this, norm errors of repeated attachments would feed on each other.
        return Kind(shape, context.dtype, 2).packed(replace(here, rotation=renormalized(here.rotation)))

    motion = named(stage(work)())
    fresh = jax.tree.map(lambda old, new: _put(old, row, new.astype(old.dtype), 1), held.motion, motion)
    return replace(state, attachments=replace(held, links=_put(held.links, row, to, 0), motion=fresh))


def _put(values: jax.Array, row: int, new: jax.Array, trailing: int) -> jax.Array:
    """Return values [..., n, (k)] with one row replaced, batch axes broadcast."""
    own, tail = values.ndim - 1 - trailing, values.shape[values.ndim - 1 - trailing :]
    batch = jnp.broadcast_shapes(values.shape[:own], new.shape[: new.ndim - trailing])
    full = jnp.broadcast_to(values, (*batch, *tail))
    index = (..., row, slice(None)) if trailing else (..., row)
    return full.at[index].set(jnp.broadcast_to(new, (*batch, *tail[1:])).astype(full.dtype))


def attachments_valid(tree: Structure, state: State) -> jax.Array:
    """Return where every attachable frame hangs, link by link, on the root: no cycle, no parent outside its candidates."""
    context = context_of(tree, state, 0)
    good = jnp.ones(context.shape, bool)
    for valid in static_components_of(context, tree.topology.attachables).placed().valid.values():
        good = good & jnp.broadcast_to(valid, context.shape)
    for row, candidates in enumerate(tree.topology.candidates):
        good = good & is_one_of(context.attachment(row)[0], candidates)
    return good
