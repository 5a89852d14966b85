"""Bisection: records halved where the motion asks for it, until a tolerance is met or a size is used up."""

import heapq
import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from jaxframes.spice.fitting.candidates import (
    DEGREES,
    MOST_RECORDS,
    Choice,
    Model,
    Part,
    Span,
    errors_of,
    index_bytes,
    longest_length,
    record_bytes,
    table_bytes,
    uniform_spans,
    verified,
)
from jaxframes.spice.fitting.goal import Goal
from jaxframes.spice.fitting.uniform import MARGIN, STALLED, probe, uniform

CHECKS = 12
FINEST = 2.0**-40  # of the longest part: a record that short follows nothing but jumps
ROUNDS = 5  # of the final check, between which records are halved
AHEAD = 16  # worst records whose halves are fitted together: one request to CSPICE and not one for each
GAIN = 0.9  # halves that are no better than this have gained nothing


def by_tolerance(model: Model, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice:
    """Return the smallest table of records halved where the motion asks for it, within a tolerance.

    Every degree is followed down at once: records that are good enough for a degree are its leaves, the others are halved. Whether
    that can end well is asked of a few records of each length first: where none of these is good enough, however short, no halving
    helps, and following every record down to there takes minutes.

    Raises:
        ToleranceError: If no records are good enough, or those that are need more bytes than allowed.
    """
    probed = probe(model, parts, unit, goal)
    limits = np.array(goal.bounds) * MARGIN
    met = [error for entry in probed.levels for error in entry.errors.T]
    if not probed.stalled or any((entry.errors <= limits[:, None]).all(0).any() for entry in probed.levels):
        degree, leaves, stayed = _leaves(model, parts, unit, limits, goal.most)
        met = [error for error in [*met, *stayed] if not goal.meets(error)]  # what a few epochs promised was not kept
        for _ in range(ROUNDS if degree is not None else 0):
            assert degree is not None
            found = verified(model, leaves, None, degree)
            if goal.meets(found.worst):
                needed = table_bytes(found, model.extras)
                if goal.size is not None and needed > goal.size:
                    raise goal.too_small(needed)
                return found
            met.append(np.array(found.worst))
            leaves = _mended(found, goal, parts, unit)
    raise goal.unmet(met)


def _mended(found: Choice, goal: Goal, parts: Sequence[Part], unit: Fraction) -> list[Span]:
    """Return records with those halved that the final check found wanting."""
    out = []
    for span, errors in zip(found.spans, found.each.T, strict=True):
        pieces = [span]
        cell = unit * Fraction(2) ** math.ceil(math.log2((span[1] - span[0]) / unit))
        for _ in range(0 if goal.meets(errors) else 3):  # a record cut short by an end is less than half a cell
            cell /= 2
            pieces = halved(span, cell, parts) if len(pieces) == 1 else pieces
        out += pieces
    return out


def _leaves(
    model: Model, parts: Sequence[Part], unit: Fraction, limits: np.ndarray, most: float
) -> tuple[int | None, list[Span], list[np.ndarray]]:
    """Return the degree of the smallest table and its records; no degree if there is none; and worst errors that stayed too large."""
    length = unit * Fraction(2) ** longest_length(parts, unit)
    shortest = max(part.stop - part.start for part in parts) * Fraction(FINEST)
    nodes, _ = uniform_spans(parts, length)
    rng = np.random.default_rng(0)
    alive = np.ones(len(DEGREES), bool)
    open_ = np.ones((len(DEGREES), len(nodes)), bool)
    leaves: list[list[Span]] = [[] for _ in DEGREES]
    stayed: list[np.ndarray] = []
    history: list[np.ndarray] = []
    while open_.any():
        a, b = np.array([[float(x) for x in node] for node in nodes]).T
        errors = errors_of(model, a, b, CHECKS, rng)
        good = np.logical_and(*(errors <= limits[:, None, None]))
        for d in range(len(DEGREES)):
            leaves[d] += [nodes[i] for i in np.flatnonzero(open_[d] & good[d])]
        open_ = np.logical_and(open_, ~good)
        worst = np.array([[errors[k, d, np.flatnonzero(open_[d])].max(initial=0.0) for d in range(len(DEGREES))] for k in (0, 1)])
        done = [len(leaves[d]) * record_bytes(DEGREES[d], model.extras) for d in range(len(DEGREES)) if alive[d] and not open_[d].any()]
        best = min(done, default=most)
        for d in range(len(DEGREES)):
            if open_[d].any():
                stayed.append(worst[:, d])
                pending = len(leaves[d]) + 2 * int(open_[d].sum())
                stalled = len(history) > 3 and bool(
                    (worst[:, d] > 0.7 * history[-3][:, d]).any()
                    and worst[0, d] < 1e-4 * model.scale
                    and (worst[:, d] > limits).any()
                    and all((worst[k, d] > 0.7 * history[-3][k, d]) or worst[k, d] <= limits[k] for k in (0, 1))
                )
                if pending * record_bytes(DEGREES[d], model.extras) >= best or pending > MOST_RECORDS or stalled:
                    alive[d], open_[d] = False, False
        history.append(worst)
        length /= 2
        keep = open_.any(0)
        if not keep.any():
            break
        if length < shortest:
            alive &= ~open_.any(1)
            break
        halves, mask = [], []
        for i in np.flatnonzero(keep):
            for piece in halved(nodes[i], length, parts):
                halves.append(piece)
                mask.append(open_[:, i])
        nodes, open_ = halves, np.array(mask).T
    sizes = [(len(leaves[d]) * record_bytes(DEGREES[d], model.extras), d) for d in range(len(DEGREES)) if alive[d]]
    if not sizes:
        return None, [], stayed
    _, d = min(sizes)
    return DEGREES[d], sorted(leaves[d]), stayed


def halved(node: Span, length: Fraction, parts: Sequence[Part]) -> list[Span]:
    """Return the parts of a record on the grid of half its cell's length; a record cut short by an end may stay whole."""
    a, b = node
    part = next(p for p in parts if p.start <= a and b <= p.stop)
    cut = part.anchor + ((b - part.anchor) / length - Fraction(1, 10**6)).__floor__() * length
    return [(a, cut), (cut, b)] if a < cut < b and cut - a > length / 1000 and b - cut > length / 1000 else [node]


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


def by_size(model: Model, parts: Sequence[Part], unit: Fraction, goal: Goal) -> Choice:
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
    uneven, even = verified(model, sorted(spans), None, DEGREES[d]), uniform(model, parts, unit, replace(goal, layout="uniform"))
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
