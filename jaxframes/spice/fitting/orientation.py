"""Fitted orientations: Chebyshev records of CSPICE's, for dynamic and switch frames, C-kernels of every type, chains of frames."""

from fractions import Fraction
from itertools import pairwise

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import CoverageError
from jaxframes.spice.assembly import assembled
from jaxframes.spice.fitting.candidates import Choice, Part
from jaxframes.spice.fitting.goal import Goal
from jaxframes.spice.fitting.rotation_model import RotationModel
from jaxframes.spice.fitting.smallest import smallest
from jaxframes.spice.fitting.translation import fit_note, serving_from
from jaxframes.spice.options import OrientationRequest
from jaxframes.spice.reading.ck_segments import GRACE
from jaxframes.spice.reading.coverage import TOUCHING, coverage_windows
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.naming import PCK, FrameFacts
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import CspiceError
from jaxframes.spice.reading.segments import Segment, kept_ends
from jaxframes.staging.arrays import default_float
from jaxframes.tables.attitude import CayleyTable
from jaxframes.tables.index import build_index
from jaxframes.tables.instants import reference_day, span_text, two_parts
from jaxframes.tables.records import HostRecordTable

NO_ANSWER = ("SPICE(NOFRAMECONNECT)", "SPICE(FRAMEDATANOTFOUND)", "SPICE(SPKINSUFFDATA)")


def orientation(pool: KernelPool, request: OrientationRequest) -> CayleyTable:
    """Return a fitted table.

    Raises:
        ToleranceError: If no table is as good.
        CoverageError: If CSPICE has no answer anywhere in the span, or nothing says how long the table is to be.
    """
    of, base = request.of, request.base
    assert request.tolerance is not None
    limits = request.tolerance.bounds("orientation")
    windows, files = coverage_windows(pool, of, base, request.start, request.stop)
    bounds = (windows[0].start, windows[-1].stop)
    parts, unit = _parts(pool, of, [(s.first, s.last) for s in windows])
    model = RotationModel(pool, of.name, base.name)
    aim = f"{of.name} relative to {base.name} over {span_text(*bounds)}"
    goal = Goal("orientation", limits, None, request.layout, aim)
    try:
        found = smallest(model, parts, unit, goal)
    except CspiceError as error:
        if error.short not in NO_ANSWER:
            raise
        raise CoverageError(f"CSPICE has no orientation of {aim}, at some instants at least: {error} Leave those out.") from error
    gaps = [(a.stop, b.start) for a, b in pairwise(windows) if b.start - a.stop > TOUCHING]
    records, spins = _records(found, reference_day(bounds[0]), kept_ends(_own(pool, of), *bounds))
    measured = (("angle error, rad", found.worst[0]), ("rate error, rad/s", found.worst[1]), model.acceleration(found))
    notes = [fit_note(goal, found, model.extras), *(f"gap: {span_text(*gap)}" for gap in gaps[:20])]
    notes += [f"{len(gaps)} gaps in all"] if gaps else []
    facts = {"method": f"{request.layout} fit of CSPICE's orientations, Cayley vectors", "measured": measured, "notes": tuple(notes)}
    spun = jnp.asarray(spins, default_float())
    return assembled(pool, CayleyTable, "cayley", request.names, bounds, [records], files, facts, spins=spun)


def _records(found: Choice, reference: int, kept: set[Fraction]) -> tuple[HostRecordTable, np.ndarray]:
    """Return the record table and the reference spins [n, 8]; a gap is a row whose length is NaN."""
    fitted, n = found.fitted, len(found.spans)
    rate = np.linalg.norm(fitted["spin"], axis=1)
    axis = np.where(rate[:, None] > 0, fitted["spin"] / np.where(rate > 0, rate, 1.0)[:, None], np.array([1.0, 0.0, 0.0]))
    spins = np.concatenate([fitted["q"], axis, rate[:, None] / 2], 1)
    hi = fitted["middle"] - reference
    back = hi - fitted["middle"]
    lo = (fitted["middle"] - (hi - back)) + (-float(reference) - back)
    series = fitted["c"][:, : found.degree + 1].reshape(n, -1)
    rows = np.concatenate([series, hi[:, None], lo[:, None], fitted["radius"][:, None]], 1)
    if found.grid is not None:
        origin, step = found.grid
        return HostRecordTable({"rows": rows, "grid": np.array([*two_parts(origin - reference), float(step)])}, 3, 0), spins
    starts, row_parts, spin_parts, at = [], [], [], 0
    nothing, still = np.zeros((1, rows.shape[1])), np.array([[1.0, 0, 0, 0, 1.0, 0, 0, 0]])
    nothing[0, -1] = np.nan
    for i in range(1, n + 1):
        if i == n or found.spans[i][0] - found.spans[i - 1][1] > TOUCHING:
            # After a gap, as long before the data as the gap is after them.
            begin = serving_from(found.spans[at][0], kept) - (GRACE if at else 0)
            starts += [begin - reference, *(serving_from(span[0], kept) - reference for span in found.spans[at + 1 : i])]
            row_parts.append(rows[at:i])
            spin_parts.append(spins[at:i])
            if i < n:
                starts.append(found.spans[i - 1][1] + GRACE - reference)
                row_parts.append(nothing)
                spin_parts.append(still)
            at = i
    index, compares = build_index(starts, found.spans[-1][1] - reference)
    return HostRecordTable({"rows": np.concatenate(row_parts), **index}, 3, compares), np.concatenate(spin_parts)


def _own(pool: KernelPool, of: FrameFacts) -> list[Segment]:
    """Return the segments of binary PCK files that orient a frame, or the one that it is fixed to."""
    frame = anchored(pool, of).frame
    return pool.pck_segments(frame.class_id) if frame.frame_class == PCK else []


def _parts(pool: KernelPool, of: FrameFacts, windows: list[tuple[Fraction, Fraction]]) -> tuple[list[Part], Fraction]:
    """Return the parts to fit, laid on the records of a binary PCK where one orients the frame, and the record length to start from."""
    own = _own(pool, of)
    cuts = sorted({Fraction(x) for s in own for x in (s.begin, s.end)})
    edges = [[a, *(c for c in cuts if a < c < b), b] for a, b in windows]
    pairs = [(a, b) for run in edges for a, b in pairwise(run)]
    if not own:
        return [Part(a, b, a) for a, b in pairs], max(b - a for a, b in windows)
    origin, length = min((s.grid()[:2] for s in own), key=lambda grid: grid[1])
    return [Part(a, b, Fraction(origin)) for a, b in pairs], Fraction(length)
