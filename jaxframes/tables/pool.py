"""Many tables of one kind, of any lengths, evaluated as one: their records stand one after the other in the same arrays."""

import dataclasses
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs, family
from jaxframes.numerics.steps import Step
from jaxframes.staging.arrays import is_concrete
from jaxframes.tables.base import Table
from jaxframes.tables.info import Info
from jaxframes.tables.records import Leg


@family(static=("infos",))
class TablePool(Edge):
    """Tables of one kind as one edge of many: its components have a last axis over the tables.

    Attributes:
        table: The tables' arrays: records, cells and what else there is for each record one after the other; what there is once for each
            table stacked ``[n_tables, k]``.
        infos: What each table says of itself.
    """

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
            if name == "legs":
                parts[name] = tuple(_one(leg, row) for leg in value)
            elif name in table.by_record:
                first = sum(rows for rows, _ in _counts(table.legs[0])[:row])
                parts[name] = value[first : first + _counts(table.legs[0])[row][0]]
            else:
                parts[name] = value[row]
        return table.replace(**parts, info=self.infos[row])


def pooled(tables: Sequence[Table]) -> TablePool:
    """Return tables of one kind as one; NumPy arrays where all numbers are known."""
    first, parts = tables[0], {}
    for name in first.parameter_fields():
        values = [getattr(table, name) for table in tables]
        if name == "legs":
            parts[name] = tuple(_many(legs) for legs in zip(*values, strict=True))
        else:
            parts[name] = _joined(values) if name in first.by_record else _stacked(values)
    return TablePool(first.replace(**parts), tuple(table.info for table in tables))  # pyright: ignore[reportCallIssue]


def _many(legs: Sequence[Leg]) -> Leg:
    counts = tuple((leg.rows.shape[0], 0 if leg.first is None else leg.first.shape[0]) for leg in legs)
    parts = {name: _joined([getattr(leg, name) for leg in legs]) for name in ("rows", "first", "ends", "low")}
    grid = _stacked([leg.grid for leg in legs])
    sizes = np.array(counts, np.int32)
    bounds = np.stack([np.cumsum(sizes, 0, dtype=np.int32) - sizes, sizes], -1).reshape(-1, 4)
    return replace(legs[0], **parts, grid=grid, compares=max(leg.compares for leg in legs), counts=counts, bounds=bounds)


def _one(leg: Leg, row: int) -> Leg:
    counts = _counts(leg)
    (row_at, cell_at), (rows, cells) = (sum(c[i] for c in counts[:row]) for i in (0, 1)), counts[row]
    parts: dict[str, Any] = {name: getattr(leg, name) for name in ("rows", "ends", "low")}
    parts = {name: None if value is None else value[row_at : row_at + rows] for name, value in parts.items()}
    first = None if leg.first is None else leg.first[cell_at : cell_at + cells]
    return dataclasses.replace(leg, **parts, first=first, grid=leg.grid[row], counts=None, bounds=None)


def _counts(leg: Leg) -> tuple[tuple[int, int], ...]:
    assert leg.counts is not None
    return leg.counts


def _joined(arrays: Sequence[Any]) -> Any:
    if arrays[0] is None:
        return None
    return np.concatenate([np.asarray(a) for a in arrays]) if all(map(is_concrete, arrays)) else jnp.concatenate(arrays)


def _stacked(arrays: Sequence[Any]) -> Any:
    return np.stack([np.asarray(a) for a in arrays]) if all(map(is_concrete, arrays)) else jnp.stack(arrays)
