"""Joining the records of segments into record tables: axes, signs, grids that are added. On the host, in float64 and exact times."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from jaxframes.errors import NoPathError
from jaxframes.spice.extraction.read_records import read_piece
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segments import Piece, Records, Segment, open_starts
from jaxframes.tables.index import irregular
from jaxframes.tables.instants import reference_day, two_parts
from jaxframes.tables.records import HostRecordTable


def join(parts: Sequence[Records], sign: int, reference: int) -> HostRecordTable:
    """Return one record table from the records of consecutive pieces.

    Args:
        parts: Records in time order, each part serving up to where the next one starts.
        sign: +1 or -1, folded into the coefficients (exact).
        reference: The table's reference epoch, whole seconds past J2000 TDB.
    """
    series = parts[0].coefficients.shape[1]
    if any(part.coefficients.shape[1] != series for part in parts):
        parts, series = _with_velocities(parts), 6
    terms = max(part.coefficients.shape[2] for part in parts)
    count = sum(len(part.middle) for part in parts)
    coefficients = np.zeros((count, terms, series))
    at = 0
    for part in parts:
        n, _, own = part.coefficients.shape
        coefficients[at : at + n, :own] = np.swapaxes(part.coefficients, 1, 2)
        at += n
    middle = np.concatenate([part.middle for part in parts])
    middle_hi = middle - reference
    back = middle_hi - middle  # the rounding error of the difference, exactly (Knuth's two-sum)
    middle_lo = (middle - (middle_hi - back)) + (-float(reference) - back)
    radius = np.concatenate([part.radius for part in parts])
    rows = np.concatenate([sign * coefficients.reshape(count, -1), np.stack([middle_hi, middle_lo, radius], 1)], 1)
    index, compares = _index(parts, reference)
    return HostRecordTable({"rows": rows, **index}, series, compares)


def rotated(records: Records, rotation: np.ndarray) -> Records:
    """Return records with their vectors turned into other axes: exact but for one rounding of each coefficient."""
    n, series, terms = records.coefficients.shape
    triples = records.coefficients.reshape(n, series // 3, 3, terms)
    turned = np.einsum("ij,nkjt->nkit", rotation, triples).reshape(n, series, terms)
    return replace(records, coefficients=turned)


def _with_velocities(parts: Sequence[Records]) -> list[Records]:
    """Return records that all have series for velocities; where the kernel has none they are the derivatives of the positions."""
    out = []
    for part in parts:
        if part.coefficients.shape[1] == 3:
            rates = np.polynomial.chebyshev.chebder(part.coefficients, axis=2) / part.radius[:, None, None]
            rates = np.concatenate([rates, np.zeros((*part.coefficients.shape[:2], 1))], 2)
            part = replace(part, coefficients=np.concatenate([part.coefficients, rates], 1))
        out.append(part)
    return out


def _index(parts: Sequence[Records], reference: int) -> tuple[dict[str, np.ndarray], int]:
    """Return the arrays that find a record by time, and how many comparisons they need."""
    length, origin = parts[0].step, parts[0].origin
    if _is_uniform(parts):
        return {"grid": np.array([*two_parts(origin - reference), float(length)])}, 0
    starts = [start - reference for part in parts for start in part.starts()]
    return irregular(starts, parts[-1].stop - reference)


def _is_uniform(parts: Sequence[Records]) -> bool:
    """Whether the records of all parts lie on the grid of the first: to 1e-10 of a record, where its series are as good as inside."""
    length, origin = parts[0].step, parts[0].origin
    count = 0
    if any(part.inner is not None or part.open_start for part in parts):
        return False
    for part in parts:
        drift = part.origin - (origin + count * length)
        if abs(drift) > length / 10**10 or abs(part.step - length) * len(part.middle) > length / 10**10:
            return False
        if count and part.start > part.origin + length / 10**10:
            return False  # served from within its first record: the record before serves until then
        count += len(part.middle)
        if part is not parts[-1] and part.stop < part.origin + len(part.middle) * part.step - length / 10**10:
            return False
    return True


def combine(record_tables: Sequence[HostRecordTable]) -> list[HostRecordTable]:
    """Return the record tables with those on the same grid added coefficient by coefficient."""
    out: list[HostRecordTable] = []
    for records in record_tables:
        twin = next((i for i, other in enumerate(out) if records.same_grid(other)), None)
        if twin is None:
            out.append(records)
        else:
            out[twin] = _sum(out[twin], records)
    return out


def _sum(a: HostRecordTable, b: HostRecordTable) -> HostRecordTable:
    long, short = (a, b) if a.arrays["rows"].shape[1] >= b.arrays["rows"].shape[1] else (b, a)
    rows = long.arrays["rows"].copy()
    width = short.arrays["rows"].shape[1] - 3
    rows[:, :width] += short.arrays["rows"][:, :-3]
    return HostRecordTable({**long.arrays, "rows": rows}, a.series, a.compares)


TURN = Fraction(62831853071795864769252867665590057683943387987502116419498891846156328125724179972560696506842341359, 10**100)
"""Two pi to a hundred digits."""


def unwrapped(records: HostRecordTable) -> HostRecordTable:
    """Return a record table of angles with whole double turns taken out of each record's constant term.

    Angles of a spinning body grow without bound (thousands of radians), and with them the rounding of their sines. Double turns, not
    single ones, so that the quaternion made of half the angle does not change its sign.
    """
    rows = records.arrays["rows"].copy()
    for column in range(3):
        for i in np.flatnonzero(np.abs(rows[:, column]) > 2 * float(TURN)):
            angle = Fraction(rows[i, column])
            rows[i, column] = float(angle - round(angle / (2 * TURN)) * 2 * TURN)
    return HostRecordTable({**records.arrays, "rows": rows}, records.series, records.compares)


def join_pieces(
    pool: KernelPool, parts: Sequence[tuple[Piece, np.ndarray | None]], sign: int, start: Fraction
) -> tuple[HostRecordTable, list[float]]:
    """Return one record table from consecutive pieces, and by how much SPICE's own velocities differ from the derivatives in each, m/s.

    Args:
        pool: The kernels.
        parts: Pieces in time order, and the matrix that turns the vectors of each, None for none.
        sign: As in ``join``.
        start: Start of the table's span.
    """
    read = []
    for (piece, rotation), is_open in zip(parts, open_starts([piece for piece, _ in parts]), strict=True):
        records = replace(read_piece(pool, piece), open_start=is_open)
        read.append(records if rotation is None else rotated(records, rotation))
    return join(read, sign, reference_day(start)), [records.apart for records in read]


def segment_rotation(pool: KernelPool, segment: Segment, axes: str) -> np.ndarray | None:
    """Return the matrix from a segment's own frame to another, which does not turn against it; None where they are the same.

    Raises:
        NoPathError: If the segment's own frame is unknown, or turns against the other.
    """
    own = pool.find_frame(segment.frame)
    if own is None:
        raise NoPathError(
            f"{segment.describe()} is relative to frame {segment.frame}, of no kernel loaded: load the kernel that defines it."
        )
    if own.name == axes:
        return None
    of, base = anchored(pool, own), anchored(pool, pool.frame(axes))
    if of.inertial and base.inertial:
        return base.matrix.T @ pool.rotation(of.frame.name, base.frame.name) @ of.matrix
    if of.frame.id != base.frame.id:
        raise NoPathError(
            f"{segment.describe()} is relative to {own.name}, which turns against {axes}: positions are exact in their own axes. "
            f"Ask for frame={own.name!r}, and for the orientation as an edge of its own, as kernels.tree and add_spice do."
        )
    between = base.matrix.T @ of.matrix
    return None if np.array_equal(between, np.eye(3)) else between
