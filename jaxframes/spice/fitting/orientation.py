"""Orientation tables fitted to what CSPICE computes: dynamic and switch frames, C-kernels of every type, chains of frames."""

from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import CoverageError
from jaxframes.numerics import host_quaternions
from jaxframes.spice.extraction.ck_attitude import GRACE
from jaxframes.spice.fitting.candidates import DEGREES, Choice, Part
from jaxframes.spice.fitting.translation import made, served
from jaxframes.spice.fitting.translation_model import slopes, spread
from jaxframes.spice.fitting.uniform import search
from jaxframes.spice.options import Goal
from jaxframes.spice.reading.coverage import TOUCHING, stretches_of
from jaxframes.spice.reading.frame_chain import PCK, anchored
from jaxframes.spice.reading.process import CspiceError
from jaxframes.spice.reading.segments import Segment, late_instants
from jaxframes.staging.arrays import default_float
from jaxframes.tables.attitude import CayleyTable
from jaxframes.tables.host_evaluate import cayley_rates
from jaxframes.tables.index import build_index
from jaxframes.tables.instants import reference_day, span_text, two_parts
from jaxframes.tables.records import HostRecordTable

if TYPE_CHECKING:
    from jaxframes.spice.extraction.orientation import Request
    from jaxframes.spice.kernels import Kernels

NO_ANSWER = ("SPICE(NOFRAMECONNECT)", "SPICE(FRAMEDATANOTFOUND)", "SPICE(SPKINSUFFDATA)")
NODES = 19  # odd: one lies in the middle of the record
SLOPES = 300


class TurnModel:
    """Attitudes o_T_p and angular velocities in o axes, as the Cayley vector of the turn from a uniformly spinning reference."""

    extras = 8
    scale = 1.0

    def __init__(self, kernels: "Kernels", of: str, base: str):
        self.kernels, self.of, self.base = kernels, of, base

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return quaternions [m, 4] and angular velocities [m, 3] at epochs [m]."""
        doing = "computing orientations for a fit"
        matrices, rates = self.kernels._process.call("turns", self.of, self.base, times, doing=doing)
        return host_quaternions.from_matrices(matrices), rates

    def fit(self, a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
        """Return records between a and b: middles, radii, Cayley series [n, NODES, 3], quaternion and rate of the reference."""
        middle, radius, times = spread(a, b, NODES)
        q, w = self.sample(times.reshape(-1))
        q, w = q.reshape(*times.shape, 4), w.reshape(*times.shape, 3)
        fitted = {"middle": middle, "radius": radius, "q": q[:, NODES // 2], "spin": w.mean(1)}
        g = _offset(q, _reference(fitted, np.arange(len(a))[:, None], times))
        s = (times - middle[:, None]) / radius[:, None]
        basis = np.polynomial.chebyshev.chebvander(s, NODES - 1)
        return {**fitted, "c": np.linalg.solve(basis, g)}

    def errors(self, fitted: Any, which: np.ndarray, times: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return errors of angle and rate [2, degrees, m]."""
        radius = fitted["radius"][which]
        s = (times - fitted["middle"][which]) / radius
        c, chosen = fitted["c"][which], np.array(DEGREES)
        t = np.polynomial.chebyshev.chebvander(s, NODES - 1)
        g = np.cumsum(t[..., None] * c, 1)[:, chosen]
        rate = np.cumsum(slopes(s, NODES)[..., None] * c, 1)[:, chosen] / radius[:, None, None]
        true = _offset(values, _reference(fitted, which, times))[:, None]
        between = (g - true) - np.cross(g - true, true)
        angle = 2 * np.arctan2(np.linalg.norm(between, axis=2), 1 + (g * true).sum(2))
        w, _ = cayley_rates(g, rate, np.zeros_like(g), fitted["spin"][which][:, None])
        return np.stack([angle, np.linalg.norm(w - rates[:, None], axis=2)]).transpose(0, 2, 1)

    def acceleration(self, found: Choice) -> tuple[str, float]:
        """Return the largest difference of angular accelerations from differences of CSPICE's angular velocities."""
        rng, fitted = np.random.default_rng(2), found.fitted
        a, b = np.array([[float(x) for x in span] for span in found.spans]).T
        which = rng.integers(0, len(a), SLOPES)
        h = 2.0 ** np.floor(np.log2(np.maximum((b - a)[which] / 64, 1e-6)))
        times = (a + b)[which] / 2 + rng.uniform(-0.4, 0.4, SLOPES) * (b - a)[which]
        stencil = np.stack([times + k * h for k in (-2, -1, 1, 2)])
        _, w = self.sample(stencil.reshape(-1))
        w, d = w.reshape(4, -1, 3), stencil - times
        reference = (w[0] - 8 * w[1] + 8 * w[2] - w[3]) / (12 * (d[2] - d[1])[:, None] / 2)
        radius = fitted["radius"][which]
        s, c = (times - fitted["middle"][which]) / radius, fitted["c"][which][:, : found.degree + 1].transpose(1, 2, 0)
        chebyshev = np.polynomial.chebyshev
        g, g1, g2 = (chebyshev.chebval(s, chebyshev.chebder(c, k), tensor=False).T / radius[:, None] ** k for k in range(3))
        _, alpha = cayley_rates(g, g1, g2, fitted["spin"][which])
        name = f"angular acceleration error, rad/s2 (differences of CSPICE's rates, {h.min():.3g} s)"
        return name, float(np.linalg.norm(alpha - reference, axis=1).max())


def _reference(fitted: dict[str, np.ndarray], which: np.ndarray, times: np.ndarray) -> np.ndarray:
    spin = fitted["spin"][which] * (times - fitted["middle"][which])[..., None]
    return host_quaternions.multiply(host_quaternions.turned(spin), np.broadcast_to(fitted["q"][which], (*times.shape, 4)))


def _offset(q: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return Cayley vectors of q before a reference."""
    d = host_quaternions.multiply(q, host_quaternions.conjugate(reference))
    return d[..., 1:] / np.where(np.abs(d[..., :1]) < 1e-9, 1e-9, d[..., :1])


def orientation(kernels: "Kernels", request: "Request") -> CayleyTable:
    """Return a fitted table.

    Raises:
        ToleranceError: If no table is as good.
        CoverageError: If CSPICE has no answer anywhere in the span, or nothing says how long the table is to be.
    """
    of, base = request.of, request.base
    assert request.tolerance is not None
    limits = request.tolerance.bounds("orientation")
    stretches, files = stretches_of(kernels, request)
    bounds = (stretches[0].start, stretches[-1].stop)
    parts, unit = _parts(kernels, of, [(s.first, s.last) for s in stretches])
    model = TurnModel(kernels, of["name"], base["name"])
    aim = f"{of['name']} relative to {base['name']} over {span_text(*bounds)}"
    goal = Goal("orientation", limits, None, request.layout, aim)
    try:
        found = search(model, parts, unit, goal)
    except CspiceError as error:
        if error.short not in NO_ANSWER:
            raise
        raise CoverageError(f"CSPICE has no orientation of {aim}, at some instants at least: {error} Leave those out.") from error
    gaps = [(a.stop, b.start) for a, b in pairwise(stretches) if b.start - a.stop > TOUCHING]
    records, spins = _records(found, reference_day(bounds[0]), late_instants(_own(kernels, of), *bounds))
    measured = (("angle error, rad", found.worst[0]), ("rate error, rad/s", found.worst[1]), model.acceleration(found))
    notes = [made(goal, found, model.extras), *(f"gap: {span_text(*gap)}" for gap in gaps[:20])]
    notes += [f"{len(gaps)} gaps in all"] if gaps else []
    facts = {"method": f"{request.layout} fit of CSPICE's orientations, Cayley vectors", "measured": measured, "notes": tuple(notes)}
    names = (of["name"], of["id"], base["name"], base["id"], base["name"])
    spun = jnp.asarray(spins, default_float())
    return kernels._table(CayleyTable, "cayley", names, bounds, [records], files, facts, spins=spun)


def _records(found: Choice, reference: int, late: set[Fraction]) -> tuple[HostRecordTable, np.ndarray]:
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
            begin = served(found.spans[at][0], late) - (GRACE if at else 0)  # after a gap, as long before the data as the gap is after them
            starts += [begin - reference, *(served(span[0], late) - reference for span in found.spans[at + 1 : i])]
            row_parts.append(rows[at:i])
            spin_parts.append(spins[at:i])
            if i < n:
                starts.append(found.spans[i - 1][1] + GRACE - reference)
                row_parts.append(nothing)
                spin_parts.append(still)
            at = i
    index, compares = build_index(starts, found.spans[-1][1] - reference)
    return HostRecordTable({"rows": np.concatenate(row_parts), **index}, 3, compares), np.concatenate(spin_parts)


def _own(kernels: "Kernels", of: dict[str, Any]) -> list[Segment]:
    """Return the segments of binary PCK files that orient a frame, or the one that it is fixed to."""
    axes = anchored(kernels, of).axes
    return [s for s in kernels._segments if s.kind == "PCK" and s.body == axes["class_id"]] if axes["class"] == PCK else []


def _parts(kernels: "Kernels", of: dict[str, Any], stretches: list[tuple[Fraction, Fraction]]) -> tuple[list[Part], Fraction]:
    """Return the parts to fit, laid on the records of a binary PCK where one orients the frame, and the record length to start from."""
    own = _own(kernels, of)
    cuts = sorted({Fraction(x) for s in own for x in (s.begin, s.end)})
    edges = [[a, *(c for c in cuts if a < c < b), b] for a, b in stretches]
    pairs = [(a, b) for run in edges for a, b in pairwise(run)]
    if not own:
        return [Part(a, b, a) for a, b in pairs], max(b - a for a, b in stretches)
    origin, length = min((s.grid()[:2] for s in own), key=lambda grid: grid[1])
    return [Part(a, b, Fraction(origin)) for a, b in pairs], Fraction(length)
