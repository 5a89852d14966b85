"""Over all frames: the motion of every frame relative to one, each edge used once, outward from the observer."""

from collections.abc import Callable

from jaxframes.kinematics.arrays import Arrays, arrays_of, motion_of
from jaxframes.kinematics.context import Context
from jaxframes.numerics.extension import extend
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, inverse


def edge_motion(context: Context, frame: int) -> Rigid:
    """Return the motion of a frame relative to its parent."""
    return extend(AT_REST, context.steps(frame), context.order)


def everything(context: Context, observer: int) -> dict[int, Arrays]:
    """Return the motions of all frames of the observer's static part as arrays.

    Each frame's result is also what its children are computed from: every frame is a stage of its own, so the program and its
    compilation grow linearly with the number of frames.
    """
    done: dict[int, Arrays] = {}

    def stage(frame: int, motion: Rigid) -> Rigid:
        done[frame] = arrays_of(motion, context.shape, context.order, context.dtype)
        return motion_of(done[frame])

    outward(context, observer, stage=stage)
    return done


def outward(
    context: Context,
    observer: int,
    wanted: frozenset[int] | None = None,
    stage: Callable[[int, Rigid], Rigid] = lambda frame, motion: motion,
) -> dict[int, Rigid]:
    """Return the motions of frames relative to an observer, within the static part of the tree that it belongs to.

    Walks up from the observer by inverted edges and down everywhere else, so every path goes through the common ancestor and
    nothing that an observer and a frame share enters their relative motion.

    Args:
        context: Tree, state and order.
        observer: The frame that everything is relative to.
        wanted: Frames whose motions are needed, all of the observer's static part. Default: all of that part.
        stage: Called with every frame and its motion; what it returns is what the next frames start from.
    """
    topology = context.topology
    needed = None if wanted is None else _with_paths(context, observer, wanted)
    found = {observer: AT_REST}
    stage(observer, AT_REST)
    ahead = [observer]
    island = topology.islands[observer]
    for frame in topology.ancestors(observer):
        if frame == island:
            break
        parent = topology.parents[frame]
        if needed is None or parent in needed:
            found[parent] = stage(parent, compose(found[frame], inverse(edge_motion(context, frame), context.order), context.order))
            ahead.append(parent)
    while ahead:
        frame = ahead.pop()
        for child in topology.children[frame]:
            if child not in found and topology.islands[child] == island and (needed is None or child in needed):
                found[child] = stage(child, extend(found[frame], context.steps(child), context.order))
                ahead.append(child)
    return found


def _with_paths(context: Context, observer: int, wanted: frozenset[int]) -> frozenset[int]:
    needed = {observer}
    for frame in wanted:
        up, down = context.topology.route(frame, observer)
        needed.update(down)
        needed.update(context.topology.parents[i] for i in up)
    return frozenset(needed)
