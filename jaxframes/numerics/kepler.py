"""Kepler's equation: the anomaly of an ellipse without a loop, and that of any conic in universal variables.

Both are operations whose derivative is the implicit one, so it is exact to any order, whatever solved the equation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import select
from jaxframes.numerics.trig import sin_cos
from jaxframes.staging.operation import Arrays, Operation, run

QUARTERINGS = 4
"""Times that the argument of Stumpff's functions is quartered before their series."""
TERMS = 9
STEPS = 8
"""Laguerre's steps: convergence is cubic, so that half of them would do for most orbits."""
HIGHEST = 0.999
"""Largest eccentricity up to which the ellipse's own solution keeps 1e-13; beyond, use that of any conic."""


def eccentric_anomaly(mean: jax.Array, eccentricity: jax.Array) -> jax.Array:
    """Return E with E - e sin E = M, in [-pi, pi] as M is.

    Markley's cubic start and one fifth-order step (Celestial Mechanics and Dynamical Astronomy 63, 1995): no loop.

    Args:
        mean: Mean anomaly M [...], rad, in [-pi, pi].
        eccentricity: e [...] below one.
    """
    return _elementwise(_Ellipse(), mean, eccentricity)


def universal_anomaly(time: jax.Array, periapsis: jax.Array, eccentricity: jax.Array, mu: jax.Array) -> jax.Array:
    """Return s with t = q s + mu e s^3 c3(b s^2), b = mu (1 - e) / q: any conic, from periapsis on (Sundman's variable, ds = dt / r).

    Args:
        time: Seconds past periapsis [...]; for ellipses within half a period of it.
        periapsis: Distance q of the periapsis [...], m.
        eccentricity: e [...], zero or more.
        mu: Gravitational parameter [...], m3/s2.
    """
    return _elementwise(_Conic(), time, periapsis, eccentricity, mu)


def _elementwise(operation: Operation, *values: Any) -> jax.Array:
    return run(operation, *jnp.broadcast_arrays(*map(jnp.asarray, values)))[0]


@dataclass(frozen=True)
class _Equation(Operation):
    """An equation that is solved element by element; all arrays are of one shape."""

    def results(self, *arrays: Any) -> list[jax.ShapeDtypeStruct]:
        return [jax.ShapeDtypeStruct(arrays[0].shape, arrays[0].dtype)]

    def mapped(self, count: int, axes: tuple[int | None, ...], *arrays: jax.Array) -> Arrays:
        full = (a if axis is not None else jnp.broadcast_to(a, (count, *a.shape)) for a, axis in zip(arrays, axes, strict=True))
        return run(self, *full)


@dataclass(frozen=True)
class _Ellipse(_Equation):
    """Of M and e."""

    def compute(self, *arrays: jax.Array) -> Arrays:
        mean, e = arrays
        pi = np.pi
        alpha = (3 * pi**2 + 1.6 * pi * (pi - jnp.abs(mean)) / (1 + e)) / (pi**2 - 6)
        d = 3 * (1 - e) + alpha * e
        r = 3 * alpha * d * (d - 1 + e) * mean + mean * mean * mean
        q = 2 * alpha * d * (1 - e) - mean * mean
        w = jnp.cbrt(jnp.square(jnp.abs(r) + jnp.sqrt(q * q * q + r * r)))
        found = (2 * r * w / (w * w + w * q + q * q) + mean) / d
        s, c = sin_cos(found)
        f2, f3 = e * s, e * c
        f0, f1 = (found - f2) - mean, 1 - f3
        d3 = -f0 / (f1 - 0.5 * f0 * f2 / f1)
        d4 = -f0 / (f1 + 0.5 * d3 * f2 + d3 * d3 * f3 / 6)
        d5 = -f0 / (f1 + 0.5 * d4 * f2 + d4 * d4 * f3 / 6 - d4 * d4 * d4 * f2 / 24)
        return (found + d5,)

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        (found,), e = run(self, *primals), primals[1]
        s, c = sin_cos(found)
        parts = [None if tangent is None else tangent * by for tangent, by in zip(tangents, (1.0, s), strict=True)]
        known = [part for part in parts if part is not None]
        return (found,), (sum(known[1:], known[0]) / (1 - e * jnp.asarray(c)),)


@dataclass(frozen=True)
class _Conic(_Equation):
    """Of t, q, e and mu."""

    def compute(self, *arrays: jax.Array) -> Arrays:
        time, q, e, mu = arrays
        beta = mu * (1 - e) / q
        steep = time * time * mu * e / (6 * q * q * q)  # the start: q s + mu e s^3 / 6 = t, that is s = g t / q with steep g^3 + g = 1
        g = 1 / jnp.cbrt(1 + steep)
        for _ in range(2):
            g = g - (steep * g * g * g + g - 1) / (3 * steep * g * g + 1)

        def laguerre(_: Any, s: jax.Array) -> jax.Array:
            _, g1, g2, g3 = universal_functions(s, beta)
            f, f1, f2 = q * s + mu * e * g3 - time, q + mu * e * g2, mu * e * g1
            return s - 5 * f / (f1 + jnp.sqrt(jnp.abs(16 * f1 * f1 - 20 * f * f2)))

        return (lax.fori_loop(0, STEPS, laguerre, g * time / q),)

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        (found,) = run(self, *primals)
        time, q, e, mu = primals

        def left_over(time: jax.Array, q: jax.Array, e: jax.Array, mu: jax.Array) -> jax.Array:
            return time - (q * found + mu * e * universal_functions(found, mu * (1 - e) / q)[3])

        steps = tuple(jnp.zeros_like(p) if tangent is None else tangent for p, tangent in zip(primals, tangents, strict=True))
        change = jax.jvp(left_over, (time, q, e, mu), steps)[1]
        return (found,), (change / (q + mu * e * universal_functions(found, mu * (1 - e) / q)[2]),)


def universal_functions(s: jax.Array, beta: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Return G_k = s^k c_k(beta s^2), k = 0 to 3: cosine and sine of any conic (Stumpff 1947; Battin 1999, section 4.5).

    c2 and c3 are summed at an argument that is quartered a few times, and doubled back: c2(4x) = c1(x)^2 / 2, c3(4x) = (c2 + c0 c3) / 4.
    """
    x = beta * s * s / 4.0**QUARTERINGS
    c2 = c3 = jnp.zeros_like(x)
    for n in reversed(range(TERMS)):
        c2 = (1 - x * c2) / ((2 * n + 1) * (2 * n + 2))
        c3 = (1 - x * c3) / ((2 * n + 2) * (2 * n + 3))
    for _ in range(QUARTERINGS):
        c0, c1 = 1 - x * c2, 1 - x * c3
        c2, c3, x = c1 * c1 * 0.5, (c2 + c0 * c3) * 0.25, x * 4
    return 1 - x * c2, s * (1 - x * c3), s * s * c2, s * s * s * c3


def nearest_turn(angle: jax.Array) -> jax.Array:
    """Return an angle less whole turns, in [-pi, pi]; a whole turn counts as constant."""
    turns = lax.stop_gradient(lax.round(angle / (2 * np.pi), lax.RoundingMethod.TO_NEAREST_EVEN))
    return angle - turns * (2 * np.pi)


def within_half_period(time: jax.Array, beta: jax.Array, mu: jax.Array) -> jax.Array:
    """Return the time past periapsis less whole periods, where the conic is an ellipse (beta above zero)."""
    closed = beta > 0
    safe = select(closed, beta, jnp.ones_like(beta))
    period = 2 * np.pi * mu / (safe * jnp.sqrt(safe))
    turns = lax.stop_gradient(lax.round(time / period, lax.RoundingMethod.TO_NEAREST_EVEN))
    return select(closed, time - turns * period, time)
