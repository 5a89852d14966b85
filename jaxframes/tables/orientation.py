"""Orientation tables: a body-fixed frame relative to an inertial one, by three Euler angles over time."""

import functools
from typing import Any

import jax

from jaxframes.edges.base import Inputs
from jaxframes.edges.family import family
from jaxframes.numerics.components import Quat
from jaxframes.numerics.packed import Kind, Packed
from jaxframes.numerics.path_motion import extend, steps_at_hand
from jaxframes.numerics.steps import Step
from jaxframes.staging.columns import parameters
from jaxframes.tables import evaluate
from jaxframes.tables.base import Table, checked_order, triples, two_parts
from jaxframes.tables.evaluate import Run
from jaxframes.tables.formulas import euler_steps
from jaxframes.tables.info import Info
from jaxframes.tables.records import RecordTable


@family(static=("info",))
class OrientationTable(Table):
    """How a body-fixed frame is turned relative to an inertial one: a pure rotation by three Euler angles in time.

    The pose ``o_T_p`` maps coordinates of the body-fixed frame p to the inertial frame o: R = placement Rz(phi) Rx(theta) Rz(psi).
    This is the transpose of SPICE's ``eul2m(psi, theta, phi, 3, 1, 3)``, turned from the segment's own base frame.

    Attributes:
        placement: ``[4]``: quaternion wxyz of the segment's base frame in the frame asked for.
    """

    record_tables: tuple[RecordTable, ...]
    reference: jax.Array
    span: jax.Array
    placement: jax.Array
    info: Info

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return three rotations, by phi about z, theta about x and psi about z."""
        placement = Quat(*parameters(self.placement, inputs.batch_rank))
        return euler_steps(placement, self.values(inputs, order))

    def describe(self) -> str:
        """Return the kind of the edge and its frames."""
        return f"table: {self.info.of} from {self.info.relative_to}"

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return the quaternion wxyz [..., 4], angular velocity and angular acceleration [..., 3] in the inertial frame's axes.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2; the first ``order + 1`` of the three are returned.
        """
        return _orientation(checked_order(order), self.run, self.placement, *two_parts(time))


@functools.partial(jax.jit, static_argnums=0)
def _orientation(order: int, run: Run, placement: jax.Array, hi: Any, lo: Any) -> tuple[jax.Array, ...]:
    values = evaluate.evaluate(run, hi, lo, order)
    steps = euler_steps(Quat(*parameters(placement)), triples(values))
    return attitude_of(extend((), steps_at_hand(steps), Kind(values[0].shape, values[0].dtype, order)))


def attitude_of(motion: Packed) -> tuple[jax.Array, ...]:
    """Return the quaternion [..., 4], angular velocity and angular acceleration [..., 3] of a motion."""
    pose, *sixes = motion
    return pose[..., :4], *(six[..., :3] for six in sixes)
