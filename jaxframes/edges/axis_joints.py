"""Joints along or about one axis: revolute, continuous, prismatic, screw, cylindrical."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Inputs
from jaxframes.edges.joint import AxisJoint, coordinate, joint_family, one_number
from jaxframes.numerics.components import mul
from jaxframes.numerics.steps import RotationStep, Step, TranslationStep
from jaxframes.spatial import Transform

TURN = 2.0 * np.pi


@joint_family("revolute")
class Revolute(AxisJoint):
    """A rotation about an axis by q radians, after a fixed placement: ``parent_T_child = placement @ Rot(axis, q)``.

    Attributes:
        axis: Unit axis [3] in the axes of the placement; normalised when the edge is made, zero is refused.
        placement: Pose of the joint in the parent at q = 0.
        limits: (lower, upper) in rad [2]; infinite where unlimited. Kept for checks, never enforced by a query.
        velocity_limits: Largest rate [1] in rad/s, infinite where unlimited. Kept, not enforced.
        effort_limits: Largest torque [1] in N m, infinite where unlimited. Kept, not enforced.
        active: Whether the joint is driven (static). Kept, no query reads it.
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    def periodic(self) -> tuple[bool, ...]:
        return (True,)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (RotationStep(angle=coordinate(inputs, 0), **self._parts(inputs)),)


@joint_family("continuous")
class Continuous(AxisJoint):
    """A rotation about an axis without end: as ``Revolute``, but q and q + 2 pi are the same place.

    ``q`` stays a plain angle that may count turns; ``tree.difference`` takes the shorter way round, in [-pi, pi], unless a joint follows
    (``Mimic``) that would not be where it was after a whole turn.

    Attributes:
        axis: Unit axis [3] in the axes of the placement.
        placement: Pose of the joint in the parent at q = 0.
        limits: Infinite [2].
        velocity_limits: Largest rate [1] in rad/s.
        effort_limits: Largest torque [1] in N m.
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    is_manifold: ClassVar[bool] = True

    def __init__(
        self,
        axis: Any = (0.0, 0.0, 1.0),
        placement: Transform | None = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
    ):
        super().__init__(axis, placement, None, velocity_limits, effort_limits, active, rest)

    def arguments(self) -> dict[str, Any]:
        return {name: value for name, value in super().arguments().items() if name != "limits"}

    def periodic(self) -> tuple[bool, ...]:
        return (True,)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (RotationStep(angle=coordinate(inputs, 0), **self._parts(inputs)),)

    def difference(self, q0: jax.Array, q1: jax.Array) -> jax.Array:
        """Return q1 - q0 less whole turns."""
        step = q1 - q0
        return step - jax.lax.stop_gradient(TURN * jnp.round(step / TURN))


@joint_family("prismatic")
class Prismatic(AxisJoint):
    """A translation along an axis by q metres, after a fixed placement: ``parent_T_child = placement @ Trans(axis q)``.

    Attributes:
        axis: Unit axis [3] in the axes of the placement; normalised when the edge is made, zero is refused.
        placement: Pose of the joint in the parent at q = 0.
        limits: (lower, upper) in m [2]; infinite where unlimited. Kept for checks, never enforced by a query.
        velocity_limits: Largest rate [1] in m/s, infinite where unlimited. Kept, not enforced.
        effort_limits: Largest force [1] in N, infinite where unlimited. Kept, not enforced.
        active: Whether the joint is driven (static). Kept, no query reads it.
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    def angles(self) -> tuple[bool, ...]:
        return (False,)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (TranslationStep(length=coordinate(inputs, 0), **self._parts(inputs)),)


@joint_family("screw")
class Screw(AxisJoint):
    """A screw: a rotation by q radians about an axis that also shifts along it by ``pitch`` metres a turn.

    ``parent_T_child = placement @ Trans(axis pitch q / (2 pi)) @ Rot(axis, q)``. The pitch is per turn, as in Drake and
    SDFormat; where a library counts it per radian (Pinocchio's helical joint, h), ``pitch = 2 pi h``. Positive is right-handed.

    Attributes:
        axis: Unit axis [3] in the axes of the placement.
        pitch: Metres for each turn [1].
        placement: Pose of the joint in the parent at q = 0.
        limits: (lower, upper) in rad [2].
        velocity_limits: Largest rate [1] in rad/s.
        effort_limits: Largest torque [1] in N m.
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    axis: jax.Array  # said again so that it stays the first leaf
    pitch: jax.Array

    def __init__(
        self,
        axis: Any = (0.0, 0.0, 1.0),
        pitch: Any = 0.0,
        placement: Transform | None = None,
        limits: Any = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
    ):
        super().__init__(axis, placement, limits, velocity_limits, effort_limits, active, rest)
        object.__setattr__(self, "pitch", one_number(pitch, "the pitch of a screw"))

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        parts = self._parts(inputs)
        per_radian = mul(inputs.components(self.pitch)[0], 1.0 / TURN)
        along = TranslationStep(length=coordinate(inputs, 0, per_radian), **parts)
        return along, RotationStep(axis=parts["axis"], angle=coordinate(inputs, 0))


@joint_family("cylindrical")
class Cylindrical(AxisJoint):
    """A rotation about an axis by q0 radians and a translation along it by q1 metres, independent of each other.

    ``parent_T_child = placement @ Rot(axis, q0) @ Trans(axis q1)``; both commute.

    Attributes:
        axis: Unit axis [3] in the axes of the placement.
        placement: Pose of the joint in the parent at q = 0.
        limits: Lower bounds of angle (rad) and length (m), then upper ones [4].
        velocity_limits: Largest rates [2] in rad/s and m/s.
        effort_limits: Largest torque and force [2].
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    nq: ClassVar[int] = 2
    nv: ClassVar[int] = 2

    def angles(self) -> tuple[bool, ...]:
        return (True, False)

    def periodic(self) -> tuple[bool, ...]:
        return self.angles()

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        parts = self._parts(inputs)
        return RotationStep(angle=coordinate(inputs, 0), **parts), TranslationStep(axis=parts["axis"], length=coordinate(inputs, 1))
