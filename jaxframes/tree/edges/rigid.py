"""Edges without coordinates: fixed mounts, and motions prescribed by the state."""

from typing import ClassVar

from jaxframes.errors import EdgeError
from jaxframes.numerics.boundary import parameters
from jaxframes.numerics.components import V3, Quat
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Transform
from jaxframes.tree.edges.base import Edge, Inputs, family


def placement_components(transform: Transform, batch_rank: int) -> tuple[Quat, V3]:
    """Return the rotation and translation of a parameter as components."""
    return Quat(*parameters(transform.rotation.wxyz, batch_rank)), V3(*parameters(transform.translation, batch_rank))


@family()
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
        object.__setattr__(self, "transform", Transform.identity() if transform is None else transform)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        rotation, translation = placement_components(self.transform, inputs.batch_rank)
        return (Rigid(rotation, translation),)


@family(static=("accelerations",))
class Prescribed(Edge):
    """A motion that the caller supplies in the state: pose, velocity and acceleration, three independent inputs.

    It starts at the identity and at rest; ``tree.set_motion`` gives it values. Nothing checks that they are consistent.

    Attributes:
        accelerations: Whether accelerations of chains through this edge may be asked for.
    """

    stacks: ClassVar[bool] = True
    is_prescribed: ClassVar[bool] = True
    accelerations: bool

    def __init__(self, supports_accelerations: bool = True):
        if not isinstance(supports_accelerations, bool):
            raise EdgeError(f"Prescribed(supports_accelerations=...) takes True or False, not {supports_accelerations!r}")
        object.__setattr__(self, "accelerations", supports_accelerations)

    @property
    def supports_accelerations(self) -> bool:
        return self.accelerations

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        assert inputs.prescribed is not None
        return (inputs.prescribed,)

    def describe(self) -> str:
        return "prescribed" if self.accelerations else "prescribed, no accelerations"
