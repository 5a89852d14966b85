"""Making translation edges: extraction of polynomial records, composed where asked for, or a fit."""

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxframes.errors import NoPathError
from jaxframes.spice import accuracy
from jaxframes.spice.extraction import composing, joining
from jaxframes.spice.fitting import translation as fit
from jaxframes.spice.options import Tolerance, checked_layout, checked_size, checked_tolerance
from jaxframes.spice.reading.segment_paths import translation_links
from jaxframes.spice.reading.segments import Piece, Segment
from jaxframes.tables.info import EXTRACTION
from jaxframes.tables.instants import Instant, reference_day
from jaxframes.tables.naif_ids import labelled
from jaxframes.tables.records import HostRecordTable, in_metres
from jaxframes.tables.translation import TranslationTable

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels


@dataclass(frozen=True)
class Request:
    """What a translation edge is asked for; the arguments of ``Kernels.translation``."""

    target: str | int
    center: str | int
    frame: str
    start: Instant | None
    stop: Instant | None
    tolerance: Tolerance | None
    size: int | None
    layout: str
    correction: str
    compose: bool


@dataclass(frozen=True)
class Extracted:
    """Record tables in km with the pieces of segments and the notes that belong to them."""

    record_tables: list[HostRecordTable]
    pieces: list[Piece]
    notes: tuple[str, ...]


def translation(kernels: "Kernels", request: Request) -> TranslationTable:
    """Return the edge that ``Kernels.translation`` documents."""
    of, relative = kernels._body(request.target, "target"), kernels._body(request.center, "center")
    if of == relative:
        raise NoPathError(f"target and center are the same body, {labelled(kernels._name(of), of)}: use jf.edges.Fixed().")
    correction = fit.correction_named(request.correction)
    axes = kernels._inertial(request.frame, "frame")["name"]
    bounds = kernels._span(request.start, request.stop, "SPK", (of, relative))
    names = (kernels._name(of), of, kernels._name(relative), relative, axes)
    tolerance, size = checked_tolerance(request.tolerance), checked_size(request.size)
    fitted = tolerance is not None or size is not None
    layout = checked_layout(request.layout, fitted or correction != "NONE")
    if fitted or correction != "NONE":
        return fit.translation(kernels, names, bounds, tolerance, size, layout, correction)
    found = extracted(kernels, of, relative, axes, bounds)
    facts: dict[str, Any] = {"notes": found.notes}
    reference = reference_day(bounds[0])
    if request.compose and all(records.series == 3 for records in found.record_tables) and len(found.record_tables) > 1:
        record_tables = [composing.composed(found.record_tables, *(x - reference for x in bounds))]
        facts["method"] = f"{EXTRACTION}, {len(found.record_tables)} record tables composed in double-double"
    else:
        record_tables = [in_metres(records) for records in joining.combine(found.record_tables)]
    facts["measured"] = accuracy.positions(kernels, of, relative, axes, record_tables, reference, bounds)
    return kernels._table(TranslationTable, "translation", names, bounds, record_tables, found.pieces, facts)


def extracted(kernels: "Kernels", of: int, relative: int, axes: str, bounds: tuple[Fraction, Fraction]) -> Extracted:
    """Return the record tables from one body to another, in km, one for each link of the chain.

    Raises:
        NoPathError: If the bodies are not connected, or a segment is not made of polynomials.
        CoverageError: If the kernels do not cover the span.
    """
    record_tables, pieces, apart = list[HostRecordTable](), list[Piece](), list[float]()
    for sign, own in translation_links(of, relative, kernels._segments, *bounds, kernels._name):
        parts = [(piece, kernels._rotation(piece.segment, axes)) for piece in own]
        records, said = kernels._join(parts, sign, bounds[0])
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
