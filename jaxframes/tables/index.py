"""Time index of a record table: an even grid, or cells and comparisons, by which an instant finds its record. On the host, exact."""

from fractions import Fraction
from typing import TypeAlias

import numpy as np

from jaxframes.errors import BadKernelError
from jaxframes.numerics import host_two_part
from jaxframes.tables.instants import two_parts

MOST_CELLS = 8
AFTER_END = Fraction(1, 2**30)
"""Segments of kernels are closed at both ends. Where the one that ends keeps its last instant, the next one starts to serve so long, a
nanosecond, after it: long enough for epochs whose two parts are not rounded to each other, and within the spacing of SPICE's epochs."""
Starts: TypeAlias = list[Fraction] | host_two_part.Pair
"""Instants in order: exact numbers, or all of them in two parts."""


def build_index(starts: Starts, stop: Fraction) -> tuple[dict[str, np.ndarray], int]:
    """Return the arrays that find a record by time, and how many comparisons they need.

    Args:
        starts: Where each record starts to serve, seconds past the reference, in order: exact numbers, or an array of two parts.
        stop: Where the last one ends.
    """
    high, low = in_two_parts(starts)
    count, origin = len(high), Fraction(high[0]) + Fraction(low[0])
    half = count // 2
    step, middle = (stop - origin) / count, (Fraction(high[half]) + Fraction(low[half]) - origin) / max(half, 1)
    if count > 1:
        gaps, rests = host_two_part.add((high[1:], low[1:]), (-high[:-1], -low[:-1]))
        usual = np.argsort(gaps)[(count - 1) // 2]
        odd = np.abs((gaps - gaps[usual]) + (rests - rests[usual]))
        shift = float(AFTER_END)  # exact; compared with a fraction, each number would become one
        if ((odd > shift / 2) & (odd < shift * 2)).any():
            return irregular((high, low), stop)  # some record keeps its last instant: not even
    for length in (step, middle):  # the last record may be cut short
        width = [np.full(count, part) for part in two_parts(length)]
        line = host_two_part.multiply((np.arange(float(count)), np.zeros(count)), (width[0], width[1]))
        off = host_two_part.add(host_two_part.add((high, low), (-line[0], -line[1])), (np.full(count, -high[0]), np.full(count, -low[0])))[
            0
        ]
        last = Fraction(high[-1]) + Fraction(low[-1])
        if np.abs(off).max() <= float(length) / 1e10 and stop <= last + length * 2:
            return {"grid": np.array([*two_parts(origin), float(length)])}, 0
    return irregular((high, low), stop)


def irregular(starts: Starts, stop: Fraction) -> tuple[dict[str, np.ndarray], int]:
    """Return what ``build_index`` does, for records of unequal length.

    Raises:
        BadKernelError: If the records are not in time order.
    """
    high, low = in_two_parts(starts)
    origin, last = (Fraction(high[i]) + Fraction(low[i]) for i in (0, -1))
    lengths = np.append(host_two_part.add((high[1:], low[1:]), (-high[:-1], -low[:-1]))[0], float(stop - last))
    if (lengths <= 0).any():
        raise BadKernelError("records of the kernels loaded are not in time order")
    span, count = stop - origin, len(high)
    # A cell no wider than the shortest record needs one comparison; a sliver of a record gets more comparisons, not millions of cells.
    cells = cells_of(count, span, Fraction(lengths.min()))
    width = float(span / cells)
    edges, rest = host_two_part.add((high, low), (np.full(count, -high[0]), np.full(count, -low[0])))
    # Rounded up where it matters: the cell that starts an instant before a record does still belongs to the one before.
    above = np.where(rest > 0, np.nextafter(edges, np.inf), edges)
    corners = np.arange(cells) * width
    slack = 1e-9 * width
    first = np.searchsorted(above, corners, side="right") - 1
    final = np.searchsorted(edges, corners + width + slack, side="right") - 1
    ends = np.stack([np.append(high[1:], np.inf), np.append(low[1:], 0.0)], 1)
    grid = np.array([*two_parts(origin), width])
    return {"grid": grid, "first": first.astype(np.float64), "ends": ends}, int((final - first).max())


def in_two_parts(starts: Starts) -> host_two_part.Pair:
    """Return instants in two parts."""
    if isinstance(starts, tuple):
        return starts
    high, low = np.array([two_parts(start) for start in starts], float).reshape(-1, 2).T
    return high, low


def cells_of(count: int, span: Fraction, shortest: Fraction) -> int:
    """Return how many cells find one of so many records of unequal length, the shortest so long, over a span."""
    return int(min(-(-span // shortest), MOST_CELLS * count + 64))
