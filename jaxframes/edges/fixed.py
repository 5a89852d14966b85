"""Fixed mounts, and the poses that edges of other families hold."""

from typing import Any, Self

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.errors import EdgeError
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Transform


def checked_pose(pose: Any, family_name: str) -> Transform:
    """Return a pose given to an edge; the identity for None (EdgeError for anything that is no ``Transform``)."""
    if pose is None:
        return Transform.identity()
    if not isinstance(pose, Transform):
        raise EdgeError(f"{family_name} takes a jf.Transform, found {type(pose).__name__}; Transform.from_matrix reads a 4x4 matrix")
    return pose


@family(name="fixed")
class Fixed(Edge):
    """A rigid mount: the child stays where the transform puts it.

    Attributes:
        transform: Pose of the child in the parent, ``parent_T_child``.

    Example:
        >>> import jaxframes as jf
        >>> mount = jf.edges.Fixed(jf.Transform.from_translation((0.0, 0.0, 0.1)))
    """

    transform: Transform

    def __init__(self, transform: Transform | None = None):
        object.__setattr__(self, "transform", checked_pose(transform, "Fixed"))

    def preceded_by(self, change: Transform) -> Self:
        return self.replace(transform=change @ self.transform)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        rotation, translation = inputs.pose(self.transform)
        return (Rigid(rotation, translation),)
