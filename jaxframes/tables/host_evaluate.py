"""Evaluation of tables on the host, in float64: what is measured while they are made needs no compiled program."""

from collections.abc import Sequence

import numpy as np

from jaxframes.numerics import host_quaternions, host_two_part
from jaxframes.tables.records import HostRecordTable

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Value, rate and acceleration at epochs: positions or quaternions [n, 3 | 4], then [n, 3] each."""
AXES = np.eye(3)


def since(times: np.ndarray, reference: int) -> host_two_part.Pair:
    """Return epochs past a table's reference, in two parts."""
    return host_two_part.two_sum(times, np.full(len(times), -float(reference)))


def record_of(records: HostRecordTable, past: host_two_part.Pair) -> np.ndarray:
    """Return the record that serves each epoch."""
    grid, total = records.arrays["grid"], past[0] + past[1]
    if "ends" not in records.arrays:
        at = np.floor(((past[0] - grid[0]) + (past[1] - grid[1])) / grid[2])
        return np.clip(at, 0, len(records.arrays["rows"]) - 1).astype(int)
    return np.searchsorted(records.arrays["ends"][:-1].sum(1), total, "right")


def derivatives(rows: np.ndarray, series: int, s: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return value, first and second time derivative [n, 3] of one Chebyshev record a row, at one argument a row."""
    n, radius = len(rows), rows[:, -1]
    terms = (rows.shape[1] - 3) // series
    coefficients = rows[:, :-3].reshape(n, terms, series).transpose(1, 2, 0)
    position, rate = coefficients[:, :3], coefficients[:, 3:] if series == 6 else None
    out = [_value(position, s)]
    if rate is None:
        rate = np.polynomial.chebyshev.chebder(position) / radius
    out.append(_value(rate, s))
    out.append(_value(np.polynomial.chebyshev.chebder(rate) / radius, s))
    return tuple(out)


def _value(coefficients: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Return series ``[terms, 3, n]`` at arguments ``[n]`` as ``[n, 3]``."""
    return np.polynomial.chebyshev.chebval(s, coefficients, tensor=False).T


def summed(record_tables: Sequence[HostRecordTable], past: host_two_part.Pair) -> Motion:
    """Return the sum of Chebyshev record tables."""
    total = [np.zeros((len(past[0]), 3)) for _ in range(3)]
    for records in record_tables:
        rows = records.arrays["rows"][record_of(records, past)]
        s = ((past[0] - rows[:, -3]) + (past[1] - rows[:, -2])) / rows[:, -1]
        total = [a + b for a, b in zip(total, derivatives(rows, records.series, s), strict=True)]
    return total[0], total[1], total[2]


def euler(angles: Sequence[np.ndarray], placement: np.ndarray) -> Motion:
    """Return the attitude of angles (phi, theta, psi) [n, 3] with their derivatives: placement Rz(phi) Rx(theta) Rz(psi)."""
    n = len(angles[0])
    q = np.broadcast_to(placement, (n, 4))
    w, alpha = np.zeros((n, 3)), np.zeros((n, 3))
    for column, axis in enumerate((2, 0, 2)):
        angle, rate, rate2 = (x[:, column] for x in angles)
        along = host_quaternions.rotate(q, np.broadcast_to(AXES[axis], (n, 3)))
        spin = along * rate[:, None]
        alpha = alpha + along * rate2[:, None] + np.cross(w, spin)
        w = w + spin
        q = host_quaternions.multiply(q, host_quaternions.from_rotation_vector(AXES[axis] * angle[:, None]))
    return q, w, alpha


def knots(records: HostRecordTable, past: host_two_part.Pair, mode: str) -> Motion:
    """Return the attitude between the knots of a C-kernel; NaN in gaps."""
    row = records.arrays["rows"][record_of(records, past)]
    length = row[:, -1:]
    u = ((past[0] - row[:, -3]) + (past[1] - row[:, -2]))[:, None] / length
    turn = row[:, 4:7] * (2 * row[:, 7:8])
    slerp = host_quaternions.multiply(host_quaternions.from_rotation_vector(turn * u), row[:, :4])
    first, second = row[:, 8:11], row[:, 11:14]
    if mode == "spice":
        return slerp, first + (second - first) * u, (second - first) / length
    v = 1 - u
    g = first * (u * v * v) - second * (u * u * v)
    g1 = (first * (v * (1 - 3 * u)) - second * (u * (2 - 3 * u))) / length
    g2 = (first * (6 * u - 4) - second * (2 - 6 * u)) / length**2
    return host_quaternions.multiply(cayley(g), slerp), *cayley_rates(g, g1, g2, turn / length)


def cayley(g: np.ndarray) -> np.ndarray:
    """Return the quaternions of Cayley vectors [n, 3]."""
    return np.concatenate([np.ones((*g.shape[:-1], 1)), g], -1) / np.sqrt(1 + (g * g).sum(-1, keepdims=True))


def cayley_rates(g: np.ndarray, g1: np.ndarray, g2: np.ndarray, spin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return angular velocity and acceleration; the formulas are those of ``attitude._cayley``."""
    square = 1 + (g * g).sum(-1, keepdims=True)
    own = 2 * (g1 + np.cross(g, g1)) / square
    own2 = 2 * (g2 + np.cross(g, g2)) / square - 2 * own * (g * g1).sum(-1, keepdims=True) / square
    spin = np.broadcast_to(spin, g.shape)
    carried = spin + 2 * (np.cross(g, spin) + np.cross(g, np.cross(g, spin))) / square
    return own + carried, own2 + np.cross(own, carried)


def model(arrays: dict[str, np.ndarray], times: np.ndarray) -> Motion:
    """Return the attitude of the analytic model of a text PCK; ``IauOrientation`` says how."""
    reference = arrays["reference"]
    past = host_two_part.add((times, np.zeros(len(times))), (np.full(len(times), -reference[0]), np.full(len(times), -reference[1])))
    sums = [_polynomial_angle(row, past) for row in arrays["polynomials"]]
    for phase, amplitude in zip(arrays["phases"], arrays["amplitudes"], strict=True):
        angle, rate, rate2 = _polynomial_angle(phase, past)
        s, c = np.sin(angle), np.cos(angle)
        sines = (s, c * rate, c * rate2 - s * rate * rate)
        cosines = (c, -s * rate, -s * rate2 - c * rate * rate)
        for i, wave in enumerate((sines, cosines, sines)):
            sums[i] = [x + amplitude[i] * y for x, y in zip(sums[i], wave, strict=True)]
    ra, dec, w = sums
    quarter = np.pi / 2
    angles = [np.stack([ra[k] + (quarter if k == 0 else 0), (quarter if k == 0 else 0) - dec[k], w[k]], 1) for k in range(3)]
    return euler(angles, arrays["placement"])


def _polynomial_angle(terms: np.ndarray, past: host_two_part.Pair) -> list[np.ndarray]:
    """Return an angle of a polynomial in turns [terms, 2], and its derivatives, rad; whole turns are taken out before rounding."""
    century = 36525 * 86400.0
    product = host_two_part.multiply(past, (np.full_like(past[0], terms[1, 0]), np.full_like(past[0], terms[1, 1])))
    angle = (product[0] - np.round(product[0])) + product[1] + terms[0].sum()
    rate, rate2 = np.full_like(angle, terms[1].sum()), np.zeros_like(angle)
    x = (past[0] + past[1]) / century
    for power, (coefficient, _) in enumerate(terms[2:], 2):
        angle = angle + coefficient * x**power
        rate = rate + coefficient * power * x ** (power - 1) / century
        rate2 = rate2 + coefficient * power * (power - 1) * x ** (power - 2) / century**2
    return [part * (2 * np.pi) for part in (angle, rate, rate2)]
