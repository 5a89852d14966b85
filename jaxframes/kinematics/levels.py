"""Over all frames of a large tree: many frames at a time, each component an array over the frames of a stage.

The program grows with the depth of the tree and the number of its edge families, not with the number of its frames. A shallow tree
goes level by level. A deep one is cut into segments of ``SPAN`` levels: the same levels of all segments are worked together relative
to each segment's start, the starts are a tree ``SPAN`` times as shallow that is worked in the same way, and one last composition joins
both. A chain of a thousand frames takes some thirty stages instead of a thousand, at twice the arithmetic.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.kinematics import doubling, plan
from jaxframes.kinematics.context import JOINT_FIELDS, Context, picked
from jaxframes.numerics.boundary import is_concrete
from jaxframes.numerics.extension import extend
from jaxframes.numerics.packed import Kind, Packed, unpacked
from jaxframes.numerics.rigid import AT_REST, inverse
from jaxframes.numerics.source import Source, source_of
from jaxframes.numerics.stages import stage
from jaxframes.numerics.steps import Step
from jaxframes.tree.edges.base import Edge, Inputs
from jaxframes.tree.state import State
from jaxframes.tree.ways import FEWEST


def applies(context: Context) -> bool:
    """Return whether all frames of a tree are worked out by stages: many frames, nothing attachable."""
    return len(context.topology.names) >= FEWEST and not context.topology.attachables


def all_frames(context: Context, observer: int) -> Packed:
    """Return the motions of all frames relative to one as arrays [*batch, n_frames, k], in order of declaration."""
    parents, turned = plan.rerooted(context.topology.parents, observer)
    others = np.delete(np.arange(len(parents)), observer)
    row = np.full(len(parents) + 1, -1)
    row[others] = np.arange(len(others))
    stages = plan.staged(row[parents[others]])
    local = _local(context, turned, [others[level.frames] for level in stages.levels], deep=len(stages.starts) > 0)
    found = _gathered(_accumulated(context, local, stages), [level.frames for level in stages.levels])
    rest = _many(context, 1).packed(AT_REST)
    return _joined([part for part in (_cut(found, 0, observer), rest, _cut(found, observer, len(others))) if part[0].shape[-2]])


def _accumulated(context: Context, local: Sequence[Packed | Source], stages: plan.Stages) -> list[Packed]:
    """Return the motions of frames relative to the observer, level by level.

    Args:
        context: Tree and state.
        local: Motions of each level's frames relative to the frames that they hang on, [*batch, n, k], or what they are made of.
        stages: The plan.
    """
    done: list[Packed] = []
    for level, here in zip(stages.levels, local, strict=True):
        done.append(_composed(context, () if level.above is None else _rows(done[-1], level.above), here, len(level.frames)))
    if not len(stages.starts):
        return done
    inner = plan.staged(stages.parents)
    ends = _rows(done[-1], stages.starts)
    starts = _accumulated(context, [_rows(ends, level.frames) for level in inner.levels], inner)
    rest = _many(context, 1).packed(AT_REST)
    above = _joined([rest, _gathered(starts, [level.frames for level in inner.levels])])
    return [_composed(context, _rows(above, level.start), here, len(level.frames)) for level, here in zip(stages.levels, done, strict=True)]


def _many(context: Context, count: int) -> Kind:
    """Return what the motions of several frames are like."""
    return Kind((*context.shape, count), context.dtype, context.order)


def _composed(context: Context, parents: Packed, local: Packed | Source, count: int) -> Packed:
    if not parents and not isinstance(local, Source):
        return local
    source = local if isinstance(local, Source) else source_of(lambda local: (unpacked(local),), local)
    return extend(parents, source, _many(context, count))


def _local(context: Context, turned: tuple[int, ...], levels: Sequence[np.ndarray], deep: bool) -> Sequence[Packed | Source]:
    """Return the motions of each level's frames relative to the frames that they hang on, [*batch, n, k], or what they are made of.

    Args:
        context: Tree and state.
        turned: The frames from the observer up to below the root: each parent there hangs on its child, by the inverted motion.
        levels: The frames of each level.
        deep: Whether the tree is cut into segments.
    """
    groups = np.array([group for group, _ in context.topology.locations])
    # What a frame's motion is made of: the edge above it, or where the edge is turned round the one above the frame it hangs on.
    edge_of = np.arange(len(groups))
    edge_of[[context.topology.parents[frame] for frame in turned]] = turned
    wanted = np.concatenate([edge_of[frames] for frames in levels])
    flipped = np.isin(np.concatenate(levels), [context.topology.parents[frame] for frame in turned])
    family = int(groups[wanted[0]])
    if deep and (groups[wanted] == family).all() and context.topology.stacked[family] and not flipped.any():
        # Each level is worked out where it is composed, and nothing is written before (measured: three quarters of the time of a chain).
        # A shallow tree gains nothing by it and takes longer to compile.
        return [_family_source(context, family, edge_of[frames].tolist()) for frames in levels]
    parts, places = [], []
    for group in dict.fromkeys(groups[wanted].tolist()):
        at = np.flatnonzero(groups[wanted] == group)
        parts.append(_family_motion(context, group, wanted[at].tolist()))
        places.append(at)
    if flipped.any():
        at, whole = np.flatnonzero(flipped), np.argsort(np.concatenate(places))
        edges = _rows(_joined(parts), whole[at])
        places = [*places, at]
        parts.append(stage(lambda edges: _many(context, len(at)).packed(inverse(unpacked(edges), context.order)))(edges))
    rows = np.empty(len(wanted), int)
    first = 0
    for at in places:
        rows[at] = first + np.arange(len(at))
        first += len(at)
    found, edges = _rows(_joined(parts), rows), np.cumsum([0, *(len(frames) for frames in levels)])
    return [_cut(found, a, b) for a, b in itertools.pairwise(edges.tolist())]


def _family_motion(context: Context, group: int, frames: list[int]) -> Packed:
    """Return the motions of edges of one family relative to their parents, [*batch, n_edges, k]."""
    if not context.topology.stacked[group]:
        return tuple(array[..., None, :] for array in extend((), context.source(frames), context.kind))
    return extend((), _family_source(context, group, frames), _many(context, len(frames)))


def _family_source(context: Context, group: int, frames: list[int]) -> Source:
    """Return the steps of edges of one family as one source, each component [*batch, n_edges]."""
    context.check(frames[0])
    rows = np.array([context.topology.locations[frame][1] for frame in frames])

    state, places = _in_order(context, frames)

    def steps(inside: Context) -> tuple[Step, ...]:
        return _family(inside, group, rows).steps(_inputs(inside, frames, places), inside.order)

    return context.inside(steps, state)


def _in_order(context: Context, frames: list[int]) -> tuple[State, np.ndarray]:
    """Return the state with coordinates in the order of the edges that read them, and where these are: first, count, twice [n, 4].

    XLA:CPU leaves a gather along the last axis lying the other way round, so whatever loop reads it goes across memory. As a stage of its
    own it is turned over once (measured: twice as fast for a chain of a thousand joints).
    """
    topology, state = context.topology, context.state
    places = np.array([topology.coordinates[frame] for frame in frames])
    if any(topology.sources[frame] >= 0 for frame in frames):
        return state, places
    arranged = places.copy()
    for kind, at in zip(JOINT_FIELDS[: 1 + context.order], (0, 2, 2), strict=False):
        count = int(places[0, at + 1])
        columns = (places[:, at, None] + np.arange(count)).reshape(-1)
        if len(columns) < 2 or len(set(np.diff(columns).tolist())) == 1:
            continue
        state = replace(state, **{kind: stage(functools.partial(picked, places=columns, axis=-1))(getattr(state, kind))})
        arranged[:, at] = count * np.arange(len(frames))
    return state, arranged


def _family(context: Context, group: int, rows: np.ndarray) -> Edge:
    """Return several edges of a family as one: every parameter is a batch [..., n_edges, k]."""

    def several(leaf: jax.Array) -> Any:
        if is_concrete(leaf):  # known numbers: nothing is left for the compiled program to do
            return jnp.asarray(np.asarray(leaf)[..., rows, :].astype(context.dtype))
        return picked(jnp.asarray(leaf), rows, -2).astype(context.dtype)

    topology = context.topology
    return jax.tree.unflatten(topology.groups[group], [several(leaf) for leaf in context.tree.parameters[group]])


def _inputs(context: Context, frames: list[int], places: np.ndarray) -> Inputs:
    """Return what several edges of one family, with their coordinates at places [n_edges, 4], read as one: components [*batch, n_edges]."""
    batch_rank = len(context.shape) + 1
    time = None if context.time is None else (context.time[0][..., None], context.time[1][..., None])
    topology = context.topology
    if any(topology.sources[frame] >= 0 for frame in frames):
        each = [context.coordinates(frame) for frame in frames]
        q, qd, qdd = doubling.stacked(each, context.shape, context.dtype)
        return Inputs(q, qd, qdd, time, None, batch_rank)
    if topology.prescribed[frames[0]] >= 0:
        held = context.prescribed(np.array([topology.prescribed[frame] for frame in frames]))
        return Inputs(time=time, prescribed=held, batch_rank=batch_rank)
    q = tuple(context.gathered("q", places[:, 0] + i) for i in range(places[0, 1]))
    qd, qdd = (tuple(context.gathered(kind, places[:, 2] + i) for i in range(places[0, 3])) for kind in ("qd", "qdd"))
    return Inputs(q, qd, qdd, time, None, batch_rank)


def _rows(arrays: Packed, rows: np.ndarray) -> Packed:
    """Return some rows of arrays [..., n, k]."""
    return tuple(picked(array, rows, -2) for array in arrays)


def _cut(arrays: Packed, first: int, last: int) -> Packed:
    return tuple(array[..., first:last, :] for array in arrays)


def _joined(parts: Sequence[Packed]) -> Packed:
    return parts[0] if len(parts) == 1 else tuple(jnp.concatenate(each, axis=-2) for each in zip(*parts, strict=True))


def _gathered(levels: Sequence[Packed], frames: Sequence[np.ndarray]) -> Packed:
    """Return the rows of levels in the order of the frames' numbers."""
    if plan.interleaved(frames):
        stacked = (jnp.stack(each, axis=-2) for each in zip(*levels, strict=True))
        return tuple(array.reshape(*array.shape[:-3], -1, array.shape[-1]) for array in stacked)
    return _rows(_joined(levels), np.argsort(np.concatenate(frames)))
