"""Composing Chebyshev record tables into one: each restricted to the records of the finest grid, in double-double, and added."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np

from jaxframes.numerics import host_two_part
from jaxframes.numerics.host_two_part import Pair
from jaxframes.tables.index import build_index
from jaxframes.tables.records import METRES, HostRecordTable

CLOSE = Fraction(1, 10**6)
"""Edges nearer to each other than this, in seconds, are one: records are good a little beyond their ends."""


def composed(record_tables: Sequence[HostRecordTable], start: Fraction, stop: Fraction) -> HostRecordTable:
    """Return one record table in metres, values summed: its records are the parts into which those of all record tables cut the span.

    Each series is restricted to its part by the recurrence T_{k+1}(a s + b) = 2 (a s + b) T_k(a s + b) - T_{k-1}(a s + b) on
    coefficients; everything is double-double until the sums are rounded once.

    Args:
        record_tables: Record tables in km, series of three.
        start: Start of the span, seconds past the reference.
        stop: End of the span, likewise.
    """
    edges = [edges_of(records) for records in record_tables]
    known = [e for own in edges for e in own]
    start, stop = max((e for e in known if e <= start), default=start), min((e for e in known if e >= stop), default=stop)
    cuts = [start]
    for edge in sorted(e for own in edges for e in own if start < e < stop):
        if edge - cuts[-1] > CLOSE and stop - edge > CLOSE:
            cuts.append(edge)
    bounds = [*cuts, stop]
    middle = np.array([float((a + b) / 2) for a, b in pairwise(bounds)])
    radius = np.array([float(max(b - Fraction(m), Fraction(m) - a)) for a, b, m in zip(bounds, bounds[1:], middle, strict=False)])
    total: Pair | None = None
    terms = max((records.arrays["rows"].shape[1] - 3) // 3 for records in record_tables)
    for records, own in zip(record_tables, edges, strict=True):
        starts = np.array([float(e) for e in own])
        which = np.clip(np.searchsorted(starts, middle, "right") - 1, 0, len(records.arrays["rows"]) - 1)
        part = _restricted(records.arrays["rows"][which], middle, radius, terms)
        total = part if total is None else host_two_part.add(total, part)
    assert total is not None
    metres = host_two_part.multiply(total, (np.full_like(total[0], METRES), np.zeros_like(total[0])))
    rows = np.concatenate([metres[0].reshape(len(middle), -1), middle[:, None], np.zeros((len(middle), 1)), radius[:, None]], 1)
    found, compares = build_index(cuts, stop)
    return HostRecordTable({"rows": rows, **found}, 3, compares)


def edges_of(records: HostRecordTable) -> list[Fraction]:
    """Return where each record of a record table starts to serve, exact seconds past the reference; and where a uniform one ends."""
    origin = Fraction(records.arrays["grid"][0]) + Fraction(records.arrays["grid"][1])
    if "ends" not in records.arrays:
        width = Fraction(records.arrays["grid"][2])
        return [origin + i * width for i in range(len(records.arrays["rows"]) + 1)]
    return [origin, *(Fraction(a) + Fraction(b) for a, b in records.arrays["ends"][:-1])]


def _restricted(rows: np.ndarray, middle: np.ndarray, radius: np.ndarray, terms: int) -> Pair:
    """Return the coefficients [n, terms, 3] of records on parts of them, in double-double."""
    n = len(rows)
    own = (rows.shape[1] - 3) // 3
    coefficients = rows[:, :-3].reshape(n, own, 3)
    high, low = host_two_part.two_sum(middle, -rows[:, -3])
    shift = host_two_part.divide(host_two_part.two_sum(high, low - rows[:, -2]), rows[:, -1])
    zero = np.zeros(n)
    scale = host_two_part.divide((radius, zero), rows[:, -1])
    same = (np.abs(shift[0]) < 1e-14) & (np.abs(scale[0] - 1) < 1e-14)
    scale = (np.where(same, 1.0, scale[0]), np.where(same, 0.0, scale[1]))
    shift = (np.where(same, 0.0, shift[0]), np.where(same, 0.0, shift[1]))
    one = (np.zeros((n, terms)), np.zeros((n, terms)))
    one[0][:, 0] = 1.0
    before, now = one, _times(one, scale, shift)
    out = _added(np.zeros((n, terms, 3)), coefficients[:, 0], one, None)
    for k in range(1, own):
        out = _added(out[0], coefficients[:, k], now, out[1])
        twice = _times(now, scale, shift)
        before, now = now, host_two_part.add((2 * twice[0], 2 * twice[1]), (-before[0], -before[1]))
    return out


def _added(high: np.ndarray, factors: np.ndarray, basis: Pair, low: np.ndarray | None) -> Pair:
    """Return a sum of coefficients plus three factors times one series."""
    wide = (np.broadcast_to(factors[:, None, :], high.shape), np.zeros(high.shape))
    term = host_two_part.multiply(tuple(b[:, :, None] + np.zeros(3) for b in basis), wide)  # pyright: ignore[reportArgumentType]
    return host_two_part.add((high, np.zeros_like(high) if low is None else low), term)


def _times(series: Pair, scale: Pair, shift: Pair) -> Pair:
    """Return the coefficients of (scale s + shift) times a series: s T_0 = T_1, s T_j = (T_{j+1} + T_{j-1}) / 2."""
    up = tuple(np.concatenate([np.zeros((len(p), 1)), p[:, :-1] / 2], 1) for p in series)
    down = tuple(np.concatenate([p[:, 1:] / 2, np.zeros((len(p), 1))], 1) for p in series)
    for part, origin in zip(up, series, strict=True):
        part[:, 1:2] = origin[:, :1]
    product = host_two_part.add(up, down)  # pyright: ignore[reportArgumentType]
    wide = lambda pair: (pair[0][:, None], pair[1][:, None])  # noqa: E731
    return host_two_part.add(host_two_part.multiply(product, wide(scale)), host_two_part.multiply(series, wide(shift)))
