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
from jaxframes.spice.reading.segment_paths import translation_legs
from jaxframes.spice.reading.segments import Piece, Segment
from jaxframes.tables.base import TranslationTable
from jaxframes.tables.info import EXTRACTION
from jaxframes.tables.instants import Instant, reference_day
from jaxframes.tables.naif_ids import labelled
from jaxframes.tables.records import HostLeg, in_metres

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
    """Legs in km with the pieces of segments and the notes that belong to them."""

    legs: list[HostLeg]
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
    if request.compose and all(leg.series == 3 for leg in found.legs) and len(found.legs) > 1:
        legs = [composing.composed(found.legs, *(x - reference for x in bounds))]
        facts["method"] = f"{EXTRACTION}, {len(found.legs)} legs composed in double-double"
    else:
        legs = [in_metres(leg) for leg in joining.combine(found.legs)]
    facts["measured"] = accuracy.positions(kernels, of, relative, axes, legs, reference, bounds)
    return kernels._table(TranslationTable, "translation", names, bounds, legs, found.pieces, facts)


def extracted(kernels: "Kernels", of: int, relative: int, axes: str, bounds: tuple[Fraction, Fraction]) -> Extracted:
    """Return the legs from one body to another, in km, one for each link of the chain.

    Raises:
        NoPathError: If the bodies are not connected, or a segment is not made of polynomials.
        CoverageError: If the kernels do not cover the span.
    """
    legs, pieces, apart = list[HostLeg](), list[Piece](), list[float]()
    for sign, own in translation_legs(of, relative, kernels._segments, *bounds, kernels._name):
        parts = [(piece, kernels._rotation(piece.segment, axes)) for piece in own]
        leg, said = kernels._join(parts, sign, bounds[0])
        legs.append(leg)
        pieces += own
        apart += said
    return Extracted(legs, pieces, _velocities(pieces, apart))


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
