"""Evaluation of tables on the host, in float64: what is measured while they are made needs no compiled program."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxframes.numerics import host_two_part
from jaxframes.numerics.components import IDENTITY, V3, Quat
from jaxframes.numerics.path_motion import with_halves
from jaxframes.numerics.rigid import AT_REST
from jaxframes.numerics.steps import append_all
from jaxframes.numerics.trig import numpy_sin_cos
from jaxframes.tables import formulas
from jaxframes.tables.formulas import Functions
from jaxframes.tables.records import HostRecordTable

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Value, rate and acceleration at epochs: positions or quaternions [n, 3 | 4], then [n, 3] each."""


def _turns(rate: Any, rate_low: Any, hi: Any, lo: Any) -> Any:
    product = host_two_part.multiply((hi, lo), (np.full_like(hi, rate), np.full_like(hi, rate_low)))
    return (product[0] - 2 * np.round(product[0] / 2)) + product[1]


NUMPY = Functions(numpy_sin_cos, np.sqrt, _turns)


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
    terms = (rows.shape[1] - 3) // series
    coefficients = [[rows[:, j * series + which] for j in range(terms)] for which in range(series)]
    return _vectors(formulas.record(coefficients, s, rows[:, -1], 2))


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
    steps = formulas.euler_steps(Quat(*placement), tuple(V3(*x.T) for x in angles))
    motion = append_all(AT_REST, with_halves(steps, numpy_sin_cos), 2)
    return _attitude([motion.rotation, motion.angular, motion.angular2])


def knots(records: HostRecordTable, past: host_two_part.Pair, mode: str) -> Motion:
    """Return the attitude between the knots of a C-kernel; NaN in gaps."""
    row = records.arrays["rows"][record_of(records, past)].T
    u = ((past[0] - row[-3]) + (past[1] - row[-2])) / row[-1]
    return _attitude(formulas.knot_motion(row, u, mode, NUMPY))


def cayley_rates(g: np.ndarray, g1: np.ndarray, g2: np.ndarray, spin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return angular velocity and acceleration [..., 3] of Cayley vectors before a reference that spins; see ``formulas.cayley``."""
    own, own1, own2, carried = (V3(*np.moveaxis(x, -1, 0)) for x in (g, g1, g2, spin))
    _, w, alpha = formulas.cayley(own, own1, own2, IDENTITY, carried, NUMPY)
    return np.stack(tuple(w), -1), np.stack(tuple(alpha), -1)


def model(arrays: dict[str, np.ndarray], times: np.ndarray) -> Motion:
    """Return the attitude of the analytic model of a text PCK; ``IauOrientation`` says how."""
    reference = arrays["reference"]
    past = host_two_part.add((times, np.zeros(len(times))), (np.full(len(times), -reference[0]), np.full(len(times), -reference[1])))
    polynomials, phases = ([[(float(a), float(b)) for a, b in row] for row in arrays[name]] for name in ("polynomials", "phases"))
    angles = formulas.model_angles(polynomials, phases, arrays["amplitudes"].tolist(), past, 2, NUMPY)
    return euler(_vectors([np.broadcast_to(x, times.shape) for x in angles]), arrays["placement"])


def _vectors(components: Sequence[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return arrays [n, 3] of components."""
    return tuple(np.stack(components[i : i + 3], -1) for i in range(0, len(components), 3))


def _attitude(motion: Sequence[Any]) -> Motion:
    """Return quaternions [n, 4], angular velocities and accelerations [n, 3] of components."""
    q, w, alpha = (np.stack(np.broadcast_arrays(*part), -1) for part in motion)
    return q, w, alpha
