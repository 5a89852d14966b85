"""Coefficients of rotations against 60 digits: values, first and second derivatives, on both sides of every border and at it."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from jaxframes.numerics import smooth

SQUARES = [0.0, 1e-18, 1e-8, 0.03, 0.0624999, 0.0625, 0.0625001, 0.09, 0.5, 0.999999, 1.0, 1.000001, 3.999999, 4.0, 4.00001, 6.0, 9.8, 30.0]


def power_series(order, square):
    return mp.nsum(lambda n: (-square) ** int(n) / mp.factorial(order + 2 * int(n)), [0, 40])


def cotangent(square):
    """(c3 - 2 c4) / (2 c2) as the text-book formula, by its series at 0."""
    if square == 0:
        return mp.mpf(1) / 12
    a = mp.sqrt(square)
    return (1 - a / 2 * mp.cot(a / 2)) / square


EXACT = {
    "versine": lambda z: power_series(2, z),
    "cubic_remainder": lambda z: power_series(3, z),
    "half_cotangent_remainder": cotangent,
}


@pytest.mark.parametrize("name", [*EXACT, "cos", "sinc"])
def test_value_and_two_derivatives(name, dtype, tol):
    function = {"cos": lambda z: smooth.cos_sinc(z)[0], "sinc": lambda z: smooth.cos_sinc(z)[1]}.get(name) or getattr(smooth, name)
    exact = {"cos": lambda z: power_series(0, z), "sinc": lambda z: power_series(1, z)}.get(name) or EXACT[name]
    z = np.array(SQUARES, dtype)
    orders = [function, jax.grad(function), jax.grad(jax.grad(function)), jax.jacfwd(jax.jacfwd(function))]
    ours = jax.jit(lambda x: [jax.vmap(part)(x) for part in orders])(z)
    with mp.workdps(60):
        points = [mp.mpf(float(v)) for v in z]
        step = mp.mpf("1e-12")
        middle = [[exact(abs(v + i * step) if name == "half_cotangent_remainder" else v + i * step) for i in (-1, 0, 1)] for v in points]
        keep = np.array([name != "half_cotangent_remainder" or v > 1e-9 for v in z])
        first = [float((c - a) / (2 * step)) for a, _, c in middle]
        second = [float((c - 2 * b + a) / step**2) for a, b, c in middle]
        value = [float(b) for _, b, _ in middle]
    for got, want in zip(ours, (value, first, second, second), strict=True):
        kept = np.ones_like(keep) if want is value else keep
        got, want = np.asarray(got, float)[kept], np.array(want)[kept]
        error = np.abs(got - want) / np.abs(want)
        assert error.max() < tol, (name, z[kept][error.argmax()], error.max())


def test_arc(dtype, tol):
    """atan2(s, w) / s and its derivatives along both arguments, near s = 0, on the border and near w = 0."""
    points = np.array(
        [[0, 1], [1e-16, 1], [0.06, 1], [0.0625, 1], [0.0626, 1], [0.5, 0.7], [1, 1e-9], [1, 0], [1, -1e-3], [0.01, 0.3]], dtype
    )
    ours = jax.jit(jax.vmap(lambda p: (smooth.arc(*p), jax.jacrev(lambda q: smooth.arc(*q))(p), jax.hessian(lambda q: smooth.arc(*q))(p))))(
        points
    )

    def exact(square, w):
        root = mp.sqrt(square)
        return mp.re(mp.atan(root / w) / root) if w > 0 and square else (1 / w if not square else mp.atan2(root, w) / root)

    with mp.workdps(60):
        for i, (square, w) in enumerate(points):
            square, w, h = mp.mpf(float(square)), mp.mpf(float(w)), mp.mpf("1e-14")
            assert abs(float(ours[0][i]) - float(exact(square, w))) < tol * abs(float(exact(square, w)))
            if square > 1e-10:
                first = [(exact(square + h, w) - exact(square - h, w)) / (2 * h), (exact(square, w + h) - exact(square, w - h)) / (2 * h)]
                assert np.abs(ours[1][i] - np.array([float(v) for v in first], dtype)).max() < 4 * tol * (1 + abs(float(first[0])))
                mixed = (exact(square + h, w + h) - exact(square + h, w - h) - exact(square - h, w + h) + exact(square - h, w - h)) / (
                    4 * h * h
                )
                assert abs(float(ours[2][i][0, 1]) - float(mixed)) < 20 * tol * (1 + abs(float(mixed)))
            else:
                assert np.abs(ours[1][i] - np.array([-1 / 3, -1.0], dtype)).max() < tol
                assert np.abs(ours[2][i] - np.array([[0.4, 1.0], [1.0, 2.0]], dtype)).max() < 4 * tol


def test_reverse_mode_at_a_border_counts_one_branch():
    """Second derivatives in reverse mode where the number that decides is itself computed: 64-bit and 32-bit, in one program.

    A ``where`` on a computed square gave twice the derivative, or none of it, for some of these points.
    """
    rng = np.random.default_rng(0)
    v = rng.normal(size=(2000, 3))
    sizes = np.sqrt(rng.choice([0.0625, 1.0, 4.0], (2000, 1)))
    v = jnp.asarray(v / np.linalg.norm(v, axis=1, keepdims=True) * sizes, np.float32)

    def total(x):
        square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        return smooth.half_cotangent_remainder(square) + smooth.cubic_remainder(square) + smooth.arc(square, jnp.ones_like(square))

    second = jax.jit(jax.vmap(jax.jacfwd(jax.jacrev(total))))(v)
    forward = jax.jit(jax.vmap(jax.jacfwd(jax.jacfwd(total))))(v)
    assert np.abs(second - forward).max() < 1e-5


def test_norm_needs_no_room(dtype):
    largest, smallest = float(np.finfo(dtype).max) / 4, float(np.finfo(dtype).tiny) * 8
    for size in (largest, smallest, 1.0):
        length = smooth.norm([jnp.asarray(0.6 * size, dtype), jnp.asarray(-0.8 * size, dtype)])
        assert float(length) == pytest.approx(size, rel=1e-6)
    assert smooth.norm([jnp.zeros(())] * 3) == 0
    assert jax.grad(lambda x: smooth.norm([x, x]))(0.0) == 0
