"""Records of positions and velocities as CSPICE computes them: sampled, fitted, and their errors."""

from typing import TYPE_CHECKING, Any

import numpy as np

from jaxframes.spice import build
from jaxframes.spice.records import DEGREES

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

NODES = 18  # of a record; the velocity series has as many terms before it is cut


class StateModel:
    """Positions and velocities of a body, in m and m/s.

    Velocities are interpolated and integrated, the constant is the mean residual of the positions: accelerations come out better than
    from interpolated positions. With ``positions`` the positions are interpolated, where SPICE's velocities are not the derivatives of
    its positions: corrections of the kind 'LT', and segments of some types (8, 9, 15, 18). SPICE takes an epoch as one double: the
    epochs sampled are doubles, and each record is interpolated at them and not at the ideal nodes, so that the rounding of epochs
    (6e-8 s, 6e-5 m for the Moon) is nowhere in the fit.
    """

    extras = 0

    def __init__(self, kernels: "Kernels", of: int, relative: int, axes: str, correction: str, positions: bool):
        self.arguments = (of, relative, axes)
        self.kernels, self.correction, self.positions = kernels, correction, positions
        self.scale = 0.0

    def sample(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions and velocities [m, 3] at epochs [m]."""
        doing = "computing states for a fit"
        states = self.kernels._process.call("states", *self.arguments, times, self.correction, doing=doing) * build.METRES
        self.scale = max(self.scale, float(np.abs(states[:, :3]).max()))
        return states[:, :3], states[:, 3:]

    def fit(self, a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
        """Return records between a and b: middles, radii, coefficients [n, NODES, 3], and the constants [n, degrees, 3]."""
        middle, radius, times = spread(a, b, NODES)
        position, velocity = (x.reshape(*times.shape, 3) for x in self.sample(times.reshape(-1)))
        s = (times - middle[:, None]) / radius[:, None]
        basis = np.moveaxis(np.polynomial.chebyshev.chebvander(s, NODES - 1), -1, 2)
        coefficients = np.linalg.solve(basis, position if self.positions else velocity)
        if self.positions:
            return {"middle": middle, "radius": radius, "c": coefficients}
        parts = np.cumsum(integrals(s)[..., None] * coefficients[:, None], 2) * radius[:, None, None, None]
        used = parts[:, :, np.array(DEGREES) - 1]
        constant = (position[:, :, None] - used).mean(1)
        return {"middle": middle, "radius": radius, "c": coefficients, "constant": constant}

    def errors(self, fitted: Any, which: np.ndarray, times: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """Return errors of position and velocity [2, degrees, m]."""
        radius = fitted["radius"][which]
        s = (times - fitted["middle"][which]) / radius
        c = fitted["c"][which]
        t = np.polynomial.chebyshev.chebvander(s, NODES - 1)
        chosen = np.array(DEGREES)
        if self.positions:
            position = np.cumsum(t[..., None] * c, 1)[:, chosen]
            rate = np.cumsum(slopes(s, NODES)[..., None] * c, 1)[:, chosen] / radius[:, None, None]
        else:
            position = np.cumsum(integrals(s)[..., None] * c, 1)[:, chosen - 1] * radius[:, None, None] + fitted["constant"][which]
            rate = np.cumsum(t[..., None] * c, 1)[:, chosen - 1]
        found = [np.linalg.norm(x - y[:, None], axis=2) for x, y in ((position, values), (rate, rates))]
        return np.stack(found).transpose(0, 2, 1)

    def coefficients(self, fitted: Any, degree: int) -> np.ndarray:
        """Return the position series [n, degree + 1, 3] of a degree."""
        if self.positions:
            return fitted["c"][:, : degree + 1]
        whole = np.polynomial.chebyshev.chebint(fitted["c"][:, :degree], axis=1, lbnd=0) * fitted["radius"][:, None, None]
        whole[:, 0] += fitted["constant"][:, DEGREES.index(degree)]
        return whole


def spread(a: np.ndarray, b: np.ndarray, nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return middles and radii [n] of records and epochs [n, nodes], doubles near the zeros of a Chebyshev polynomial."""
    middle = a + (b - a) / 2
    radius = np.maximum(b - middle, middle - a)
    s = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
    if nodes % 2:
        s[nodes // 2] = 0.0
    return middle, radius, np.clip(middle[:, None] + radius[:, None] * s, a[:, None], b[:, None])


def integrals(s: np.ndarray) -> np.ndarray:
    """Return the integrals from 0 to s of T_0 .. T_{NODES-1}, [..., NODES]."""
    t = np.polynomial.chebyshev.chebvander(s, NODES)
    zero = np.polynomial.chebyshev.chebvander(np.zeros(1), NODES)[0]
    k = np.arange(2, NODES)
    out = np.empty((*s.shape, NODES))
    out[..., 0], out[..., 1] = s, s * s / 2
    out[..., 2:] = (t[..., k + 1] - zero[k + 1]) / (2 * (k + 1)) - (t[..., k - 1] - zero[k - 1]) / (2 * (k - 1))
    return out


def slopes(s: np.ndarray, count: int) -> np.ndarray:
    """Return the derivatives of T_0 .. T_{count-1} at s, [..., count]."""
    return np.stack([np.polynomial.chebyshev.chebval(s, np.polynomial.chebyshev.chebder(row)) for row in np.eye(count)], -1)
