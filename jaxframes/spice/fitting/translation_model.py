"""The model of a fitted translation: positions and velocities of CSPICE sampled, fitted, their errors; and which of the two is fitted."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from jaxframes.spice.fitting.candidates import DEGREES, Choice, Part, table_bytes
from jaxframes.spice.fitting.goal import Goal, UnmetError
from jaxframes.spice.fitting.smallest import smallest
from jaxframes.spice.reading.pool import KernelPool

NODES = 18  # of a record; the velocity series has as many terms before it is cut
MUCH = 10.0  # times better must a fit of the positions be to be preferred, where nothing says how good the velocity shall be
LARGER = 3.0  # times the bytes of a fit of the positions may a fit of the velocities take
SAMPLES = 64


class TranslationModel:
    """Positions and velocities of a body, in m and m/s.

    Velocities are interpolated and integrated, the constant is the mean residual of the positions: accelerations come out better than
    from interpolated positions. With ``positions`` the positions are interpolated, where SPICE's velocities are not the derivatives of
    its positions: corrections of the kind 'LT', and segments of some types (8, 9, 15, 18). SPICE takes an epoch as one double: the
    epochs sampled are doubles, and each record is interpolated at them and not at the ideal nodes, so that the rounding of epochs
    (6e-8 s, 6e-5 m for the Moon) is nowhere in the fit.
    """

    extras = 0

    def __init__(self, pool: KernelPool, of: int, relative: int, axes: str, correction: str, positions: bool):
        self.arguments = (of, relative, axes)
        self.pool, self.correction, self.positions = pool, correction, positions
        self.scale = 0.0

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities [m, 3] at epochs [m]."""
        positions, velocities = self.pool.states(*self.arguments, times, self.correction, doing="computing states for a fit")
        self.scale = max(self.scale, float(np.abs(positions).max()))
        return positions, velocities

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


Found = tuple[TranslationModel, Choice, tuple[str, ...]]


def choose_fit_variable(make: Callable[[bool], TranslationModel], parts: Sequence[Part], unit: Fraction, goal: Goal) -> Found:
    """Return the model, its records, and notes for the report.

    Velocities are fitted if that meets the goal: accelerations come out better. Where CSPICE's velocities are not the derivatives of its
    positions, their integral drifts away from these; then positions are fitted, if that meets the goal.

    Args:
        make: Gives the model of velocities (False) or of positions (True).
        parts: As in ``smallest``.
        unit: As in ``smallest``.
        goal: What is asked of the records. Where it bounds velocities alone, positions are held to the same relative accuracy.

    Raises:
        ToleranceError: If neither meets it; says if that is because the velocities are not the derivatives of the positions.
    """
    by_rates, by_values = make(False), make(True)
    if "LT" in by_values.correction:
        return by_values, smallest(by_values, parts, unit, goal), ()
    held = _held(by_rates, parts, goal)
    notes = (held.note.strip(" ()"),) if held.note else ()
    values = _found(by_values, parts, unit, held)
    if isinstance(values, Choice) and not goal.free:
        held = replace(held, most=LARGER * table_bytes(values, by_values.extras))
    elif isinstance(values, UnmetError) and np.isfinite(goal.bounds).all():
        # Records so short that the velocities have no time to lead astray are steps, and no table: each bound alone says what one takes.
        alone = [(by_values, (held.bounds[0], np.inf)), (by_rates, (np.inf, held.bounds[1]))]
        single = [(model, _found(model, parts, unit, replace(held, bounds=bounds, size=None))) for model, bounds in alone]
        if all(isinstance(found, Choice) for _, found in single):
            held = replace(
                held, most=LARGER * sum(table_bytes(found, model.extras) for model, found in single if isinstance(found, Choice))
            )
    rates = _found(by_rates, parts, unit, held)
    if isinstance(rates, Choice) and (not goal.free or (isinstance(values, Choice) and rates.worst[0] <= MUCH * values.worst[0])):
        return by_rates, rates, notes
    if isinstance(values, Choice):
        reason = f"positions are fitted, not velocities, which do not lead to them: CSPICE's differ by up to {values.worst[1]:.3g} m/s"
        return by_values, values, (*notes, reason)
    assert isinstance(rates, UnmetError)
    raise _why(held, rates, values)


def _found(model: TranslationModel, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice | UnmetError:
    try:
        return smallest(model, parts, unit, goal)
    except UnmetError as error:
        return error


def _held(model: TranslationModel, parts: Sequence[Part], goal: Goal) -> Goal:
    """Return the goal with a bound for positions where there is one for velocities only: an integral is not to drift without bounds."""
    if np.isfinite(goal.bounds[0]) or not np.isfinite(goal.bounds[1]):
        return goal
    start, stop = float(parts[0].start), float(parts[-1].stop)
    places = np.random.default_rng(3).uniform(0, 1, SAMPLES)
    at = np.clip([float(p.start) + float(p.stop - p.start) * u for p, u in zip(_spread(parts), places, strict=False)], start, stop)
    position, velocity = model.sample(at)
    distance, speed = (float(np.linalg.norm(x, axis=1).max()) for x in (position, velocity))
    if not speed or not distance:
        return goal
    bound = goal.bounds[1] * distance / speed
    note = f" (positions are held within {bound:.3g} m, the same fraction of the distance as the velocity's of the speed)"
    return replace(goal, bounds=(bound, goal.bounds[1]), note=note)


def _spread(parts: Sequence[Part]) -> list[Part]:
    """Return so many parts as there are samples, each about as often as it is long."""
    ends = np.cumsum([float(part.stop - part.start) for part in parts])
    which = np.searchsorted(ends, (np.arange(SAMPLES) + 0.5) / SAMPLES * ends[-1])
    return [parts[int(i)] for i in which]


def _why(goal: Goal, rates: UnmetError, values: UnmetError) -> UnmetError:
    """Return the error that says what stands in the way, of those met by fitting velocities and by fitting positions."""
    place, speed = min(values.met), min(rates.met, key=lambda errors: errors[1])
    if place[0] > min(rates.met)[0] / 2 or place[1] < 2 * speed[1]:
        return min(rates, values, key=lambda error: min(map(goal.ratio, error.met)))
    return UnmetError(
        f"{goal.aim}: no table meets {goal.text()}{goal.note}. CSPICE's velocities are not the derivatives of its positions here: "
        f"fitted to the positions, a table reaches {goal.reached(place)}; fitted to the velocities, {goal.reached(speed)}. "
        "Ask for less, or bound one of the two alone.",
        (place, speed),
    )
