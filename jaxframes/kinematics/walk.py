"""Over all frames: the motion of every frame relative to one, each edge used once, outward from the observer."""

from jaxframes.kinematics.context import Context
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, inverse
from jaxframes.numerics.steps import append


def edge_motion(context: Context, frame: int) -> Rigid:
    """Return the motion of a frame relative to its parent."""
    motion = AT_REST
    for step in context.steps(frame):
        motion = append(motion, step, context.order)
    return motion


def extend(context: Context, motion: Rigid, frame: int) -> Rigid:
    """Return the motion of a frame from that of its parent."""
    for step in context.steps(frame):
        motion = append(motion, step, context.order)
    return motion


def outward(context: Context, observer: int, wanted: frozenset[int] | None = None) -> dict[int, Rigid]:
    """Return the motions of frames relative to an observer, within the static part of the tree that it belongs to.

    Walks up from the observer by inverted edges and down everywhere else, so every path goes through the common ancestor and
    nothing that an observer and a frame share enters their relative motion.

    Args:
        context: Tree, state and order.
        observer: The frame that everything is relative to.
        wanted: Frames whose motions are needed, all of the observer's static part. Default: all of that part.
    """
    topology = context.topology
    needed = None if wanted is None else _with_paths(context, observer, wanted)
    found = {observer: AT_REST}
    ahead = [observer]
    island = topology.islands[observer]
    for frame in topology.ancestors(observer):
        if frame == island:
            break
        parent = topology.parents[frame]
        if needed is None or parent in needed:
            found[parent] = compose(found[frame], inverse(edge_motion(context, frame), context.order), context.order)
            ahead.append(parent)
    while ahead:
        frame = ahead.pop()
        for child in topology.children[frame]:
            if child not in found and topology.islands[child] == island and (needed is None or child in needed):
                found[child] = extend(context, found[frame], child)
                ahead.append(child)
    return found


def _with_paths(context: Context, observer: int, wanted: frozenset[int]) -> frozenset[int]:
    needed = {observer}
    for frame in wanted:
        up, down = context.topology.route(frame, observer)
        needed.update(down)
        needed.update(context.topology.parents[i] for i in up)
    return frozenset(needed)
