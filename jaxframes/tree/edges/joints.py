"""Joints of one coordinate: an axis, a placement before it, and limits."""

from typing import Any, ClassVar

import jax
import numpy as np

from jaxframes.errors import EdgeError
from jaxframes.numerics.boundary import as_float, is_concrete, parameters
from jaxframes.numerics.components import V3
from jaxframes.numerics.steps import Coordinate, Slide, Step, Turn
from jaxframes.spatial import Transform
from jaxframes.tree.edges.base import Edge, Inputs, family
from jaxframes.tree.edges.rigid import placement_components


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
    return as_float(numbers / length)


def as_bounds(limits: Any) -> jax.Array:
    """Return limits (lower, upper) as [..., 2]; None means unlimited.

    Raises:
        EdgeError: The limits are reversed or not two numbers.
    """
    if isinstance(limits, jax.Array) and not is_concrete(limits):
        return limits
    bounds = np.asarray((-np.inf, np.inf) if limits is None else limits, np.float64)
    if bounds.shape[-1:] != (2,) or np.any(np.isnan(bounds)):
        raise EdgeError(f"joint limits are (lower, upper), found {limits!r}")
    if np.any(bounds[..., 0] > bounds[..., 1]):
        raise EdgeError(f"joint limits are reversed: lower {bounds[..., 0]} is above upper {bounds[..., 1]}; swap them")
    return as_float(bounds)


class AxisJoint(Edge):
    """What revolute and prismatic joints share: axis, placement, limits."""

    nq: ClassVar[int] = 1
    nv: ClassVar[int] = 1
    axis: jax.Array
    placement: Transform
    limits: jax.Array

    def __init__(self, axis: Any = (0.0, 0.0, 1.0), placement: Transform | None = None, limits: Any = None):
        object.__setattr__(self, "axis", unit_axis(axis))
        object.__setattr__(self, "placement", Transform.identity() if placement is None else placement)
        object.__setattr__(self, "limits", as_bounds(limits))

    def describe(self) -> str:
        """Return the kind and the axis."""
        if not isinstance(self.axis, (jax.Array, np.ndarray)) or not is_concrete(self.axis) or np.ndim(self.axis) != 1:
            return type(self).__name__.lower()
        word = "about" if isinstance(self, Revolute) else "along"
        return f"{type(self).__name__.lower()} {word}" + " ({:.3g}, {:.3g}, {:.3g})".format(*np.asarray(self.axis, float))

    def limits_of(self) -> tuple[Any, Any] | None:
        """Return the lower and upper bounds [..., 1]."""
        return self.limits[..., :1], self.limits[..., 1:]

    def _parts(self, inputs: Inputs) -> dict[str, Any]:
        rotation, translation = placement_components(self.placement, inputs.batch_rank)
        return {"axis": V3(*parameters(self.axis, inputs.batch_rank)), "rotation": rotation, "translation": translation}


@family()
class Revolute(AxisJoint):
    """A rotation about an axis by q radians, after a fixed placement: ``parent_T_child = placement @ Rot(axis, q)``.

    Attributes:
        axis: Unit axis [3] in the axes of the placement; normalised when the edge is made, zero is refused.
        placement: Pose of the joint in the parent at q = 0.
        limits: (lower, upper) in rad [2]; infinite where unlimited. Kept for checks, never enforced by a query.
    """

    axis: jax.Array
    placement: Transform
    limits: jax.Array

    __init__ = AxisJoint.__init__

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (Turn(angle=Coordinate(inputs.q[0], inputs.qd[0], inputs.qdd[0]), **self._parts(inputs)),)


@family()
class Prismatic(AxisJoint):
    """A translation along an axis by q metres, after a fixed placement: ``parent_T_child = placement @ Trans(axis q)``.

    Attributes:
        axis: Unit axis [3] in the axes of the placement; normalised when the edge is made, zero is refused.
        placement: Pose of the joint in the parent at q = 0.
        limits: (lower, upper) in m [2]; infinite where unlimited. Kept for checks, never enforced by a query.
    """

    axis: jax.Array
    placement: Transform
    limits: jax.Array

    __init__ = AxisJoint.__init__

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (Slide(length=Coordinate(inputs.q[0], inputs.qd[0], inputs.qdd[0]), **self._parts(inputs)),)
