"""Records of segments as Chebyshev series: the reader of each segment type, and those of Chebyshev segments themselves."""

import math
from fractions import Fraction

import numpy as np

from jaxframes.errors import BadKernelError
from jaxframes.spice.extraction.node_segments import read_nodes
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segments import MOST, Piece, Records, damaged


def read_chebyshev(pool: KernelPool, piece: Piece) -> Records:
    """Return the records of a Chebyshev segment (types 2 and 3) that cover its piece of the span, and no others.

    Raises:
        NoPathError: If the segment's type is not read.
        BadKernelError: If the segment is damaged.
    """
    segment = piece.segment
    init, length, size, count = segment.grid()
    step = Fraction(length)
    first = min(max(math.floor((piece.start - Fraction(init)) / step), 0), count - 1)
    # The instant at which a record ends belongs to the next one, except the last of the piece.
    last = min(max(math.ceil((piece.stop - Fraction(init)) / step) - 1, first), count - 1)
    address = segment.first + first * size
    rows = pool.words(segment, address, segment.first + (last + 1) * size - 1).reshape(last - first + 1, size)
    middle, radius = rows[:, 0].copy(), rows[:, 1].copy()
    expected = init + (np.arange(first, last + 1) + 0.5) * length
    if (
        not np.isfinite(rows).all()
        or np.abs(rows[:, 2:]).max() > MOST
        or np.abs(middle - expected).max() > 1e-6 * length
        or np.abs(radius * 2 / length - 1).max() > 1e-6
    ):
        raise BadKernelError(f"{segment.describe()} is damaged: its records are not finite or not where its directory says.")
    coefficients = rows[:, 2:].reshape(len(rows), segment.series, -1)
    return Records(coefficients, middle, radius, Fraction(init) + first * step, step, piece.start, piece.stop)


def read_velocities(pool: KernelPool, piece: Piece) -> Records:
    """Return the records of a type 20 segment, velocities as Chebyshev series and positions at the middles, integrated: exact.

    Raises:
        BadKernelError: If the segment is damaged.
    """
    segment = piece.segment
    total = segment.last - segment.first + 1
    if total < 7:
        raise damaged(segment, f"it has {total} words")
    tail = pool.words(segment, segment.last - 6, segment.last)
    scale, second, day, part, length, size, count = (float(w) for w in tail)
    if not np.isfinite(tail).all() or size != int(size) or count != int(count) or size < 6 or size % 3 or count < 1 or length <= 0:
        raise damaged(segment, f"it says {count:g} records of {size:g} words and {length:g} days")
    if scale <= 0 or second <= 0 or total != size * count + 7:
        raise damaged(segment, f"{count:g} records of {size:g} words do not fill its {total} words")
    origin = (Fraction(day) - 2451545 + Fraction(part)) * 86400
    step = Fraction(length) * 86400
    if not origin - step / 10**6 <= Fraction(segment.begin) <= Fraction(segment.end) <= origin + step * int(count) + step / 10**6:
        raise damaged(segment, "its records do not cover what its summary says")
    first = min(max(math.floor((piece.start - origin) / step), 0), int(count) - 1)
    last = min(max(math.ceil((piece.stop - origin) / step) - 1, first), int(count) - 1)
    address = segment.first + first * int(size)
    rows = pool.words(segment, address, segment.first + (last + 1) * int(size) - 1).reshape(last - first + 1, 3, int(size) // 3)
    if not (np.abs(rows) < MOST).all():
        raise damaged(segment, "its records are not all numbers of a plausible size")
    radius = float(step) / 2
    rates = rows[:, :, :-1] * (scale / second) * radius
    integral = np.polynomial.chebyshev.chebint(rates, axis=2)  # zero at the middle, which chebint takes by default
    integral[:, :, 0] += rows[:, :, -1] * scale
    middle = np.array([float(origin + (first + i + Fraction(1, 2)) * step) for i in range(len(rows))])
    return Records(integral, middle, np.full(len(rows), radius), origin + first * step, step, piece.start, piece.stop)


READERS = {
    **{("SPK", kind): read_nodes for kind in (8, 9, 12, 13)},
    ("SPK", 20): read_velocities,
}
"""Kind of file and type of segment -> its reader; Chebyshev segments of types 2 and 3 otherwise."""
POLYNOMIAL = {("SPK", 2), ("SPK", 3), ("PCK", 2), *READERS}


def read_piece(pool: KernelPool, piece: Piece) -> Records:
    """Return the records of a segment that cover its piece of the span.

    Raises:
        NoPathError: If the segment's type is not made of polynomials.
        BadKernelError: If the segment is damaged.
    """
    reader = READERS.get((piece.segment.kind, piece.segment.type), read_chebyshev)
    return reader(pool, piece)
