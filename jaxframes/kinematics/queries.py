"""Queries: from trees, states and names of frames to values. What ``FrameTree``'s methods call; each is compiled once a topology."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import ShapeError
from jaxframes.kinematics import attachments, attachments_by_level, level_blocks, levels, light_time, reattachment, unrolled
from jaxframes.kinematics.apparent import ApparentState, Looking
from jaxframes.kinematics.arrays import named, of_halves
from jaxframes.kinematics.context import Context
from jaxframes.kinematics.derived import angle_between, context_of
from jaxframes.kinematics.jacobian import jacobian as by_geometry
from jaxframes.kinematics.path import outward
from jaxframes.kinematics.state_rate import broadcast, rate
from jaxframes.kinematics.tree_arguments import Plan, as_arguments
from jaxframes.model.group import Group
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.numerics.packed import Kind, Packed, unpacked
from jaxframes.numerics.rigid import express
from jaxframes.spatial import Motion, Transform
from jaxframes.staging.internals import is_compiling
from jaxframes.staging.sharding import stack_arrays
from jaxframes.staging.stages import stage

Value = TypeVar("Value")


def _between(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int, order: int) -> Motion:
    context = context_of(tree, state, order)
    motion = _pair(context, of, relative_to)
    if order and expressed_in != relative_to:
        motion = velocities_in_axes(context.kind, _pair(context_of(tree, state, 0), relative_to, expressed_in), motion)
    return named(motion)


def _pair(context: Context, of: int, relative_to: int) -> Packed:
    """Return the motion of one frame as another sees it, by level where a query across links may touch many frames."""
    home = context.topology.static_components
    if home[of] == home[relative_to] or not attachments.touches_many(context, (of, relative_to)):
        return attachments.between(context, of, relative_to)
    return tuple(array[..., of, :] for array in attachments_by_level.all_frames(context, relative_to))


def velocities_in_axes(kind: Kind, axes: Packed, motion: Packed) -> Packed:
    """Return motions whose velocities and accelerations are in other axes; the pose of their own in these is given."""
    return stage(lambda axes, motion: kind.packed(express(unpacked(axes).rotation, unpacked(motion))))(axes, motion)


def _all_frames(tree: Structure, state: State, relative_to: int, order: int) -> Motion:
    context = context_of(tree, state, order)
    if levels.applies(context):
        if tree.topology.attachables:
            return named(attachments_by_level.all_frames(context, relative_to))
        return of_halves(level_blocks.all_frames(context, relative_to))
    if not tree.topology.attachables:
        return of_halves(unrolled.all_frames(context, relative_to))
    found = attachments.all_frames(context, relative_to)
    return named(_values_stacked([found[frame] for frame in range(len(tree.names))], -2))


def _group(tree: Structure, state: State, of: tuple[int, ...], relative_to: int, expressed_in: int, order: int) -> Motion:
    """Return the motions of several frames as one sees them, stacked on a leading axis."""
    context = context_of(tree, state, order)
    motions = _rows_of_group(context, of, relative_to)
    if order and expressed_in != relative_to:
        axes = _pair(context_of(tree, state, 0), relative_to, expressed_in)
        rows = replace(context.kind, shape=(*context.shape, len(of)))
        motions = velocities_in_axes(rows, tuple(array[..., None, :] for array in axes), motions)
    return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, -2, 0), named(motions))


def _rows_of_group(context: Context, of: tuple[int, ...], relative_to: int) -> Packed:
    """Return the motions of several frames as one sees them, arrays [*batch, n, k]; by level in a large tree."""
    topology = context.topology
    if levels.applies(context):
        whole = attachments_by_level.all_frames if topology.attachables else levels.all_frames
        return levels.rows_of(whole(context, relative_to), np.array(of))
    return _rows_by_paths(context, of, relative_to)


def _rows_by_paths(context: Context, of: tuple[int, ...], relative_to: int) -> Packed:
    """Return the same along the paths from the observer outward, and across links to those beyond."""
    home = context.topology.static_components
    near = frozenset(frame for frame in of if home[frame] == home[relative_to])
    found = outward(context, relative_to, near) if near else {}
    found |= attachments.between_many(context, [frame for frame in of if frame not in near], relative_to)
    return _values_stacked([found[frame] for frame in of], -2)


def _pairs(tree: Structure, state: State, of: tuple[int, ...], relative_to: tuple[int, ...]) -> Transform:
    context = context_of(tree, state, 0)
    return named(_values_stacked([_rows_by_paths(context, of, observer) for observer in relative_to], -3)).transform


def _values_stacked(values: Sequence[Value], axis: int) -> Value:
    return jax.tree.map(lambda *leaves: stack_arrays(leaves, axis), *values)


def _jacobian(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int) -> jax.Array:
    topology = tree.topology
    crosses_links = topology.static_components[of] != topology.static_components[relative_to]
    if crosses_links or any(topology.reads[frame] for way in topology.route(of, relative_to) for frame in way):
        return _jacobian_by_rates(tree, state, of, relative_to, expressed_in)
    context = context_of(tree, state, 0)
    axes = None if expressed_in == relative_to else attachments.between(context, relative_to, expressed_in)
    return by_geometry(context, of, relative_to, axes)


def _jacobian_by_rates(tree: Structure, state: State, of: int, relative_to: int, expressed_in: int) -> jax.Array:
    """Return the Jacobian where the path is data, or edges on it read other frames: each column is a derivative by a rate."""
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


def _jacobians(tree: Structure, state: State, of: tuple[int, ...], relative_to: int, expressed_in: int) -> jax.Array:
    return stack_arrays([_jacobian(tree, state, frame, relative_to, expressed_in) for frame in of], -3)


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


_between_compiled = _compiled(_between, "of", "relative_to", "expressed_in", "order")
_all_frames_compiled = _compiled(_all_frames, "relative_to", "order")
_group_compiled = _compiled(_group, "of", "relative_to", "expressed_in", "order")
_pairs_compiled = _compiled(_pairs, "of", "relative_to")
_jacobian_compiled = _compiled(_jacobian, "of", "relative_to", "expressed_in")
_jacobians_compiled = _compiled(_jacobians, "of", "relative_to", "expressed_in")
_jacobian_dot_compiled = _compiled(_jacobian_dot, "of", "relative_to", "expressed_in")
_apparent_compiled = _compiled(light_time.apparent, "looking")
_angle_compiled = _compiled(angle_between, "frame")
_attach_compiled = _compiled(reattachment.attach, "frame", "keep")
_valid_compiled = _compiled(reattachment.attachments_valid)


def between(tree: Structure, state: State, of: str | Group, relative_to: str, expressed_in: str | None = None, order: int = 2) -> Motion:
    """Return the motion of one frame relative to another, or of a group on a leading axis; what lies beyond the order is None.

    Args:
        tree: The tree.
        state: Values at one instant or a batch of them.
        of: Frame asked about, or a group.
        relative_to: Frame of the observer.
        expressed_in: Frame whose axes resolve velocity and acceleration. Default: ``relative_to``.
        order: 0 for the pose, 1 with the velocity, 2 with the acceleration.
    """
    if isinstance(of, Group):
        return of_group(tree, state, of, relative_to, expressed_in, order)
    return _between_compiled(tree, state, order=order, **_indices(tree, of, relative_to, expressed_in))


def of_group(tree: Structure, state: State, of: Group, relative_to: str, expressed_in: str | None = None, order: int = 2) -> Motion:
    """Return the motions of a group's frames relative to one, on a leading axis; arguments as for ``between``."""
    places = _indices(tree, relative_to, relative_to, expressed_in)
    return _group_compiled(tree, state, order=order, **{**places, "of": of.indices(tree.topology)})


def all_frames(tree: Structure, state: State, relative_to: str, order: int) -> Motion:
    """Return the motions of all frames relative to one, stacked on the axis before the last; what lies beyond the order is None."""
    return _all_frames_compiled(tree, state, relative_to=tree.topology.index(relative_to), order=order)


def pairs(tree: Structure, state: State, of: Sequence[str], relative_to: Sequence[str]) -> Transform:
    """Return the poses of several frames in several others: leaves [..., len(relative_to), len(of), 4 or 3] (ShapeError if none)."""
    if isinstance(of, str) or isinstance(relative_to, str) or not of or not relative_to:
        raise ShapeError(f"transforms_between takes lists of frame names that are not empty, found of={of!r}, relative_to={relative_to!r}")
    index = tree.topology.index
    return _pairs_compiled(tree, state, of=tuple(map(index, of)), relative_to=tuple(map(index, relative_to)))


def jacobian(tree: Structure, state: State, of: str, relative_to: str, expressed_in: str | None = None) -> jax.Array:
    """Return the Jacobian [..., 6, nv] of a relative velocity with respect to the joint rates, angular first."""
    return _jacobian_compiled(tree, state, **_indices(tree, of, relative_to, expressed_in))


def jacobians(tree: Structure, state: State, of: Sequence[str], relative_to: str, expressed_in: str | None = None) -> jax.Array:
    """Return the Jacobians of several frames, [..., len(of), 6, nv], in one program (ShapeError if no frames are named)."""
    if isinstance(of, str) or not of:
        raise ShapeError(f"jacobians takes a list of frame names that is not empty, found of={of!r}")
    indices = _indices(tree, of[0], relative_to, expressed_in)
    return _jacobians_compiled(tree, state, **{**indices, "of": tuple(map(tree.topology.index, of))})


def jacobian_dot(tree: Structure, state: State, of: str, relative_to: str, expressed_in: str | None = None) -> jax.Array:
    """Return the time derivative [..., 6, nv] of the Jacobian along the state's motion."""
    return _jacobian_dot_compiled(tree, state, **_indices(tree, of, relative_to, expressed_in))


def angle_between_vectors(tree: Structure, state: State, frame: int) -> jax.Array:
    """Return the angle [...] in rad between the two vectors that define a frame; NaN where one of them is zero."""
    return _angle_compiled(tree, state, frame=frame)


def apparent(tree: Structure, state: State, looking: Looking) -> ApparentState:
    """Return where a frame appears to an observer."""
    return _apparent_compiled(tree, state, looking=looking)


def attach(tree: Structure, state: State, frame: int, to: jax.Array, keep: str) -> State:
    """Return a state in which an attachable frame hangs on the frames with indices ``to`` [...]."""
    return _attach_compiled(tree, state, to, frame=frame, keep=keep)


def attachments_valid(tree: Structure, state: State) -> jax.Array:
    """Return where every attachable frame hangs, link by link, on the root: bool [...]."""
    return _valid_compiled(tree, state)


def _indices(tree: Structure, of: str, relative_to: str, expressed_in: str | None) -> dict[str, int]:
    index = tree.topology.index
    axes = relative_to if expressed_in is None else expressed_in
    return {"of": index(of), "relative_to": index(relative_to), "expressed_in": index(axes)}
