"""Chebyshev series and their time derivatives by Clenshaw's recurrence, on components."""

from collections.abc import Sequence

import jax


def series(terms: Sequence[jax.Array], s: jax.Array, order: int) -> tuple[jax.Array, ...]:
    """Return a Chebyshev series and its first derivatives with respect to s.

    The value and the first derivative take the same operations in the same order as SPICE's CHBINT, so that they agree to
    rounding. Differentiating the recurrence k times gives one more recurrence for each derivative:
    w_j = c_j + 2 s w_{j+1} - w_{j+2}, and with D^k: D^k w_j = 2 k D^{k-1} w_{j+1} + 2 s D^k w_{j+1} - D^k w_{j+2}.

    Args:
        terms: Coefficients c_0, c_1, ..., each [...].
        s: Argument in [-1, 1], [...].
        order: Highest derivative.

    Returns:
        The value and ``order`` derivatives, each [...].
    """
    zero = s * 0  # not zeros_like: a NaN in s must reach series of any length
    twice = s + s
    last, before = [zero] * (order + 1), [zero] * (order + 1)
    for term in reversed(terms[1:]):
        new = [term + (twice * last[0] - before[0])]
        new += [2 * k * last[k - 1] + twice * last[k] - before[k] for k in range(1, order + 1)]
        last, before = new, last
    value = terms[0] + (s * last[0] - before[0])
    return (value, *(k * last[k - 1] + s * last[k] - before[k] for k in range(1, order + 1)))
