"""Edges that only keep numbers: virtual joints and movable frames."""

from typing import Any, ClassVar

from jaxframes.edges.base import KEPT, Edge, Inputs, family
from jaxframes.edges.fixed import placement_components
from jaxframes.edges.joint import Joint
from jaxframes.errors import EdgeError
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Transform


@family(static=(*KEPT, "count"))
class Virtual(Joint):
    """A joint that keeps coordinates and moves nothing: ``parent_T_child = placement``, as RobWork's VirtualJoint.

    Its numbers stand in ``q``, ``qd`` and ``qdd`` for whoever reads them (a gripper's opening, a value that ``Mimic`` joints
    follow); its columns of every Jacobian are zero. State size ``count``, mobility 0.

    Attributes:
        count: How many coordinates it keeps (static).
        placement: Pose of the child in the parent.
        limits: Lower, then upper bounds [2 count].
        velocity_limits: Largest rates [count].
        effort_limits: Largest efforts [count].
        active: Whether the joint is driven (static).
    """

    placement: Transform
    limits: tuple[float, ...]
    velocity_limits: tuple[float, ...]
    effort_limits: tuple[float, ...]
    active: bool
    count: int

    def __init__(
        self,
        count: int = 1,
        placement: Transform | None = None,
        limits: Any = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
    ):
        if not isinstance(count, int) or count < 1:
            raise EdgeError(f"Virtual(count=...) takes the number of coordinates to keep, 1 or more; found {count!r}")
        object.__setattr__(self, "count", count)
        self._share(placement, limits, velocity_limits, effort_limits, active)

    @property
    def nq(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.count

    @property
    def nv(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.count

    @property
    def dof(self) -> int:
        return 0

    def angles(self) -> tuple[bool, ...]:
        return (False,) * self.count

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (Rigid(*placement_components(self.placement, inputs.batch_rank)),)

    def describe(self) -> str:
        return f"virtual, {self.count} numbers"


@family()
class Movable(Edge):
    """A frame that is put somewhere: RobWork's MovableFrame. The state holds its pose in its parent; it starts at ``pose``.

    ``tree.set_motion(state, name, transform)`` is RobWork's setTransform, ``tree.move_to(state, name, transform,
    relative_to=...)`` its moveTo. Like ``Prescribed``, the state also holds a velocity and an acceleration, zero unless given. The
    parent never changes: RobWork's movable frames that are attached and gripped are ``Attachable`` here. (RobWork starts with
    a rotation of zeros; this starts at the identity.) State size 7, mobility 6; no entries of ``q``.

    Attributes:
        pose: Pose in the parent that a new state starts with.
    """

    is_prescribed: ClassVar[bool] = True
    pose: Transform

    def __init__(self, pose: Transform | None = None):
        object.__setattr__(self, "pose", Transform.identity() if pose is None else pose)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        assert inputs.prescribed is not None
        return (inputs.prescribed,)
