"""Records halved where the motion asks for it, as many as a size allows: the best such table of at most so many bytes."""

import heapq
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from jaxframes.spice.dyadic import CHECKS, FINEST, halved
from jaxframes.spice.records import (
    DEGREES,
    Choice,
    Model,
    Part,
    Span,
    errors_of,
    index_bytes,
    longest_length,
    record_bytes,
    uniform_spans,
    verified,
)
from jaxframes.spice.search import STALLED, search
from jaxframes.spice.tolerance import Goal

AHEAD = 16  # worst records whose halves are fitted together: one request to CSPICE and not one for each
GAIN = 0.9  # halves that are no better than this have gained nothing


class Halves:
    """Errors of value [degrees] of records, fitted when they are first asked for."""

    def __init__(self, model: Model, parts: Sequence[Part]):
        self.model, self.parts, self.rng = model, parts, np.random.default_rng(0)
        self.errors: dict[Span, np.ndarray] = {}

    def fit(self, spans: Sequence[Span]) -> None:
        """Fit those that were not fitted yet."""
        new = [span for span in dict.fromkeys(spans) if span not in self.errors]
        if new:
            a, b = np.array([[float(x) for x in span] for span in new]).T
            found = errors_of(self.model, a, b, CHECKS, self.rng)[0]
            self.errors |= {span: found[:, i] for i, span in enumerate(new)}


def sized(model: Model, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice:
    """Return the records whose largest error of value is smallest: for each degree, the worst one is halved while the size allows.

    Where records of one length do better, which need no table to be found by, these are returned.

    Raises:
        ToleranceError: If not even the longest records fit.
    """
    assert goal.size is not None
    length = unit * Fraction(2) ** longest_length(parts, unit)
    whole, _ = uniform_spans(parts, length)
    halves = Halves(model, parts)
    halves.fit(whole)
    found = [leaves for d in range(len(DEGREES)) if (leaves := _refined(halves, whole, length, d, model.extras, goal.size))]
    if not found:
        raise goal.too_small(_bytes(whole, DEGREES[0], model.extras))
    _, d, spans = min(found)
    uneven, even = verified(model, sorted(spans), None, DEGREES[d]), search(model, parts, unit, replace(goal, layout="uniform"))
    return min(uneven, even, key=lambda choice: choice.worst[0])


def _bytes(spans: Sequence[Span], degree: int, extras: int) -> int:
    span = max(b for _, b in spans) - min(a for a, _ in spans)
    index = index_bytes(len(spans), span, min(b - a for a, b in spans), len(spans) == 1)
    return len(spans) * record_bytes(degree, extras) + index


def _refined(
    halves: Halves, whole: Sequence[Span], length: Fraction, d: int, extras: int, size: int
) -> tuple[float, int, list[Span]] | None:
    """Return the largest error, the place of the degree and the records; None if not even the longest fit."""
    if _bytes(whole, DEGREES[d], extras) > size:
        return None
    total = max(b for _, b in whole) - min(a for a, _ in whole)
    finest, shortest = length * Fraction(FINEST), min(b - a for a, b in whole)
    heap = [(-float(halves.errors[span][d]), span, length / 2, 0) for span in whole]
    heapq.heapify(heap)
    while True:
        error, span, half, stale = heap[0]
        if half < finest or stale >= STALLED:  # at the floor of what CSPICE computes, or at a jump
            break
        pieces = halved(span, half, halves.parts)
        if len(pieces) == 1:
            heapq.heapreplace(heap, (error, span, half / 2, stale))
            continue
        smaller = min(shortest, *(b - a for a, b in pieces))
        needed = (len(heap) + 1) * record_bytes(DEGREES[d], extras) + index_bytes(len(heap) + 1, total, smaller, False)
        if needed > size:
            break
        if any(piece not in halves.errors for piece in pieces):
            worst = heapq.nsmallest(AHEAD, heap)
            halves.fit([piece for _, other, cell, _ in worst for piece in halved(other, cell, halves.parts)])
        heapq.heappop(heap)
        for piece in pieces:
            own = float(halves.errors[piece][d])
            gained = own <= GAIN * -error or own > 1e-4 * halves.model.scale
            heapq.heappush(heap, (-own, piece, half / 2, 0 if gained else stale + 1))
        shortest = smaller
    return -heap[0][0], d, [span for _, span, _, _ in heap]
