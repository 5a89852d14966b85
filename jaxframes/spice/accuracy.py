"""Tables that are not fitted against CSPICE, while they are made: the worst differences at some hundred epochs, for the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxframes.errors import TableError
from jaxframes.numerics import host_quaternions
from jaxframes.spice.kernels import Kernels
from jaxframes.spice.reading.process import CspiceError
from jaxframes.tables import host_evaluate
from jaxframes.tables.records import METRES, HostRecordTable

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

Measured = tuple[tuple[str, float], ...]
EPOCHS = 200
SLOPES = 60  # epochs at which accelerations are compared: four calls of CSPICE each
STENCIL = (-2, -1, 1, 2)
CENTURY = 36525 * 86400.0


def positions(
    kernels: "Kernels",
    of: int,
    relative: int,
    axes: str,
    record_tables: Sequence[HostRecordTable],
    reference: int,
    bounds: tuple[Fraction, Fraction],
) -> Measured:
    """Return the worst errors of a translation, SI units.

    Args:
        kernels: The kernels.
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
        states = kernels._process.call("states", of, relative, axes, times, doing="computing states to check a table") * METRES
        return states[:, :3], states[:, 3:]

    try:
        times = _epochs(bounds)
        position, velocity, _ = table(times)
        there, speed = cspice(times)
        middle, half = _records(record_tables, reference, bounds)
        slope = _slopes(middle, half, bounds, lambda t: table(t)[2], lambda t: cspice(t)[1])
    except CspiceError:  # of this table CSPICE itself says nothing: a leap-seconds kernel is missing, say
        return ()
    found = [("position error, m", _largest(position - there)), ("velocity error, m/s", _largest(velocity - speed))]
    return (*found, *((f"acceleration error, m/s2 (differences of CSPICE's velocities, {h:.3g} s)", x) for x, h in slope))


def turns(
    kernels: "Kernels",
    of: str,
    base: str,
    table: Callable[[np.ndarray], host_evaluate.Motion],
    times: np.ndarray,
    records: tuple[np.ndarray, np.ndarray],
    bounds: tuple[Fraction, Fraction],
) -> Measured:
    """Return the worst errors of an orientation, SI units; where CSPICE has no answer nothing is compared.

    Args:
        kernels: The kernels.
        of: Name of the frame.
        base: Name of the frame it is relative to.
        table: Evaluates the table at epochs.
        times: Where to compare.
        records: Middles and half lengths of records within which accelerations are compared.
        bounds: The span.
    """

    def cspice(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        matrices, rates = kernels._process.call("attitudes", of, base, times, doing="computing orientations to check a table")
        known = np.isfinite(matrices).all((1, 2))
        q = np.full((len(times), 4), np.nan)
        q[known] = host_quaternions.from_matrices(matrices[known]) if known.any() else q[known]
        return q, rates

    q, w, _ = table(times)
    turned, spin = cspice(times)
    between = np.linalg.norm(host_quaternions.vector_of(host_quaternions.multiply(q, host_quaternions.conjugate(turned))), axis=1)
    found = [("angle error, rad", between), ("rate error, rad/s", np.linalg.norm(w - spin, axis=1))]
    slope = _slopes(*records, bounds, lambda t: table(t)[2], lambda t: cspice(t)[1])
    out = [(name, float(np.nanmax(x))) for name, x in found if np.isfinite(x).any()]
    return (*out, *((f"angular acceleration error, rad/s2 (differences of CSPICE's rates, {h:.3g} s)", x) for x, h in slope))


def angles(
    kernels: "Kernels",
    of: str,
    base: str,
    records: HostRecordTable,
    placement: np.ndarray,
    reference: int,
    bounds: tuple[Fraction, Fraction],
) -> Measured:
    """Return the worst errors of three Euler angles; see ``turns``."""

    def table(times: np.ndarray) -> host_evaluate.Motion:
        return host_evaluate.euler(host_evaluate.summed([records], host_evaluate.since(times, reference)), placement)

    return turns(kernels, of, base, table, _epochs(bounds), _records([records], reference, bounds), bounds)


def knots(
    kernels: "Kernels", of: str, base: str, records: HostRecordTable, mode: str, reference: int, bounds: tuple[Fraction, Fraction]
) -> Measured:
    """Return the worst errors of knots; see ``turns``."""
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

    return turns(kernels, of, base, table, times, (middle[picked], half[picked]), bounds)


def model(kernels: "Kernels", of: str, base: str, arrays: dict[str, np.ndarray]) -> Measured:
    """Return the worst errors of the analytic model of a text PCK within fifty years of J2000; see ``turns``."""
    bounds = Fraction(-CENTURY / 2), Fraction(CENTURY / 2)
    records = np.random.default_rng(5).uniform(-CENTURY / 2, CENTURY / 2, SLOPES), np.full(SLOPES, 16384.0)
    found = turns(kernels, of, base, lambda times: host_evaluate.model(arrays, times), _epochs(bounds), records, bounds)
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


def _largest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max())


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
    if not hasattr(table, "info") or not hasattr(table, "evaluate"):
        raise TableError(f"{table!r} is no table to be compared.")
    info, seconds = table.info, np.asarray(times, np.float64).reshape(-1)
    if not len(seconds):
        raise TableError(f"{table.describe()}: there are no epochs to compare at.")
    value, rate, acceleration = (np.asarray(x, np.float64) for x in table.evaluate(seconds))

    def cspice(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if info.kind == "translation":
            return kernels.states(target=info.of_id, center=info.relative_id, frame=info.axes, times=at, correction=info.correction)
        return kernels.turns(frame=info.of, relative_to=info.relative_to, times=at)

    there, speed = cspice(seconds)
    if info.kind == "translation":
        apart, size = _largest(there - value), _largest(there)
    else:
        between = host_quaternions.vector_of(
            host_quaternions.multiply(value, host_quaternions.conjugate(host_quaternions.from_matrices(there)))
        )
        apart, size = _largest(between), float(np.pi)
    h = _step(table)
    room = _room(table, seconds, h)
    slopes = (np.nan, np.nan, h)
    if room.any():
        reference = differences(lambda at: cspice(at)[1], seconds[room], np.full(int(room.sum()), h))
        slopes = (_largest(acceleration[room] - reference), _largest(acceleration[room]), h)
    return Differences(apart, _largest(speed - rate), size, _largest(speed), *slopes)


def _step(table: Any) -> float:
    """Return the step for differences of rates."""
    record_tables = getattr(table, "record_tables", ())
    halves = [np.asarray(records.rows[:, -1], float) / (1 if records.series in (3, 6) else 2) for records in record_tables]
    shortest = min((float(np.nanmedian(half)) for half in halves), default=STEP * 32)
    return float(2.0 ** np.floor(np.log2(max(shortest / 32, 1e-3))))


def _room(table: Any, times: np.ndarray, step: float) -> np.ndarray:
    """Return around which epochs the table covers all that differences over a step are taken of."""
    if not hasattr(table, "record_tables"):
        return np.ones(len(times), bool)
    return np.all([np.asarray(table.coverage_code(times + k * step)) == 0 for k in STENCIL], 0)
