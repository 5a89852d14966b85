"""Fitted translations: Chebyshev records of what CSPICE computes, for any segment type, any pair of bodies, corrected states."""

import contextlib
import functools
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np

from jaxframes.errors import BadKernelError, CoverageError, FrameError, NoPathError
from jaxframes.spice.assembly import assembled
from jaxframes.spice.extraction.node_segments import node_grid
from jaxframes.spice.extraction.read_records import POLYNOMIAL
from jaxframes.spice.extraction.translation import extracted
from jaxframes.spice.fitting.candidates import Choice, Part, table_bytes
from jaxframes.spice.fitting.goal import Goal
from jaxframes.spice.fitting.translation_model import TranslationModel, choose_fit_variable
from jaxframes.spice.options import TranslationRequest
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import CspiceError
from jaxframes.spice.reading.segment_paths import Walk, translation_links
from jaxframes.spice.reading.segments import Piece, Segment, kept_ends
from jaxframes.tables.index import AFTER_END, build_index
from jaxframes.tables.instants import reference_day, span_text, two_parts
from jaxframes.tables.records import HostRecordTable, RecordTable, in_metres
from jaxframes.tables.report import record_jumps
from jaxframes.tables.translation import TranslationTable

SLOPES = 400  # epochs at which accelerations are compared
NODES = (8, 9, 12, 13, 18)  # types of segments that interpolate between nodes
MOST_JUMPS = 200_000  # records of the kernel whose jumps are looked at


def translation(pool: KernelPool, request: TranslationRequest) -> TranslationTable:
    """Return a fitted table.

    Raises:
        ToleranceError: If no table is as good, or as small.
        NoPathError: If nothing says how good or how small it is to be.
        CoverageError: If CSPICE has no answer somewhere in the span.
    """
    names, bounds, tolerance, size, correction = request.names, request.bounds, request.tolerance, request.size, request.correction
    _, of, _, relative, axes = names
    limits = (np.inf, np.inf) if tolerance is None else tolerance.bounds("translation")
    if tolerance is None and size is None:
        raise NoPathError(f"correction={correction!r} needs a fit: give tolerance=jf.spice.Tolerance(position=...) or size=.")
    segments = involved(pool, of, relative, bounds, correction)
    parts, unit = native_grid(pool, of, relative, bounds, segments, correction)
    aim = f"{names[0]} relative to {names[2]} over {span_text(*bounds)}"
    goal = Goal("translation", limits, size, request.layout, aim)
    try:
        make = functools.partial(TranslationModel, pool, of, relative, axes, correction)
        model, found, notes = choose_fit_variable(make, parts, unit, goal)
    except CspiceError as error:
        if error.short == "SPICE(SPKINSUFFDATA)":
            translation_links(of, relative, pool.segments, *bounds, pool.body_name)  # says more, if the chain itself has a gap
            raise CoverageError(f"The kernels loaded do not cover {aim}, with what its correction needs: {error}") from error
        raise
    measured = {"position error, m": found.worst[0], "velocity error, m/s": found.worst[1]}
    measured |= dict([acceleration(model, found, bounds)])
    if correction == "NONE" and all((s.kind, s.type) in POLYNOMIAL for s in segments):
        with contextlib.suppress(FrameError):  # a chain that changes its centres, say: CSPICE follows it, extraction does not
            measured |= jumps(extracted(pool, of, relative, axes, bounds).record_tables)
    how = "positions" if model.positions else "velocities"
    facts = {
        "method": f"{request.layout} fit of CSPICE's {how}" + (f", {correction}" if correction != "NONE" else ""),
        "correction": correction,
        "measured": tuple(measured.items()),
        "notes": (fit_note(goal, found, model.extras), *notes),
    }
    kept = kept_ends(segments, *bounds)
    records = host_records(found, model.coefficients(found.fitted, found.degree), reference_day(bounds[0]), kept)
    pieces = [Piece(s, max(Fraction(s.begin), bounds[0]), min(Fraction(s.end), bounds[1])) for s in segments]
    return assembled(pool, TranslationTable, "translation", names, bounds, [records], pieces, facts)


def fit_note(goal: Goal, found: Choice, extras: int) -> str:
    """Return the line of the report that says what was asked for and what came of it."""
    records = f"{len(found.spans)} records of degree {found.degree}, {table_bytes(found, extras)} bytes in float64"
    return f"asked for {goal.asked()}; {records}, checked at independent epochs"


def host_records(found: Choice, coefficients: np.ndarray, reference: int, kept: set[Fraction]) -> HostRecordTable:
    """Return the record table of chosen records; a uniform grid where there is one."""
    n = len(found.spans)
    hi = found.fitted["middle"] - reference
    back = hi - found.fitted["middle"]
    lo = (found.fitted["middle"] - (hi - back)) + (-float(reference) - back)
    rows = np.concatenate([coefficients.reshape(n, -1), hi[:, None], lo[:, None], found.fitted["radius"][:, None]], 1)
    if found.grid is not None:
        origin, step = found.grid
        return HostRecordTable({"rows": rows, "grid": np.array([*two_parts(origin - reference), float(step)])}, 3, 0)
    index, compares = build_index([serving_from(a, kept) - reference for a, _ in found.spans], found.spans[-1][1] - reference)
    return HostRecordTable({"rows": rows, **index}, 3, compares)


def serving_from(start: Fraction, kept: set[Fraction]) -> Fraction:
    """Return from when on a record that starts at an instant serves: from after it, where the segment before keeps it (``kept_ends``)."""
    return start + (AFTER_END if start in kept else 0)


def involved(pool: KernelPool, of: int, relative: int, bounds: tuple[Fraction, Fraction], correction: str) -> list[Segment]:
    """Return the SPK segments of all bodies on the ways from two bodies towards the barycentre that touch the span."""
    todo, seen, found = [of, relative], set(), []
    while todo:
        body = todo.pop()
        if body in seen:
            continue
        seen.add(body)
        own = [s for s in pool.segments if s.kind == "SPK" and s.body == body and s.begin <= bounds[1] and s.end >= bounds[0]]
        todo += [s.center for s in own]
        found += own
    if not found:
        translation_links(of, relative, pool.segments, *bounds, pool.body_name)  # says what is missing
    if correction != "NONE":
        with contextlib.suppress(NoPathError):  # a chain that changes its centres
            for walk in (Walk(body, pool.segments, *bounds, pool.body_name) for body in (of, relative)):
                for segment in (piece.segment for link in walk.links for piece in link):
                    if segment.type in (2, 3):
                        segment.grid()  # says so if it is damaged: CSPICE may take what lies beyond its end for data
        return found
    try:
        links = translation_links(of, relative, pool.segments, *bounds, pool.body_name)
    except NoPathError:
        return found
    used = {id(piece.segment) for _, link in links for piece in link}
    return [s for s in found if id(s) in used]


def native_grid(
    pool: KernelPool, of: int, relative: int, bounds: tuple[Fraction, Fraction], segments: list[Segment], correction: str
) -> tuple[list[Part], Fraction]:
    """Return the parts to fit by themselves and the record length to start from: laid on the kernel's own records."""
    start, stop = bounds
    cuts = {start, stop} | {Fraction(x) for s in segments for x in (s.begin, s.end) if start < Fraction(x) < stop}
    edges = sorted(cuts)
    edges = [edges[0], *(b for a, b in pairwise(edges) if b - a > Fraction(1, 1000))]
    edges[-1] = stop
    grids = [grid for s in segments if (grid := own_grid(pool, s)) is not None] if correction == "NONE" else []
    if not grids:
        return [Part(a, b, a) for a, b in pairwise(edges)], stop - start
    origin, unit = min(grids, key=lambda grid: grid[1])
    return [Part(a, b, origin) for a, b in pairwise(edges)], unit


def own_grid(pool: KernelPool, segment: Segment) -> tuple[Fraction, Fraction] | None:
    """Return an edge of a segment's own records, or of its nodes, and the length of these; None if it has no even ones."""
    if segment.type in (2, 3):
        origin, length, _, _ = segment.grid()
        return Fraction(origin), Fraction(length)
    if segment.type in NODES:
        with contextlib.suppress(BadKernelError, TypeError, ValueError, OverflowError):  # what CSPICE makes of it, it says itself
            return node_grid(pool, segment)
    return None


def acceleration(model: TranslationModel, found: Choice, bounds: tuple[Fraction, Fraction]) -> tuple[str, float]:
    """Return the largest difference of accelerations from differences of CSPICE's velocities, and what it was taken over."""
    rng = np.random.default_rng(2)
    fitted = found.fitted
    which = rng.integers(0, len(fitted["middle"]), SLOPES)
    middle, radius = fitted["middle"][which], fitted["radius"][which]
    h = 2.0 ** np.floor(np.log2(np.maximum(radius / 32, 1e-3)))
    times = np.round((middle + rng.uniform(-0.9, 0.9, SLOPES) * radius) / h) * h
    inside = (times - 2 * h > float(bounds[0])) & (times + 2 * h < float(bounds[1]))
    which, middle, radius, h, times = (x[inside] for x in (which, middle, radius, h, times))
    if not len(times):
        return "acceleration error, m/s2", float("nan")
    _, v = model.sample(np.concatenate([times + k * h for k in (-2, -1, 1, 2)]))
    a = v.reshape(4, -1, 3)
    reference = (a[0] - 8 * a[1] + 8 * a[2] - a[3]) / (12 * h[:, None])
    series = model.coefficients(fitted, found.degree)[which]
    second = np.polynomial.chebyshev.chebder(series, 2, axis=1)
    mine = np.polynomial.chebyshev.chebval((times - middle) / radius, second.transpose(1, 2, 0), tensor=False).T / radius[:, None] ** 2
    return f"acceleration error, m/s2 (differences of CSPICE's velocities, {h.min():.3g} s)", float(
        np.linalg.norm(mine - reference, axis=1).max()
    )


def jumps(record_tables: list[HostRecordTable]) -> dict[str, float]:
    """Return the largest jumps at the edges of the kernel's own records, SI units, by what they are."""
    found = np.zeros(3)
    for records in record_tables:
        rows = in_metres(records).arrays["rows"]
        if len(rows) > MOST_JUMPS:
            return {}
        own: Any = RecordTable(rows, records.arrays["grid"], None, None, records.series, records.compares)  # pyright: ignore[reportArgumentType]
        sizes = record_jumps(own)
        found = np.maximum(found, sizes if sizes is not None else 0.0)
    units = ("position, m", "velocity, m/s", "acceleration, m/s2")
    return {f"kernel's own jumps in {unit}": float(jump) for unit, jump in zip(units, found, strict=True)}
