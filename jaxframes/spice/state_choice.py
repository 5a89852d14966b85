"""Whether velocities or positions are fitted: a kernel's velocities need not be the derivatives of its positions."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from jaxframes.spice.records import Choice, Part, table_bytes
from jaxframes.spice.search import search
from jaxframes.spice.state_model import StateModel
from jaxframes.spice.tolerance import Goal, UnmetError

MUCH = 10.0  # times better must a fit of the positions be to be preferred, where nothing says how good the velocity shall be
LARGER = 3.0  # times the bytes of a fit of the positions may a fit of the velocities take
SAMPLES = 64

Found = tuple[StateModel, Choice, tuple[str, ...]]


def chosen(make: Callable[[bool], StateModel], parts: Sequence[Part], unit: Fraction, goal: Goal) -> Found:
    """Return the model, its records, and notes for the report.

    Velocities are fitted if that meets the goal: accelerations come out better. Where CSPICE's velocities are not the derivatives of its
    positions, their integral drifts away from these; then positions are fitted, if that meets the goal.

    Args:
        make: Gives the model of velocities (False) or of positions (True).
        parts: As in ``search``.
        unit: As in ``search``.
        goal: What is asked of the records. Where it bounds velocities alone, positions are held to the same relative accuracy.

    Raises:
        ToleranceError: If neither meets it; says if that is because the velocities are not the derivatives of the positions.
    """
    by_rates, by_values = make(False), make(True)
    if "LT" in by_values.correction:
        return by_values, search(by_values, parts, unit, goal), ()
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


def _found(model: StateModel, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice | UnmetError:
    try:
        return search(model, parts, unit, goal)
    except UnmetError as error:
        return error


def _held(model: StateModel, parts: Sequence[Part], goal: Goal) -> Goal:
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
