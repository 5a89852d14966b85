"""Queries: from trees and states to values, through components; the engine behind ``FrameTree``'s methods."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

from jaxframes.kinematics import attachments, attachments_by_level, level_blocks, levels, unrolled
from jaxframes.kinematics.arrays import named, of_halves
from jaxframes.kinematics.attachments import between
from jaxframes.kinematics.context import Context
from jaxframes.kinematics.jacobian import jacobian
from jaxframes.kinematics.light_time import apparent
from jaxframes.kinematics.path import outward
from jaxframes.kinematics.reattachment import attach, attachments_valid
from jaxframes.kinematics.state_rate import broadcast, rate
from jaxframes.kinematics.tree_arguments import Plan, as_arguments
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.numerics.packed import Packed, unpacked
from jaxframes.numerics.rigid import express
from jaxframes.spatial import Motion, Transform
from jaxframes.staging.internals import is_compiling
from jaxframes.staging.sharding import stacked
from jaxframes.staging.stages import stage

Value = TypeVar("Value")


def _between(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int, order: int) -> Motion:
    context = Context(tree, state, order)
    motion = _pair(context, of, relative_to)
    if order and expressed_in != relative_to:
        motion = turned(context, _pair(Context(tree, state, 0), relative_to, expressed_in), motion)
    return named(motion)


def _pair(context: Context, of: int, relative_to: int) -> Packed:
    """Return the motion of one frame as another sees it, by level where a query across links may touch many frames."""
    home = context.topology.islands
    if home[of] == home[relative_to] or not attachments.touches_many(context, (of, relative_to)):
        return between(context, of, relative_to)
    return tuple(array[..., of, :] for array in attachments_by_level.all_frames(context, relative_to))


def turned(context: Context, axes: Packed, motion: Packed) -> Packed:
    """Return a motion whose velocity and acceleration are in other axes; the pose of its own in these is given."""
    return stage(lambda axes, motion: context.kind.packed(express(unpacked(axes).rotation, unpacked(motion))))(axes, motion)


def _all_frames(tree: Structure, state: State, relative_to: int, order: int) -> Motion:
    context = Context(tree, state, order)
    if levels.applies(context):
        if tree.topology.attachables:
            return named(attachments_by_level.all_frames(context, relative_to))
        return of_halves(level_blocks.all_frames(context, relative_to))
    if not tree.topology.attachables:
        return of_halves(unrolled.all_frames(context, relative_to))
    found = attachments.all_frames(context, relative_to)
    return named(_stacked([found[frame] for frame in range(len(tree.names))], -2))


def _pairs(tree: Structure, state: State, of: tuple[int, ...], relative_to: tuple[int, ...]) -> Transform:
    context, rows = Context(tree, state, 0), []
    home = tree.topology.islands
    for observer in relative_to:
        near = frozenset(frame for frame in of if home[frame] == home[observer])
        found = outward(context, observer, near) if near else {}
        found |= attachments.between_many(context, [frame for frame in of if frame not in near], observer)
        rows.append(_stacked([found[frame] for frame in of], -2))
    return named(_stacked(rows, -3)).transform


def _stacked(values: Sequence[Value], axis: int) -> Value:
    return jax.tree.map(lambda *leaves: stacked(leaves, axis), *values)


def _jacobian(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int) -> jax.Array:
    if tree.topology.islands[of] != tree.topology.islands[relative_to]:
        return _jacobian_by_rates(tree, state, of, relative_to, expressed_in)
    context = Context(tree, state, 0)
    axes = None if expressed_in == relative_to else between(context, relative_to, expressed_in)
    return jacobian(context, of, relative_to, axes)


def _jacobian_by_rates(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int) -> jax.Array:
    """Return the Jacobian where the path is data: velocities are linear in the rates, so each column is a derivative."""
    whole = broadcast(state)

    def velocity(qd: jax.Array) -> jax.Array:
        return _between(tree, whole.replace(qd=qd), of, relative_to, expressed_in, 1).velocity.as_vector()

    units = jnp.broadcast_to(
        jnp.eye(tree.nv, dtype=whole.qd.dtype)[(slice(None), *[None] * (whole.qd.ndim - 1))], (tree.nv, *whole.qd.shape)
    )
    columns = jax.vmap(lambda unit: jax.jvp(velocity, (whole.qd,), (unit,))[1])(units)
    return jnp.moveaxis(columns, 0, -1)


def _jacobian_dot(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int) -> jax.Array:
    def along(moving: State) -> jax.Array:
        return _jacobian(tree, moving, of, relative_to, expressed_in)

    return jax.jvp(along, (broadcast(state),), (rate(tree, state),))[1]


def _compiled(function: Callable[..., Any], *static: str) -> Callable[..., Any]:
    """Return a query that is compiled once for each topology, with the tree's numbers as arguments, unless it is part of a larger program.

    So it is for values and for what ``jax.grad``, ``jax.vmap`` and their like make of a query outside of ``jax.jit``: the second call
    compiles nothing, also with another tree. Within a larger program it is traced in place, and the numbers of a tree that is not
    traced are constants of the program.
    """

    def on_arguments(arguments: Any, *values: Any, plan: Plan | None, **options: Any) -> Any:
        return function(arguments if plan is None else plan.tree(arguments), *values, **options)

    compiled = jax.jit(on_arguments, static_argnames=("plan", *static))

    def run(tree: Structure, *values: Any, **options: Any) -> Any:
        if is_compiling():
            return function(tree, *values, **options)
        arguments, plan = as_arguments(tree)
        return compiled(arguments, *values, plan=plan, **options)

    return run


class PathEngine:
    """The engine that trees use."""

    between = staticmethod(_compiled(_between, "of", "relative_to", "expressed_in", "order"))
    all_frames = staticmethod(_compiled(_all_frames, "relative_to", "order"))
    pairs = staticmethod(_compiled(_pairs, "of", "relative_to"))
    jacobian = staticmethod(_compiled(_jacobian, "of", "relative_to", "expressed_in"))
    jacobian_dot = staticmethod(_compiled(_jacobian_dot, "of", "relative_to", "expressed_in"))
    apparent = staticmethod(_compiled(apparent, "looking"))
    attached = staticmethod(_compiled(attach, "frame", "keep"))
    attachments_valid = staticmethod(_compiled(attachments_valid))
    rate = staticmethod(rate)
