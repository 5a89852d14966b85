"""The smallest Chebyshev table within a tolerance: searching record lengths and degrees, checked at epochs that no fit has seen."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import numpy as np

from jaxframes.errors import ToleranceError

DEGREES = tuple(range(7, 18))
PROBES = 48  # records fitted to judge a record length
CHECKS = 8  # epochs a probed record is checked at, at least
PROBED = 256  # epochs that the records of a length are checked at, at least
INDEPENDENT = 2000  # random epochs of the final check, beside some in every record
MARGINS = (0.8, 0.4, 0.1)  # of the tolerance is aimed for, one after the other: a few epochs do not meet the worst
MOST_RECORDS = 400_000
SHORTEST = Fraction(1, 20)  # seconds: the nodes of shorter records are too close for one double's spacing
SAMPLED = 1000  # records that are looked at before a large table is fitted
SLIVER = Fraction(1, 1000)


@dataclass(frozen=True)
class Tolerance:
    """The largest errors that a fitted table may have against CSPICE.

    Attributes:
        position: Metres, for translations.
        velocity: Metres per second, for translations.
        angle: Radians, for orientations.
        rate: Radians per second, for orientations.
    """

    position: float | None = None
    velocity: float | None = None
    angle: float | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        given = [v for v in (self.position, self.velocity, self.angle, self.rate) if v is not None]
        if not given or not all(np.isfinite(v) and v > 0 for v in given):
            raise ToleranceError(
                f"{self!r}: give at least one of position, velocity (m, m/s) or angle, rate (rad, rad/s), greater than zero."
            )

    def bounds(self, kind: str) -> tuple[float, float]:
        """Return the bounds of value and rate for a translation or an orientation, infinite where none is given."""
        chosen = (self.position, self.velocity) if kind == "translation" else (self.angle, self.rate)
        if chosen == (None, None):
            wanted = "position= and velocity=" if kind == "translation" else "angle= and rate="
            raise ToleranceError(f"{self!r} says nothing about a {kind}: give {wanted}.")
        value, rate = (np.inf if v is None else float(v) for v in chosen)
        return value, rate


@dataclass(frozen=True)
class Part:
    """A stretch of time that is fitted by itself: nothing breaks within it.

    Attributes:
        start: Start, seconds past J2000 TDB.
        stop: End.
        anchor: An edge of the kernel's own records, on which the grid of records is laid.
    """

    start: Fraction
    stop: Fraction
    anchor: Fraction

    def cells(self, length: Fraction) -> tuple[int, int]:
        """Return the first and last + 1 of the grid's cells that the part touches by more than a sliver."""
        low, high = (self.start - self.anchor) / length, (self.stop - self.anchor) / length
        first, last = low // 1, -((-high) // 1)
        first += 1 if first + 1 - low < SLIVER and first + 1 < last else 0
        last -= 1 if high - (last - 1) < SLIVER and last - 1 > first else 0
        return int(first), int(last)

    def span(self, first: int, last: int, cell: int, length: Fraction) -> tuple[Fraction, Fraction]:
        """Return where a cell, cut to the part, starts and ends."""
        a = self.start if cell == first else self.anchor + cell * length
        b = self.stop if cell == last - 1 else self.anchor + (cell + 1) * length
        return a, b


class Model(Protocol):
    """What is fitted: how to sample it, to fit records, and to say their errors."""

    kind: str
    extras: int
    scale: float

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return values and rates at epochs [m] (ET seconds)."""
        ...

    def fit(self, a: np.ndarray, b: np.ndarray) -> Any:
        """Return the records between starts and ends [n]."""
        ...

    def errors(self, fitted: Any, which: np.ndarray, times: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return the errors of value and rate [2, degrees, m] at epochs [m] that the records ``which`` serve."""
        ...


@dataclass(frozen=True)
class Choice:
    """Records that were chosen.

    Attributes:
        degree: Their degree.
        spans: Start and end of each, in order.
        grid: Start of the uniform grid and its step, None where there is none.
        fitted: What the model made of them.
        worst: Largest errors of value and rate met in the final check.
    """

    degree: int
    spans: list[tuple[Fraction, Fraction]]
    grid: tuple[Fraction, Fraction] | None
    fitted: Any
    worst: tuple[float, float]


def record_bytes(degree: int, extras: int) -> int:
    """Return the size of one record in float64."""
    return 8 * (3 * (degree + 1) + 3 + extras)


def search(
    model: Model, parts: Sequence[Part], unit: Fraction, bounds: tuple[float, float], size: int | None, layout: str, aim: str
) -> Choice:
    """Return the records to use.

    Args:
        model: What is fitted.
        parts: Stretches that are fitted by themselves.
        unit: Length of the kernel's own records; those tried are this times powers of two.
        bounds: Largest errors of value and rate allowed.
        size: Most bytes allowed, None for any.
        layout: ``"uniform"`` or ``"dyadic"``.
        aim: What is fitted, for messages.

    Raises:
        ToleranceError: If no records do.
    """
    from jaxframes.spice.dyadic import dyadic

    if layout == "dyadic":
        found = dyadic(model, parts, unit, bounds, aim)
        if size is not None and len(found.spans) * record_bytes(found.degree, model.extras) > size:
            raise ToleranceError(
                f"{aim}: {len(found.spans) * record_bytes(found.degree, model.extras)} bytes are needed within {_text(bounds)}, "
                f"more than size={size}."
            )
        return found
    if layout != "uniform":
        raise ToleranceError(f"layout={layout!r}: records are 'uniform' or 'dyadic'.")
    levels, failed, room = list[Level](), list[tuple[tuple[int, int], tuple[float, float]]](), MOST_RECORDS // 4
    for margin in MARGINS:  # records that met the tolerance where they were probed, but not everywhere, are tried shorter
        levels = _probe(model, parts, unit, bounds, size, margin)
        candidates = _ranked(model, levels, bounds, size, margin)
        for _, count, level, degree in candidates:
            if (level, degree) in dict(failed) or (failed and count > room):
                continue
            spans, grid = _uniform_spans(parts, unit * Fraction(2) ** level)
            worst = _sampled(model, spans, degree) if count > 2 * SAMPLED else (0.0, 0.0)
            if worst[0] <= bounds[0] and worst[1] <= bounds[1]:
                room -= count
                found = verified(model, spans, grid, degree)
                if found.worst[0] <= bounds[0] and found.worst[1] <= bounds[1]:
                    return found
                worst = found.worst
            failed.append(((level, degree), worst))
        if not candidates:
            break
    needed = [
        e.count * record_bytes(d, model.extras) for e in levels for d, er in zip(DEGREES, e.errors.T, strict=True) if (er <= bounds).all()
    ]
    if size is not None and needed:
        raise ToleranceError(f"{aim}: {min(needed)} bytes are needed within {_text(bounds)}, more than size={size}.")
    reached = [worst for _, worst in failed] or [(float(v), float(r)) for e in levels for v, r in e.errors.T]
    raise ToleranceError(f"{aim}: {unreachable(model.kind, bounds, reached)}")


def unreachable(kind: str, bounds: tuple[float, float], reached: Sequence[tuple[float, float]]) -> str:
    """Return what to say where no table meets a tolerance, from the errors of value and rate of those that were tried."""
    best = min(reached, key=lambda errors: max(e / b if np.isfinite(b) else 0.0 for e, b in zip(errors, bounds, strict=True)))
    said = f"no table meets {_text(bounds)}. The best reached is {_text(best)}: "
    least = min(errors[0] for errors in reached)
    if least <= bounds[0] * 1e-3 and best[1] > bounds[1]:
        value, rate = ("position", "velocity") if kind == "translation" else ("angle", "rate")
        return (
            f"{said}what CSPICE gives as {rate} is not the derivative of its {value} to better than that (as for frames of date with "
            f"ROTATION_STATE 'INERTIAL'). Give {value}= alone: the table's own {rate} is the derivative."
        )
    return f"{said}what CSPICE computes is not smoother than that (its own rounding, the kernel's jumps between records). Ask for less."


def _text(bounds: tuple[float, float]) -> str:
    return " and ".join(f"{b:.2g}" for b in bounds)


@dataclass(frozen=True)
class Level:
    """One record length: how many records, and the worst errors [2, degrees] of those probed."""

    level: int
    count: int
    errors: np.ndarray


def _probe(
    model: Model, parts: Sequence[Part], unit: Fraction, bounds: tuple[float, float], size: int | None, margin: float
) -> list[Level]:
    """Return what records of each length are worth, from the longest down to where shorter ones cannot win."""
    longest = max(part.stop - part.start for part in parts)
    level = int(np.ceil(np.log2(float(longest / unit))))
    out: list[Level] = []
    rng, smallest = np.random.default_rng(0), np.inf
    free = not np.isfinite(bounds).any()
    while True:
        length = unit * Fraction(2) ** level
        cells = [part.cells(length) for part in parts]
        count = sum(b - a for a, b in cells)
        least = count * record_bytes(DEGREES[0], model.extras)
        if out and (count > MOST_RECORDS or length < SHORTEST or least > smallest or (size is not None and free and least > size)):
            return out
        chosen = _some(parts, cells, rng)
        a, b = np.array([[float(x) for x in parts[p].span(*cells[p], c, length)] for p, c in chosen]).T
        errors = _errors(model, a, b, max(CHECKS, PROBED // len(a)), rng).max(-1)
        out.append(Level(level, count, errors))
        meeting = (errors <= np.array(bounds)[:, None] * margin).all(0) & (not free)
        if meeting.any():
            smallest = min(smallest, count * record_bytes(DEGREES[int(np.argmax(meeting))], model.extras))
        level -= 1


def _some(parts: Sequence[Part], cells: Sequence[tuple[int, int]], rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return up to PROBES cells of all parts, ends of parts first."""
    ends = [(p, c) for p, (a, b) in enumerate(cells) for c in {a, b - 1}]
    if len(ends) > PROBES:
        ends = [ends[i] for i in rng.choice(len(ends), PROBES, replace=False)]
    total = [b - a for a, b in cells]
    rest = rng.choice(len(cells), max(PROBES - len(ends), 0), p=np.array(total) / sum(total))
    return list(dict.fromkeys([*ends, *((int(p), int(rng.integers(*cells[p]))) for p in rest)]))


def _errors(model: Model, a: np.ndarray, b: np.ndarray, checks: int, rng: np.random.Generator) -> np.ndarray:
    """Return the worst errors [2, degrees, n] of records fitted between a and b, at epochs of their own."""
    fitted = model.fit(a, b)
    times = a[:, None] + (b - a)[:, None] * (np.arange(checks) + rng.uniform(0, 1, (len(a), checks))) / checks
    times = np.clip(times, a[:, None], b[:, None]).reshape(-1)
    which = np.repeat(np.arange(len(a)), checks)
    found = model.errors(fitted, which, times, *model.sample(times))
    return found.reshape(2, len(DEGREES), len(a), checks).max(-1)


def _ranked(
    model: Model, levels: Sequence[Level], bounds: tuple[float, float], size: int | None, margin: float
) -> list[tuple[float, int, int, int]]:
    """Return candidates (rank, records, level, degree), best first."""
    out = []
    limit = np.array(bounds) * (margin if size is None else margin / MARGINS[0])
    for entry in levels:
        for i, degree in enumerate(DEGREES):
            needed, error = entry.count * record_bytes(degree, model.extras), entry.errors[:, i]
            if (size is not None and needed > size) or not (error <= limit).all():
                continue
            rank = float(needed) if np.isfinite(bounds).any() else float(error[0])
            out.append((rank, entry.count, entry.level, degree))
    return sorted(out)[:8]


def _uniform_spans(parts: Sequence[Part], length: Fraction) -> tuple[list[tuple[Fraction, Fraction]], tuple[Fraction, Fraction] | None]:
    spans = []
    for part in parts:
        first, last = part.cells(length)
        spans += [part.span(first, last, cell, length) for cell in range(first, last)]
    if len(parts) > 1:
        return spans, None
    return spans, (parts[0].anchor + parts[0].cells(length)[0] * length, length)


def resolved(model: Model, parts: Sequence[Part], length: Fraction, goal: np.ndarray) -> bool:
    """Whether much shorter records meet a goal: an error that halving does not reduce is an oscillation then, and no noise."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        length = length / 16
        cells = [part.cells(length) for part in parts]
        if length < SHORTEST or sum(b - a for a, b in cells) > MOST_RECORDS:
            return False
        chosen = _some(parts, cells, rng)
        a, b = np.array([[float(x) for x in parts[p].span(*cells[p], c, length)] for p, c in chosen]).T
        if (_errors(model, a, b, CHECKS, rng).max(-1) <= goal[:, None]).all(0).any():
            return True
    return False


def _sampled(model: Model, spans: Sequence[tuple[Fraction, Fraction]], degree: int) -> tuple[float, float]:
    """Return the worst errors of some of many records, at the ends and between: fitting them all takes its time."""
    ends, rng = np.arange(SAMPLED // 10), np.random.default_rng(4)
    chosen = np.concatenate([ends, len(spans) - 1 - ends, rng.choice(len(spans), SAMPLED - 2 * len(ends))])
    a, b = np.array([[float(x) for x in spans[i]] for i in chosen]).T
    value, rate = _errors(model, a, b, CHECKS, rng)[:, DEGREES.index(degree)].max(-1)
    return float(value), float(rate)


def verified(model: Model, spans: list[tuple[Fraction, Fraction]], grid: tuple[Fraction, Fraction] | None, degree: int) -> Choice:
    """Return records fitted and checked: at random epochs over the whole span and at some within every record."""
    a, b = np.array([[float(x) for x in span] for span in spans]).T
    rng = np.random.default_rng(1)
    fitted = model.fit(a, b)
    each = max(1, min(6, 20_000 // len(a)))
    times = (a[:, None] + (b - a)[:, None] * rng.uniform(0, 1, (len(a), each))).reshape(-1)
    which = np.repeat(np.arange(len(a)), each)
    lengths = b - a
    more = rng.choice(len(a), INDEPENDENT, p=lengths / lengths.sum())
    times = np.concatenate([times, a[more] + lengths[more] * rng.uniform(0, 1, INDEPENDENT)])
    which = np.concatenate([which, more])
    worst = np.zeros(2)
    for at in range(0, len(times), 20_000):
        use = slice(at, at + 20_000)
        found = model.errors(fitted, which[use], times[use], *model.sample(times[use]))
        worst = np.maximum(worst, found[:, DEGREES.index(degree)].max(-1))
    return Choice(degree, spans, grid, fitted, (float(worst[0]), float(worst[1])))
