"""Turning at constant rates: uniform rotation about an axis, and precession of a tilted axis."""

from typing import Any, ClassVar, Self

import jax

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.edges.instants import since_epoch, two_part_epoch
from jaxframes.edges.joint import one_number, unit_axis
from jaxframes.numerics.components import V3
from jaxframes.numerics.steps import Coordinate, RotationStep, Step
from jaxframes.numerics.two_part import recast_pairs
from jaxframes.staging.arrays import unit
from jaxframes.time.epoch import Epoch


class TurningSince(Edge):
    """What edges that turn at constant rates since an epoch share.

    Attributes:
        epoch: ``[2]``: the instant of their angles in two parts, seconds past J2000 TDB.
    """

    needs_time: ClassVar[bool] = True
    epoch: jax.Array

    def astype(self, dtype: Any) -> Self:
        plain = super().astype(dtype)
        return plain.replace(epoch=recast_pairs(self.epoch, dtype))

    def arguments(self) -> dict[str, Any]:
        return {**super().arguments(), "epoch": Epoch(self.epoch[..., 0], self.epoch[..., 1])}


@family(name="uniform_rotation")
class UniformRotation(TurningSince):
    """A rotation about an axis at a constant rate: a planet's day, a wheel, a spinning craft.

    ``parent_T_child = Rot(axis, angle + rate t)``, t in seconds since the epoch.

    Attributes:
        axis: Unit axis [3] in the parent.
        rate: ``[1]``, rad/s.
        angle: ``[1]``: angle at the epoch, rad.
        epoch: ``[2]``: that instant in two parts, seconds past J2000 TDB.

    Args:
        axis: Direction [..., 3]; normalised, zero is refused.
        rate: rad/s, [...] or [..., 1].
        angle: rad, likewise.
        epoch: ``Epoch`` or seconds past J2000 TDB. Default: J2000. One near the times asked for keeps the angle's digits.

    Raises:
        EdgeError: The axis is zero, or a number is not finite.

    Example:
        >>> import jaxframes as jf
        >>> earth = jf.edges.UniformRotation((0, 0, 1), rate=7.292115e-5)
    """

    axis: jax.Array
    rate: jax.Array
    angle: jax.Array
    epoch: jax.Array

    def __init__(self, axis: Any = (0.0, 0.0, 1.0), rate: Any = 0.0, angle: Any = 0.0, epoch: Any = 0.0):
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        put("axis", unit_axis(axis))
        put("rate", one_number(rate, "the rate of a rotation"))
        put("angle", one_number(angle, "the angle of a rotation"))
        put("epoch", two_part_epoch(epoch, "UniformRotation"))

    def normalized(self) -> Self:
        return super().normalized().replace(axis=unit(self.axis))

    def directions(self) -> dict[str, Any]:
        return {"axis": self.axis}

    def describe(self) -> str:
        return "uniform rotation"

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return (
            RotationStep(V3(*inputs.components(self.axis)), _turn(since_epoch(self, inputs, self.epoch), inputs, self.angle, self.rate)),
        )


@family(name="precession")
class Precession(TurningSince):
    """A tilted axis that goes round at a constant rate, with a spin about it: a top, a planet's pole, an orbit's plane whose node drifts.

    ``parent_T_child = Rot(z, node + node_rate t) Rot(x, tilt) Rot(z, angle + rate t)``: Euler angles of which two are linear in time.
    An orbit with secular drifts of node and periapsis is ``Kepler`` in its own plane, hung on such a frame.

    Attributes:
        node: ``[1]``: angle of the node at the epoch, rad.
        node_rate: ``[1]``: rate of precession, rad/s.
        tilt: ``[1]``: angle between the parent's z and the child's, rad.
        angle: ``[1]``: angle of the spin at the epoch, rad.
        rate: ``[1]``: rate of the spin, rad/s.
        epoch: ``[2]``: the instant of the angles in two parts, seconds past J2000 TDB.

    Args:
        node_rate: rad/s, [...] or [..., 1]; so all other numbers.
        tilt: rad.
        node: rad.
        rate: rad/s.
        angle: rad.
        epoch: ``Epoch`` or seconds past J2000 TDB. Default: J2000.

    Raises:
        EdgeError: A number is not finite.
    """

    node: jax.Array
    node_rate: jax.Array
    tilt: jax.Array
    angle: jax.Array
    rate: jax.Array
    epoch: jax.Array

    def __init__(self, node_rate: Any, tilt: Any, *, node: Any = 0.0, rate: Any = 0.0, angle: Any = 0.0, epoch: Any = 0.0):
        for name, value in (("node", node), ("node_rate", node_rate), ("tilt", tilt), ("angle", angle), ("rate", rate)):
            object.__setattr__(self, name, one_number(value, f"the {name} of a precession"))
        object.__setattr__(self, "epoch", two_part_epoch(epoch, "Precession"))

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        seconds, z = since_epoch(self, inputs, self.epoch), V3(0.0, 0.0, 1.0)
        first, last = (_turn(seconds, inputs, *pair) for pair in ((self.node, self.node_rate), (self.angle, self.rate)))
        (tilt,) = inputs.components(self.tilt)
        return RotationStep(z, first), RotationStep(V3(1.0, 0.0, 0.0), Coordinate(tilt)), RotationStep(z, last)


def _turn(seconds: jax.Array, inputs: Inputs, angle: jax.Array, rate: jax.Array) -> Coordinate:
    """Return an angle that grows at a constant rate."""
    (start,), (slope,) = inputs.components(angle), inputs.components(rate)
    return Coordinate(start + slope * seconds, slope)
