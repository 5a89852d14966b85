"""Uniform records: the search for the length and degree of the smallest table within a tolerance, checked at epochs of its own."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from jaxframes.spice.fitting.candidates import (
    DEGREES,
    MOST_RECORDS,
    Choice,
    Model,
    Part,
    errors_of,
    index_bytes,
    longest_length,
    record_bytes,
    uniform_spans,
    verified,
)
from jaxframes.spice.fitting.goal import Goal

PROBES = 48  # records fitted to judge a record length
CHECKS = 8  # epochs a probed record is checked at
MARGIN = 0.8  # of the tolerance is aimed for: a few epochs do not meet the worst
TWICE = 2  # records of a length that fail the final check: a higher degree would not help
STALLED = 3  # halvings without gain, at the rounding of what is sampled, after which shorter records are not tried
PATIENCE = 9  # halvings without gain elsewhere: those between a kernel's long waves and its nodes gain nothing
SHORTEST = Fraction(1, 20)  # seconds: the nodes of shorter records are too close for one double's spacing
ROUNDING = 1e-14  # of the largest value: errors below it are rounding


def uniform(model: Model, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice:
    """Return records of one length: the smallest that meet the goal's errors, or the best of its size.

    Args:
        model: What is fitted.
        parts: Spans of time that are fitted by themselves.
        unit: Length of the kernel's own records; those tried are this times powers of two.
        goal: What is asked of them.

    Raises:
        ToleranceError: If no records do.
    """
    levels: list[Level] = []
    met: list[Any] = []
    probed = probe(model, parts, unit, goal)
    while True:
        levels += probed.levels
        met += [error for entry in probed.levels for error in entry.errors.T]
        failed: dict[int, int] = {}
        for _, count, level, degree in _ranked(model, parts, unit, probed.levels, goal):
            if failed.get(level, 0) >= TWICE:
                continue
            spans, grid = uniform_spans(parts, unit * Fraction(2) ** level)
            assert len(spans) == count
            found = verified(model, spans, grid, degree)
            if goal.meets(found.worst):
                return found
            failed[level] = failed.get(level, 0) + 1
            met = [found.worst, *(error for error in met if not goal.meets(error))]  # what a few epochs promised was not kept
        if not failed or probed.after is None:
            break
        probed = probe(model, parts, unit, goal, probed.after)
    meeting = [(entry, d) for entry in levels for d, error in zip(DEGREES, entry.errors.T, strict=True) if goal.meets(error)]
    smallest = min((_bytes(model, parts, unit, entry, d) for entry, d in meeting), default=None)
    if goal.size is not None and smallest is not None:
        raise goal.too_small(smallest)
    raise goal.unmet(met)


@dataclass(frozen=True)
class Level:
    """One record length: how many records, and the worst errors [2, degrees] of those probed."""

    level: int
    count: int
    errors: np.ndarray


@dataclass(frozen=True)
class Probed:
    """What records of each length are worth, from the longest down.

    Attributes:
        levels: One entry for each length.
        stalled: Whether shorter ones did not get better.
        after: The next shorter length, None if there is no use in it.
    """

    levels: list[Level]
    stalled: bool
    after: int | None


def probe(model: Model, parts: Sequence[Part], unit: Fraction, goal: Goal, start: int | None = None) -> Probed:
    """Return what records of each length are worth, from the longest, or a power of two of the unit, to where shorter ones cannot win."""
    level = longest_length(parts, unit) if start is None else start
    out: list[Level] = []
    rng, smallest, stalled, last = np.random.default_rng(0), np.inf, 0, np.inf
    while stalled < (STALLED if out and out[-1].errors[0].min() < ROUNDING * model.scale else PATIENCE):
        length = unit * Fraction(2) ** level
        cells = [part.cells(length) for part in parts]
        count = sum(b - a for a, b in cells)
        least = count * record_bytes(DEGREES[0], model.extras)
        large = least > goal.most or (out and goal.size is not None and goal.free and least > goal.size)
        if count > MOST_RECORDS or length < SHORTEST or large:
            return Probed(out, False, None)
        if least > smallest:
            return Probed(out, False, level)
        chosen = _some(parts, cells, rng)
        a, b = np.array([[float(x) for x in parts[p].span(*cells[p], c, length)] for p, c in chosen]).T
        errors = errors_of(model, a, b, CHECKS, rng).max(-1)
        out.append(Level(level, count, errors))
        meeting = (errors <= np.array(goal.bounds)[:, None] * MARGIN).all(0) & (not goal.free)
        if meeting.any():
            smallest = min(smallest, count * record_bytes(DEGREES[int(np.argmax(meeting))], model.extras))
        ratio = float(errors[0].min() if goal.free else (errors / np.array(goal.bounds)[:, None]).max(0).min())
        # Records too long to follow the motion at all do not get better by halving either: only small errors that stay count.
        stalled = stalled + 1 if errors[0].min() < 1e-4 * model.scale and ratio > 0.7 * last and not meeting.any() else 0
        last = min(last, ratio)
        level -= 1
    return Probed(out, True, None)


def _some(parts: Sequence[Part], cells: Sequence[tuple[int, int]], rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return up to PROBES cells of all parts, ends of parts first."""
    ends = [(p, c) for p, (a, b) in enumerate(cells) for c in {a, b - 1}]
    if len(ends) > PROBES:
        ends = [ends[i] for i in rng.choice(len(ends), PROBES, replace=False)]
    total = [b - a for a, b in cells]
    rest = rng.choice(len(cells), max(PROBES - len(ends), 0), p=np.array(total) / sum(total))
    return list(dict.fromkeys([*ends, *((int(p), int(rng.integers(*cells[p]))) for p in rest)]))


def _bytes(model: Model, parts: Sequence[Part], unit: Fraction, entry: Level, degree: int) -> int:
    """Return the size of a table of one record length; of several parts, whose ends may be short, the most that it can be."""
    span, length = parts[-1].stop - parts[0].start, unit * Fraction(2) ** entry.level
    shortest = length if len(parts) == 1 else min(length, *(part.stop - part.start for part in parts)) / 1000
    return entry.count * record_bytes(degree, model.extras) + index_bytes(entry.count, span, shortest, len(parts) == 1)


def _ranked(model: Model, parts: Sequence[Part], unit: Fraction, levels: Sequence[Level], goal: Goal) -> list[tuple[float, int, int, int]]:
    """Return candidates (rank, records, level, degree), best first."""
    out = []
    for entry in levels:
        for i, degree in enumerate(DEGREES):
            needed = _bytes(model, parts, unit, entry, degree)
            if needed > goal.most or (goal.size is not None and needed > goal.size):
                continue
            error = entry.errors[:, i]
            if goal.free:
                out.append((float(error[0]), entry.count, entry.level, degree))
            elif (error <= np.array(goal.bounds) * (MARGIN if goal.size is None else 1.0)).all():
                out.append((float(needed), entry.count, entry.level, degree))
    return sorted(out)
