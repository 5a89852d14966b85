"""Error-free sums stay exact under jit, vmap and inside larger programs."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics import host_two_part
from jaxframes.numerics.two_part import fast_two_sum, two_product, two_sum


def pairs(dtype):
    rng = np.random.default_rng(0)
    a = rng.normal(size=2000) * 10 ** rng.uniform(-6, 12, 2000)
    b = rng.normal(size=2000) * 10 ** rng.uniform(-6, 12, 2000)
    b[:50] = -a[:50] * (1 + 1e-12)
    return a.astype(dtype), b.astype(dtype)


def assert_exact(s, e, a, b):
    assert all(
        Fraction(float(s_)) + Fraction(float(e_)) == Fraction(float(a_)) + Fraction(float(b_))
        for s_, e_, a_, b_ in zip(s, e, a, b, strict=True)
    )
    assert np.array_equal(s, a + b)
    assert np.any(np.asarray(e) != 0)


def test_exact_under_jit(dtype):
    a, b = pairs(dtype)
    for transform in (jax.jit, lambda f: jax.jit(jax.vmap(f))):
        assert_exact(*transform(two_sum)(a, b), a, b)
        large, small = np.where(abs(a) >= abs(b), a, b), np.where(abs(a) >= abs(b), b, a)
        assert_exact(*transform(fast_two_sum)(large, small), large, small)


def test_exact_inside_a_larger_program(dtype):
    """Sums of products before and after: contraction of a product and a sum would show here."""
    a, b = pairs(dtype)
    a, b = a[np.abs(a) < 1e6], b[np.abs(a) < 1e6]

    @jax.jit
    def program(a, b):
        scaled = a * jnp.asarray(2.0, dtype)
        s, e = two_sum(scaled, b)
        return scaled, s, e, jnp.sum(s * e)

    scaled, s, e, _ = program(a, b)
    assert_exact(s, e, np.asarray(scaled), b)


def test_products_are_exact(dtype):
    """Product and remainder, on the device as in NumPy, hold every digit of the product of two numbers."""
    rng = np.random.default_rng(1)
    a, b = (x.astype(dtype) for x in (rng.normal(size=500) * 10 ** rng.uniform(-6, 6, 500), rng.normal(size=500)))
    ways = [jax.jit(two_product), jax.jit(jax.vmap(two_product)), lambda a, b: jax.jit(lambda *x: two_product(*x)[::-1])(a, b)[::-1]]
    if dtype == np.float64:
        ways.append(host_two_part.two_product)
    for way in ways:
        p, e = way(a, b)
        assert np.array_equal(p, a * b)
        assert np.any(np.asarray(e) != 0)
        for parts in zip(p, e, a, b, strict=True):
            product, rest, x, y = (Fraction(float(number)) for number in parts)
            assert product + rest == x * y
    slope, rest = jax.jvp(two_product, (jnp.asarray(a), jnp.asarray(b)), (jnp.asarray(b), jnp.asarray(a)))[1]
    np.testing.assert_allclose(slope, b * b + a * a, rtol=4 * np.finfo(dtype).eps)
    assert not np.any(rest)
