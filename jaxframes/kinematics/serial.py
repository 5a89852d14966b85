"""Along a long path whose edges repeat: one piece of it, compiled once, that a scan takes over the path.

A snake of sixty joints is the same few edges over and over, with other numbers. Unrolled, each would be compiled by itself: half a minute
for the derivatives of its acceleration. A scan compiles one piece and runs it on every stretch of the path in turn, over the whole batch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.kinematics.context import JOINT_FIELDS, Context
from jaxframes.kinematics.edge_steps import Reading
from jaxframes.numerics.extension import StepsRecipe, extend
from jaxframes.numerics.packed import Packed
from jaxframes.numerics.rigid import AT_REST
from jaxframes.numerics.steps import Step
from jaxframes.staging.columns import column
from jaxframes.staging.sharding import like
from jaxframes.staging.traced_inputs import Source
from jaxframes.tree.edges.base import Inputs
from jaxframes.tree.ways import Repeats


def down(context: Context, frames: Sequence[int], found: Repeats) -> Packed:
    """Return the motion of the last frame of a path that repeats relative to the frame above its first edge."""
    context.check(frames[0])
    size, topology = len(found.groups), context.topology
    moving = [i for i in range(size) if topology.coordinates[frames[i]][1]]

    def coordinates(kind: str) -> jax.Array:
        first = 0 if kind == "q" else 2
        columns = np.array([topology.coordinates[frames[p * size + i]][first] for p in range(found.pieces) for i in moving])
        whole = context.gathered(kind, columns)
        return jnp.moveaxis(whole.reshape(*whole.shape[:-1], found.pieces, len(moving)), -2, 0)

    edges = [_numbers(context, found.groups[place], frames[place::size]) for place in range(size)]
    values = [coordinates(kind) for kind in JOINT_FIELDS[: 1 + context.order]]
    definitions, counts = tuple(topology.groups[group] for group in found.groups), tuple(map(len, edges))
    columns = tuple(moving.index(place) if place in moving else None for place in range(size))
    recipe = PieceSteps(definitions, counts, columns, context.reading)

    def piece(motion: Packed, given: Any) -> tuple[Packed, None]:
        return extend(motion, Source(recipe, tuple(jax.tree.leaves(given))), context.kind), None

    start = tuple(like(a, *jax.tree.leaves(values)) for a in context.kind.packed(AT_REST))
    return lax.scan(piece, start, (edges, values))[0]


def _numbers(context: Context, group: int, frames: Sequence[int]) -> list[jax.Array]:
    """Return the numbers of edges of one family, one edge after the other: arrays [n_edges, k]."""
    edge = jax.tree.unflatten(context.topology.groups[group], context.tree.numbers(frames)).normalized()
    return [jnp.asarray(leaf) for leaf in jax.tree.leaves(edge)]


@dataclass(frozen=True)
class PieceSteps(StepsRecipe):
    """The steps of a piece's edges, of their numbers one after the other, then of its coordinates [..., n moving].

    Attributes:
        definitions: How each edge is put together.
        counts: How many arrays each takes.
        columns: Which column of the coordinates each reads, None for one that does not move.
        reading: How arrays are read.
    """

    definitions: tuple[Any, ...]
    counts: tuple[int, ...]
    columns: tuple[int | None, ...]
    reading: Reading

    def __call__(self, *arrays: jax.Array) -> tuple[Step, ...]:
        """Return the steps."""
        return tuple(step for place in range(self.count) for step in self._edge(place, arrays))

    def _edge(self, place: int, arrays: Sequence[jax.Array]) -> tuple[Step, ...]:
        first, rank, order = sum(self.counts[:place]), self.reading.rank, self.reading.order
        edge = self.reading.edge(jax.tree.unflatten(self.definitions[place], arrays[first : first + self.counts[place]]))
        at = self.columns[place]
        if at is None:
            return edge.steps(Inputs(batch_rank=rank), order)
        own = [(column(value, at),) for value in arrays[sum(self.counts) :]]
        return edge.steps(Inputs(*own, *[(0.0,)] * (2 - order), batch_rank=rank), order)  # pyright: ignore[reportArgumentType]

    @property
    def numbers(self) -> frozenset[int]:
        """Places of the arrays that are the tree's own numbers."""
        return frozenset(range(sum(self.counts)))

    @property
    def count(self) -> int:
        """How many edges make the steps."""
        return len(self.counts)

    def part(self, first: int, last: int) -> "tuple[PieceSteps, tuple[int, ...]]":
        """Return the recipe for some of the edges, and the places of the arrays that these read."""
        total, last = sum(self.counts), min(last, self.count)
        part = PieceSteps(self.definitions[first:last], self.counts[first:last], self.columns[first:last], self.reading)
        numbers = range(sum(self.counts[:first]), sum(self.counts[:last]))
        return part, (*numbers, *range(total, total + 1 + self.reading.order))
