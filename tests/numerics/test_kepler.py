"""Kepler's equation against its own residual at 40 digits, on ellipses, parabolas and hyperbolas; derivatives by the implicit rule."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from jaxframes.numerics import kepler


def test_the_eccentric_anomaly_solves_keplers_equation(dtype, rng):
    mean = np.r_[0.0, 1e-9, np.pi, -np.pi, rng.uniform(-np.pi, np.pi, 40)].astype(dtype)
    e = np.r_[0.0, 0.99, 0.5, 0.2, rng.uniform(0, 0.99, 40)].astype(dtype)
    found = np.asarray(jax.jit(kepler.eccentric_anomaly)(mean, e), np.float64)
    for m, ecc, x in zip(mean.tolist(), e.tolist(), found.tolist(), strict=True):
        with mp.workdps(40):
            exact = mp.findroot(lambda E, m=m, ecc=ecc: E - ecc * mp.sin(E) - m, x, tol=1e-30)
            slope = 1 - ecc * mp.cos(exact)
            # the rounding of M moves E by eps |M| / slope, that of e by eps e |sin E| / slope
            assert abs(x - exact) <= np.finfo(dtype).eps * (abs(x) + (abs(m) + ecc * abs(mp.sin(exact))) / slope)


@pytest.mark.float64
def test_the_universal_anomaly_solves_its_equation(rng):
    count = 60
    q, mu = rng.uniform(6.6e6, 4e7, count), np.full(count, 3.986004418e14)
    e = np.r_[0.0, 1.0, 1.0 - 1e-9, 1.0 + 1e-9, rng.uniform(0, 1, 28), rng.uniform(1, 6, 28)]
    time = rng.uniform(-1, 1, count) * np.where(e < 1, np.pi * np.sqrt(q**3 / np.abs(1 - e + (e == 1)) ** 3 / mu), 2e5)
    time = np.clip(time, -1e6, 1e6)
    found = jax.jit(kepler.universal_anomaly)(time, q, e, mu)
    for t, peri, ecc, gm, s in zip(*(x.tolist() for x in (time, q, e, mu, np.asarray(found))), strict=True):
        with mp.workdps(40):
            x = mp.mpf(gm) * (1 - mp.mpf(ecc)) / peri * mp.mpf(s) ** 2
            c2, c3 = (mp.nsum(lambda n, x=x, k=k: (-x) ** n / mp.factorial(2 * n + k), [0, 60]) for k in (2, 3))
            residual = peri * mp.mpf(s) + mp.mpf(gm) * ecc * mp.mpf(s) ** 3 * c3 - t
            radius = peri + mp.mpf(gm) * ecc * mp.mpf(s) ** 2 * c2
            assert abs(residual / radius) <= 2e-15 * abs(s) + 4e-16 * abs(t) / radius


@pytest.mark.float64
def test_derivatives_of_any_order_are_the_equations(rng):
    """Of E, of M and e: E' = 1 / (1 - e cos E), E'' = -e sin E / (1 - e cos E)^3."""
    e, mean = 0.6, jnp.linspace(-2.0, 3.0, 7)
    solve = lambda m: kepler.eccentric_anomaly(m, jnp.asarray(e))
    found, first = jax.vmap(solve)(mean), jax.vmap(jax.grad(solve))(mean)
    second = jax.vmap(jax.grad(jax.grad(solve)))(mean)
    slope = 1 - e * np.cos(found)
    np.testing.assert_allclose(first, 1 / slope, rtol=1e-13)
    np.testing.assert_allclose(second, -e * np.sin(found) / slope**3, rtol=1e-12)
    through_a_loop = jax.grad(lambda m: jax.lax.scan(lambda c, x: (c + solve(x * m), None), 0.0, mean)[0])(1.0)
    np.testing.assert_allclose(through_a_loop, np.sum(first * mean), rtol=1e-13)
