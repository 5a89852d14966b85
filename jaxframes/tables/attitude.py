"""Attitude tables: knots of C-kernels and fitted Cayley series, evaluated under jit with angular velocity and acceleration."""

import functools
from collections.abc import Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Inputs
from jaxframes.edges.family import family
from jaxframes.numerics.components import V3, Quat, quat_mul, select
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.staging.columns import assemble, take_apart
from jaxframes.staging.sharding import rows_at
from jaxframes.staging.stages import stage
from jaxframes.tables import evaluate, formulas
from jaxframes.tables.base import Table, checked_order, two_parts
from jaxframes.tables.evaluate import DEVICE, Run
from jaxframes.tables.info import Info
from jaxframes.tables.records import RecordTable
from jaxframes.tables.report import report

PAYLOAD = 14
"""Numbers of a knot interval: quaternion at its start, axis, half angle, and two vectors that the mode gives a meaning."""
MODES = ("smooth", "spice")


class Attitude(Table):
    """What tables of attitudes share. In a gap everything is NaN, gradients included, and the coverage code is +1: after the data."""

    stackable: ClassVar[bool] = False

    @property
    def other_bytes(self) -> int:
        """Size of the arrays beside the record tables."""
        return 0

    @property
    def evaluator(self) -> tuple[Any, str, tuple[jax.Array, ...]]:
        """The function that evaluates the table, the mode, and the arrays beside the record tables."""
        raise NotImplementedError

    def motion(self, hi: Any, lo: Any, order: int) -> jax.Array:
        """Return quaternion, angular velocity and angular acceleration as one array [..., 4, 7 or 10]."""
        evaluator, mode, rest = self.evaluator
        return evaluator(mode, self.run, rest, hi, lo, order)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return one motion: the rotation, without translation."""
        parts = take_apart(self.motion(*inputs.epoch_for(self), order))
        rates = dict(zip(("angular", "angular2"), (V3(*parts[i : i + 3]) for i in range(4, len(parts), 3)), strict=False))
        return (Rigid(rotation=Quat(*parts[:4]), **rates),)

    def coverage_code(self, time: Any) -> jax.Array:
        """Return -1 before the coverage, 0 inside, +1 after it and in gaps: int32 [...]."""
        hi, lo = two_parts(time)
        code = evaluate.coverage_code(self.run, hi, lo)
        records = self.record_tables[0]
        index = records.serving(*evaluate.since_reference(self.run, jnp.asarray(hi), jnp.asarray(lo)))
        lengths = rows_at(records.rows, index)[..., -1]
        return select((code == 0) & jnp.isnan(lengths), np.int32(1), code)

    def describe(self) -> str:
        """Return the kind of the edge and its frames."""
        return f"table: {self.info.of} from {self.info.relative_to}"

    def report(self) -> str:
        """Return what the table is made of, in lines."""
        return report(self.info, self.record_tables, False, self.other_bytes)

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return the quaternion wxyz [..., 4], angular velocity and angular acceleration [..., 3] in the axes of ``relative_to``.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2; the first ``order + 1`` of the three are returned.
        """
        evaluator, mode, rest = self.evaluator
        return _arrays(checked_order(order), evaluator, mode, self.run, rest, *two_parts(time))


def _knots(mode: str, run: Run, rest: tuple[jax.Array, ...], hi: Any, lo: Any, order: int) -> jax.Array:
    """Return the motion between knots; ``AttitudeTable`` says how."""

    def work(run: Run, hi: jax.Array, lo: jax.Array) -> jax.Array:
        run = run.as_read(hi.ndim)
        (records,) = run.record_tables
        dt_hi, dt_lo = evaluate.since_reference(run, hi, lo)
        row = jnp.moveaxis(rows_at(records.rows, records.serving(dt_hi, dt_lo)), -1, 0)
        u = (((dt_hi - row[-3]) + (dt_lo - row[-2])) + _outside(run, dt_hi, dt_lo)) / row[-1]
        return _as_array(formulas.knot_motion(row, u, mode, DEVICE), order)

    return stage(work)(run, *evaluate.recast(hi, lo, run.record_tables[0].rows.dtype))


def _series(mode: str, run: Run, rest: tuple[jax.Array, ...], hi: Any, lo: Any, order: int) -> jax.Array:
    """Return the motion by Cayley series; ``CayleyTable`` says how."""

    def work(run: Run, spins: jax.Array, hi: jax.Array, lo: jax.Array, values: Sequence[jax.Array]) -> jax.Array:
        run = run.as_read(hi.ndim)
        (records,) = run.record_tables
        dt_hi, dt_lo = evaluate.since_reference(run, hi, lo)
        index = records.serving(dt_hi, dt_lo)
        spin = jnp.moveaxis(rows_at(spins, index), -1, 0)
        times = jnp.moveaxis(rows_at(records.rows[..., -3:], index), -1, 0)
        tau = (dt_hi - times[0]) + (dt_lo - times[1])
        reference = quat_mul(formulas.rotation_about(V3(*spin[4:7]), spin[7] * tau, DEVICE), Quat(*spin[:4]))
        zero = V3(0.0, 0.0, 0.0)
        g, g1, g2 = (*(V3(*values[i : i + 3]) for i in range(0, len(values), 3)), zero, zero)[:3]
        return _as_array(formulas.cayley(g, g1, g2, reference, V3(*spin[4:7]) * (spin[7] * 2), DEVICE), order)

    hi, lo = evaluate.recast(hi, lo, run.record_tables[0].rows.dtype)
    return stage(work)(run, *rest, hi, lo, evaluate.evaluate(run, hi, lo, order))


def _as_array(motion: Sequence[Any], order: int) -> jax.Array:
    return assemble(tuple(c for group in motion[: order + 1] for c in group))


@functools.partial(jax.jit, static_argnums=(0, 1, 2))
def _arrays(order: int, evaluator: Any, mode: str, run: Run, rest: tuple[jax.Array, ...], hi: Any, lo: Any) -> tuple[jax.Array, ...]:
    whole = evaluator(mode, run, rest, hi, lo, order)
    return tuple(whole[..., a:b] for a, b in ((0, 4), (4, 7), (7, 10))[: order + 1])


@family(static=("mode", "info"))
class AttitudeTable(Attitude):
    """The attitude of a C-kernel between its knots, made by ``Kernels.orientation`` of a CK frame.

    ``mode="smooth"``: q(u) = Cayley(g(u)) slerp(u), g(u) = g0 u (1-u)^2 - g1 u^2 (1-u), with g0, g1 so chosen that attitude and angular
    velocity are the kernel's at every knot. Attitude, rate and acceleration belong together, and the rate is continuous.
    ``mode="spice"``: what SPICE computes to the last digits: slerp between the knots, and the kernel's angular velocities interpolated
    linearly; these are not the derivative of that attitude. The acceleration is theirs.

    Attributes:
        record_tables: One, whose rows hold an interval each: quaternion at its start, axis, half angle, two vectors (g0, g1 or the
            rates), then its start in two parts and its length. A row whose length is NaN is a gap.
        mode: ``"smooth"`` or ``"spice"``.
    """

    record_tables: tuple[RecordTable, ...]
    reference: jax.Array
    span: jax.Array
    mode: str
    info: Info

    @property
    def evaluator(self) -> tuple[Any, str, tuple[jax.Array, ...]]:
        """The function that evaluates the table, the mode, and the arrays beside the record tables."""
        return _knots, self.mode, ()


@family(static=("info",))
class CayleyTable(Attitude):
    """An attitude fitted to what CSPICE computes: the Cayley vector from a uniformly spinning reference, as Chebyshev series.

    q = Cayley(g) exp(spin tau / 2) q_mid, tau from the middle of a record. No frame has a singularity here, and spinners keep low degrees.

    Attributes:
        record_tables: One Chebyshev run of g.
        spins: ``[n, 8]``: for each record q_mid, the axis of the reference spin and half its rate, rad/s.
    """

    record_tables: tuple[RecordTable, ...]
    reference: jax.Array
    span: jax.Array
    spins: jax.Array
    info: Info
    by_record: ClassVar[tuple[str, ...]] = ("spins",)

    @property
    def other_bytes(self) -> int:
        """Size of the arrays beside the record tables."""
        return self.spins.nbytes

    @property
    def evaluator(self) -> tuple[Any, str, tuple[jax.Array, ...]]:
        """The function that evaluates the table, the mode, and the arrays beside the record tables."""
        return _series, "", (self.spins,)


def _outside(run: Run, dt_hi: jax.Array, dt_lo: jax.Array) -> jax.Array:
    since, until = evaluate.margins(run, dt_hi, dt_lo)
    return select((since >= 0) & (until >= 0), np.zeros((), dt_hi.dtype), np.array(np.nan, dt_hi.dtype))
