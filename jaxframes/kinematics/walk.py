"""Frame by frame: the motions of many frames relative to one, outward from the observer, each edge used once."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax

from jaxframes.kinematics.context import Context
from jaxframes.kinematics.path import between
from jaxframes.numerics.extension import extend
from jaxframes.numerics.packed import Kind, Packed, unpacked
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, inverse, relative
from jaxframes.numerics.steps import append_all
from jaxframes.staging.stages import stage
from jaxframes.staging.traced_inputs import Source
from jaxframes.tree.edges.rigid import Fixed
from jaxframes.tree.topology import Topology

FEW = 3
"""Up to so many frames, each path is worked out by itself: as many loops instead of one for each frame on the way."""


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
    return follow(moves(context.topology, observer, wanted), observer, lambda edge: context.source((edge,)), context.kind)


def follow(order: "Sequence[Move]", observer: int, source: Callable[[int], Source], kind: Kind) -> dict[int, Packed]:
    """Return the motions, relative to an observer, of the frames that moves lead to one after the other.

    Args:
        order: The moves.
        observer: The frame that they start from.
        source: Returns the steps of the edge above a frame.
        kind: What the motions are like.
    """
    found: dict[int, Packed] = {observer: ()}
    for move in order:
        if move.backward:
            found[move.end] = _backward(found[move.start], extend((), source(move.edge), kind), kind)
        else:
            found[move.end] = extend(found[move.start], source(move.edge), kind)
    return {frame: motion or kind.packed(AT_REST) for frame, motion in found.items()}


def known_pose(context: Context, of: int, relative_to: int) -> Rigid | None:
    """Return the pose of a frame in another where it is a number known while tracing: the path between them is fixed, or empty."""
    ways = context.topology.route(of, relative_to)
    if not all(isinstance(context.tree._edge(frame), Fixed) for way in ways for frame in way):
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
    found, ahead, island = list[Move](), [observer], topology.islands[observer]
    seen = {observer}

    def go(start: int, end: int, edge: int) -> None:
        if end not in seen and topology.islands[end] == island and (needed is None or end in needed):
            found.append(Move(start, end, edge, end != edge))
            seen.add(end)
            ahead.append(end)

    for frame in topology.ancestors(observer):
        if frame == island:
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
