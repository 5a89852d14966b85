"""Evaluation of tables on the device: any batch of epochs to components, in blocks on CPU, with exact time derivatives.

Why this shape. XLA:CPU keeps every step of a recurrence over a large batch in memory; blocks of some hundred epochs stay in cache
(measured: four times faster). One gather takes a record's whole row; the block is then turned over so that each coefficient is
contiguous. Derivatives with respect to time are the further recurrences themselves, so the derivative of a position
is the velocity, exactly, to any order.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import select
from jaxframes.numerics.trig import sin_cos
from jaxframes.numerics.two_part import recast_pair, turns_in, two_sum
from jaxframes.staging.columns import assemble
from jaxframes.staging.operation import Mapped, Operation
from jaxframes.staging.operation import run as operate
from jaxframes.staging.sharding import is_large, like, may_block, rows_at
from jaxframes.staging.stages import stage
from jaxframes.tables.formulas import Functions, record
from jaxframes.tables.records import RecordTable, of_tables

BLOCK = 512
"""Epochs a block on CPU."""


def _turns(rate: Any, rate_low: Any, hi: jax.Array, lo: jax.Array) -> jax.Array:
    rate, rate_low = (jnp.broadcast_to(jnp.asarray(x, hi.dtype), hi.shape) for x in (rate, rate_low))
    return turns_in(rate, rate_low, hi, lo)


DEVICE = Functions(sin_cos, jnp.sqrt, _turns)
"""What the formulas of tables take of JAX."""
Values: TypeAlias = tuple[jax.Array, ...]
"""Three components of the value (four of a quaternion), then as many of each derivative: 3 (order + 1) arrays of the batch's shape; or, as
vectors, order + 1 arrays [..., 3]."""
OUTSIDE = ("nan", "hold", "extrapolate")
"""What a run may give outside its span: NaN, the value at its end, or what its first or last record says there."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Run:
    """What an evaluation reads.

    Attributes:
        record_tables: Chebyshev runs whose sum is the table's value.
        reference: ``[2]``: the table's reference epoch in two parts, seconds past J2000 TDB.
        span: ``[4]``: start and stop of the coverage, each in two parts, seconds past the reference.
        outside: What it gives outside its span, one of ``OUTSIDE``.
    """

    record_tables: tuple[RecordTable, ...]
    reference: jax.Array
    span: jax.Array
    outside: str = field(default="nan", metadata={"static": True})

    @property
    def width(self) -> int:
        """Components of the value."""
        return self.record_tables[0].width

    @property
    def count(self) -> int | None:
        """How many tables of one kind stand one after the other in the arrays (``reference`` [n, 2] and ``span`` [n, 4] then)."""
        counts = self.record_tables[0].counts
        return None if counts is None else len(counts)

    def as_read(self, rank: int, which: jax.Array | None = None) -> "Run":
        """Return the run as samples read it; that of one table is itself.

        Args:
            rank: Rank of the samples.
            which: The table that each sample reads; None where the samples' last axis is over the tables.
        """
        if self.count is None:
            return self
        reference, span = (of_tables(values, rank, which) for values in (self.reference, self.span))
        return replace(self, record_tables=tuple(r.as_read(rank, which) for r in self.record_tables), reference=reference, span=span)


def evaluate(run: Run, hi: Any, lo: Any, order: int, vectors: bool = False) -> Values:
    """Return a table's value and its first ``order`` time derivatives at epochs (hi, lo).

    Args:
        run: The table; or many, then the epochs' last axis is over them.
        hi: High parts of the epochs, seconds past J2000 TDB, [...].
        lo: Low parts, broadcast against them.
        order: Highest derivative: 0, 1 or 2; more where gradients are taken.
        vectors: Whether to return arrays [..., 3], put together block by block, and not components.

    Returns:
        3 (order + 1) components [...] or order + 1 arrays [..., 3], that nothing later is fused with. NaN outside the coverage, in
        derivatives too.
        Differentiable in time (exact, any order) and in the coefficients (linear); the records' grid counts as constant.
    """
    hi, lo = recast(hi, lo, run.record_tables[0].rows.dtype)
    leaves, structure = jax.tree.flatten(run)
    return tuple(operate(_Evaluation(structure, order, vectors), *leaves, hi, lo))


def recast(hi: Any, lo: Any, dtype: Any) -> tuple[jax.Array, jax.Array]:
    """Return epochs in the dtype of a table, of one shape; what a narrower high part cannot hold moves to the low part."""
    hi, lo = jnp.broadcast_arrays(jnp.asarray(hi), jnp.asarray(lo))
    return (hi, lo) if hi.dtype == lo.dtype == dtype else recast_pair(hi, lo, dtype)


def coverage_code(run: Run, hi: jax.Array, lo: jax.Array) -> jax.Array:
    """Return -1 before the coverage, 0 inside and +1 after it (int32 [...]); -1 for an epoch that is NaN."""
    hi, lo = jnp.asarray(hi), jnp.asarray(lo)
    since, until = margins(run, *since_reference(run, hi, lo))
    after = (until < 0) | (hi == np.inf)  # an infinity has no second part: the margins of one are NaN
    return jnp.where(after, 1, jnp.where(since >= 0, 0, -1)).astype(jnp.int32)


@dataclass(frozen=True)
class _Evaluation(Operation):
    """The operation: of a run's leaves, then both parts of the epochs. Each derivative's tangent by time is the next derivative."""

    structure: Any
    order: int
    vectors: bool
    blocks: bool = True

    def _taken(self, arrays: Sequence[Any]) -> tuple[Run, Any, Any]:
        *leaves, hi, lo = arrays
        return jax.tree.unflatten(self.structure, leaves), hi, lo

    def results(self, *arrays: Any) -> list[jax.ShapeDtypeStruct]:
        run, hi, _ = self._taken(arrays)
        count = (1 if self.vectors else run.width) * (self.order + 1)
        return [jax.ShapeDtypeStruct((*hi.shape, run.width) if self.vectors else hi.shape, hi.dtype)] * count

    def compute(self, *arrays: jax.Array) -> Values:
        return self._computed(_plain, *arrays)

    def compute_on_cpu(self, *arrays: jax.Array) -> Values:
        hi = arrays[-2]
        large = is_large(hi.shape, BLOCK) and self.blocks and may_block(hi)
        return self._computed(_in_blocks if large else _plain, *arrays)

    def _computed(self, evaluator: Callable[..., Values], *arrays: jax.Array) -> Values:
        run, hi, lo = self._taken(arrays)
        flat = (-1,) if run.count is None else (-1, run.count)
        values = evaluator(self.order, self.vectors, run, hi.reshape(flat), lo.reshape(flat))
        return tuple(v.reshape(hi.shape + ((run.width,) if self.vectors else ())) for v in values)

    def derivative(self, primals: Sequence[jax.Array], tangents: Sequence[jax.Array | None]) -> tuple[Values, Sequence[jax.Array | None]]:
        run, hi, lo = self._taken(primals)
        width = 1 if self.vectors else run.width
        further = operate(_Evaluation(self.structure, self.order + 1, self.vectors, self.blocks), *primals)
        out = tuple(further[:-width])
        moved: list[jax.Array | None] = [None] * len(out)
        steps = [d for d in tangents[-2:] if d is not None]
        if steps:
            dt = functools.reduce(lambda a, b: a + b, steps)
            moved = [v * (dt[..., None] if self.vectors else dt) for v in further[width:]]
        places = range(len(tangents) - 2)
        at = jax.tree.unflatten(self.structure, places)
        rows = [tangents[records.rows] for records in at.record_tables]
        if any(d is not None for d in rows):
            more = _by_coefficients(self.order, self.vectors, run, rows, hi, lo)
            moved = [v if m is None else m + v for m, v in zip(moved, more, strict=True)]
        return out, moved

    def mapped(self, count: int, axes: tuple[int | None, ...], *arrays: jax.Array) -> Sequence[jax.Array]:
        """Take a vmapped axis of epochs as a larger batch and not element by element, unless the tables differ."""
        if any(axis is not None for axis in axes[:-2]):
            return operate(Mapped(replace(self, blocks=False), count, axes), *arrays)
        epochs = (x if axis is not None else jnp.broadcast_to(x, (count, *x.shape)) for x, axis in zip(arrays[-2:], axes[-2:], strict=True))
        return operate(self, *arrays[:-2], *epochs)


def _by_coefficients(
    order: int, vectors: bool, run: Run, tangents: Sequence[jax.Array | None], hi: jax.Array, lo: jax.Array
) -> Sequence[jax.Array]:
    """Return the change of the values with the coefficients: the same sums with the coefficients' tangents in their place."""

    def work(run: Run, tangents: Sequence[jax.Array | None], hi: jax.Array, lo: jax.Array) -> Sequence[jax.Array]:
        values = _components(order, run.as_read(hi.ndim), hi, lo, tangents)
        return _vectors(values, run.width) if vectors else values

    return stage(work)(run, tangents, hi, lo)


def _plain(order: int, vectors: bool, run: Run, hi: jax.Array, lo: jax.Array) -> Values:
    """Return the values of a batch of any shape at once."""

    def work(run: Run, hi: jax.Array, lo: jax.Array) -> Values:
        values = _components(order, run.as_read(hi.ndim), hi, lo)
        return _vectors(values, run.width) if vectors else values

    return stage(work)(run, hi, lo)


def _vectors(components: Values, width: int) -> Values:
    """Return arrays [..., width] of components."""
    return tuple(assemble(components[i : i + width]) for i in range(0, len(components), width))


def _in_blocks(order: int, vectors: bool, run: Run, hi: jax.Array, lo: jax.Array) -> Values:
    """Return the values of a flat batch, block after block. A loop's results are in memory: nothing is fused across.

    The last block starts early enough to be whole, so nothing is padded, cut or copied.
    """
    count, hi, lo = hi.size, hi.reshape(-1), lo.reshape(-1)

    def block(i: jax.Array, out: Values) -> Values:
        at = jnp.minimum(i * BLOCK, count - BLOCK)
        which = None if run.count is None else (at + lax.iota(at.dtype, BLOCK)) % run.count
        values = _components(order, run.as_read(1, which), lax.dynamic_slice(hi, (at,), (BLOCK,)), lax.dynamic_slice(lo, (at,), (BLOCK,)))
        if not vectors:
            return tuple(lax.dynamic_update_slice_in_dim(o, v, at, 0) for o, v in zip(out, values, strict=True))
        # Column by column: putting vectors together first computes each component three times (measured: 1.3 times the whole).
        return tuple(_with_columns(o, values[run.width * k : run.width * (k + 1)], at) for k, o in enumerate(out))

    empty = jnp.empty((count, run.width) if vectors else (count,), hi.dtype)
    start = (like(empty, hi, lo),) * ((1 if vectors else run.width) * (order + 1))
    return lax.fori_loop(0, -(-count // BLOCK), block, start)


def _with_columns(out: jax.Array, columns: Sequence[jax.Array], at: jax.Array) -> jax.Array:
    for j, column in enumerate(columns):
        out = lax.dynamic_update_slice(out, column[:, None], (at, jnp.asarray(j, at.dtype)))
    return out


def since_reference(run: Run, hi: jax.Array, lo: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the time past the reference epoch in two parts; nothing is lost."""
    dt_hi, error = two_sum(hi, -run.reference[0])
    return dt_hi, error + (lo - run.reference[1])


def margins(run: Run, dt_hi: jax.Array, dt_lo: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the time since the start and until the stop; their signs are right to the last bit."""
    start_hi, start_lo, stop_hi, stop_lo = (run.span[i] for i in range(4))
    return (dt_hi - start_hi) + (dt_lo - start_lo), (stop_hi - dt_hi) + (stop_lo - dt_lo)


def _components(order: int, run: Run, hi: jax.Array, lo: jax.Array, tangents: Sequence[jax.Array | None] | None = None) -> Values:
    """Return the values of a batch (any shape) straight away: no blocks, no fence, no rules.

    With tangents of the record tables' rows, the values are linear in these: they take the coefficients' place, None counting as zero.
    """
    dt_hi, dt_lo = since_reference(run, hi, lo)
    since, until = margins(run, dt_hi, dt_lo)
    inside, zero = (since >= 0) & (until >= 0), np.zeros((), hi.dtype)
    # Added to the argument, not selected afterwards: so the NaN is in every derivative too.
    outside = select(inside, zero, np.array(np.nan, hi.dtype)) if run.outside == "nan" else zero
    held = inside if run.outside == "hold" else None
    used = [(records, records.rows) for records in run.record_tables] if tangents is None else zip(run.record_tables, tangents, strict=True)
    parts = [_values(order, records, rows, (dt_hi, dt_lo), outside, held) for records, rows in used if rows is not None]
    return tuple(functools.reduce(lambda a, b: a + b, terms) for terms in zip(*parts, strict=True))


def _values(
    order: int, records: RecordTable, rows: jax.Array, past: tuple[jax.Array, jax.Array], outside: Any, held: jax.Array | None
) -> list[jax.Array]:
    """Return the values of one record table, or of tangents of its rows.

    Args:
        order: Highest derivative.
        records: The record table.
        rows: Its rows, or their tangents.
        past: Seconds past the reference, in two parts.
        outside: What is added to the argument: NaN outside the coverage.
        held: Where the value is not that at the end of the coverage, which does not move; None for everywhere.
    """
    index = records.serving(*past)
    place = jnp.moveaxis(rows_at(records.rows, index), -1, 0)
    row = place if rows is records.rows else jnp.moveaxis(rows_at(rows, index), -1, 0)
    middle_hi, middle_lo, radius = place[-3], place[-2], place[-1]
    s = (((past[0] - middle_hi) + (past[1] - middle_lo)) + outside) / radius
    if held is not None:
        s = lax.clamp(np.array(-1, s.dtype), s, np.array(1, s.dtype))
    coefficients = [[row[j * records.series + which] for j in range(records.terms)] for which in range(records.series)]
    values = record(coefficients, s, radius, order)
    if held is None:
        return values
    return [v if i < records.width else select(held, v, v * 0) for i, v in enumerate(values)]
