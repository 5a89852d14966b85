"""The sine-cosine pair: within 2 ulp where polynomials serve, the library's values beyond, each the other's derivative."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from jax.experimental.jet import jet

from jaxframes.numerics.trig import REACH, sin_cos


def errors(x):
    """Return the errors of (sin, cos) at x in units in the last place of the true values."""
    pair = [np.asarray(part) for part in jax.jit(sin_cos)(x)]
    eps = float(np.finfo(x.dtype).eps)
    result = []
    with mp.workdps(60):
        for got, exact in zip(pair, (mp.sin, mp.cos), strict=True):
            want = [exact(mp.mpf(float(v))) for v in x]
            unit = [max(2.0 ** np.floor(np.log2(abs(float(w)))), 1e-300) * eps if w else eps for w in want]
            result.append(np.array([abs(float(mp.mpf(float(g)) - w)) / u for g, w, u in zip(got, want, unit, strict=True)]))
    return result


def samples(dtype, limit):
    rng = np.random.default_rng(0)
    signs = rng.choice([-1.0, 1.0], 500)
    spread = np.concatenate(
        [rng.uniform(-np.pi, np.pi, 800), signs * 10 ** rng.uniform(-12, np.log10(limit), 500), [0.0, 1.0, limit, -limit]]
    )
    quarters = np.round(10 ** rng.uniform(0, np.log10(limit / 2), 200)) * np.pi / 2
    return np.concatenate([spread, quarters[quarters < limit]]).astype(dtype)


def test_within_one_and_a_half_ulp_in_reach(dtype):
    for limit in (8.0, 8e3, 8e5, REACH[dtype.name]):
        for error in errors(samples(dtype, limit)):
            assert error.max() <= 1.5, limit


def test_beyond_reach_there_is_no_answer(dtype):
    x = np.array([0.5, 2 * REACH[dtype.name], -1e3 * REACH[dtype.name], 1e20, np.inf, np.nan], dtype)
    s, c = jax.jit(sin_cos)(x)
    assert np.isnan(s[1:]).all()
    assert np.isnan(c[1:]).all()
    assert np.array_equal([s[0], c[0]], jax.jit(sin_cos)(x[0])), "no sample depends on its neighbours"
    gradient = jax.vmap(jax.grad(lambda v: sin_cos(v)[0]))(x)
    assert np.isnan(gradient[1:]).all()


def test_there_is_no_branch(dtype):
    text = jax.jit(sin_cos).lower(jnp.ones(3, dtype)).as_text()
    assert "stablehlo.case" not in text
    assert "stablehlo.reduce" not in text


def test_series_through_jet(dtype):
    """Taylor coefficients, which no branch can take: sin(x + t) = sin x + t cos x - t^2 / 2 sin x."""
    value, (first, second) = jet(lambda x: sin_cos(x)[0], (jnp.asarray(0.3, dtype),), ((jnp.ones((), dtype), jnp.zeros((), dtype)),))
    np.testing.assert_allclose([value, first, second], [np.sin(0.3), np.cos(0.3), -np.sin(0.3)], rtol=8 * np.finfo(dtype).eps)


def test_derivatives_are_each_other():
    x = jnp.linspace(-4, 4, 9)
    s, c = sin_cos(x)
    each = jax.vmap(jax.grad(lambda v: sin_cos(v)[0])), jax.vmap(jax.grad(lambda v: sin_cos(v)[1]))
    assert np.array_equal(each[0](x), c)
    assert np.array_equal(each[1](x), -s)
    assert np.array_equal(jax.vmap(jax.grad(jax.grad(lambda v: sin_cos(v)[0])))(x), -s)


def test_known_numbers_stay_numbers():
    assert sin_cos(0.0) == (0.0, 1.0)
    assert all(isinstance(part, float) for part in sin_cos(0.3))


@pytest.mark.parametrize("shape", [(), (1,), (3, 2)])
def test_any_shape_and_batching(shape):
    x = jnp.ones(shape)
    s, c = sin_cos(x)
    assert s.shape == c.shape == shape
    assert np.allclose(jax.vmap(lambda v: sin_cos(v)[0])(jnp.ones((4, *shape))), np.sin(1.0))
