"""Accuracy of tables that are extracted, measured against CSPICE while they are made: the worst differences at some hundred epochs."""

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np

from jaxframes.numerics import host_quaternions
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import CspiceError
from jaxframes.tables import host_evaluate
from jaxframes.tables.formulas import CENTURY
from jaxframes.tables.records import HostRecordTable

Measured = tuple[tuple[str, float], ...]
EPOCHS = 200
SLOPES = 60  # epochs at which accelerations are compared: four calls of CSPICE each
STENCIL = (-2, -1, 1, 2)


def positions(
    pool: KernelPool,
    of: int,
    relative: int,
    axes: str,
    record_tables: Sequence[HostRecordTable],
    reference: int,
    bounds: tuple[Fraction, Fraction],
) -> Measured:
    """Return the worst errors of a translation, SI units.

    Args:
        pool: The kernels.
        of: Id of the target.
        relative: Id of the center.
        axes: Name of the axes.
        record_tables: Record tables in metres.
        reference: Their reference, seconds past J2000 TDB.
        bounds: The span.
    """

    def table(times: np.ndarray) -> host_evaluate.Motion:
        return host_evaluate.summed(record_tables, host_evaluate.since(times, reference))

    def cspice(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return pool.states(of, relative, axes, times, doing="computing states to check a table")

    try:
        times = _epochs(bounds)
        position, velocity, _ = table(times)
        there, speed = cspice(times)
        middle, half = _records(record_tables, reference, bounds)
        slope = _slopes(middle, half, bounds, lambda t: table(t)[2], lambda t: cspice(t)[1])
    except CspiceError:  # of this table CSPICE itself says nothing: a leap-seconds kernel is missing, say
        return ()
    found = [("position error, m", largest(position - there)), ("velocity error, m/s", largest(velocity - speed))]
    return (*found, *((f"acceleration error, m/s2 (differences of CSPICE's velocities, {h:.3g} s)", x) for x, h in slope))


def rotations(
    pool: KernelPool,
    of: str,
    base: str,
    table: Callable[[np.ndarray], host_evaluate.Motion],
    times: np.ndarray,
    records: tuple[np.ndarray, np.ndarray],
    bounds: tuple[Fraction, Fraction],
) -> Measured:
    """Return the worst errors of an orientation, SI units; where CSPICE has no answer nothing is compared.

    Args:
        pool: The kernels.
        of: Name of the frame.
        base: Name of the frame it is relative to.
        table: Evaluates the table at epochs.
        times: Where to compare.
        records: Middles and half lengths of records within which accelerations are compared.
        bounds: The span.
    """

    def cspice(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrices, rates = pool.attitudes_or_nan(of, base, times, doing="computing orientations to check a table")
        known = np.isfinite(matrices).all((1, 2))
        q = np.full((len(times), 4), np.nan)
        q[known] = host_quaternions.from_matrices(matrices[known]) if known.any() else q[known]
        return q, rates

    q, w, _ = table(times)
    true, true_rates = cspice(times)
    between = np.linalg.norm(host_quaternions.vector_of(host_quaternions.multiply(q, host_quaternions.conjugate(true))), axis=1)
    found = [("angle error, rad", between), ("rate error, rad/s", np.linalg.norm(w - true_rates, axis=1))]
    slope = _slopes(*records, bounds, lambda t: table(t)[2], lambda t: cspice(t)[1])
    out = [(name, float(np.nanmax(x))) for name, x in found if np.isfinite(x).any()]
    return (*out, *((f"angular acceleration error, rad/s2 (differences of CSPICE's rates, {h:.3g} s)", x) for x, h in slope))


def angles(
    pool: KernelPool,
    of: str,
    base: str,
    records: HostRecordTable,
    placement: np.ndarray,
    reference: int,
    bounds: tuple[Fraction, Fraction],
) -> Measured:
    """Return the worst errors of three Euler angles; see ``rotations``."""

    def table(times: np.ndarray) -> host_evaluate.Motion:
        return host_evaluate.euler(host_evaluate.summed([records], host_evaluate.since(times, reference)), placement)

    return rotations(pool, of, base, table, _epochs(bounds), _records([records], reference, bounds), bounds)


def knots(
    pool: KernelPool, of: str, base: str, records: HostRecordTable, mode: str, reference: int, bounds: tuple[Fraction, Fraction]
) -> Measured:
    """Return the worst errors of knots; see ``rotations``."""
    rows = records.arrays["rows"]
    middle = rows[:, -3] + rows[:, -2] + rows[:, -1] / 2 + reference
    half = rows[:, -1] / 2
    real = np.isfinite(half) & (middle - half >= float(bounds[0])) & (middle + half <= float(bounds[1]))
    rng = np.random.default_rng(4)
    chosen = rng.choice(np.flatnonzero(real), EPOCHS) if real.any() else np.zeros(0, int)
    # Within intervals, at their ends above all: there the attitude is the kernel's own in every mode.
    times = middle[chosen] + half[chosen] * np.clip(rng.uniform(-1.5, 1.5, len(chosen)), -1, 1)
    picked = rng.choice(np.flatnonzero(real), SLOPES) if real.any() else np.zeros(0, int)

    def table(times: np.ndarray) -> host_evaluate.Motion:
        return host_evaluate.knots(records, host_evaluate.since(times, reference), mode)

    return rotations(pool, of, base, table, times, (middle[picked], half[picked]), bounds)


def model(pool: KernelPool, of: str, base: str, arrays: dict[str, np.ndarray]) -> Measured:
    """Return the worst errors of the analytic model of a text PCK within fifty years of J2000; see ``rotations``."""
    bounds = Fraction(-CENTURY / 2), Fraction(CENTURY / 2)
    records = np.random.default_rng(5).uniform(-CENTURY / 2, CENTURY / 2, SLOPES), np.full(SLOPES, 16384.0)
    found = rotations(pool, of, base, lambda times: host_evaluate.model(arrays, times), _epochs(bounds), records, bounds)
    return tuple((f"{name}, 1950 .. 2050", value) for name, value in found)


def _epochs(bounds: tuple[Fraction, Fraction]) -> np.ndarray:
    """Return epochs over a span, up to its ends; not these themselves, at which CSPICE may take the segment that follows."""
    low, high = float(bounds[0]), float(bounds[1])
    low, high = np.nextafter(low, high), np.nextafter(high, low)
    return np.clip(np.concatenate([[low, high], np.random.default_rng(6).uniform(low, high, EPOCHS)]), low, high)


def _records(record_tables: Sequence[HostRecordTable], reference: int, bounds: tuple[Fraction, Fraction]) -> tuple[np.ndarray, np.ndarray]:
    """Return middles and half lengths of some records of the record table that has most of them."""
    rows = max(record_tables, key=lambda records: len(records.arrays["rows"])).arrays["rows"]
    middle = rows[:, -3] + reference
    inside = np.flatnonzero((middle > float(bounds[0])) & (middle < float(bounds[1])))
    chosen = np.random.default_rng(7).choice(inside, SLOPES) if len(inside) else inside
    return middle[chosen], rows[chosen, -1]


def _slopes(
    middle: np.ndarray,
    half: np.ndarray,
    bounds: tuple[Fraction, Fraction],
    table: Callable[[np.ndarray], np.ndarray],
    rates: Callable[[np.ndarray], np.ndarray],
) -> list[tuple[float, float]]:
    """Return the largest difference of accelerations from differences of rates within records, and the step; none if there is no room."""
    h = 2.0 ** np.floor(np.log2(np.maximum(half / 32, 1e-3)))
    times = np.round((middle + np.random.default_rng(8).uniform(-0.9, 0.9, len(middle)) * half) / h) * h
    inside = (times - 2 * h > float(bounds[0])) & (times + 2 * h < float(bounds[1]))
    times, h = times[inside], h[inside]
    if not len(times):
        return []
    apart = np.linalg.norm(table(times) - differences(rates, times, h), axis=1)
    return [(float(np.nanmax(apart)), float(h.min()))] if np.isfinite(apart).any() else []


def differences(rates: Callable[[np.ndarray], np.ndarray], times: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Return accelerations [n, 3] as fourth-order differences of rates, over steps h [n]."""
    v = rates(np.concatenate([times + k * h for k in STENCIL])).reshape(4, -1, 3)
    return (v[0] - 8 * v[1] + 8 * v[2] - v[3]) / (12 * h[:, None])


def largest(vectors: np.ndarray) -> float:
    """Return the length of the longest of vectors [n, 3]."""
    return float(np.linalg.norm(vectors, axis=1).max())
