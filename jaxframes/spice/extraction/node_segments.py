"""Node segments (SPK types 8, 9, 12, 13) as Chebyshev records: between two nodes the interpolant is one polynomial, so it is exact."""

from fractions import Fraction

import numpy as np

from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segments import MOST, Piece, Records, Segment, damaged

HERMITE, EQUAL_STEPS = (12, 13), (8, 12)
DIRECTORY = 100  # epochs that one word of a segment's directory stands for
BLOCK = 20_000  # records converted at a time
MOST_WINDOW = 64


def read_nodes(pool: KernelPool, piece: Piece) -> Records:
    """Return the records that reproduce a node segment over its piece of the span, one between each two nodes.

    SPICE interpolates a window of neighbouring nodes, by Lagrange (8, 9) or Hermite (12, 13) polynomials. With an even window it changes
    at the nodes, with an odd one half way between, and near the ends of the segment it stays within. The position is the
    kernel's to rounding. The velocity is the position's derivative: the same for Hermite polynomials, while for Lagrange ones SPICE
    interpolates velocities by themselves; by how much these differ is measured and stated.

    Raises:
        BadKernelError: If the segment is damaged.
    """
    segment = piece.segment
    epochs, window = _directory(pool, segment)
    starts, first = _windows(epochs, window)
    begin = int(np.searchsorted(starts, float(piece.start), "right")) - 1
    end = int(np.searchsorted(starts, float(piece.stop), "left"))
    begin, end = max(begin, 0), min(max(end, begin + 1), len(starts))
    first, edges = first[begin:end], np.append(starts, epochs[-1])[begin : end + 1]
    low, high = int(first[0]), int(first[-1]) + window
    states = pool.words(segment, segment.first + 6 * low, segment.first + 6 * high - 1).reshape(-1, 6)
    if not (np.abs(states) < MOST).all():
        raise damaged(segment, "its states are not all numbers of a plausible size")
    middle = edges[:-1] + (edges[1:] - edges[:-1]) / 2
    radius = np.maximum(edges[1:] - middle, middle - edges[:-1])
    parts, worst = [], 0.0
    for a in range(0, len(first), BLOCK):
        use = slice(a, a + BLOCK)
        pick = (first[use] - low)[:, None] + np.arange(window)
        times = epochs[pick + low]
        made, difference = _convert(times, states[pick], middle[use], radius[use], segment.type in HERMITE)
        parts.append(made)
        worst = max(worst, difference)
    coefficients = np.concatenate(parts)
    if not np.isfinite(coefficients).all():
        raise damaged(segment, "its states cannot be interpolated")
    step = Fraction(float(edges[-1] - edges[0])) / len(first)
    origin = Fraction(float(edges[0]))
    even = np.abs(edges - (edges[0] + float(step) * np.arange(len(edges)))).max() <= min(1e-6, 1e-7 * float(step))
    inner = None if even else tuple(Fraction(float(e)) for e in edges[1:-1])
    return Records(coefficients, middle, radius, origin, step, piece.start, piece.stop, inner, worst * 1e3)


def _directory(pool: KernelPool, segment: Segment) -> tuple[np.ndarray, int]:
    """Return the epochs of a segment's nodes and how many nodes a window has."""
    size = segment.last - segment.first + 1
    tail_words = 4 if segment.type in EQUAL_STEPS else 2
    if size < tail_words + 7:
        raise damaged(segment, f"it has {size} words")
    tail = pool.words(segment, segment.last - tail_words + 1, segment.last)
    window, count = tail[-2] + 1, tail[-1]
    least = 1 if segment.type in HERMITE else 2  # one node with its velocity makes a line
    if not np.isfinite(tail).all() or window != int(window) or count != int(count) or not least <= window <= min(count, MOST_WINDOW):
        raise damaged(segment, f"it says {count:g} nodes in windows of {window:g}")
    n = int(count)
    if segment.type in EQUAL_STEPS:
        expected = 6 * n + 4
        epochs = tail[0] + tail[1] * np.arange(n)
    else:
        expected = 7 * n + (n - 1) // DIRECTORY + 2
        if size == expected:
            place = segment.first + 6 * n
            epochs = pool.words(segment, place, place + n - 1)
        else:
            epochs = np.zeros(1)
    if size != expected:
        raise damaged(segment, f"{n} nodes do not fill its {size} words")
    if not np.isfinite(epochs).all() or not (np.diff(epochs) > 0).all():
        raise damaged(segment, "its epochs are not in order")
    slack = 1e-6 * (epochs[-1] - epochs[0])
    if epochs[0] - slack > segment.begin or epochs[-1] + slack < segment.end:
        raise damaged(
            segment, f"its nodes cover ET {epochs[0]:.3f} .. {epochs[-1]:.3f}, its summary {segment.begin:.3f} .. {segment.end:.3f}"
        )
    return epochs, int(window)


def node_grid(pool: KernelPool, segment: Segment) -> tuple[Fraction, Fraction] | None:
    """Return an instant at which the interpolant of a segment of nodes changes, and the step between these; None for uneven nodes.

    Args:
        pool: The kernels.
        segment: A segment of type 8, 9, 12, 13 or 18.
    """
    if segment.type == 18:
        kind, window, count = (int(x) for x in pool.words(segment, segment.last - 2, segment.last))
        place = segment.first + (6 if kind else 12) * count
        if not 0 <= kind <= 1 or not 0 < window <= count or place + count > segment.last:
            return None
        epochs = pool.words(segment, place, place + count - 1)
    else:
        epochs, window = _directory(pool, segment)
    step = (epochs[-1] - epochs[0]) / max(len(epochs) - 1, 1)
    if step <= 0 or np.abs(epochs - (epochs[0] + step * np.arange(len(epochs)))).max() > min(1e-6, 1e-7 * step):
        return None
    exact = Fraction(float(epochs[-1] - epochs[0])) / (len(epochs) - 1)
    return Fraction(float(epochs[0])) + (exact / 2 if window % 2 else 0), exact


def _windows(epochs: np.ndarray, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where each polynomial starts to serve, and the first node of its window (SPICE's choice: spkr08, spkr09)."""
    count, half = len(epochs), (window - 1) // 2
    if window % 2 == 0:
        starts, first = epochs[:-1], np.arange(count - 1) - half
    else:
        starts, first = np.concatenate([epochs[:1], (epochs[1:] + epochs[:-1]) / 2]), np.arange(count) - half
    first = np.clip(first, 0, count - window)
    changes = np.concatenate([[True], np.diff(first) != 0])
    if window % 2 == 0:
        changes[:] = True  # gaps between nodes keep their own records at the ends: short ones are well conditioned
    return starts[changes], first[changes]


def _convert(times: np.ndarray, states: np.ndarray, middle: np.ndarray, radius: np.ndarray, hermite: bool) -> tuple[np.ndarray, float]:
    """Return Chebyshev coefficients [n, 3, terms] of the polynomials through nodes, and how far their derivatives are off SPICE's rates.

    The nodes [n, w] are taken from the nearest outwards, and what is interpolated is the difference from uniform motion through the
    nearest: both keep the rounding at that of small numbers.
    """
    x = (times - middle[:, None]) / radius[:, None]
    order = np.argsort(np.abs(x), axis=1, kind="stable")
    x = np.take_along_axis(x, order, 1)
    states = np.take_along_axis(states, order[:, :, None], 1)
    place, rate = states[:, :1, :3].copy(), states[:, :1, 3:] * radius[:, None, None]
    since = (x - x[:, :1])[:, :, None]
    rest = (states[:, :, :3] - place) - rate * since
    rest_rates = states[:, :, 3:] * radius[:, None, None] - rate
    terms = (2 if hermite else 1) * x.shape[1]
    points = np.cos(np.pi * (np.arange(terms) + 0.5) / terms)
    values = _newton(x, rest, rest_rates if hermite else None, points)
    coefficients = _to_chebyshev(values)
    worst = 0.0
    if not hermite:
        own = _newton(x, rest_rates, None, points)
        derivative = np.polynomial.chebyshev.chebval(points, np.polynomial.chebyshev.chebder(coefficients, axis=1).transpose(1, 0, 2))
        worst = float((np.linalg.norm(derivative.transpose(0, 2, 1) - own, axis=2) / radius[:, None]).max())
    coefficients[:, 0] += (place - rate * x[:, :1, None])[:, 0]
    coefficients[:, 1] += rate[:, 0]
    return coefficients.transpose(0, 2, 1), worst


def _newton(x: np.ndarray, values: np.ndarray, rates: np.ndarray | None, points: np.ndarray) -> np.ndarray:
    """Return the polynomials through values [n, w, 3] (and rates) at nodes x [n, w], at points [m] common to all: [n, m, 3]."""
    z, column = (x, values) if rates is None else (np.repeat(x, 2, 1), np.repeat(values, 2, 1))
    count = z.shape[1]
    leading = [column[:, 0]]
    for level in range(1, count):
        gap = z[:, level:] - z[:, :-level]
        if level == 1 and rates is not None:
            gap[:, ::2] = 1.0
        column = (column[:, 1:] - column[:, :-1]) / gap[:, :, None]
        if level == 1 and rates is not None:
            column[:, ::2] = rates  # nodes that coincide: the divided difference is the derivative
        leading.append(column[:, 0])
    out = np.broadcast_to(leading[-1][:, None], (len(x), len(points), 3)).copy()
    for level in range(count - 2, -1, -1):
        out = out * (points[None, :] - z[:, level, None])[:, :, None] + leading[level][:, None]
    return out


def _to_chebyshev(values: np.ndarray) -> np.ndarray:
    """Return coefficients [n, m, 3] from values [n, m, 3] at the m zeros of T_m."""
    m = values.shape[1]
    basis = np.cos(np.pi * np.outer(np.arange(m), np.arange(m) + 0.5) / m) * (2 / m)
    basis[0] /= 2
    return np.einsum("kj,njc->nkc", basis, values)
