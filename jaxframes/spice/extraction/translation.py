"""Extraction of translations: the polynomial records of SPK segments along the chain from one body to another."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from jaxframes.spice import accuracy
from jaxframes.spice.assembly import assembled
from jaxframes.spice.extraction import composing, joining
from jaxframes.spice.options import TranslationRequest
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segment_paths import translation_links
from jaxframes.spice.reading.segments import Piece, Segment
from jaxframes.tables.info import EXTRACTION
from jaxframes.tables.instants import reference_day
from jaxframes.tables.records import HostRecordTable, in_metres
from jaxframes.tables.translation import TranslationTable


@dataclass(frozen=True)
class Extracted:
    """Record tables in km with the pieces of segments and the notes that belong to them."""

    record_tables: list[HostRecordTable]
    pieces: list[Piece]
    notes: tuple[str, ...]


def translation(pool: KernelPool, request: TranslationRequest) -> TranslationTable:
    """Return the table of the records that the kernels hold, exact to rounding.

    Raises:
        NoPathError: If the bodies are not connected, or a segment is not made of polynomials.
        CoverageError: If the kernels do not cover the span.
    """
    (_, of, _, relative, axes), bounds = request.names, request.bounds
    found = extracted(pool, of, relative, axes, bounds)
    facts: dict[str, Any] = {"notes": found.notes}
    reference = reference_day(bounds[0])
    if request.compose and all(records.series == 3 for records in found.record_tables) and len(found.record_tables) > 1:
        record_tables = [composing.composed(found.record_tables, *(x - reference for x in bounds))]
        facts["method"] = f"{EXTRACTION}, {len(found.record_tables)} record tables composed in double-double"
    else:
        record_tables = [in_metres(records) for records in joining.combine(found.record_tables)]
    facts["measured"] = accuracy.positions(pool, of, relative, axes, record_tables, reference, bounds)
    return assembled(pool, TranslationTable, "translation", request.names, bounds, record_tables, found.pieces, facts)


def extracted(pool: KernelPool, of: int, relative: int, axes: str, bounds: tuple[Fraction, Fraction]) -> Extracted:
    """Return the record tables from one body to another, in km, one for each link of the chain.

    Raises:
        NoPathError: If the bodies are not connected, or a segment is not made of polynomials.
        CoverageError: If the kernels do not cover the span.
    """
    record_tables, pieces, apart = list[HostRecordTable](), list[Piece](), list[float]()
    for sign, own in translation_links(of, relative, pool.segments, *bounds, pool.body_name):
        parts = [(piece, joining.segment_rotation(pool, piece.segment, axes)) for piece in own]
        records, said = joining.join_pieces(pool, parts, sign, bounds[0])
        record_tables.append(records)
        pieces += own
        apart += said
    return Extracted(record_tables, pieces, _velocities(pieces, apart))


def _velocities(pieces: list[Piece], apart: list[float]) -> tuple[str, ...]:
    """Return a line for each file in which SPICE's velocities are not the derivatives of its positions."""
    worst: dict[tuple[str, int, int], dict[Segment, float]] = {}
    for piece, size in zip(pieces, apart, strict=True):
        if size:
            own = worst.setdefault((Path(piece.segment.path).name, piece.segment.type, piece.segment.body), {})
            own[piece.segment] = max(size, own.get(piece.segment, 0.0))
    return tuple(
        f"{len(sizes)} segment{'s' if len(sizes) > 1 else ''} (type {kind}, id {body}) of {name}: "
        f"SPICE's own velocities differ by up to {max(sizes.values()):.2g} m/s"
        for (name, kind, body), sizes in worst.items()
    )
