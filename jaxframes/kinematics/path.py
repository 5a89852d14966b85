"""Along a path: the motion of one frame relative to another, through their common ancestor, and of many frames outward from one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.base import Inputs
from jaxframes.edges.fixed import Fixed
from jaxframes.kinematics.context import JOINT_FIELDS, Context
from jaxframes.kinematics.edge_steps import Reading
from jaxframes.kinematics.plan import Repeats, pieces_of
from jaxframes.model.topology import Topology
from jaxframes.numerics.packed import Kind, Packed, unpacked
from jaxframes.numerics.path_motion import StepsRecipe, extend
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, inverse, relative
from jaxframes.numerics.steps import Step, append_all
from jaxframes.staging.columns import column
from jaxframes.staging.sharding import like
from jaxframes.staging.stages import stage
from jaxframes.staging.traced_inputs import TracedInput

FEW = 3
"""Up to so many frames, each path is worked out by itself: as many loops instead of one for each frame on the way."""


def between(context: Context, of: int, relative_to: int) -> Packed:
    """Return the motion of ``of`` as ``relative_to`` sees it, where no attachable frame stands between them.

    Both are composed from their lowest common ancestor only: numbers that both share, such as the distance to the Sun, never
    enter, so nothing cancels (semantics: X(o,p) = X(c,o)^-1 X(c,p)).
    """
    to_observer, to_target = context.topology.route(of, relative_to)
    target = down(context, to_target)
    return seen(context, down(context, to_observer), target) if to_observer else target


def seen(context: Context, observer: Packed, target: Packed) -> Packed:
    """Return the motion of a target as an observer sees it; both are given relative to one frame."""

    def work(observer: Packed, target: Packed) -> Packed:
        return context.kind.packed(relative(unpacked(observer), unpacked(target), context.order))

    return stage(work)(observer, target)


def down(context: Context, frames: Sequence[int]) -> Packed:
    """Return the motion of the last frame of a downward path relative to the frame above its first edge."""
    found: Packed = ()
    pattern, pieces = pieces_of(context.tree, frames, context.order)
    if pattern is not None:
        found = repeated(context, frames[: pattern.edges], pattern)
    for piece in pieces:
        found = extend(found, context.steps_of(piece), context.kind)
    return found


def repeated(context: Context, frames: Sequence[int], found: Repeats) -> Packed:
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
        return extend(motion, TracedInput(recipe, tuple(jax.tree.leaves(given))), context.kind), None

    start = tuple(like(a, *jax.tree.leaves(values)) for a in context.kind.packed(AT_REST))
    return lax.scan(piece, start, (edges, values))[0]


def _numbers(context: Context, group: int, frames: Sequence[int]) -> list[jax.Array]:
    """Return the numbers of edges of one family, one edge after the other: arrays [n_edges, ..., k]."""
    edge = jax.tree.unflatten(context.topology.groups[group], context.tree.numbers(frames)).normalized()
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(edge)]
    return [leaf if leaf.ndim == 2 else jnp.moveaxis(leaf, -2, 0) for leaf in leaves]


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


def outward(context: Context, observer: int, wanted: frozenset[int] | None = None) -> dict[int, Packed]:
    """Return the motions of frames relative to an observer, within the static part of the tree that it belongs to.

    Walks up from the observer by inverted edges and down everywhere else, so every path goes through the common ancestor and
    nothing that an observer and a frame share enters their relative motion. Every frame is a stage, which those after it start from:
    the program and its compilation grow linearly with the number of frames.

    Args:
        context: Tree, state and order.
        observer: The frame that everything is relative to.
        wanted: Frames whose motions are needed, all of the observer's static part. Default: all of that part.
    """
    if wanted is not None and len(wanted) <= FEW:
        rest = context.kind.packed(AT_REST)
        return {frame: rest if frame == observer else between(context, frame, observer) for frame in wanted}
    return follow(moves(context.topology, observer, wanted), observer, lambda edge: context.steps_of((edge,)), context.kind)


def follow(order: "Sequence[Move]", observer: int, steps_of: Callable[[int], TracedInput], kind: Kind) -> dict[int, Packed]:
    """Return the motions, relative to an observer, of the frames that moves lead to one after the other.

    Args:
        order: The moves.
        observer: The frame that they start from.
        steps_of: Returns the steps of the edge above a frame.
        kind: What the motions are like.
    """
    found: dict[int, Packed] = {observer: ()}
    for move in order:
        if move.backward:
            found[move.end] = _backward(found[move.start], extend((), steps_of(move.edge), kind), kind)
        else:
            found[move.end] = extend(found[move.start], steps_of(move.edge), kind)
    return {frame: motion or kind.packed(AT_REST) for frame, motion in found.items()}


def known_pose(context: Context, of: int, relative_to: int) -> Rigid | None:
    """Return the pose of a frame in another where it is a number known while tracing: the path between them is fixed, or empty."""
    ways = context.topology.route(of, relative_to)
    if not all(isinstance(context.tree.edge_of(frame), Fixed) for way in ways for frame in way):
        return None
    observer, target = (append_all(AT_REST, (step for frame in way for step in context.fixed_steps(frame)), 0) for way in ways)
    if any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves((observer, target))):
        return None
    return relative(observer, target, 0)


class Move(NamedTuple):
    """A step from one frame to the next across the edge above one of them; ``backward`` where that leads up, to a parent."""

    start: int
    end: int
    edge: int
    backward: bool


def moves(topology: Topology, observer: int, wanted: frozenset[int] | None = None) -> list[Move]:
    """Return the steps that lead outward from an observer to all frames wanted, of its static part of the tree."""
    needed = None if wanted is None else _with_paths(topology, observer, wanted)
    found, ahead, component = list[Move](), [observer], topology.static_components[observer]
    seen = {observer}

    def go(start: int, end: int, edge: int) -> None:
        if end not in seen and topology.static_components[end] == component and (needed is None or end in needed):
            found.append(Move(start, end, edge, end != edge))
            seen.add(end)
            ahead.append(end)

    for frame in topology.ancestors(observer):
        if frame == component:
            break
        go(frame, topology.parents[frame], frame)
    while ahead:
        frame = ahead.pop()
        for child in topology.children[frame]:
            go(frame, child, child)
    return found


def _backward(start: Packed, edge: Packed, kind: Kind) -> Packed:
    """Return the motion of a frame's parent from that of the frame."""

    def work(start: Packed, edge: Packed) -> Packed:
        return kind.packed(compose(unpacked(start), inverse(unpacked(edge), kind.order), kind.order))

    return stage(work)(start, edge)


def _with_paths(topology: Topology, observer: int, wanted: frozenset[int]) -> frozenset[int]:
    needed = {observer}
    for frame in wanted:
        up, down = topology.route(frame, observer)
        needed.update(down)
        needed.update(topology.parents[i] for i in up)
    return frozenset(needed)
