"""Tables assembled from records on the host, with the facts about the kernels that they were made of."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar

from jaxframes.spice.reading.kernel_files import sha256
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segments import Piece
from jaxframes.tables.base import Table
from jaxframes.tables.info import Info, Source, decimal
from jaxframes.tables.instants import pairs, reference_day
from jaxframes.tables.records import HostRecordTable, to_record_table
from jaxframes.tables.translation import TranslationTable

T = TypeVar("T", bound=Table)


def assembled(
    pool: KernelPool,
    table: type[T],
    kind: str,
    names: tuple[str, int, str, int, str],
    bounds: tuple[Fraction, Fraction],
    record_tables: Sequence[HostRecordTable],
    used: Sequence[Piece | Path],
    facts: dict[str, Any] | None = None,
    **fields: Any,
) -> T:
    """Return a table.

    Args:
        pool: The kernels.
        table: Its class.
        kind: Its kind, as ``Info`` says it.
        names: Name and id of what it is of, name and id of what that is relative to, name of the axes.
        bounds: The span.
        record_tables: Its record tables, SI units, times past the last whole day before the start.
        used: The pieces of segments, or the files, that its numbers come from.
        facts: Further fields of ``Info``.
        fields: Further fields of the table.
    """
    reference = Fraction(reference_day(bounds[0]))
    pieces = [piece for piece in used if isinstance(piece, Piece)]
    files = sorted({p if isinstance(p, Path) else Path(p.segment.path) for p in used}) + pool.text
    lines = tuple(dict.fromkeys(f"{piece.segment.describe()}, frame id {piece.segment.frame}" for piece in pieces))
    info = Info(
        kind,
        *names,
        *(decimal(x) for x in (*bounds, reference)),
        sources=tuple(Source(f.name, sha256(f)) for f in files),
        toolkit=pool.version(),
        **{"segments": lines, **(facts or {})},
    )
    low = table is TranslationTable
    fields["record_tables"] = tuple(to_record_table(r.arrays, r.series, r.compares, low=low) for r in record_tables)
    return table(**fields, reference=pairs(reference), span=pairs(*(x - reference for x in bounds)), info=info)  # pyright: ignore[reportCallIssue]
