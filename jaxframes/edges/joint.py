"""What all joints share: a placement before the motion, limits, how a user's axes and limits are checked; and virtual joints."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import jax
import numpy as np

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import Family, family
from jaxframes.errors import EdgeError
from jaxframes.numerics.components import V3, Component, mul
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Coordinate, Step
from jaxframes.spatial import Transform
from jaxframes.staging.arrays import as_float, is_concrete, unit

KEPT = ("active", "limits", "velocity_limits", "effort_limits", "rest")
"""Static fields of joints that no query reads."""


def joint_family(name: str, static: tuple[str, ...] = ()) -> Callable[[Family], Family]:
    """Return the decorator of a joint family: its name in files, and its static fields beside those that all joints have."""
    return family(static=(*KEPT, *static), name=name)


def unit_axis(axis: Any) -> jax.Array:
    """Return an axis [..., 3] at unit length.

    Raises:
        EdgeError: The axis is not three finite numbers, or is zero.
    """
    if isinstance(axis, jax.Array) and not is_concrete(axis):
        return axis
    try:
        numbers = np.asarray(axis, np.float64)
    except (TypeError, ValueError):
        raise EdgeError(f"a joint axis needs three numbers, found {axis!r}") from None
    if numbers.shape[-1:] != (3,):
        raise EdgeError(f"a joint axis needs three numbers, found shape {numbers.shape}: {axis!r}")
    length = np.linalg.norm(numbers, axis=-1, keepdims=True)
    if not np.all(np.isfinite(numbers)) or np.any(length < 1e-12):
        raise EdgeError(f"a joint axis must be finite and not zero, found {numbers.tolist()}; give a direction such as (0, 0, 1)")
    return as_float(np.where(np.abs(length - 1.0) < 4e-16, numbers, numbers / length))


def as_bounds(limits: Any, count: int = 1) -> tuple[float, ...]:
    """Return limits (lower, upper), each a number or one for each coordinate, as 2 count numbers; None means unlimited.

    Raises:
        EdgeError: The limits are reversed, not two numbers for each coordinate, or traced.
    """
    _known(limits, "joint limits")
    try:
        if limits is None:
            bounds = np.repeat((-np.inf, np.inf), count)
        elif count == 1:
            bounds = np.asarray(limits, np.float64)
        else:
            bounds = np.concatenate([np.broadcast_to(np.asarray(side, np.float64), (count,)) for side in limits])
    except (TypeError, ValueError):
        bounds = np.empty(0)
    if bounds.shape != (2 * count,) or np.any(np.isnan(bounds)):
        raise EdgeError(f"joint limits are (lower, upper){f' for {count} coordinates' if count > 1 else ''}, found {limits!r}")
    low, high = bounds[:count], bounds[count:]
    if np.any(low > high):
        raise EdgeError(f"joint limits are reversed: lower {low} is above upper {high}; swap them")
    return tuple(bounds.tolist())


def as_magnitude_limits(limits: Any, count: int, what: str) -> tuple[float, ...]:
    """Return the largest magnitudes allowed, one for each rate; None means unlimited (EdgeError for negative or wrong ones)."""
    _known(limits, f"{what} limits")
    try:
        numbers = np.broadcast_to(np.asarray(np.inf if limits is None else limits, np.float64), (count,))
    except (TypeError, ValueError):
        raise EdgeError(f"{what} limits are one number, or one for each of {count} rates; found {limits!r}") from None
    if not np.all(numbers >= 0):
        raise EdgeError(f"{what} limits are magnitudes and cannot be negative, found {limits!r}")
    return tuple(numbers.tolist())


def as_rest(rest: Any, count: int, quaternion: bool) -> tuple[float, ...] | None:
    """Return coordinates at rest as so many numbers, a quaternion before them at unit length; None for the usual ones.

    Args:
        rest: One number, or ``count`` of them, or None.
        count: How many coordinates the joint has.
        quaternion: Whether the first four are a quaternion wxyz.

    Raises:
        EdgeError: The numbers are not as many or not finite, the quaternion is zero, or they are traced.
    """
    if rest is None:
        return None
    _known(rest, "coordinates at rest")
    try:
        numbers = np.asarray(rest, np.float64).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (count,) or not np.all(np.isfinite(numbers)):
        raise EdgeError(f"rest takes {count} finite number{'s' if count > 1 else ''}, found {rest!r}")
    if quaternion:
        if np.linalg.norm(numbers[:4]) == 0:
            raise EdgeError(f"rest begins with a quaternion (w, x, y, z), and that of {rest!r} is zero; the identity is (1, 0, 0, 0)")
        numbers = np.concatenate([unit(numbers[:4]), numbers[4:]])
    return tuple(numbers.tolist())


def _known(values: Any, what: str) -> None:
    """Refuse traced numbers where a static field needs known ones."""
    if not all(map(is_concrete, jax.tree.leaves(values))):
        raise EdgeError(f"{what} are static, so they cannot be traced; give them as numbers, outside of jit, grad and vmap")


def one_number(value: Any, what: str) -> jax.Array:
    """Return one number as a parameter [1], or batches of one [..., 1] as they are (EdgeError if it is not finite)."""
    if isinstance(value, jax.Array) and not is_concrete(value):
        return value[None] if value.ndim == 0 else value
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise EdgeError(f"{what} is one number, found {value!r}") from None
    numbers = numbers[None] if numbers.ndim == 0 else numbers
    if numbers.shape[-1:] != (1,) or not np.all(np.isfinite(numbers)):
        raise EdgeError(f"{what} is one finite number, found {value!r}")
    return as_float(numbers)


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Joint(Edge):
    """What all joints share: a placement before the motion, limits, and whether the joint is driven.

    Attributes:
        placement: Pose of the joint in the parent where all its coordinates are neutral.
        limits: Lower bounds of all coordinates, then upper bounds, 2 nq numbers: rad or m, infinite where unlimited. Kept for
            ``tree.clamp``, ``tree.random`` and ``tree.check``; no query enforces them. Static, as all limits are: no parameters that an
            optimiser would see.
        velocity_limits: Largest magnitude of each rate, nv numbers, infinite where unlimited. Kept, not enforced.
        effort_limits: Largest torque or force of each rate, nv numbers (N m or N). Kept, not enforced.
        active: Whether the joint is driven (static). Kept, no query reads it.
        rest: The nq coordinates that ``tree.state()`` and ``tree.neutral()`` start with (static); None for zeros and identity quaternions.
    """

    placement: Transform
    limits: tuple[float, ...]
    velocity_limits: tuple[float, ...]
    effort_limits: tuple[float, ...]
    active: bool
    rest: tuple[float, ...] | None

    def __init__(self, placement: Transform | None, limits: Any, velocity_limits: Any, effort_limits: Any, active: bool, rest: Any):
        if placement is not None and not isinstance(placement, Transform):
            raise EdgeError(f"placement must be a jf.Transform, found {type(placement).__name__}: {placement!r}")
        if not isinstance(active, bool):
            raise EdgeError(f"{type(self).__name__}(active=...) takes True or False, not {active!r}")
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("placement", Transform.identity() if placement is None else placement)
        put("limits", as_bounds(limits, self.nq))
        put("velocity_limits", as_magnitude_limits(velocity_limits, self.nv, "velocity"))
        put("effort_limits", as_magnitude_limits(effort_limits, self.nv, "effort"))
        put("active", active)
        put("rest", as_rest(rest, self.nq, quaternion=self.nq != self.nv))

    def neutral(self) -> tuple[float, ...]:
        """Return the coordinates at rest."""
        return super().neutral() if self.rest is None else self.rest

    def limits_of(self) -> tuple[Any, Any] | None:
        """Return the lower and upper bounds [nq]."""
        return np.asarray(self.limits[: self.nq]), np.asarray(self.limits[self.nq :])

    def arguments(self) -> dict[str, Any]:
        """Return what the constructor takes; limits as (lower, upper), each a number or one for each coordinate; no rest that is none."""
        lower, upper = self.limits[: self.nq], self.limits[self.nq :]
        given = {name: value for name, value in super().arguments().items() if name != "rest" or value is not None}
        return {**given, "limits": self.limits if self.nq == 1 else (lower, upper)}

    def checked_fact(self, name: str, value: Any) -> Any:
        if name == "limits":
            return as_bounds(value, self.nq)
        if name in ("velocity_limits", "effort_limits"):
            return as_magnitude_limits(value, self.nv, name.removesuffix("_limits"))
        if name == "rest":
            return as_rest(value, self.nq, quaternion=self.nq != self.nv)
        return super().checked_fact(name, value)

    def preceded_by(self, change: Transform) -> Self:
        return self.replace(placement=change @ self.placement)

    def bare(self) -> Edge:
        return self.replace(**dict.fromkeys(KEPT))

    def _placed(self, inputs: Inputs) -> dict[str, Any]:
        rotation, translation = inputs.pose(self.placement)
        return {"rotation": rotation, "translation": translation}


def coordinate(inputs: Inputs, i: int, scale: Component = 1.0) -> Coordinate:
    """Return the i-th coordinate of an edge with its derivatives, times a scale."""
    return Coordinate(mul(inputs.q[i], scale), mul(inputs.qd[i], scale), mul(inputs.qdd[i], scale))


@dataclass(frozen=True, eq=False, repr=False, init=False)
class AxisJoint(Joint):
    """What joints with one axis share.

    Attributes:
        axis: Unit axis [3] in the axes of the placement.
    """

    nq: ClassVar[int] = 1
    nv: ClassVar[int] = 1
    axis: jax.Array

    def __init__(
        self,
        axis: Any = (0.0, 0.0, 1.0),
        placement: Transform | None = None,
        limits: Any = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
    ):
        object.__setattr__(self, "axis", unit_axis(axis))
        super().__init__(placement, limits, velocity_limits, effort_limits, active, rest)

    def normalized(self) -> Self:
        return super().normalized().replace(axis=unit(self.axis))

    def directions(self) -> dict[str, Any]:
        return {"axis": self.axis}

    def describe(self) -> str:
        """Return the kind and the axis."""
        name = type(self).__name__.lower()
        if not isinstance(self.axis, (jax.Array, np.ndarray)) or not is_concrete(self.axis) or np.ndim(self.axis) != 1:
            return name
        word = "along" if not any(self.angles()) else "about"
        return f"{name} {word}" + " ({:.3g}, {:.3g}, {:.3g})".format(*np.asarray(self.axis, float))

    def _parts(self, inputs: Inputs) -> dict[str, Any]:
        return {"axis": V3(*inputs.components(self.axis)), **self._placed(inputs)}


@joint_family("virtual", static=("count",))
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
        rest: Coordinates that ``tree.state()`` starts with (static). Default: zeros.
    """

    count: int

    def __init__(
        self,
        count: int = 1,
        placement: Transform | None = None,
        limits: Any = None,
        velocity_limits: Any = None,
        effort_limits: Any = None,
        active: bool = True,
        rest: Any = None,
    ):
        if not isinstance(count, int) or count < 1:
            raise EdgeError(f"Virtual(count=...) takes the number of coordinates to keep, 1 or more; found {count!r}")
        object.__setattr__(self, "count", count)
        super().__init__(placement, limits, velocity_limits, effort_limits, active, rest)

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
        return (Rigid(*inputs.pose(self.placement)),)

    def describe(self) -> str:
        return f"virtual, {self.count} numbers"
