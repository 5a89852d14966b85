"""Edges as functions of arrays: what a stage works out of an edge, from the tree's numbers and a state's arrays, within itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.mimic import Mimic
from jaxframes.kinematics.arrays import motion_of
from jaxframes.numerics.components import V3, Component, mul
from jaxframes.numerics.path_motion import StepsRecipe, folded
from jaxframes.numerics.rigid import AT_REST
from jaxframes.numerics.steps import Step, append_all
from jaxframes.staging.columns import column, parameters, take_apart
from jaxframes.staging.traced_inputs import Parts

Row = tuple[Component, ...]


@dataclass(frozen=True)
class StateColumns:
    """Which columns of an array that a state holds an edge reads: the array's place among inputs, the first column and their number."""

    place: int
    first: int
    count: int


@dataclass(frozen=True)
class Reading:
    """How arrays are read: in which dtype, and with which rank of the batch.

    Attributes:
        rank: Rank of the batch: batch axes of every array are padded to it on the left.
        dtype: Name of the float dtype.
        order: 0 for poses, 1 with velocities, 2 with accelerations.
    """

    rank: int
    dtype: str
    order: int

    def ranked(self, array: jax.Array, trailing: int) -> jax.Array:
        """Return an array in the dtype, its batch axes padded on the left to the rank (none stays none)."""
        own = array.ndim - trailing
        missing = self.rank - own if own else 0
        converted = array.astype(self.dtype)
        return lax.expand_dims(converted, range(missing)) if missing else converted

    def edge(self, edge: Any) -> Any:
        """Return an edge with its float numbers in the dtype."""
        return jax.tree.map(lambda leaf: leaf.astype(self.dtype) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf, edge)


class Partitioned(tuple):
    """Arrays of which each is taken apart once, for all edges that read some of its columns."""

    def __init__(self, arrays: Sequence[jax.Array]):
        self._apart: dict[int, Row] = {}

    def columns(self, place: int, reading: Reading) -> Row:
        """Return the components of one of the arrays [..., k]."""
        if place not in self._apart:
            self._apart[place] = take_apart(reading.ranked(self[place], 1))
        return self._apart[place]


def columns(arrays: Sequence[jax.Array], kept: StateColumns, reading: Reading) -> Row:
    """Return the columns that an edge reads of an array that a state holds."""
    if not kept.count:
        return ()
    if isinstance(arrays, Partitioned):
        return arrays.columns(kept.place, reading)[kept.first : kept.first + kept.count]
    array = reading.ranked(arrays[kept.place], 1)
    return tuple(column(array, kept.first + i) for i in range(kept.count))


@dataclass(frozen=True)
class EdgeSteps:
    """The steps of one edge as a function of arrays.

    Attributes:
        edge: The edge, its traced numbers being places of arrays.
        kept: For ``q``, ``qd`` and ``qdd`` (as far as the order asks) the columns of the edge that drives it.
        counts: How many coordinates and rates that edge has.
        followers: Edges that follow that edge one after the other, this edge last; empty for an edge with coordinates of its own.
        held: Places of the arrays of motions that a state holds, and the row among them; None for an edge that is not prescribed.
    """

    edge: Parts
    kept: tuple[StateColumns, ...] = ()
    counts: tuple[int, int] = (0, 0)
    followers: tuple[Parts, ...] = ()
    held: tuple[tuple[int, ...], int] | None = None

    def inputs(self, arrays: Sequence[jax.Array], reading: Reading) -> Inputs:
        """Return what the edge reads of a state."""
        rows: list[Row] = [columns(arrays, kept, reading) for kept in self.kept]
        rows += [(0.0,) * self.counts[1]] * (3 - len(rows))
        q, qd, qdd = rows
        for follower in self.followers:
            edge = reading.edge(follower.of(arrays))
            assert isinstance(edge, Mimic)
            q, qd, qdd = edge.follow(q, qd, qdd, reading.rank)
        held = None
        if self.held is not None:
            places, row = self.held
            parts = (lax.index_in_dim(arrays[p], row, arrays[p].ndim - 2, keepdims=False) for p in places)
            held = motion_of(reading.ranked(part, 1) for part in parts)
        return Inputs(q=q, qd=qd, qdd=qdd, prescribed=held, batch_rank=reading.rank)

    def steps(self, arrays: Sequence[jax.Array], reading: Reading) -> tuple[Step, ...]:
        """Return the elementary motions from the edge's parent to its child."""
        return reading.edge(self.edge.of(arrays)).steps(self.inputs(arrays, reading), reading.order)

    def unit_twists(self, arrays: Sequence[jax.Array], reading: Reading) -> list[tuple[V3, V3]]:
        """Return, for each rate that moves the edge, the edge's velocity (angular, linear) for a unit of it."""
        scale: Component = 1.0
        for follower in self.followers:
            followed = reading.edge(follower.of(arrays))
            assert isinstance(followed, Mimic)
            scale = mul(scale, parameters(followed.multiplier, reading.rank)[0])
        return unit_twists(reading.edge(self.edge.of(arrays)), self.inputs(arrays, reading), scale)

    @property
    def numbers(self) -> frozenset[int]:
        """Places of the arrays that are the tree's own numbers."""
        return frozenset().union(self.edge.places, *(f.places for f in self.followers))

    @property
    def places(self) -> frozenset[int]:
        """Places of all arrays that it reads."""
        return self.numbers | {kept.place for kept in self.kept if kept.count} | set(self.held[0] if self.held else ())

    def moved(self, places: dict[int, int]) -> "EdgeSteps":
        """Return the same with arrays at other places."""
        return replace(
            self,
            edge=self.edge.moved(places),
            kept=tuple(replace(kept, place=places.get(kept.place, 0)) for kept in self.kept),
            followers=tuple(follower.moved(places) for follower in self.followers),
            held=None if self.held is None else (tuple(places[p] for p in self.held[0]), self.held[1]),
        )


@dataclass(frozen=True)
class PrecomputedSteps:
    """Steps of an edge that were worked out before, in stages of their own, as tables are.

    Attributes:
        made: The steps.
        twists: The edge's velocity (angular, linear) for a unit of each rate that moves it.
    """

    made: Parts
    twists: Parts

    def steps(self, arrays: Sequence[jax.Array], reading: Reading) -> tuple[Step, ...]:
        """Return the steps."""
        return self.made.of(arrays)

    def unit_twists(self, arrays: Sequence[jax.Array], reading: Reading) -> list[tuple[V3, V3]]:
        """Return the edge's velocity (angular, linear) for a unit of each rate that moves it."""
        return self.twists.of(arrays)

    @property
    def numbers(self) -> frozenset[int]:
        """No array is a number of the tree."""
        return frozenset()

    @property
    def places(self) -> frozenset[int]:
        """Places of all arrays that it reads."""
        return self.made.places | self.twists.places

    def moved(self, places: dict[int, int]) -> "PrecomputedSteps":
        """Return the same with arrays at other places."""
        return PrecomputedSteps(self.made.moved(places), self.twists.moved(places))


AnySteps = EdgeSteps | PrecomputedSteps


def unit_twists(edge: Edge, inputs: Inputs, scale: Component = 1.0) -> list[tuple[V3, V3]]:
    """Return the velocity (angular, linear) of an edge for a unit of each of its rates, times a scale."""
    count = len(inputs.qd)
    ones = [tuple(scale if i == j else 0.0 for j in range(count)) for i in range(count)]
    steps = (edge.steps(inputs._replace(qd=one, qdd=(0.0,) * count), 1) for one in ones)
    moved = (append_all(AT_REST, each, 1) for each in steps)
    return [(motion.angular, motion.linear) for motion in moved]


@dataclass(frozen=True)
class PathSteps(StepsRecipe):
    """The steps of edges one after the other: a recipe of a ``Source``."""

    edges: tuple[AnySteps, ...]
    reading: Reading

    def __call__(self, *arrays: jax.Array) -> tuple[Step, ...]:
        """Return the steps."""
        opened = Partitioned(arrays)
        return folded(step for edge in self.edges for step in edge.steps(opened, self.reading))

    @property
    def numbers(self) -> frozenset[int]:
        """Places of the arrays that are a tree's own numbers."""
        return frozenset().union(*(edge.numbers for edge in self.edges))

    @property
    def count(self) -> int:
        """How many edges make the steps."""
        return len(self.edges)

    def tails(self, count: int) -> tuple[int, ...]:
        """Return, for each of so many arrays, how many axes at its end are none of the batch."""
        return tails(self.edges, count, of_numbers=1)

    def part(self, first: int, last: int) -> "tuple[PathSteps, tuple[int, ...]]":
        """Return the recipe for some of the edges, and the places of the arrays that these read."""
        edges = self.edges[first:last]
        places = tuple(sorted(frozenset().union(*(edge.places for edge in edges))))
        moved = {place: i for i, place in enumerate(places)}
        return PathSteps(tuple(edge.moved(moved) for edge in edges), self.reading), places


def tails(edges: Sequence[AnySteps], count: int, of_numbers: int) -> tuple[int, ...]:
    """Return, for each of so many arrays that edges read, how many axes at its end are none of the batch.

    Args:
        edges: The edges.
        count: How many arrays there are.
        of_numbers: What is returned for a tree's own numbers.
    """
    found = [0] * count
    for edge in edges:
        for place in edge.numbers:
            found[place] = of_numbers
        if isinstance(edge, EdgeSteps):
            for kept in edge.kept:
                if kept.count:  # else it reads no array, and there may be none
                    found[kept.place] = 1
            for place in edge.held[0] if edge.held else ():
                found[place] = 2
    return tuple(found)
