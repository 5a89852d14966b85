"""Record tables: runs of Chebyshev records as arrays, and finding the record that serves an instant."""

from dataclasses import dataclass, field, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.staging.arrays import default_float, on_device
from jaxframes.staging.sharding import rows_at
from jaxframes.tables.instants import split

RESOLVED = 2.0**-18
"""Seconds that two float32 tell apart, thirty years from J2000."""
METRES = 1000.0
"""Metres of a kilometre."""
LOW_TERMS = 6
"""Terms of each series that float32 tables hold in two parts."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class RecordTable:
    """Records of one Chebyshev run; times in seconds past the table's reference epoch, in two parts.

    Attributes:
        rows: ``[n, series * terms + 3]``: coefficients term by term (SI), then the record's middle in two parts and its half length.
            The middle and half length are those stored in the kernel, not recomputed.
        grid: ``[3]``: start of the first cell in two parts, and the cells' width.
        first: ``[cells]``: the record that serves where a cell starts (whole numbers, kept as floats so that a tree of tables can be
            differentiated); None where cells are records.
        ends: ``[n, 2]``: end of each record in two parts; None where cells are records.
        series: 3 for one series an axis, 6 where velocities have series of their own (SPK type 3), 4 for quaternions.
        compares: Most records that begin within one cell.
        counts: Records and cells of each table where many stand one after the other in these arrays (``grid`` is [n_tables, 3] then, and
            ``first`` counts from each table's own first record); None for one table.
        low: ``[n, LOW_TERMS * series + 1]``: what float32 cannot hold of the lowest coefficients and the half length, for
            ``evaluate_two_part``; None in float64.
        bounds: ``[n_tables, 4]``: first record, records, first cell and cells of each of many tables, int32; None for one table.
    """

    rows: jax.Array
    grid: jax.Array
    first: jax.Array | None
    ends: jax.Array | None
    series: int = field(metadata={"static": True})
    compares: int = field(metadata={"static": True})
    low: jax.Array | None = None
    counts: tuple[tuple[int, int], ...] | None = field(default=None, metadata={"static": True})
    bounds: jax.Array | None = None

    def as_read(self, rank: int, which: jax.Array | None) -> "RecordTable":
        """Return the record table of many tables as samples read it, ``grid`` [3, ...]; one table's is itself.

        Args:
            rank: Rank of the samples.
            which: The table that each sample reads; None where the samples' last axis is over the tables.
        """
        if self.counts is None:
            return self
        assert self.bounds is not None
        return replace(self, grid=of_tables(self.grid, rank, which), bounds=of_tables(self.bounds, rank, which))

    @property
    def terms(self) -> int:
        """Coefficients a series."""
        return (self.rows.shape[-1] - 3) // self.series

    @property
    def width(self) -> int:
        """Components of the value: four where the series are those of a quaternion, else three."""
        return 4 if self.series == 4 else 3

    @property
    def bytes(self) -> int:
        """Size of the arrays."""
        return sum(a.nbytes for a in (self.rows, self.grid, self.first, self.ends, self.low) if a is not None)

    @property
    def gaps(self) -> np.ndarray:
        """Which rows stand for a gap, bool [..., n]: all of their numbers are finite but the length."""
        rows = np.asarray(self.rows)
        return np.isnan(rows[..., -1]) & np.isfinite(rows[..., :-1]).all(-1)

    def unmarked(self) -> "RecordTable":
        """Return the record table with finite numbers in place of the marks of gaps and of the open end of the last record."""
        rows, ends = np.array(self.rows), self.ends
        rows[..., -1] = np.where(self.gaps, 0.0, rows[..., -1])
        if ends is not None:
            ends = np.array(ends)
            ends[..., -1, 0] = np.where(ends[..., -1, 0] == np.inf, 0.0, ends[..., -1, 0])
        return replace(self, rows=rows, ends=ends)  # pyright: ignore[reportArgumentType]

    def serving(self, dt_hi: jax.Array, dt_lo: jax.Array) -> jax.Array:
        """Return the index (int32 [...]) of the record that serves an instant; the first or last one outside.

        Uniform records are found by one division; others by the table of the cell and halvings, as many as ``compares`` has binary
        digits. The last instant belongs to the last record.
        """
        origin_hi, origin_lo, width = (self.grid[i] for i in range(3))
        first_row, rows, first_cell, cells = self._bounds
        uniform = self.first is None or self.ends is None
        first_cell, cells = (first_row, rows) if uniform else (first_cell, cells)
        position = jnp.floor(((dt_hi - origin_hi) + (dt_lo - origin_lo)) / width)
        last = cells - 1
        cell = _bounded(_bounded(position, last.astype(position.dtype)).astype(jnp.int32), last) + first_cell
        if self.first is None or self.ends is None:
            return cell
        index = rows_at(self.first[:, None], cell)[..., 0].astype(jnp.int32)
        for bit in reversed(range(self.compares.bit_length())):  # halvings: of the ends within the cell, how many lie before
            ahead = index + np.int32((1 << bit) - 1)
            end = rows_at(self.ends, _bounded(ahead, rows - 1) + first_row)
            past = (((dt_hi - end[..., 0]) + (dt_lo - end[..., 1])) >= 0) & (ahead < rows)
            index = _bounded(index + past.astype(jnp.int32) * np.int32(1 << bit), rows - 1)
        return index + first_row

    @property
    def _bounds(self) -> tuple[Any, Any, Any, Any]:
        """First record, records, first cell and cells: those of one table, or of the table that each sample reads."""
        if self.bounds is not None:
            return self.bounds[0], self.bounds[1], self.bounds[2], self.bounds[3]
        return np.int32(0), np.int32(self.rows.shape[0]), np.int32(0), np.int32(0 if self.first is None else self.first.shape[0])


@dataclass(frozen=True)
class HostRecordTable:
    """A record table in float64 on the host: the arrays of ``RecordTable`` under their names, with its static numbers."""

    arrays: dict[str, np.ndarray]
    series: int
    compares: int

    def same_grid(self, other: "HostRecordTable") -> bool:
        """Whether two record tables have the same records in time, so that their coefficients can be added."""
        if (self.series, self.compares, set(self.arrays)) != (other.series, other.compares, set(other.arrays)):
            return False
        pairs = [(self.arrays[name], other.arrays[name]) for name in self.arrays if name != "rows"]
        pairs.append((self.arrays["rows"][:, -3:], other.arrays["rows"][:, -3:]))
        return all(np.array_equal(a, b) for a, b in pairs)


def of_tables(values: jax.Array, rank: int, which: jax.Array | None) -> jax.Array:
    """Return numbers [n_tables, k] as samples read them, [k, ...]; None where the samples' last axis is over the tables."""
    return jnp.moveaxis(lax.expand_dims(values, range(rank - 1)) if which is None else rows_at(values, which), -1, 0)


def _bounded(index: jax.Array, last: Any) -> jax.Array:
    """Return an index between 0 and the last one: what a NaN converts to is not defined."""
    return lax.clamp(np.zeros((), index.dtype), index, jnp.broadcast_to(last, index.shape) if np.ndim(last) else last)


def to_record_table(arrays: dict[str, np.ndarray], series: int, compares: int, dtype: Any = None, low: bool = False) -> RecordTable:
    """Return a record table from float64 arrays; pairs keep what one float32 cannot hold.

    Args:
        arrays: The arrays of ``RecordTable`` by name.
        series: As in ``RecordTable``.
        compares: As in ``RecordTable``.
        dtype: Float dtype of the record table. Default: JAX's own.
        low: Whether a float32 record table keeps low parts of its coefficients.
    """
    dtype = np.dtype(default_float() if dtype is None else dtype)
    rows = arrays["rows"].astype(dtype)
    rows[:, -3], rows[:, -2] = split(arrays["rows"][:, -3], arrays["rows"][:, -2], dtype)
    grid = arrays["grid"].astype(dtype)
    grid[0], grid[1] = split(arrays["grid"][0], arrays["grid"][1], dtype)
    first = on_device(arrays["first"].astype(dtype)) if "first" in arrays else None
    ends = None
    if "ends" in arrays:
        ends = on_device(np.stack(_ends(arrays["ends"][:, 0], arrays["ends"][:, 1], dtype), 1))
    rest = None
    if low and dtype == np.float32:
        at = two_part_columns(rows.shape[1], series)
        rest = on_device((arrays["rows"][:, at] - rows[:, at].astype(np.float64)).astype(dtype))
    return RecordTable(on_device(rows), on_device(grid), first, ends, series, compares, rest)


def _ends(high: np.ndarray, low: np.ndarray, dtype: np.dtype) -> tuple[np.ndarray, np.ndarray]:
    """Return ends of records in two parts of a dtype; in float32 the next one that its epochs can tell from the instants before.

    An end may lie a nanosecond after the instant at which a segment ends, which still belongs to it.
    """
    if dtype != np.float64:
        steps = np.ceil(high / RESOLVED)
        steps += (steps * RESOLVED == high) & (low > 0)
        high, low = steps * RESOLVED, np.zeros_like(low)
    return split(high, low, dtype)


def two_part_columns(width: int, series: int) -> np.ndarray:
    """Return the columns of rows that float32 record tables keep in two parts: the lowest coefficients and the half length."""
    return np.array([*range(min(LOW_TERMS * series, width - 3)), width - 1])


def host_arrays(records: RecordTable) -> dict[str, np.ndarray]:
    """Return a record table's arrays as float64; exact, so that ``to_record_table`` gives the same one again."""
    rows, grid = np.array(records.rows, np.float64), np.array(records.grid, np.float64)
    if records.low is not None:
        rows[:, two_part_columns(rows.shape[1], records.series)] += np.array(records.low, np.float64)
    rows[:, -3], rows[:, -2] = split(rows[:, -3], rows[:, -2], np.dtype(np.float64))
    grid[0], grid[1] = split(grid[0], grid[1], np.dtype(np.float64))
    arrays = {"rows": rows, "grid": grid}
    if records.first is not None and records.ends is not None:
        ends = np.array(records.ends, np.float64)
        arrays |= {"first": np.array(records.first, np.float64), "ends": np.stack(split(ends[:, 0], ends[:, 1], np.dtype(np.float64)), 1)}
    return arrays


def in_metres(records: HostRecordTable) -> HostRecordTable:
    """Return a record table with its coefficients turned from km and km/s to m and m/s: one rounding each."""
    rows = records.arrays["rows"].copy()
    rows[:, :-3] *= METRES
    return HostRecordTable({**records.arrays, "rows": rows}, records.series, records.compares)
