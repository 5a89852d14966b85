"""The base of all tables over time: coverage, conversion to another dtype, and the evaluation of many tables as one edge."""

import dataclasses
from collections.abc import Hashable, Sequence
from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.errors import EdgeError
from jaxframes.numerics import host_two_part
from jaxframes.numerics.components import V3, Component
from jaxframes.numerics.steps import Step
from jaxframes.numerics.two_part import recast_pairs
from jaxframes.tables import evaluate
from jaxframes.tables.evaluate import Run
from jaxframes.tables.info import Info
from jaxframes.tables.instants import past_reference, split
from jaxframes.tables.pool import concatenated, concatenated_arrays, counts_of, single, stacked_arrays
from jaxframes.tables.records import RecordTable, two_part_columns
from jaxframes.tables.report import report
from jaxframes.tables.table_edge import TableEdge
from jaxframes.time import seconds
from jaxframes.time.epoch import EPOCH, Epoch


class Table(TableEdge):
    """What both kinds of table share. Time is an ``Epoch``; outside the coverage everything is NaN, gradients included.

    Attributes:
        record_tables: Chebyshev runs whose sum is the table's value (SI units).
        reference: ``[2]``: reference epoch in two parts, seconds past J2000 TDB.
        span: ``[4]``: start and stop of the coverage, each in two parts, seconds past the reference.
        info: Names, ids, coverage and kernels; static.
        by_record: Names of the fields beside the record tables that hold a row for each record.
    """

    stackable: ClassVar[bool] = False
    needs_time: ClassVar[bool] = True
    by_record: ClassVar[tuple[str, ...]] = ()
    record_tables: tuple[RecordTable, ...]
    reference: jax.Array
    span: jax.Array

    def astype(self, dtype: Any) -> Self:
        """Return a copy with numbers of another dtype; times, kept in two parts, lose no more than they must."""
        plain = super().astype(dtype)
        return plain.replace(
            reference=recast_pairs(self.reference, dtype),
            span=recast_pairs(self.span, dtype),
            record_tables=tuple(recast_records(old, new, dtype) for old, new in zip(self.record_tables, plain.record_tables, strict=True)),
        )

    @property
    def has_gaps(self) -> bool:
        """Whether there are instants without data between its first and its last."""
        return any(records.gaps.any() for records in self.record_tables)

    def checkable(self) -> Self:
        """Return the table without the marks of its gaps and of the open end of its last record."""
        return self.replace(record_tables=tuple(records.unmarked() for records in self.record_tables))

    def kind(self) -> Hashable:
        """Return what tables have in common that are evaluated as one, whatever the number of their records."""
        own = tuple(getattr(self, f.name) for f in dataclasses.fields(self) if f.name not in (*self.parameter_fields(), "info"))
        record_tables = tuple(
            (records.series, records.rows.shape[-1], records.rows.dtype.name, records.first is None, records.low is None)
            for records in self.record_tables
        )
        return type(self), own, record_tables

    @classmethod
    def together(cls, edges: Sequence[Edge]) -> Edge:
        """Return tables of one kind as one edge of many."""
        return _pooled(edges)  # pyright: ignore[reportArgumentType]

    @property
    def run(self) -> Run:
        """The arrays that an evaluation reads."""
        return Run(self.record_tables, self.reference, self.span)

    @property
    def knots(self) -> Epoch:
        """Where the table's polynomials meet, and its two ends, ``Epoch`` [n] in order: where higher derivatives may jump (on the host).

        For solvers of differential equations, which should step onto them: ``diffrax``'s ``jump_ts`` or ``step_ts``, say.
        """
        span = np.asarray(self.span, np.float64)
        high, low = [span[[0, 2]]], [span[[1, 3]]]
        for records in self.record_tables:
            if records.ends is not None:
                ends = np.asarray(records.ends, np.float64)[:-1]
                high.append(ends[:, 0])
                low.append(ends[:, 1])
            else:
                grid, steps = np.asarray(records.grid, np.float64), np.arange(1.0, records.rows.shape[0])
                product = host_two_part.two_product(steps, np.full_like(steps, grid[2]))
                whole = host_two_part.add(product, (np.full_like(steps, grid[0]), np.full_like(steps, grid[1])))
                high.append(whole[0])
                low.append(whole[1])
        found = host_two_part.two_sum(np.concatenate(high), np.concatenate(low))
        inside = (found[0] >= span[0] + span[1]) & (found[0] <= span[2] + span[3])
        order = np.lexsort((found[1][inside], found[0][inside]))
        parts = np.unique(np.stack(found, 1)[inside][order], axis=0)
        hi, lo = split(*past_reference(self.reference, parts[:, 0], parts[:, 1]), np.dtype(self.reference.dtype))
        return Epoch(jnp.asarray(hi), jnp.asarray(lo))

    def coverage_code(self, time: Any) -> jax.Array:
        """Return -1 where an ``Epoch`` (or ET seconds) lies before the coverage, 0 inside, +1 after: int32 [...]; -1 for NaN."""
        return evaluate.coverage_code(self.run, *two_parts(time))

    def report(self) -> str:
        """Return what the table is made of, in lines: method, records, degree, bytes, coverage, kernels, jumps between records."""
        return report(self.info, self.record_tables)

    def values(self, inputs: Inputs, order: int) -> tuple[V3, ...]:
        """Return the table's value and its derivatives at the epoch of a state, as components."""
        return triples(evaluate.evaluate(self.run, *inputs.epoch_for(self), order))


@family(static=("infos",))
class TablePool(Edge):
    """Tables of one kind as one edge of many: its components have a last axis over the tables.

    Attributes:
        table: The tables' arrays: records, cells and what else there is for each record one after the other; what there is once for each
            table stacked ``[n_tables, k]``.
        infos: What each table says of itself.
    """

    stackable: ClassVar[bool] = False
    needs_time: ClassVar[bool] = True
    table: Table
    infos: tuple[Info, ...]

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return the steps of all tables, each component [*batch, n_tables]; so are the parts of the time."""
        return self.table.steps(inputs, order)

    def describe(self) -> str:
        """Return how many tables there are, and the first."""
        return f"{len(self.infos)} tables, the first of them {self.table.describe()}"

    def alone(self, row: int) -> Table:
        """Return one of the tables."""
        table, parts = self.table, {}
        for name in table.parameter_fields():
            value = getattr(table, name)
            if name == "record_tables":
                parts[name] = tuple(single(records, row) for records in value)
            elif name in table.by_record:
                first = sum(rows for rows, _ in counts_of(table.record_tables[0])[:row])
                parts[name] = value[first : first + counts_of(table.record_tables[0])[row][0]]
            else:
                parts[name] = value[row]
        return table.replace(**parts, info=self.infos[row])


def _pooled(tables: Sequence[Table]) -> TablePool:
    """Return tables of one kind as one; NumPy arrays where all numbers are known."""
    first, parts = tables[0], {}
    for name in first.parameter_fields():
        values = [getattr(table, name) for table in tables]
        if name == "record_tables":
            parts[name] = tuple(concatenated(record_tables) for record_tables in zip(*values, strict=True))
        else:
            parts[name] = concatenated_arrays(values) if name in first.by_record else stacked_arrays(values)
    return TablePool(first.replace(**parts), tuple(table.info for table in tables))


def recast_records(old: RecordTable, plain: RecordTable, dtype: Any) -> RecordTable:
    """Return a record table whose times and lowest coefficients are converted as pairs; ``plain`` holds everything else converted."""
    numpy: Any = np if isinstance(old.rows, np.ndarray) else jnp
    middle = recast_pairs(old.rows[..., -3:-1], dtype)
    rows = numpy.concatenate([plain.rows[..., :-3], middle, plain.rows[..., -1:]], -1)
    grid = numpy.concatenate([recast_pairs(old.grid[..., :2], dtype), plain.grid[..., 2:]], -1)
    ends = None if old.ends is None else recast_pairs(old.ends, dtype)
    low = plain.low
    if low is not None and low.dtype != old.rows.dtype:  # a wider number holds both parts; the empty low part keeps the tree's structure
        whole = plain.rows[..., two_part_columns(rows.shape[-1], old.series)] + low
        rows = numpy.concatenate([whole[..., :-1], rows[..., low.shape[-1] - 1 : -1], whole[..., -1:]], -1)
        low = low * 0
    return RecordTable(rows, grid, plain.first, ends, old.series, old.compares, low)


def triples(values: tuple[Component, ...]) -> tuple[V3, ...]:
    """Return components three by three as vectors."""
    return tuple(V3(*values[i : i + 3]) for i in range(0, len(values), 3))


def checked_order(order: int) -> int:
    """Return the order that a caller asks for (EdgeError unless it is 0, 1 or 2)."""
    if order not in (0, 1, 2):
        raise EdgeError(f"order={order!r}: tables give order 0 (value), 1 (and rate) or 2 (and acceleration)")
    return order


def two_parts(time: Any) -> tuple[Any, Any]:
    """Return the parts of an ``Epoch``; plain seconds keep what one number cannot hold, and nothing else is taken (FrameError)."""
    if isinstance(time, Epoch):
        return time.hi, time.lo
    return seconds.two_parts(time, None, EPOCH)
