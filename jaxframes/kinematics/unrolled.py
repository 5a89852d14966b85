"""All frames of a tree of some dozens: frame after frame on components, a large batch block after block on a CPU.

What is written is many times what is computed, so this is about memory. Within a block of some thousand samples every frame's components
stay in the cache, each an array of its own that XLA vectorises; a few loops put them together to rows of the result. Frame by frame
over a whole batch, each would go through memory several times (measured: three times as long).
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.kinematics.arrays import halves
from jaxframes.kinematics.batches import SIZES, BatchOperation
from jaxframes.kinematics.context import Context
from jaxframes.kinematics.edge_steps import AnySteps, Partitioned, PathSteps, Reading, tails
from jaxframes.kinematics.path import Move, follow, moves
from jaxframes.numerics.components import Component
from jaxframes.numerics.packed import Kind
from jaxframes.numerics.path_motion import folded, half_angles, with_halves
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, inverse
from jaxframes.numerics.steps import Step, append_all
from jaxframes.numerics.trig import precomputed_pairs, sin_cos, sin_cos_of
from jaxframes.staging.columns import assemble
from jaxframes.staging.operation import Arrays, run, with_changes
from jaxframes.staging.sharding import alike, is_large, may_block, stack_arrays
from jaxframes.staging.stages import stage, staged
from jaxframes.staging.traced_inputs import Operands, TracedInput

IN_PLACE = jax.__version_info__ >= (0, 11)
"""Whether loops write columns straight to their places in the result, or rows are put together first. Measured: on jax 0.12 the
former takes three quarters of the time, on jax 0.10 a third more."""
BLOCK, COLUMNS = (1024, 8) if IN_PLACE else (4096, 10)
"""Samples a block on CPU, and columns that are put together at a time."""
Part = Callable[[], jax.Array]


def all_frames(context: Context, observer: int) -> Arrays:
    """Return the motions of all frames relative to one as arrays [*batch, n_frames, 4 or 3], in a tree without attachable frames.

    Returns:
        Quaternion and translation; the two halves of the velocity; those of the acceleration.
    """
    order, operands = moves(context.topology, observer), Operands()
    edges = context.edge_steps([move.edge for move in order], operands, whole=True)
    ranks = tails(edges, len(operands.arrays), of_numbers=-1)  # none of the tree's own numbers are batched
    operation = _AllFrames(edges, tuple(order), observer, ranks, context.shape, context.reading)
    return run(operation, *operands.arrays) if operands.arrays else operation.compute()


@dataclass(frozen=True)
class _AllFrames(BatchOperation):
    """The operation, of a tree's numbers, a state's arrays and the steps of edges that need the time.

    Attributes:
        edges: The steps of the edge that each move crosses.
        moves: The moves that lead from the observer to all other frames.
        observer: The frame that everything is relative to.
        ranks: For each array, how many axes at its end are none of the batch; -1 for numbers of the tree.
        shape: Batch shape.
        reading: How arrays are read.
    """

    edges: tuple[AnySteps, ...]
    moves: tuple[Move, ...]
    observer: int
    ranks: tuple[int, ...]
    shape: tuple[int, ...]
    reading: Reading

    @property
    def _kind(self) -> Kind:
        return Kind(self.shape, np.dtype(self.reading.dtype), self.reading.order)

    @property
    def _count(self) -> int:
        return len(self.moves) + 1

    def results(self, *arrays: Any) -> list[jax.ShapeDtypeStruct]:
        sizes = SIZES[: 2 + 2 * self.reading.order]
        return [jax.ShapeDtypeStruct((*self.shape, self._count, size), self._kind.dtype) for size in sizes]

    def compute(self, *arrays: jax.Array) -> Arrays:
        """Return the arrays of the whole batch."""
        whole = [_row(parts) for parts in self._columns(*arrays)]
        return tuple(w.reshape(*self.shape, self._count, w.shape[-1] // self._count) for w in whole)

    def compute_on_cpu(self, *arrays: jax.Array) -> Arrays:
        own = [a for a, rank in zip(arrays, self.ranks, strict=True) if rank < 0]
        if not is_large(self.shape, BLOCK) or any(a.ndim > 1 for a in own) or not all(map(may_block, arrays)):
            return self.compute(*arrays)

        def write(inner: _AllFrames, own: Arrays, out: Arrays, at: jax.Array) -> Arrays:
            return [_written(o, parts, at) for o, parts in zip(out, inner._columns(*own), strict=True)]

        # Zeros, though all are written over: this is where memory new to the process is first touched, by several threads.
        start = [jnp.zeros((math.prod(self.shape), math.prod(r.shape[-2:])), r.dtype) for r in self.results()]
        return self.in_blocks(BLOCK, start, write, arrays)

    def _columns(self, *arrays: jax.Array) -> list[list[Part]]:
        """Return how to make each result: the parts [*batch, k] that one after the other are its rows."""
        turning = _Angles(self.edges, self.reading)
        angles = len(turning(*arrays))
        pair = precomputed_pairs(*sin_cos_of(turning, *arrays)) if angles else sin_cos
        arrays = Partitioned(arrays)
        found, starts = {self.observer: AT_REST}, {move.start for move in self.moves}
        for move, edge in zip(self.moves, self.edges, strict=True):
            steps = with_halves(folded(edge.steps(arrays, self.reading)), pair)
            made = functools.partial(_moved, self.reading.order, found[move.start], steps, move)
            # What nothing starts from is worked out where it is put together: fewer loops to compile.
            found[move.end] = staged(made) if move.end in starts else made()
        motions = [found[frame] for frame in range(self._count)]
        parts = [[tuple(part) for part in _parts(motion, self.reading.order)] for motion in motions]
        return [_column_parts(rows, self._kind) for rows in zip(*parts, strict=True)]

    def over(self, shape: tuple[int, ...]) -> "_AllFrames":
        """Return the operation over a batch of another shape."""
        return replace(self, shape=shape, reading=replace(self.reading, rank=len(shape)))

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        return with_changes(self._frame_by_frame, primals, tangents)

    def _frame_by_frame(self, *arrays: jax.Array) -> Arrays:
        """Return the same by operations of one frame each, which bring their derivatives."""
        steps = {move.edge: edge for move, edge in zip(self.moves, self.edges, strict=True)}

        def steps_of(edge: int) -> TracedInput:
            recipe, places = PathSteps((steps[edge],), self.reading).part(0, 1)
            return TracedInput(recipe, tuple(arrays[place] for place in places))

        found = follow(self.moves, self.observer, steps_of, self._kind)
        packed = [stack_arrays(parts, -2) for parts in zip(*(found[frame] for frame in range(self._count)), strict=True)]
        return tuple(half for whole in packed for half in halves(whole))


@dataclass(frozen=True)
class _Angles:
    """Half the angles of all edges, in the order of the moves."""

    edges: tuple[AnySteps, ...]
    reading: Reading

    def __call__(self, *arrays: jax.Array) -> list[jax.Array]:
        opened = Partitioned(arrays)
        return [angle for edge in self.edges for angle in half_angles(edge.steps(opened, self.reading))]


def _moved(order: int, start: Rigid, steps: Sequence[Step], move: Move) -> Rigid:
    """Return the motion at the end of a move."""
    if not move.backward:
        return append_all(start, steps, order)
    return compose(start, inverse(append_all(AT_REST, steps, order), order), order)


def _parts(motion: Rigid, order: int) -> Sequence[Any]:
    parts = (motion.rotation, motion.translation, motion.angular, motion.linear, motion.angular2, motion.linear2)
    return parts[: 2 + 2 * order]


def _column_parts(rows: Sequence[tuple[Component, ...]], kind: Kind) -> list[Part]:
    """Return how to put the components of all frames together, some columns at a time."""
    many = COLUMNS // len(rows[0])

    def some(first: int) -> Callable[[], jax.Array]:
        columns = [component for row in rows[first : first + many] for component in row]
        return lambda: assemble(columns, kind.shape, kind.dtype)

    return [some(first) for first in range(0, len(rows), many)]


def _row(parts: Sequence[Part]) -> jax.Array:
    """Return the parts of rows put together."""
    made = [stage(part)() for part in parts]
    return stage(lambda: lax.concatenate(alike(*made), made[0].ndim - 1))()


def _written(out: jax.Array, parts: Sequence[Part], at: jax.Array) -> jax.Array:
    """Return an array [n, k] with a block of its rows written."""
    first = 0
    for part in [part() for part in parts] if IN_PLACE else [_row(parts)]:
        out = lax.dynamic_update_slice(out, part, (at, jnp.asarray(first, at.dtype)))
        first += part.shape[1]
    return out
