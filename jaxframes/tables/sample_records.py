"""Trajectories as records: positions and attitudes between samples, evaluated under jit; one trajectory or thousands as one edge."""

from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.errors import EdgeError
from jaxframes.numerics.components import IDENTITY, V3, ZERO, Quat, dot, quat_conj, quat_mul, select
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.smooth import cos_sinc
from jaxframes.numerics.steps import Step
from jaxframes.numerics.two_part import recast_pairs
from jaxframes.staging.columns import assemble, take_apart
from jaxframes.staging.sharding import rows_at
from jaxframes.staging.stages import stage
from jaxframes.tables import evaluate
from jaxframes.tables.base import recast_records, triples, two_parts
from jaxframes.tables.evaluate import Run
from jaxframes.tables.pool import single
from jaxframes.tables.records import RecordTable

SLERP = 7
"""Numbers of a record of slerp: the quaternion at its start and the rotation vector to its end."""


@family(static=("outside", "count"), name="sampled_records")
class SampledRecords(Edge):
    """Trajectories between samples as records: what ``Sampled`` becomes where it is evaluated.

    Made by ``Sampled.records``, for a trajectory whose samples no longer change: nothing is worked out anew then.

    Attributes:
        position: Records of positions, None for an edge without translation.
        attitude: Records of quaternions, or of slerp; None for an edge without rotation.
        reference: ``[2]``: the epoch from which times count, in two parts, seconds past J2000 TDB.
        span: ``[4]``: start and stop, each in two parts, seconds past the reference.
        outside: What holds outside the span: ``"nan"``, ``"hold"`` or ``"extrapolate"`` (static).
        count: How many trajectories there are, one after the other in the arrays; None for one (static).
    """

    stackable: ClassVar[bool] = False
    needs_time: ClassVar[bool] = True
    position: RecordTable | None
    attitude: RecordTable | None
    reference: jax.Array
    span: jax.Array
    outside: str
    count: int | None

    def __init__(self, position: Any, attitude: Any, reference: Any, span: Any, outside: str, count: int | None = None):
        for name, value in (("position", position), ("attitude", attitude), ("reference", reference), ("span", span)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "outside", outside)
        object.__setattr__(self, "count", count)

    def describe(self) -> str:
        return "sampled" if self.count is None else f"{self.count} sampled trajectories"

    def astype(self, dtype: Any) -> Self:
        plain, parts = super().astype(dtype), {}
        for name in ("position", "attitude"):
            old, new = getattr(self, name), getattr(plain, name)
            parts[name] = None if old is None else recast_records(old, new, dtype)
        return plain.replace(reference=recast_pairs(self.reference, dtype), span=recast_pairs(self.span, dtype), **parts)

    def arguments(self) -> dict[str, Any]:
        raise EdgeError("records of samples are not written to files: write the tree with the Sampled edge that they were made of")

    @property
    def known_part(self) -> RecordTable:
        """The records of positions, or of attitudes where there are no positions."""
        found = self.position if self.position is not None else self.attitude
        assert found is not None
        return found

    @property
    def has_gaps(self) -> bool:
        return bool(self.known_part.gaps.any())

    def checkable(self) -> Self:
        parts = {name: None if getattr(self, name) is None else getattr(self, name).unmarked() for name in ("position", "attitude")}
        return self.replace(**parts)

    def alone(self, row: int) -> Edge:
        parts = {name: None if getattr(self, name) is None else single(getattr(self, name), row) for name in ("position", "attitude")}
        return self.replace(**parts, reference=self.reference[row], span=self.span[row], count=None)

    def coverage_code(self, time: Any) -> jax.Array:
        """Return -1 before the span, 0 inside, +1 after it and in gaps: int32 [...]; whatever holds outside."""
        hi, lo = two_parts(time)
        run = self._run(self.known_part)
        code = evaluate.coverage_code(run, hi, lo)
        index = self.known_part.serving(*evaluate.since_reference(run, jnp.asarray(hi), jnp.asarray(lo)))
        lengths = rows_at(self.known_part.rows, index)[..., -1]
        return select((code == 0) & jnp.isnan(lengths), np.int32(1), code)

    def _run(self, records: RecordTable) -> Run:
        return Run((records,), self.reference, self.span, self.outside)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        hi, lo = inputs.epoch_for(self)
        shifts: tuple[V3, ...] = (ZERO,) * (order + 1)
        if self.position is not None:
            shifts = triples(evaluate.evaluate(self._run(self.position), hi, lo, order))
        rotation, spins = IDENTITY, (ZERO,) * order
        if self.attitude is not None:
            turned = take_apart(_attitude(self._run(self.attitude), hi, lo, order))
            rotation, spins = Quat(*turned[:4]), triples(turned[4:])
        rates = [half for pair in zip(spins, shifts[1:], strict=True) for half in pair]
        return (Rigid(rotation, shifts[0], *rates),)


def _attitude(run: Run, hi: Any, lo: Any, order: int) -> jax.Array:
    """Return quaternion, angular velocity and angular acceleration as one array [..., 4, 7 or 10]."""
    if run.record_tables[0].series == SLERP:
        return _slerp(run, hi, lo, order)
    return stage(lambda *values: _of_series(values, order))(*evaluate.evaluate(run, hi, lo, order))


def _of_series(values: tuple[jax.Array, ...], order: int) -> jax.Array:
    """Return the attitude q = p / |p| of four series p with its rates: those of Cayley's vector, for any length of p.

    w = 2 vec(p' p*) / |p|^2, alpha = 2 vec(p'' p*) / |p|^2 - 2 w (p . p') / |p|^2.
    """
    p, *rates = (Quat(*values[i : i + 4]) for i in range(0, 4 * (order + 1), 4))
    back, inverse = quat_conj(p), 1 / jnp.asarray(dot(p.vector, p.vector) + p.w * p.w)
    out = [c * lax.sqrt(inverse) for c in p]
    if rates:
        spin = quat_mul(rates[0], back).vector * (2 * inverse)
        out += list(spin)
        if order > 1:
            along = dot(p.vector, rates[0].vector) + p.w * rates[0].w
            out += list(quat_mul(rates[1], back).vector * (2 * inverse) - spin * (2 * along * inverse))
    return assemble(tuple(out))


def _slerp(run: Run, hi: Any, lo: Any, order: int) -> jax.Array:
    """Return the motion by slerp: a constant angular velocity between neighbouring samples."""

    def work(run: Run, hi: jax.Array, lo: jax.Array) -> jax.Array:
        run = run.as_read(hi.ndim)
        (records,) = run.record_tables
        past = evaluate.since_reference(run, hi, lo)
        since, until = evaluate.margins(run, *past)
        inside, zero = (since >= 0) & (until >= 0), np.zeros((), hi.dtype)
        row = jnp.moveaxis(rows_at(records.rows, records.serving(*past)), -1, 0)
        outside = select(inside, zero, np.array(np.nan, hi.dtype)) if run.outside == "nan" else zero
        half = row[-1]
        u = ((((past[0] - row[-3]) + (past[1] - row[-2])) + outside) / half + 1) * 0.5
        rate = V3(*row[4:7]) * (0.5 / half)
        if run.outside == "hold":
            u = select(inside, u, lax.stop_gradient(lax.clamp(zero, u, np.ones((), u.dtype))))
            rate = V3(*(select(inside, c, c * 0) for c in rate))
        turn = V3(*row[4:7]) * (u * 0.5)
        c, sinc = cos_sinc(jnp.asarray(dot(turn, turn)))
        turned = quat_mul(Quat(c, *(turn * sinc)), Quat(*row[:4]))
        return assemble((*turned, *((*rate,) if order > 0 else ()), *((u * 0,) * 3 if order > 1 else ())))

    return stage(work)(run, *evaluate.recast(hi, lo, run.record_tables[0].rows.dtype))
