"""Edges whose motion the state holds: prescribed motions and movable frames."""

from typing import Any, ClassVar

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.edges.fixed import checked_pose
from jaxframes.errors import EdgeError
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Transform


class HeldByState(Edge):
    """What they share: the one step is the motion that the state holds."""

    is_prescribed: ClassVar[bool] = True

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        assert inputs.prescribed is not None
        return (inputs.prescribed,)


@family(static=("accelerations",), name="prescribed")
class Prescribed(HeldByState):
    """A motion that the caller supplies in the state: pose, velocity and acceleration, three independent inputs.

    It starts at the identity and at rest; ``tree.set_motion`` gives it values. Nothing checks that they are consistent.

    Attributes:
        accelerations: Whether accelerations of chains through this edge may be asked for.
    """

    accelerations: bool

    def __init__(self, supports_accelerations: bool = True):
        if not isinstance(supports_accelerations, bool):
            raise EdgeError(f"Prescribed(supports_accelerations=...) takes True or False, not {supports_accelerations!r}")
        object.__setattr__(self, "accelerations", supports_accelerations)

    def arguments(self) -> dict[str, Any]:
        return {"supports_accelerations": self.accelerations}

    @property
    def supports_accelerations(self) -> bool:
        return self.accelerations

    def describe(self) -> str:
        return "prescribed" if self.accelerations else "prescribed, no accelerations"


@family(name="movable")
class Movable(HeldByState):
    """A frame that is put somewhere: RobWork's MovableFrame. The state holds its pose in its parent; it starts at ``pose``.

    ``tree.set_motion(state, name, transform)`` is RobWork's setTransform, ``tree.move_to(state, name, transform,
    relative_to=...)`` its moveTo. Like ``Prescribed``, the state also holds a velocity and an acceleration, zero unless given. The
    parent never changes: RobWork's movable frames that are attached and gripped are ``Attachable`` here. (RobWork starts with
    a rotation of zeros; this starts at the identity.) State size 7, mobility 6; no entries of ``q``.

    Attributes:
        pose: Pose in the parent that a new state starts with.
    """

    pose: Transform

    def __init__(self, pose: Transform | None = None):
        object.__setattr__(self, "pose", checked_pose(pose, "Movable"))
