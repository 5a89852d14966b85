"""The model of a fitted orientation: rotations of CSPICE sampled, fitted as Cayley vectors, and their errors."""

from typing import Any

import numpy as np

from jaxframes.numerics import host_quaternions
from jaxframes.spice.fitting.candidates import DEGREES, Choice
from jaxframes.spice.fitting.translation_model import slopes, spread
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.tables.host_evaluate import cayley_rates

NODES = 19  # odd: one lies in the middle of the record
SLOPES = 300


class RotationModel:
    """Attitudes o_T_p and angular velocities in o axes, as the Cayley vector of the rotation from a uniformly spinning reference."""

    extras = 8
    scale = 1.0

    def __init__(self, pool: KernelPool, of: str, base: str):
        self.pool, self.of, self.base = pool, of, base

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return quaternions [m, 4] and angular velocities [m, 3] at epochs [m]."""
        matrices, rates = self.pool.rotations(self.of, self.base, times, doing="computing orientations for a fit")
        return host_quaternions.from_matrices(matrices), rates

    def fit(self, a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
        """Return records between a and b: middles, radii, Cayley series [n, NODES, 3], quaternion and rate of the reference."""
        middle, radius, times = spread(a, b, NODES)
        q, w = self.sample(times.reshape(-1))
        q, w = q.reshape(*times.shape, 4), w.reshape(*times.shape, 3)
        fitted = {"middle": middle, "radius": radius, "q": q[:, NODES // 2], "spin": w.mean(1)}
        g = _offset(q, _reference(fitted, np.arange(len(a))[:, None], times))
        s = (times - middle[:, None]) / radius[:, None]
        basis = np.polynomial.chebyshev.chebvander(s, NODES - 1)
        return {**fitted, "c": np.linalg.solve(basis, g)}

    def errors(self, fitted: Any, which: np.ndarray, times: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return errors of angle and rate [2, degrees, m]."""
        radius = fitted["radius"][which]
        s = (times - fitted["middle"][which]) / radius
        c, chosen = fitted["c"][which], np.array(DEGREES)
        t = np.polynomial.chebyshev.chebvander(s, NODES - 1)
        g = np.cumsum(t[..., None] * c, 1)[:, chosen]
        rate = np.cumsum(slopes(s, NODES)[..., None] * c, 1)[:, chosen] / radius[:, None, None]
        true = _offset(values, _reference(fitted, which, times))[:, None]
        between = (g - true) - np.cross(g - true, true)
        angle = 2 * np.arctan2(np.linalg.norm(between, axis=2), 1 + (g * true).sum(2))
        w, _ = cayley_rates(g, rate, np.zeros_like(g), fitted["spin"][which][:, None])
        return np.stack([angle, np.linalg.norm(w - rates[:, None], axis=2)]).transpose(0, 2, 1)

    def acceleration(self, found: Choice) -> tuple[str, float]:
        """Return the largest difference of angular accelerations from differences of CSPICE's angular velocities."""
        rng, fitted = np.random.default_rng(2), found.fitted
        a, b = np.array([[float(x) for x in span] for span in found.spans]).T
        which = rng.integers(0, len(a), SLOPES)
        h = 2.0 ** np.floor(np.log2(np.maximum((b - a)[which] / 64, 1e-6)))
        times = (a + b)[which] / 2 + rng.uniform(-0.4, 0.4, SLOPES) * (b - a)[which]
        stencil = np.stack([times + k * h for k in (-2, -1, 1, 2)])
        _, w = self.sample(stencil.reshape(-1))
        w, d = w.reshape(4, -1, 3), stencil - times
        reference = (w[0] - 8 * w[1] + 8 * w[2] - w[3]) / (12 * (d[2] - d[1])[:, None] / 2)
        radius = fitted["radius"][which]
        s, c = (times - fitted["middle"][which]) / radius, fitted["c"][which][:, : found.degree + 1].transpose(1, 2, 0)
        chebyshev = np.polynomial.chebyshev
        g, g1, g2 = (chebyshev.chebval(s, chebyshev.chebder(c, k), tensor=False).T / radius[:, None] ** k for k in range(3))
        _, alpha = cayley_rates(g, g1, g2, fitted["spin"][which])
        name = f"angular acceleration error, rad/s2 (differences of CSPICE's rates, {h.min():.3g} s)"
        return name, float(np.linalg.norm(alpha - reference, axis=1).max())


def _reference(fitted: dict[str, np.ndarray], which: np.ndarray, times: np.ndarray) -> np.ndarray:
    spin = fitted["spin"][which] * (times - fitted["middle"][which])[..., None]
    return host_quaternions.multiply(host_quaternions.from_rotation_vector(spin), np.broadcast_to(fitted["q"][which], (*times.shape, 4)))


def _offset(q: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return Cayley vectors of q before a reference."""
    d = host_quaternions.multiply(q, host_quaternions.conjugate(reference))
    return d[..., 1:] / np.where(np.abs(d[..., :1]) < 1e-9, 1e-9, d[..., :1])
