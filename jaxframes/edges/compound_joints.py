"""Joints of several axes one after another: universal, spherical, their prismatic kin, and planar."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Inputs
from jaxframes.edges.joint import AxisJoint, Joint, coordinate, joint_family, unit_axis
from jaxframes.errors import EdgeError
from jaxframes.numerics.components import V3
from jaxframes.numerics.steps import RotationStep, Step, TranslationStep
from jaxframes.spatial import Transform
from jaxframes.staging.arrays import unit

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Compound(Joint):
    """Rotations about and translations along fixed axes, each in the axes that the ones before it have turned.

    Attributes:
        turning: For each coordinate, whether it turns (else slides).
        standard: The axes where the user gives none: those of RobWork's joints.
        axes: Unit axis [3] of each coordinate.
    """

    turning: ClassVar[tuple[bool, ...]] = ()
    standard: ClassVar[tuple[tuple[float, float, float], ...]] = ()
    axes: tuple[jax.Array, ...]

    def __init__(
        self,
        placement: Transform | None = None,
        axes: Sequence[Any] | None = None,
        limits: Any = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
    ):
        given = self.standard if axes is None else tuple(axes)
        if len(given) != self.nq:
            raise EdgeError(f"{type(self).__name__}(axes=...) takes {self.nq} axes, found {len(given)}: {axes!r}")
        object.__setattr__(self, "axes", tuple(unit_axis(axis) for axis in given))
        super().__init__(placement, limits, velocity_limits, effort_limits, active, rest)

    def normalized(self) -> Self:
        return super().normalized().replace(axes=tuple(map(unit, self.axes)))

    def directions(self) -> dict[str, Any]:
        return {f"axes.{i}": axis for i, axis in enumerate(self.axes)}

    def angles(self) -> tuple[bool, ...]:
        return self.turning

    def periodic(self) -> tuple[bool, ...]:
        return self.turning

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        found: list[Step] = []
        placed = self._placed(inputs)
        for i, (turns, axis) in enumerate(zip(self.turning, self.axes, strict=True)):
            direction, value = V3(*inputs.components(axis)), coordinate(inputs, i)
            found.append(RotationStep(direction, value, **placed) if turns else TranslationStep(direction, value, **placed))
            placed = {}
        return tuple(found)


@joint_family("universal")
class Universal(Compound):
    """Two turns: ``parent_T_child = placement @ Rx(q0) @ Ry(q1)``, as RobWork's UniversalJoint, or about two other axes.

    Attributes:
        axes: Unit axes [3] of the two turns. Default: x and y.
        placement: Pose of the joint in the parent at q = 0.
        limits: Two lower, then two upper bounds [4] in rad.
        velocity_limits: Largest rates [2].
        effort_limits: Largest torques [2].
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    nq: ClassVar[int] = 2
    nv: ClassVar[int] = 2
    turning = (True, True)
    standard = (X, Y)


@joint_family("spherical")
class Spherical(Compound):
    """Three turns: ``parent_T_child = placement @ Rx(q0) @ Ry(q1) @ Rz(q2)``, as RobWork's SphericalJoint.

    Three angles have a singular place (q1 = pi/2 about the standard axes), where two of them turn about the same line: the pose
    and its derivatives are right there, but some angular velocities need rates without bound. ``Ball`` has none.

    Attributes:
        axes: Unit axes [3] of the three turns. Default: x, y and z.
        placement: Pose of the joint in the parent at q = 0.
        limits: Three lower, then three upper bounds [6] in rad.
        velocity_limits: Largest rates [3].
        effort_limits: Largest torques [3].
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    nq: ClassVar[int] = 3
    nv: ClassVar[int] = 3
    turning = (True, True, True)
    standard = (X, Y, Z)


@joint_family("prismatic_spherical")
class PrismaticSpherical(Compound):
    """Three turns and a slide: ``placement @ Rx(q0) @ Ry(q1) @ Rz(q2) @ Tz(q3)``, as RobWork's PrismaticSphericalJoint.

    Attributes:
        axes: Unit axes [3] of the turns and the slide. Default: x, y, z and z.
        placement: Pose of the joint in the parent at q = 0.
        limits: Four lower, then four upper bounds [8] in rad and m.
        velocity_limits: Largest rates [4].
        effort_limits: Largest torques and force [4].
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    nq: ClassVar[int] = 4
    nv: ClassVar[int] = 4
    turning = (True, True, True, False)
    standard = (X, Y, Z, Z)


@joint_family("prismatic_universal")
class PrismaticUniversal(Compound):
    """Two turns and a slide: ``placement @ Rx(q0) @ Ry(q1) @ Tz(q2)``, as RobWork's PrismaticUniversalJoint.

    Attributes:
        axes: Unit axes [3] of the turns and the slide. Default: x, y and z.
        placement: Pose of the joint in the parent at q = 0.
        limits: Three lower, then three upper bounds [6] in rad and m.
        velocity_limits: Largest rates [3].
        effort_limits: Largest torques and force [3].
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    nq: ClassVar[int] = 3
    nv: ClassVar[int] = 3
    turning = (True, True, False)
    standard = (X, Y, Z)


@joint_family("planar")
class Planar(AxisJoint):
    """Motion in the plane across an axis n: ``placement @ Trans(q0 u + q1 v) @ Rot(n, q2)``, (m, m, rad).

    The rates are the derivatives of these coordinates, so the velocity in the plane is given along the axes u and v of the
    placement, which do not turn with the child (Pinocchio's planar joint gives it along the child's axes). u and v complete n to a
    right-handed frame: for n = z they are x and y; for n with n_z >= 0 they are x and y turned by the shortest rotation from z
    to n; elsewhere they follow Duff et al., "Building an orthonormal basis, revisited", JCGT 6 (2017).

    Attributes:
        axis: Unit normal n of the plane [3] in the axes of the placement.
        placement: Pose of the joint in the parent at q = 0.
        limits: Three lower, then three upper bounds [6] in m, m and rad.
        velocity_limits: Largest rates [3].
        effort_limits: Largest forces and torque [3].
        active: Whether the joint is driven (static).
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    nq: ClassVar[int] = 3
    nv: ClassVar[int] = 3

    def angles(self) -> tuple[bool, ...]:
        return (False, False, True)

    def periodic(self) -> tuple[bool, ...]:
        return self.angles()

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        n = V3(*inputs.components(self.axis))
        u, v = plane_axes(n)
        first = TranslationStep(u, coordinate(inputs, 0), **self._placed(inputs))
        return first, TranslationStep(v, coordinate(inputs, 1)), RotationStep(n, coordinate(inputs, 2))


def plane_axes(n: V3) -> tuple[V3, V3]:
    """Return two unit vectors that complete a unit normal to a right-handed frame (u, v, n)."""
    x, y, z = n
    if isinstance(x, float) and isinstance(y, float) and isinstance(z, float):
        s = -1.0 if z < 0 else 1.0
        a = -1.0 / (s + z)
        u, v = (1.0 + s * x * x * a, s * x * y * a, -s * x), (x * y * a, s + y * y * a, -y)
        length = math.hypot(*u), math.hypot(*v)  # a rounding error at most, but it would scale every length
        return V3(*(c / length[0] for c in u)), V3(*(c / length[1] for c in v))
    s: Any = (
        np.where(z < 0, -1.0, 1.0) if isinstance(z, np.ndarray) else jnp.where(jnp.asarray(z) < 0, -1.0, 1.0).astype(jnp.asarray(z).dtype)
    )
    a = -1.0 / (s + z)
    return V3(1.0 + s * x * x * a, s * x * y * a, -s * x), V3(x * y * a, s + y * y * a, -y)
