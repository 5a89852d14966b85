"""Over all frames of a large tree: many frames at a time, each component an array over the frames of a stage.

The program grows with the depth of the tree and the number of its edge families, not with the number of its frames. A shallow tree
goes level by level. A deep one is cut into segments of ``SPAN`` levels: the same levels of all segments are worked together relative
to each segment's start, the starts are a tree ``SPAN`` times as shallow that is worked in the same way, and one last composition joins
both. A chain of a thousand frames takes some thirty stages instead of a thousand, at twice the arithmetic.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.base import Inputs
from jaxframes.edges.mimic import Mimic
from jaxframes.kinematics import plan, pointer_doubling
from jaxframes.kinematics.arrays import motion_of
from jaxframes.kinematics.context import JOINT_FIELDS, Context, take
from jaxframes.kinematics.edge_steps import EdgeSteps, Reading
from jaxframes.kinematics.plan import by_level
from jaxframes.model.state import State
from jaxframes.numerics.packed import Kind, Packed, unpacked
from jaxframes.numerics.path_motion import StepsRecipe, extend
from jaxframes.numerics.rigid import AT_REST, inverse
from jaxframes.numerics.steps import Step
from jaxframes.staging.stages import stage
from jaxframes.staging.traced_inputs import Operands, TracedInput


def applies(context: Context) -> bool:
    """Return whether all frames of a tree are worked out by stages: there are many."""
    return by_level(context.topology)


def all_frames(context: Context, observer: int) -> Packed:
    """Return the motions of all frames relative to one as arrays [*batch, n_frames, k], in order of declaration.

    Attachable frames count as lying where the observer does: what hangs on one is given relative to it.
    """
    parents, turned = plan.rerooted(context.topology.parents, observer)
    parents[[frame for frame in context.topology.attachables if frame != observer]] = observer
    others = np.delete(np.arange(len(parents)), observer)
    row = np.full(len(parents) + 1, -1)
    row[others] = np.arange(len(others))
    stages = plan.staged(row[parents[others]])
    local = _local(context, turned, [others[level.frames] for level in stages.levels], deep=len(stages.starts) > 0)
    found = _gathered(_accumulated(context, local, stages), [level.frames for level in stages.levels])
    rest = _many(context, 1).packed(AT_REST)
    return _levels_joined([part for part in (_cut(found, 0, observer), rest, _cut(found, observer, len(others))) if part[0].shape[-2]])


def _accumulated(context: Context, local: Sequence[Packed | TracedInput], stages: plan.Stages) -> list[Packed]:
    """Return the motions of frames relative to the observer, level by level.

    Args:
        context: Tree and state.
        local: Motions of each level's frames relative to the frames that they hang on, [*batch, n, k], or what they are made of.
        stages: The plan.
    """
    done: list[Packed] = []
    for level, here in zip(stages.levels, local, strict=True):
        done.append(_composed(context, () if level.above is None else rows_of(done[-1], level.above), here, len(level.frames)))
    if not len(stages.starts):
        return done
    inner = plan.staged(stages.parents)
    ends = rows_of(done[-1], stages.starts)
    starts = _accumulated(context, [rows_of(ends, level.frames) for level in inner.levels], inner)
    rest = _many(context, 1).packed(AT_REST)
    above = _levels_joined([rest, _gathered(starts, [level.frames for level in inner.levels])])
    return [
        _composed(context, rows_of(above, level.start), here, len(level.frames)) for level, here in zip(stages.levels, done, strict=True)
    ]


def _many(context: Context, count: int) -> Kind:
    """Return what the motions of several frames are like."""
    return Kind((*context.shape, count), context.dtype, context.order)


def _composed(context: Context, parents: Packed, local: Packed | TracedInput, count: int) -> Packed:
    if not parents and not isinstance(local, TracedInput):
        return local
    return extend(parents, local if isinstance(local, TracedInput) else TracedInput(Motions(), local), _many(context, count))


def _local(context: Context, turned: tuple[int, ...], levels: Sequence[np.ndarray], deep: bool) -> Sequence[Packed | TracedInput]:
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
        return [_family_steps(context, family, edge_of[frames].tolist()) for frames in levels]
    parts, places = [], []
    for group in dict.fromkeys(groups[wanted].tolist()):
        at = np.flatnonzero(groups[wanted] == group)
        parts.append(_family_motion(context, group, wanted[at].tolist()))
        places.append(at)
    if flipped.any():
        at, whole = np.flatnonzero(flipped), np.argsort(np.concatenate(places))
        edges = rows_of(_levels_joined(parts), whole[at])
        places = [*places, at]
        parts.append(stage(lambda edges: _many(context, len(at)).packed(inverse(unpacked(edges), context.order)))(edges))
    rows = np.empty(len(wanted), int)
    first = 0
    for at in places:
        rows[at] = first + np.arange(len(at))
        first += len(at)
    found, edges = rows_of(_levels_joined(parts), rows), np.cumsum([0, *(len(frames) for frames in levels)])
    return [_cut(found, a, b) for a, b in itertools.pairwise(edges.tolist())]


def _family_motion(context: Context, group: int, frames: list[int]) -> Packed:
    """Return the motions of edges of one family relative to their parents, [*batch, n_edges, k]."""
    if frames[0] in context.topology.attachables:
        return _many(context, len(frames)).packed(AT_REST)
    if not context.topology.stacked[group]:
        members = context.topology.members[group]
        if len(members) == 1:
            return tuple(array[..., None, :] for array in extend((), context.steps_of(frames), context.kind))
        found = extend((), context.family_steps(group), _many(context, len(members)))
        return rows_of(found, np.array([context.topology.locations[frame][1] for frame in frames]))
    return extend((), _family_steps(context, group, frames), _many(context, len(frames)))


def _family_steps(context: Context, group: int, frames: list[int]) -> TracedInput:
    """Return the steps of edges of one family as one traced input, each component [*batch, n_edges]."""
    context.check(frames[0])
    topology, operands = context.topology, Operands()
    edge = jax.tree.unflatten(topology.groups[group], context.tree.numbers(frames)).normalized()
    numbers = tuple(operands.place(_in_dtype(leaf, context.dtype)) for leaf in jax.tree.leaves(edge))
    rank = len(context.shape)
    reading = replace(context.reading, rank=rank + 1)
    if topology.prescribed[frames[0]] >= 0:
        rows = tuple(topology.prescribed[frame] for frame in frames)
        held = tuple(operands.place(leaf) for leaf in context.held_motions())
        return TracedInput(FamilySteps(topology.groups[group], numbers, (), (0, 0), (held, rows), reading), tuple(operands.arrays))
    drivers = [topology.sources[frame] for frame in frames]
    follows = all(driver >= 0 and topology.sources[driver] < 0 for driver in drivers)
    follows = follows and len({topology.coordinates[driver][1::2] for driver in drivers}) == 1
    state, places = _in_order(context, drivers if follows else frames)
    counts = int(places[0, 1]), int(places[0, 3])
    kept = []
    for kind, at in zip(JOINT_FIELDS[: 1 + context.order], (0, 2, 2), strict=False):
        count = int(places[0, at + 1])
        columns = tuple(tuple((places[:, at] + i).tolist()) for i in range(count))
        kept.append((operands.place(getattr(state, kind)) if count else 0, columns))
    followed = () if follows else _followed(context, frames, operands)
    recipe = FamilySteps(topology.groups[group], numbers, tuple(kept), counts, None, reading, followed, follows)
    if edge.needs_time:
        return context.precomputed_input(recipe.steps(operands.arrays, context.times(len(frames))), reading)
    return TracedInput(recipe, tuple(operands.arrays))


def _in_dtype(leaf: Any, dtype: Any) -> jax.Array:
    return jnp.asarray(leaf).astype(dtype) if jnp.issubdtype(leaf.dtype, jnp.floating) else jnp.asarray(leaf)


def _followed(context: Context, frames: list[int], operands: Operands) -> tuple[EdgeSteps, ...]:
    """Return, for edges that follow others, each with the ones that it follows: whence its coordinates come."""
    if all(context.topology.sources[frame] < 0 for frame in frames):
        return ()
    return tuple(edge for edge in context.edge_steps(frames, operands) if isinstance(edge, EdgeSteps))


@dataclass(frozen=True)
class Motions(StepsRecipe):
    """One step: a motion that is given as arrays."""

    def __call__(self, *arrays: jax.Array) -> tuple[Step, ...]:
        """Return the step."""
        return (unpacked(arrays),)


@dataclass(frozen=True)
class FamilySteps(StepsRecipe):
    """The steps of several edges of one family, each component [*batch, n_edges].

    Attributes:
        definition: How an edge of the family is put together.
        parameters: Places of its numbers [..., n_edges, k].
        kept: For ``q``, ``qd`` and ``qdd`` (as far as the order asks) the place of the array, and the column of each edge, coordinate
            after coordinate.
        counts: How many coordinates and rates an edge has.
        held: Places of the arrays of motions that a state holds, and each edge's row; None for edges that are not prescribed.
        reading: How arrays are read; the rank counts the axis of edges.
        followed: Where the coordinates of edges come from that follow others which follow in turn.
        follows: Whether the columns are those of joints that the edges follow.
    """

    definition: Any
    parameters: tuple[int, ...]
    kept: tuple[tuple[int, tuple[tuple[int, ...], ...]], ...]
    counts: tuple[int, int]
    held: tuple[tuple[int, ...], tuple[int, ...]] | None
    reading: Reading
    followed: tuple[EdgeSteps, ...] = ()
    follows: bool = False

    def __call__(self, *arrays: jax.Array) -> tuple[Step, ...]:
        """Return the steps."""
        return self.steps(arrays)

    def steps(self, arrays: Sequence[jax.Array], time: tuple[jax.Array, jax.Array] | None = None) -> tuple[Step, ...]:
        """Return the steps; for edges that read the epoch, at that in two parts [*batch, n_edges]."""
        edge = self.reading.edge(jax.tree.unflatten(self.definition, [arrays[place] for place in self.parameters]))
        inputs = self._inputs(arrays)._replace(time=time)
        if self.follows and isinstance(edge, Mimic):
            q, qd, qdd = edge.follow(inputs.q, inputs.qd, inputs.qdd, self.reading.rank)
            inputs = inputs._replace(q=q, qd=qd, qdd=qdd)
        return edge.steps(inputs, self.reading.order)

    def _inputs(self, arrays: Sequence[jax.Array]) -> Inputs:
        rank = self.reading.rank
        alone = replace(self.reading, rank=rank - 1)
        if self.held is not None:
            places, rows = self.held
            leaves = (take(alone.ranked(arrays[place], 2), np.array(rows), -2) for place in places)
            held = motion_of(lax.expand_dims(leaf, range(rank + 1 - leaf.ndim)) for leaf in leaves)
            return Inputs(prescribed=held, batch_rank=rank)
        if self.followed:
            each = [edge.inputs(arrays, alone)[:3] for edge in self.followed]
            shape = jnp.broadcast_shapes(*(np.shape(c) for c in jax.tree.leaves(each)))
            return Inputs(*pointer_doubling.stack_components(each, shape, self.reading.dtype), batch_rank=rank)
        rows = [tuple(self._column(arrays[place], one, alone) for one in columns) for place, columns in self.kept]
        rows += [(0.0,) * self.counts[1]] * (3 - len(rows))
        return Inputs(*rows, batch_rank=rank)  # pyright: ignore[reportArgumentType]

    def _column(self, array: jax.Array, columns: tuple[int, ...], alone: Reading) -> jax.Array:
        found = take(alone.ranked(array, 1), np.array(columns), -1)
        return lax.expand_dims(found, range(self.reading.rank - found.ndim))

    @property
    def numbers(self) -> frozenset[int]:
        """Places of the arrays that are the tree's own numbers."""
        return frozenset(self.parameters)


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
        state = replace(state, **{kind: stage(functools.partial(take, places=columns, axis=-1))(getattr(state, kind))})
        arranged[:, at] = count * np.arange(len(frames))
    return state, arranged


def rows_of(arrays: Packed, rows: np.ndarray) -> Packed:
    """Return some rows of arrays [..., n, k]."""
    return tuple(take(array, rows, -2) for array in arrays)


def _cut(arrays: Packed, first: int, last: int) -> Packed:
    return tuple(array[..., first:last, :] for array in arrays)


def _levels_joined(parts: Sequence[Packed]) -> Packed:
    return parts[0] if len(parts) == 1 else tuple(jnp.concatenate(each, axis=-2) for each in zip(*parts, strict=True))


def _gathered(levels: Sequence[Packed], frames: Sequence[np.ndarray]) -> Packed:
    """Return the rows of levels in the order of the frames' numbers."""
    if plan.interleaved(frames):
        stacked = (jnp.stack(each, axis=-2) for each in zip(*levels, strict=True))
        return tuple(array.reshape(*array.shape[:-3], -1, array.shape[-1]) for array in stacked)
    return rows_of(_levels_joined(levels), np.argsort(np.concatenate(frames)))
