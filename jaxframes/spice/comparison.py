"""Comparison of tables with CSPICE, by users: the worst differences at epochs of their choice."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxframes.errors import TableError
from jaxframes.numerics import host_quaternions
from jaxframes.spice.accuracy import STENCIL, differences, largest
from jaxframes.spice.kernels import Kernels
from jaxframes.tables.base import Table
from jaxframes.tables.table_edge import TableEdge

STEP = 512.0  # seconds, for models without records


@dataclass(frozen=True)
class Differences:
    """The largest differences between a table and CSPICE.

    Attributes:
        value: Distance in m, or angle of the rotation between the two in rad.
        rate: Difference of velocities in m/s, or of angular velocities in rad/s.
        largest_value: Largest distance from the centre met, m; pi for orientations.
        largest_rate: Largest speed met, m/s or rad/s.
        acceleration: Difference of the table's accelerations from differences of CSPICE's rates over ``step``, m/s2 or rad/s2; NaN where
            the coverage leaves no room for these.
        largest_acceleration: Largest acceleration of the table met there.
        step: Seconds between the rates that were subtracted: a 32nd of half a record, as a power of two.
    """

    value: float
    rate: float
    largest_value: float
    largest_rate: float
    acceleration: float = np.nan
    largest_acceleration: float = np.nan
    step: float = np.nan


def compare(kernels: Kernels, table: Any, times: Any) -> Differences:
    """Return the worst differences of a table from what CSPICE computes from kernels.

    Args:
        kernels: The kernels that the table was made of, open.
        table: The table, or the model of a text PCK.
        times: ET seconds within its coverage, [n]. Give whole seconds: both sides then mean the same instant, to the last bit.

    Raises:
        TableError: If it is no table, or there are no epochs.
        SpiceError: If CSPICE has no answer for one of the epochs.
    """
    if not isinstance(table, TableEdge):
        raise TableError(f"{table!r} is no table to be compared.")
    info, seconds = table.info, np.asarray(times, np.float64).reshape(-1)
    if not len(seconds):
        raise TableError(f"{table.describe()}: there are no epochs to compare at.")
    value, rate, acceleration = (np.asarray(x, np.float64) for x in table.evaluate(seconds))

    def cspice(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if info.kind == "translation":
            return kernels.states(target=info.of_id, center=info.relative_id, frame=info.axes, times=at, correction=info.correction)
        return kernels.rotations(frame=info.of, relative_to=info.relative_to, times=at)

    there, speed = cspice(seconds)
    if info.kind == "translation":
        apart, size = largest(there - value), largest(there)
    else:
        between = host_quaternions.vector_of(
            host_quaternions.multiply(value, host_quaternions.conjugate(host_quaternions.from_matrices(there)))
        )
        apart, size = largest(between), float(np.pi)
    h = _step(table)
    room = _room(table, seconds, h)
    slopes = (np.nan, np.nan, h)
    if room.any():
        reference = differences(lambda at: cspice(at)[1], seconds[room], np.full(int(room.sum()), h))
        slopes = (largest(acceleration[room] - reference), largest(acceleration[room]), h)
    return Differences(apart, largest(speed - rate), size, largest(speed), *slopes)


def _step(table: TableEdge) -> float:
    """Return the step for differences of rates."""
    record_tables = table.record_tables if isinstance(table, Table) else ()
    halves = [np.asarray(records.rows[:, -1], float) / (1 if records.series in (3, 6) else 2) for records in record_tables]
    shortest = min((float(np.nanmedian(half)) for half in halves), default=STEP * 32)
    return float(2.0 ** np.floor(np.log2(max(shortest / 32, 1e-3))))


def _room(table: TableEdge, times: np.ndarray, step: float) -> np.ndarray:
    """Return around which epochs the table covers all that differences over a step are taken of."""
    if not isinstance(table, Table):
        return np.ones(len(times), bool)
    return np.all([np.asarray(table.coverage_code(times + k * step)) == 0 for k in STENCIL], 0)
