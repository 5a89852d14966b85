"""Records halved where the motion asks for it: the search for the smallest such table within a tolerance."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from jaxframes.errors import ToleranceError
from jaxframes.spice.search import DEGREES, MARGINS, MOST_RECORDS, Choice, Model, Part, _errors, _text, record_bytes, resolved, verified

CHECKS = 12
FINEST = 2.0**-40  # of the longest part: a record that short follows nothing but jumps
RETRIES = 3


def dyadic(model: Model, parts: Sequence[Part], unit: Fraction, bounds: tuple[float, float], aim: str) -> Choice:
    """Return the records to use, as ``search.search`` does.

    Every degree is followed down at once: records that are good enough for a degree are its leaves, the others are halved.
    """
    goal, floor = np.array(bounds) * MARGINS[0], (np.inf, np.inf)
    for _ in range(RETRIES):
        degree, leaves = _leaves(model, parts, unit, goal, aim, bounds)
        found = verified(model, leaves, None, degree)
        if found.worst[0] <= bounds[0] and found.worst[1] <= bounds[1]:
            return found
        goal = goal * 0.5
        floor = found.worst
    raise ToleranceError(f"{aim}: no table meets {_text(bounds)}; the best reached is {floor[0]:.2g} and {floor[1]:.2g}. Ask for less.")


def _leaves(
    model: Model, parts: Sequence[Part], unit: Fraction, goal: np.ndarray, aim: str, bounds: tuple[float, float]
) -> tuple[int, list[tuple[Fraction, Fraction]]]:
    longest = max(part.stop - part.start for part in parts)
    length = unit * Fraction(2) ** int(np.ceil(np.log2(float(longest / unit))))
    nodes = []
    for part in parts:
        first, last = part.cells(length)
        nodes += [part.span(first, last, cell, length) for cell in range(first, last)]
    rng = np.random.default_rng(0)
    alive = np.ones(len(DEGREES), bool)
    open_ = np.ones((len(DEGREES), len(nodes)), bool)
    leaves: list[list[tuple[Fraction, Fraction]]] = [[] for _ in DEGREES]
    floor = np.full(2, np.inf)
    history: list[np.ndarray] = []
    while open_.any():
        a, b = np.array([[float(x) for x in node] for node in nodes]).T
        errors = _errors(model, a, b, CHECKS, rng)
        good = np.logical_and(*(errors <= goal[:, None, None]))
        for d in range(len(DEGREES)):
            leaves[d] += [nodes[i] for i in np.flatnonzero(open_[d] & good[d])]
        open_ = np.logical_and(open_, ~good)
        worst = np.array([[errors[k, d, np.flatnonzero(open_[d])].max(initial=0.0) for d in range(len(DEGREES))] for k in (0, 1)])
        done = [len(leaves[d]) * record_bytes(DEGREES[d], model.extras) for d in range(len(DEGREES)) if alive[d] and not open_[d].any()]
        best = min(done, default=np.inf)
        for d in range(len(DEGREES)):
            if open_[d].any():
                floor = np.minimum(floor, np.where(worst[:, d] > 0, worst[:, d], np.inf))
                pending = len(leaves[d]) + 2 * int(open_[d].sum())
                stalled = len(history) > 3 and bool(
                    (worst[:, d] > 0.7 * history[-3][:, d]).any()
                    and worst[0, d] < 1e-4 * model.scale
                    and (worst[:, d] > goal).any()
                    and all((worst[k, d] > 0.7 * history[-3][k, d]) or worst[k, d] <= goal[k] for k in (0, 1))
                    and not resolved(model, parts, length, goal)
                )
                if pending * record_bytes(DEGREES[d], model.extras) >= best or pending > MOST_RECORDS or stalled:
                    alive[d], open_[d] = False, False
        history.append(worst)
        length /= 2
        keep = open_.any(0)
        if not keep.any():
            break
        if length < longest * Fraction(FINEST):
            alive &= ~open_.any(1)
            break
        halves, mask = [], []
        for i in np.flatnonzero(keep):
            for piece in _halves(nodes[i], length, parts):
                halves.append(piece)
                mask.append(open_[:, i])
        nodes, open_ = halves, np.array(mask).T
    sizes = [(len(leaves[d]) * record_bytes(DEGREES[d], model.extras), d) for d in range(len(DEGREES)) if alive[d]]
    if not sizes:
        raise ToleranceError(
            f"{aim}: no table meets {_text(bounds)}. The best reached is {floor[0]:.2g} and {floor[1]:.2g}: what CSPICE computes is not "
            "smoother than that (its own rounding, the kernel's jumps between records). Ask for less."
        )
    _, d = min(sizes)
    return DEGREES[d], sorted(leaves[d])


def _halves(node: tuple[Fraction, Fraction], length: Fraction, parts: Sequence[Part]) -> list[tuple[Fraction, Fraction]]:
    """Return the parts of a record on the grid of half its cell's length; a record cut short by an end may stay whole."""
    a, b = node
    part = next(p for p in parts if p.start <= a and b <= p.stop)
    cut = part.anchor + ((b - part.anchor) / length - Fraction(1, 10**6)).__floor__() * length
    return [(a, cut), (cut, b)] if a < cut < b and cut - a > length / 1000 and b - cut > length / 1000 else [node]
