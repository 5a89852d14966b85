"""Along a path: the motion of one frame relative to another, through their common ancestor, edge by edge."""

from collections.abc import Sequence

from jaxframes.kinematics import serial
from jaxframes.kinematics.context import Context
from jaxframes.numerics.extension import extend
from jaxframes.numerics.packed import Packed, unpacked
from jaxframes.numerics.rigid import relative
from jaxframes.staging.stages import stage
from jaxframes.tree.ways import pieces_of


def down(context: Context, frames: Sequence[int]) -> Packed:
    """Return the motion of the last frame of a downward path relative to the frame above its first edge."""
    found: Packed = ()
    pattern, pieces = pieces_of(context.tree, frames, context.order)
    if pattern is not None:
        found = serial.down(context, frames[: pattern.edges], pattern)
    for piece in pieces:
        found = extend(found, context.source(piece), context.kind)
    return found


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
