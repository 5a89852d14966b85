"""Error-free sums: the arithmetic of numbers kept in two parts.

XLA compiles these without reassociation, so they stay exact under jit on CPU (a test asserts it).
"""

import jax


def two_sum(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return (s, e) with s = fl(a + b) and s + e = a + b exactly (Knuth 1969)."""
    s = a + b
    bb = s - a
    return s, (a - (s - bb)) + (b - bb)


def fast_two_sum(a: jax.Array, b: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return (s, e) as ``two_sum`` does, for |a| >= |b| (Dekker 1971)."""
    s = a + b
    return s, b - (s - a)
