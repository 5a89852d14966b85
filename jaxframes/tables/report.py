"""The report of a table: what it is made of, and how far its records fail to meet."""

from collections.abc import Sequence

import numpy as np

from jaxframes.tables.host_evaluate import derivatives
from jaxframes.tables.info import UNITS, Info
from jaxframes.tables.naif_ids import labelled
from jaxframes.tables.records import RecordTable, host_arrays


def report(info: Info, record_tables: Sequence[RecordTable], jumps: bool = True, more: int = 0) -> str:
    """Return the report of a table as text, with the jumps between its records if these are plain series; ``more`` counts other bytes."""
    what = "position" if info.kind == "translation" else "orientation"
    what += "" if info.correction == "NONE" else f" (corrected: {info.correction})"
    lines = [
        f"{what} of {labelled(info.of, info.of_id)} relative to {labelled(info.relative_to, info.relative_id)}, axes {info.axes}",
        f"method:   {info.method}, {len(record_tables)} record table{'s' if len(record_tables) != 1 else ''}",
        f"coverage: {info.coverage}",
        f"size:     {sum(records.bytes for records in record_tables) + more} bytes, {record_tables[0].rows.dtype.name}",
    ]
    for i, records in enumerate(record_tables, 1):
        if records.series not in (3, 6):
            lines.append(f"table {i}:  {records.rows.shape[0]} intervals of up to {float(np.nanmax(records.rows[:, -1])):.6g} s")
            continue
        days = 2 * float(np.nanmax(records.rows[:, -1])) / 86400
        own = ", velocities of their own" if records.series == 6 else ""
        lines.append(f"table {i}:  {records.rows.shape[0]} records of up to {days:.6g} days, degree {records.terms - 1}{own}")
        sizes = record_jumps(records) if jumps else None
        if sizes is not None:
            text = ", ".join(f"{size:.2g} {unit}" for size, unit in zip(sizes, UNITS[info.kind], strict=True))
            lines.append(f"          largest jumps between records: {text}")
    lines += [f"measured: {name}: {value:.3g}" for name, value in info.measured]
    lines += [f"note:     {text}" for text in info.notes]
    lines += [f"segment:  {text}" for text in info.segments]
    lines += [f"kernel:   {source.name} sha256 {source.sha256}" for source in info.sources]
    lines.append(f"read by:  {info.toolkit}")
    return "\n".join(lines)


def record_jumps(records: RecordTable) -> tuple[float, float, float] | None:
    """Return the largest jumps of value, first and second derivative where one record hands over to the next.

    The jump is the length of the difference vector at the instant where the earlier record ends; angles are compared modulo a
    whole turn when they are angles, which is left to the caller to read: a kernel may wind an angle back from record to record.

    Returns:
        Three numbers in SI units, or None for a record table of one record.
    """
    rows = host_arrays(records)["rows"]
    if len(rows) < 2:
        return None
    left, right = rows[:-1], rows[1:]
    instant = left[:, -3] + left[:, -1]
    ends = [
        derivatives(side, records.series, ((instant - side[:, -3]) + (left[:, -2] - side[:, -2])) / side[:, -1]) for side in (left, right)
    ]
    jumps = [a - b for a, b in zip(*ends, strict=True)]
    turn = 2 * np.pi
    if np.abs(jumps[0]).max() > turn / 2 and np.abs(ends[0][0]).max() < 4 * turn:
        jumps[0] = jumps[0] - turn * np.round(jumps[0] / turn)
    first, second, third = (float(np.linalg.norm(jump, axis=1).max()) for jump in jumps)
    return first, second, third
