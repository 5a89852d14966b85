"""Record tables of many tables as one: their records stand one after the other in the same arrays."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxframes.staging.arrays import is_concrete
from jaxframes.tables.records import RecordTable


def concatenated(record_tables: Sequence[RecordTable]) -> RecordTable:
    """Return the record tables of several tables as one; NumPy arrays where all numbers are known."""
    counts = tuple((records.rows.shape[0], 0 if records.first is None else records.first.shape[0]) for records in record_tables)
    parts = {name: concatenated_arrays([getattr(records, name) for records in record_tables]) for name in ("rows", "first", "ends", "low")}
    grid = stacked_arrays([records.grid for records in record_tables])
    sizes = np.array(counts, np.int32)
    bounds = np.stack([np.cumsum(sizes, 0, dtype=np.int32) - sizes, sizes], -1).reshape(-1, 4)
    return replace(
        record_tables[0], **parts, grid=grid, compares=max(records.compares for records in record_tables), counts=counts, bounds=bounds
    )


def single(records: RecordTable, row: int) -> RecordTable:
    """Return the record table of one of the tables."""
    counts = counts_of(records)
    (row_at, cell_at), (rows, cells) = (sum(c[i] for c in counts[:row]) for i in (0, 1)), counts[row]
    parts: dict[str, Any] = {name: getattr(records, name) for name in ("rows", "ends", "low")}
    parts = {name: None if value is None else value[row_at : row_at + rows] for name, value in parts.items()}
    first = None if records.first is None else records.first[cell_at : cell_at + cells]
    return replace(records, **parts, first=first, grid=records.grid[row], counts=None, bounds=None)


def counts_of(records: RecordTable) -> tuple[tuple[int, int], ...]:
    """Return the numbers of records and cells of each of the tables."""
    assert records.counts is not None
    return records.counts


def concatenated_arrays(arrays: Sequence[Any]) -> Any:
    """Return arrays one after the other, None for none; of NumPy where all numbers are known."""
    if arrays[0] is None:
        return None
    return np.concatenate([np.asarray(a) for a in arrays]) if all(map(is_concrete, arrays)) else jnp.concatenate(arrays)


def stacked_arrays(arrays: Sequence[Any]) -> Any:
    """Return arrays as one with a leading axis; of NumPy where all numbers are known."""
    return np.stack([np.asarray(a) for a in arrays]) if all(map(is_concrete, arrays)) else jnp.stack(arrays)
