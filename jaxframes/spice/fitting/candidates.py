"""Records that are fitted: the spans of time that they are laid on, their size, and the final check at epochs that no fit has seen."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any, Protocol

import numpy as np

from jaxframes.tables.index import cells_of

DEGREES = tuple(range(7, 18))
INDEPENDENT = 2000  # random epochs of the final check, beside some in every record
MOST_RECORDS = 400_000
SLIVER = Fraction(1, 1000)
GRID = 3 * 8  # bytes of a record table's grid


@dataclass(frozen=True)
class Part:
    """A span of time that is fitted by itself: nothing breaks within it.

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


Span = tuple[Fraction, Fraction]


class Model(Protocol):
    """What is fitted: how to sample it, to fit records, and to say their errors."""

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
        each: Those of each record [2, n].
    """

    degree: int
    spans: list[Span]
    grid: Span | None
    fitted: Any
    worst: tuple[float, float]
    each: np.ndarray


def longest_length(parts: Sequence[Part], unit: Fraction) -> int:
    """Return the power of two by which the unit is as long as the longest part."""
    return int(np.ceil(np.log2(float(max(part.stop - part.start for part in parts) / unit))))


def uniform_spans(parts: Sequence[Part], length: Fraction) -> tuple[list[Span], Span | None]:
    """Return the records of one length, and their grid if there is one part only."""
    spans = []
    for part in parts:
        first, last = part.cells(length)
        spans += [part.span(first, last, cell, length) for cell in range(first, last)]
    if len(parts) > 1:
        return spans, None
    return spans, (parts[0].anchor + parts[0].cells(length)[0] * length, length)


def record_bytes(degree: int, extras: int) -> int:
    """Return the size of one record in float64."""
    return 8 * (3 * (degree + 1) + 3 + extras)


def index_bytes(count: int, span: Fraction, shortest: Fraction, even: bool) -> int:
    """Return the size of what finds a record by time, in float64: the grid, for uneven records cells and their ends too."""
    return GRID if even else GRID + 8 * cells_of(count, span, shortest) + 16 * count


def table_bytes(choice: Choice, extras: int) -> int:
    """Return the size of a table of records in float64."""
    count, spans = len(choice.spans), choice.spans
    index = index_bytes(count, spans[-1][1] - spans[0][0], min(b - a for a, b in spans), choice.grid is not None or is_even(spans))
    return count * record_bytes(choice.degree, extras) + index


def is_even(spans: Sequence[Span]) -> bool:
    """Whether records follow one another at one step, the last one perhaps cut short."""
    step = spans[0][1] - spans[0][0]
    follow = all(a[1] == b[0] for a, b in pairwise(spans))
    return follow and all(b - a == step for a, b in spans[:-1]) and spans[-1][1] - spans[-1][0] <= step


def within(a: np.ndarray, b: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return random epochs [n * count] within records between a and b [n], more near their ends, and which record each is of.

    They lie as the zeros of a Chebyshev polynomial do: fitted polynomials go astray at the ends of records first.
    """
    places = (np.arange(count) + rng.uniform(0, 1, (len(a), count))) / count
    times = a[:, None] + (b - a)[:, None] * (1 - np.cos(np.pi * places)) / 2
    return np.clip(times, a[:, None], b[:, None]).reshape(-1), np.repeat(np.arange(len(a)), count)


def errors_of(model: Model, a: np.ndarray, b: np.ndarray, checks: int, rng: np.random.Generator) -> np.ndarray:
    """Return the worst errors [2, degrees, n] of records fitted between a and b, at epochs of their own."""
    fitted = model.fit(a, b)
    times, which = within(a, b, checks, rng)
    found = model.errors(fitted, which, times, *model.sample(times))
    return found.reshape(2, len(DEGREES), len(a), checks).max(-1)


def verified(model: Model, spans: list[Span], grid: Span | None, degree: int) -> Choice:
    """Return records fitted and checked: at random epochs over the whole span and at some within every record."""
    a, b = np.array([[float(x) for x in span] for span in spans]).T
    rng = np.random.default_rng(1)
    fitted = model.fit(a, b)
    times, which = within(a, b, max(1, min(24, 20_000 // len(a))), rng)
    lengths = b - a
    more = rng.choice(len(a), INDEPENDENT, p=lengths / lengths.sum())
    times = np.concatenate([times, a[more] + lengths[more] * rng.uniform(0, 1, INDEPENDENT)])
    which = np.concatenate([which, more])
    each = np.zeros((2, len(a)))
    for at in range(0, len(times), 20_000):
        use = slice(at, at + 20_000)
        found = model.errors(fitted, which[use], times[use], *model.sample(times[use]))[:, DEGREES.index(degree)]
        for worst, errors in zip(each, found, strict=True):
            np.maximum.at(worst, which[use], errors)
    return Choice(degree, spans, grid, fitted, (float(each[0].max()), float(each[1].max())), each)
