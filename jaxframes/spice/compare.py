"""Tables against CSPICE on the same kernels: the worst differences at epochs of the caller's choice."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxframes.spice.kernels import Kernels
from jaxframes.spice.tables import OrientationTable, TranslationTable


@dataclass(frozen=True)
class Differences:
    """The largest differences between a table and CSPICE.

    Attributes:
        value: Distance in m, or angle of the rotation between the two in rad.
        rate: Difference of velocities in m/s, or of angular velocities in rad/s.
        largest_value: Largest distance from the centre met, m; pi for orientations.
        largest_rate: Largest speed met, m/s or rad/s.
    """

    value: float
    rate: float
    largest_value: float
    largest_rate: float


def compare(kernels: Kernels, table: TranslationTable | OrientationTable, times: Any) -> Differences:
    """Return the worst differences of a table from what CSPICE computes from kernels.

    Args:
        kernels: The kernels that the table was made of, open.
        table: The table.
        times: ET seconds within its coverage, [n]. Give whole seconds: both sides then mean the same instant, to the last bit.
    """
    info, seconds = table.info, np.asarray(times, np.float64)
    value, rate = (np.asarray(x, np.float64) for x in table.evaluate(seconds, order=1))
    if isinstance(table, TranslationTable):
        position, velocity = kernels.states(
            target=info.of_id, center=info.relative_id, frame=info.axes, times=seconds, correction=info.correction
        )
        lengths = (position - value, velocity - rate, position, velocity)
        return Differences(*(_largest(x) for x in lengths))
    rotation, spin = kernels.turns(frame=info.of, relative_to=info.relative_to, times=seconds)
    between = np.einsum("nij,nkj->nik", _matrices(value), rotation)
    # The antisymmetric part holds the sine of a small angle with all its digits; the trace would not.
    half = np.stack([between[:, 2, 1] - between[:, 1, 2], between[:, 0, 2] - between[:, 2, 0], between[:, 1, 0] - between[:, 0, 1]], 1) / 2
    angle = np.arctan2(np.linalg.norm(half, axis=1), (np.trace(between, axis1=1, axis2=2) - 1) / 2)
    return Differences(float(np.max(angle)), _largest(spin - rate), float(np.pi), _largest(spin))


def _largest(vectors: np.ndarray) -> float:
    return float(np.max(np.linalg.norm(vectors, axis=1)))


def _matrices(wxyz: np.ndarray) -> np.ndarray:
    """Return the rotation matrices [n, 3, 3] of quaternions [n, 4]."""
    w, x, y, z = wxyz.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
