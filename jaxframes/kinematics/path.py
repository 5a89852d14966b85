"""Along a path: the motion of one frame relative to another, through their common ancestor, edge by edge."""

from jaxframes.kinematics import attached
from jaxframes.kinematics.context import Context
from jaxframes.numerics.extension import extend
from jaxframes.numerics.rigid import AT_REST, Rigid, relative


def down(context: Context, frames: tuple[int, ...]) -> Rigid:
    """Return the motion of the last frame of a downward path relative to the frame above its first edge."""
    return extend(AT_REST, (step for frame in frames for step in context.steps(frame)), context.order)


def between(context: Context, of: int, relative_to: int) -> Rigid:
    """Return the motion of ``of`` as ``relative_to`` sees it.

    Both are composed from their lowest common ancestor only: numbers that both share, such as the distance to the Sun, never
    enter, so nothing cancels (semantics: X(o,p) = X(c,o)^-1 X(c,p)).
    """
    if context.topology.islands[of] != context.topology.islands[relative_to]:
        return attached.between(context, of, relative_to)
    to_observer, to_target = context.topology.route(of, relative_to)
    target = down(context, to_target)
    return relative(down(context, to_observer), target, context.order) if to_observer else target
