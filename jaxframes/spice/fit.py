"""Translation tables fitted to what CSPICE computes: any segment type, any pair of bodies, corrected states."""

import contextlib
from fractions import Fraction
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxframes.errors import CoverageError, FrameError, NoPathError, suggest
from jaxframes.spice import build
from jaxframes.spice.extract import POLYNOMIAL
from jaxframes.spice.paths import Walk, translation_legs
from jaxframes.spice.process import CspiceError
from jaxframes.spice.report import record_jumps
from jaxframes.spice.search import DEGREES, Choice, Part, Tolerance, record_bytes, search
from jaxframes.spice.segments import Piece, Segment
from jaxframes.spice.tables import TranslationTable
from jaxframes.spice.times import reference_day, span_text, two_parts

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

CORRECTIONS = ("NONE", "CN", "CN+S", "XCN", "XCN+S", "LT", "LT+S", "XLT", "XLT+S")
NODES = 18  # of a record; the velocity series has as many terms before it is cut
SLOPES = 400  # epochs at which accelerations are compared
MOST_JUMPS = 200_000  # records of the kernel whose jumps are looked at


def correction_named(name: str) -> str:
    """Return a correction's name as SPICE spells it.

    Raises:
        NoPathError: If there is none of this name.
    """
    found = str(name).upper().replace(" ", "")
    if found not in CORRECTIONS:
        raise NoPathError(f"correction={name!r} is none of SPICE's.{suggest(found, CORRECTIONS)}")
    return found


class StateModel:
    """Positions and velocities of a body, in m and m/s.

    Velocities are interpolated and integrated, the constant is the mean residual of the positions: accelerations come out better than
    from interpolated positions. With ``positions`` the positions are interpolated, for corrections whose velocities in SPICE are not
    the derivatives of the positions ('LT'). SPICE takes an epoch as one double: the epochs sampled are doubles, and each record is
    interpolated at them and not at the ideal nodes, so that the rounding of epochs (6e-8 s, 6e-5 m for the Moon) is nowhere in the fit.
    """

    kind = "translation"
    extras = 0

    def __init__(self, kernels: "Kernels", of: int, relative: int, axes: str, correction: str):
        self.arguments = (of, relative, axes)
        self.kernels, self.correction = kernels, correction
        self.positions = "LT" in correction
        self.scale = 0.0

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities [m, 3] at epochs [m]."""
        doing = "computing states for a fit"
        states = self.kernels._process.call("states", *self.arguments, times, self.correction, doing=doing) * build.METRES
        self.scale = max(self.scale, float(np.abs(states[:, :3]).max()))
        return states[:, :3], states[:, 3:]

    def fit(self, a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
        """Return records between a and b: middles, radii, coefficients [n, NODES, 3], and the constants [n, degrees, 3]."""
        middle, radius, times = spread(a, b, NODES)
        position, velocity = (x.reshape(*times.shape, 3) for x in self.sample(times.reshape(-1)))
        s = (times - middle[:, None]) / radius[:, None]
        basis = np.moveaxis(np.polynomial.chebyshev.chebvander(s, NODES - 1), -1, 2)
        coefficients = np.linalg.solve(basis, position if self.positions else velocity)
        if self.positions:
            return {"middle": middle, "radius": radius, "c": coefficients}
        parts = np.cumsum(integrals(s)[..., None] * coefficients[:, None], 2) * radius[:, None, None, None]
        used = parts[:, :, np.array(DEGREES) - 1]
        constant = (position[:, :, None] - used).mean(1)
        return {"middle": middle, "radius": radius, "c": coefficients, "constant": constant}

    def errors(self, fitted: Any, which: np.ndarray, times: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return errors of position and velocity [2, degrees, m]."""
        radius = fitted["radius"][which]
        s = (times - fitted["middle"][which]) / radius
        c = fitted["c"][which]
        t = np.polynomial.chebyshev.chebvander(s, NODES - 1)
        chosen = np.array(DEGREES)
        if self.positions:
            position = np.cumsum(t[..., None] * c, 1)[:, chosen]
            rate = np.cumsum(slopes(s, NODES)[..., None] * c, 1)[:, chosen] / radius[:, None, None]
        else:
            position = np.cumsum(integrals(s)[..., None] * c, 1)[:, chosen - 1] * radius[:, None, None] + fitted["constant"][which]
            rate = np.cumsum(t[..., None] * c, 1)[:, chosen - 1]
        found = [np.linalg.norm(x - y[:, None], axis=2) for x, y in ((position, values), (rate, rates))]
        return np.stack(found).transpose(0, 2, 1)

    def coefficients(self, fitted: Any, degree: int) -> np.ndarray:
        """Return the position series [n, degree + 1, 3] of a degree."""
        if self.positions:
            return fitted["c"][:, : degree + 1]
        whole = np.polynomial.chebyshev.chebint(fitted["c"][:, :degree], axis=1, lbnd=0) * fitted["radius"][:, None, None]
        whole[:, 0] += fitted["constant"][:, DEGREES.index(degree)]
        return whole


def spread(a: np.ndarray, b: np.ndarray, nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return middles and radii [n] of records and epochs [n, nodes], doubles near the zeros of a Chebyshev polynomial."""
    middle = a + (b - a) / 2
    radius = np.maximum(b - middle, middle - a)
    s = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
    if nodes % 2:
        s[nodes // 2] = 0.0
    return middle, radius, np.clip(middle[:, None] + radius[:, None] * s, a[:, None], b[:, None])


def integrals(s: np.ndarray) -> np.ndarray:
    """Return the integrals from 0 to s of T_0 .. T_{NODES-1}, [..., NODES]."""
    t = np.polynomial.chebyshev.chebvander(s, NODES)
    zero = np.polynomial.chebyshev.chebvander(np.zeros(1), NODES)[0]
    k = np.arange(2, NODES)
    out = np.empty((*s.shape, NODES))
    out[..., 0], out[..., 1] = s, s * s / 2
    out[..., 2:] = (t[..., k + 1] - zero[k + 1]) / (2 * (k + 1)) - (t[..., k - 1] - zero[k - 1]) / (2 * (k - 1))
    return out


def slopes(s: np.ndarray, count: int) -> np.ndarray:
    """Return the derivatives of T_0 .. T_{count-1} at s, [..., count]."""
    return np.stack([np.polynomial.chebyshev.chebval(s, np.polynomial.chebyshev.chebder(row)) for row in np.eye(count)], -1)


def translation(
    kernels: "Kernels",
    names: tuple[str, int, str, int, str],
    bounds: tuple[Fraction, Fraction],
    tolerance: Tolerance | None,
    size: int | None,
    layout: str,
    correction: str,
) -> TranslationTable:
    """Return a fitted table; the arguments are those of ``Kernels.translation``, looked up.

    Raises:
        ToleranceError: If no table is as good, or as small.
        CoverageError: If CSPICE has no answer somewhere in the span.
    """
    from jaxframes.spice.translate import extracted

    _, of, _, relative, axes = names
    limits = (np.inf, np.inf) if tolerance is None else tolerance.bounds("translation")
    if tolerance is None and size is None:
        raise NoPathError(f"correction={correction!r} needs a fit: give tolerance=jf.spice.Tolerance(position=...) or size=.")
    segments = involved(kernels, of, relative, bounds, correction)
    parts, unit = native_grid(kernels, of, relative, bounds, segments, correction)
    model = StateModel(kernels, of, relative, axes, correction)
    aim = f"{names[0]} relative to {names[2]} over {span_text(*bounds)}"
    try:
        found = search(model, parts, unit, limits, size, layout, aim)
    except CspiceError as error:
        if error.short == "SPICE(SPKINSUFFDATA)":
            translation_legs(of, relative, kernels._segments, *bounds, kernels._name)  # says more, if the chain itself has a gap
            raise CoverageError(f"The kernels loaded do not cover {aim}, with what its correction needs: {error}") from error
        raise
    measured = {"position error, m": found.worst[0], "velocity error, m/s": found.worst[1]}
    measured |= dict([acceleration(model, found, bounds)])
    if correction == "NONE" and all((s.kind, s.type) in POLYNOMIAL for s in segments):
        with contextlib.suppress(FrameError):  # a chain that changes its centres, say: CSPICE follows it, extraction does not
            measured |= jumps(extracted(kernels, of, relative, axes, bounds).legs)
    how = "positions" if model.positions else "velocities"
    facts = {
        "method": f"{layout} fit of CSPICE's {how}" + (f", {correction}" if correction != "NONE" else ""),
        "correction": correction,
        "measured": tuple(measured.items()),
        "notes": (wanted(limits, size, found, model.extras),),
    }
    leg = host_leg(found, model.coefficients(found.fitted, found.degree), reference_day(bounds[0]))
    pieces = [Piece(s, max(Fraction(s.begin), bounds[0]), min(Fraction(s.end), bounds[1])) for s in segments]
    return kernels._table(TranslationTable, "translation", names, bounds, [leg], pieces, facts)


def wanted(limits: tuple[float, float], size: int | None, found: Choice, extras: int) -> str:
    """Return the line of the report that says what was asked for."""
    asked = [f"{name} within {limit:.3g}" for name, limit in zip(("value", "rate"), limits, strict=True) if np.isfinite(limit)]
    asked += [f"at most {size} bytes" if size is not None else ""]
    made = f"{len(found.spans)} records of degree {found.degree}, {len(found.spans) * record_bytes(found.degree, extras)} bytes in float64"
    return f"asked for {', '.join(a for a in asked if a)}; {made}, checked at independent epochs"


def host_leg(found: Choice, coefficients: np.ndarray, reference: int) -> build.HostLeg:
    """Return the leg of chosen records; a uniform grid where there is one."""
    n = len(found.spans)
    hi = found.fitted["middle"] - reference
    back = hi - found.fitted["middle"]
    lo = (found.fitted["middle"] - (hi - back)) + (-float(reference) - back)
    rows = np.concatenate([coefficients.reshape(n, -1), hi[:, None], lo[:, None], found.fitted["radius"][:, None]], 1)
    if found.grid is not None:
        origin, step = found.grid
        return build.HostLeg({"rows": rows, "grid": np.array([*two_parts(origin - reference), float(step)])}, 3, 0)
    index, compares = build.index([a - reference for a, _ in found.spans], found.spans[-1][1] - reference)
    return build.HostLeg({"rows": rows, **index}, 3, compares)


def involved(kernels: "Kernels", of: int, relative: int, bounds: tuple[Fraction, Fraction], correction: str) -> list[Segment]:
    """Return the SPK segments of all bodies on the ways from two bodies towards the barycentre that touch the span."""
    todo, seen, found = [of, relative], set(), []
    while todo:
        body = todo.pop()
        if body in seen:
            continue
        seen.add(body)
        own = [s for s in kernels._segments if s.kind == "SPK" and s.body == body and s.begin <= bounds[1] and s.end >= bounds[0]]
        todo += [s.center for s in own]
        found += own
    if not found:
        translation_legs(of, relative, kernels._segments, *bounds, kernels._name)  # says what is missing
    if correction != "NONE":
        with contextlib.suppress(NoPathError):  # a chain that changes its centres
            for walk in (Walk(body, kernels._segments, *bounds, kernels._name) for body in (of, relative)):
                for segment in (piece.segment for leg in walk.legs for piece in leg):
                    if segment.type in (2, 3):
                        segment.grid()  # says so if it is damaged: CSPICE may take what lies beyond its end for data
        return found
    try:
        legs = translation_legs(of, relative, kernels._segments, *bounds, kernels._name)
    except NoPathError:
        return found
    used = {id(piece.segment) for _, leg in legs for piece in leg}
    return [s for s in found if id(s) in used]


def native_grid(
    kernels: "Kernels", of: int, relative: int, bounds: tuple[Fraction, Fraction], segments: list[Segment], correction: str
) -> tuple[list[Part], Fraction]:
    """Return the parts to fit by themselves and the record length to start from: laid on the kernel's own records."""
    start, stop = bounds
    cuts = {start, stop} | {Fraction(x) for s in segments for x in (s.begin, s.end) if start < Fraction(x) < stop}
    edges = sorted(cuts)
    edges = [edges[0], *(b for a, b in pairwise(edges) if b - a > Fraction(1, 1000))]
    edges[-1] = stop
    grids = [s.grid()[:2] for s in segments if s.type in (2, 3)] if correction == "NONE" else []
    if not grids:
        return [Part(a, b, a) for a, b in pairwise(edges)], stop - start
    origin, unit = min(grids, key=lambda grid: grid[1])
    return [Part(a, b, Fraction(origin)) for a, b in pairwise(edges)], Fraction(unit)


def acceleration(model: StateModel, found: Choice, bounds: tuple[Fraction, Fraction]) -> tuple[str, float]:
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


def jumps(legs: list[build.HostLeg]) -> dict[str, float]:
    """Return the largest jumps at the edges of the kernel's own records, SI units, by what they are."""
    from jaxframes.spice.legs import Leg

    found = np.zeros(3)
    for leg in legs:
        rows = build.in_metres(leg).arrays["rows"]
        if len(rows) > MOST_JUMPS:
            return {}
        own: Any = Leg(rows, leg.arrays["grid"], None, None, leg.series, leg.compares)  # pyright: ignore[reportArgumentType]
        sizes = record_jumps(own)
        found = np.maximum(found, sizes if sizes is not None else 0.0)
    units = ("position, m", "velocity, m/s", "acceleration, m/s2")
    return {f"kernel's own jumps in {unit}": float(jump) for unit, jump in zip(units, found, strict=True)}
