"""All frames of a tree of some dozens: frame after frame on components, a large batch block after block on a CPU.

What is written is many times what is computed, so this is about memory. Within a block of some thousand samples every frame's components
stay in the cache, each an array of its own that XLA vectorises; a few loops put them together to rows of the result. Frame by frame
over a whole batch, each would go through memory several times (measured: three times as long).
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.kinematics.arrays import halves
from jaxframes.kinematics.context import JOINT_FIELDS, Context, Within
from jaxframes.kinematics.rates import batch_of, trailing
from jaxframes.kinematics.walk import Move, moves, outward
from jaxframes.numerics.blocks import may_block
from jaxframes.numerics.boundary import assemble
from jaxframes.numerics.components import Component
from jaxframes.numerics.extension import folded, half_angles, with_halves
from jaxframes.numerics.layout import alike, like, stacked
from jaxframes.numerics.operation import Arrays, elementwise, run, with_changes
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, inverse
from jaxframes.numerics.source import Opened
from jaxframes.numerics.stages import by_platform, stage, staged
from jaxframes.numerics.steps import append_all
from jaxframes.numerics.trig import given_pairs, sin_cos, sin_cos_of

IN_PLACE = jax.__version_info__ >= (0, 11)
"""Whether loops write columns straight to their places in the result, or rows are put together first. Measured: on jax 0.12 the
former takes three quarters of the time, on jax 0.10 a third more."""
BLOCK, COLUMNS = (1024, 8) if IN_PLACE else (4096, 10)
"""Samples a block on CPU, and columns that are put together at a time."""
SIZES = (4, 3, 3, 3, 3, 3)
"""Columns of quaternion, translation and the halves of velocity and acceleration."""
WHOLE = dict.fromkeys(JOINT_FIELDS, 0)
Part = Callable[[], jax.Array]


def all_frames(context: Context, observer: int) -> Arrays:
    """Return the motions of all frames relative to one as arrays [*batch, n_frames, 4 or 3], in a tree without attachable frames.

    Returns:
        Quaternion and translation; the two halves of the velocity; those of the acceleration.
    """
    names = range(1, len(context.topology.names))
    given = {frame: context.steps(frame) for frame in names if context.check(frame) or context.tree._edge(frame).needs_time}
    values = (context.tree, context.state, given)
    ranks = (jax.tree.map(lambda _: -1, context.tree), trailing(context.state), jax.tree.map(lambda _: 0, given))
    opened = Opened(*values)
    operation = _AllFrames(opened, [jax.tree.leaves(ranks)[i] for i in opened.places], context, observer)
    return run(operation, *opened.arrays) if opened.arrays else operation.compute()


class _AllFrames:
    """The operation, of the traced arrays of a tree, a state and the steps of edges that need the time."""

    def __init__(self, opened: Opened, ranks: Sequence[int], context: Context, observer: int, shape: tuple[int, ...] | None = None):
        self._opened, self._ranks, self._context, self._observer = opened, ranks, context, observer
        self._shape = context.shape if shape is None else shape

    def _inside(self, arrays: Arrays) -> Context:
        tree, state, given = self._opened(*arrays)
        return Context(tree, state, self._context.order, Within(given, WHOLE))

    def results(self, *arrays: Any) -> list[jax.ShapeDtypeStruct]:
        count, dtype = len(self._context.topology.names), self._context.dtype
        return [jax.ShapeDtypeStruct((*self._shape, count, size), dtype) for size in SIZES[: 2 + 2 * self._context.order]]

    def compute(self, *arrays: jax.Array) -> Arrays:
        if math.prod(self._shape) <= BLOCK or -1 in self._batched(arrays) or not all(map(may_block, arrays)):
            return self._at_once(*arrays)
        return by_platform(*arrays, cpu=self._in_blocks, default=self._at_once)

    def _batched(self, arrays: Arrays) -> list[int]:
        """Return the ranks of those arrays that have batch axes; -1 for a tree's."""
        stacked = self._opened(*arrays)[0].parameters
        found = [rank for a, rank in zip(arrays, self._ranks, strict=True) if rank >= 0 and math.prod(batch_of(a, rank)) > 1]
        usual = zip(stacked, self._context.topology.stacked, strict=True)
        return found + [-1 for leaves, on in usual for leaf in leaves if on and leaf.ndim > 2]

    def _at_once(self, *arrays: jax.Array) -> Arrays:
        """Return the arrays of the whole batch."""
        shape, count = self._shape, len(self._context.topology.names)
        whole = [_row(parts) for parts in self._columns(*arrays)]
        return tuple(w.reshape(*shape, count, w.shape[-1] // count) for w in whole)

    def _columns(self, *arrays: jax.Array) -> list[list[Part]]:
        """Return how to make each result: the parts [*batch, k] that one after the other are its rows."""
        context = self._inside(arrays)
        order = moves(context.topology, self._observer)

        def angles(*arrays: jax.Array) -> list[jax.Array]:
            inside = self._inside(arrays)
            return [angle for move in order for angle in half_angles(inside.steps(move.edge))]

        pairs, first = sin_cos_of(angles, *arrays) if angles(*arrays) else (), 0
        found, starts = {self._observer: AT_REST}, {move.start for move in order}
        for move in order:
            made = functools.partial(_moved, context, (*pairs, first), found[move.start], move)
            # What nothing starts from is worked out where it is put together: fewer loops to compile.
            found[move.end] = staged(made) if move.end in starts else made()
            first += len(half_angles(context.steps(move.edge)))
        motions = [found[frame] for frame in range(len(context.topology.names))]
        parts = [[tuple(part) for part in _parts(motion, context.order)] for motion in motions]
        return [_joined(rows, context) for rows in zip(*parts, strict=True)]

    def _in_blocks(self, *arrays: jax.Array) -> Arrays:
        """Return the same, block after block. The last block starts early enough to be whole."""
        count = math.prod(self._shape)
        flat = [self._flat(a, rank) for a, rank in zip(arrays, self._ranks, strict=True)]
        inner = _AllFrames(self._opened, self._ranks, self._context, self._observer, (BLOCK,))

        def block(i: jax.Array, out: Arrays) -> Arrays:
            at = jnp.minimum(i * BLOCK, count - BLOCK)
            own = (lax.dynamic_slice_in_dim(a, at, BLOCK) if long else a for a, long in flat)
            return tuple(_written(o, parts, at) for o, parts in zip(out, inner._columns(*own), strict=True))

        # Zeros, though all are written over: this is where memory new to the process is first touched, by several threads.
        start = tuple(like(jnp.zeros((count, math.prod(r.shape[-2:])), r.dtype), *arrays) for r in self.results())
        whole = lax.fori_loop(0, -(-count // BLOCK), block, start)
        return tuple(w.reshape(r.shape) for w, r in zip(whole, self.results(), strict=True))

    def _flat(self, array: jax.Array, rank: int) -> tuple[jax.Array, bool]:
        """Return an array with its batch axes as one, and True; or without batch axes, and False, where it is the same for all samples."""
        if rank < 0:
            return array, False
        tail = array.shape[array.ndim - rank :]
        if math.prod(batch_of(array, rank)) == 1:
            return array.reshape(tail), False
        return jnp.broadcast_to(array, (*self._shape, *tail)).reshape(-1, *tail), True

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        return with_changes(self._frame_by_frame, primals, tangents)

    def _frame_by_frame(self, *arrays: jax.Array) -> Arrays:
        """Return the same by operations of one frame each, which bring their derivatives."""
        context = self._inside(arrays)
        found = outward(context, self._observer)
        packed = [stacked(parts, -2) for parts in zip(*(found[f] for f in range(len(context.topology.names))), strict=True)]
        return tuple(half for whole in packed for half in halves(whole))

    def mapped(self, count: int, axes: Sequence[int | None], *arrays: jax.Array) -> Arrays:
        """Take a vmapped axis as a further batch axis, unless trees differ."""
        if any(axis is not None and rank < 0 for axis, rank in zip(axes, self._ranks, strict=True)):
            return elementwise(self)(count, axes, *arrays)
        aligned = []
        for array, axis, rank in zip(arrays, axes, self._ranks, strict=True):
            missing = len(self._shape) - (array.ndim - rank - 1)
            aligned.append(array if axis is None else lax.expand_dims(array, range(1, 1 + missing)))
        return run(_AllFrames(self._opened, self._ranks, self._context, self._observer, (count, *self._shape)), *aligned)


def _moved(context: Context, pairs: tuple[Any, ...], start: Rigid, move: Move) -> Rigid:
    """Return the motion at the end of a move."""
    steps = with_halves(folded(context.steps(move.edge)), given_pairs(*pairs) if len(pairs) > 1 else sin_cos)
    if not move.backward:
        return append_all(start, steps, context.order)
    return compose(start, inverse(append_all(AT_REST, steps, context.order), context.order), context.order)


def _parts(motion: Rigid, order: int) -> Sequence[Any]:
    parts = (motion.rotation, motion.translation, motion.angular, motion.linear, motion.angular2, motion.linear2)
    return parts[: 2 + 2 * order]


def _joined(rows: Sequence[tuple[Component, ...]], context: Context) -> list[Part]:
    """Return how to put the components of all frames together, some columns at a time."""
    many = COLUMNS // len(rows[0])

    def some(first: int) -> Callable[[], jax.Array]:
        columns = [component for row in rows[first : first + many] for component in row]
        return lambda: assemble(columns, context.shape, context.dtype)

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
