"""Double-double arithmetic on NumPy arrays: numbers as unevaluated sums (hi, lo) of two doubles, about 32 digits."""

from typing import TypeAlias

import numpy as np

Pair: TypeAlias = tuple[np.ndarray, np.ndarray]


def two_sum(a: np.ndarray, b: np.ndarray) -> Pair:
    """Return the sum of two doubles and its rounding error, exactly (Knuth 1969)."""
    s = a + b
    bb = s - a
    return s, (a - (s - bb)) + (b - bb)


def two_product(a: np.ndarray, b: np.ndarray) -> Pair:
    """Return the product of two doubles and its rounding error, exactly (Dekker 1971)."""
    p = a * b
    (ah, al), (bh, bl) = _halves(a), _halves(b)
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


def _halves(a: np.ndarray) -> Pair:
    t = 134217729.0 * a  # 2**27 + 1
    high = t - (t - a)
    return high, a - high


def add(a: Pair, b: Pair) -> Pair:
    """Return a + b."""
    s, e = two_sum(a[0], b[0])
    return two_sum(s, e + (a[1] + b[1]))


def multiply(a: Pair, b: Pair) -> Pair:
    """Return a * b."""
    p, e = two_product(a[0], b[0])
    return two_sum(p, e + (a[0] * b[1] + a[1] * b[0]))


def divide(a: Pair, b: np.ndarray) -> Pair:
    """Return a / b for doubles b."""
    q = a[0] / b
    p, e = two_product(q, b)
    rest = ((a[0] - p) - e) + a[1]
    return two_sum(q, rest / b)
