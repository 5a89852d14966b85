"""Sampled trajectories: positions and attitudes at given times as an edge, with a named interpolant between them."""

import functools
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.errors import EdgeError, ShapeError
from jaxframes.numerics import host_two_part
from jaxframes.numerics.steps import Step
from jaxframes.numerics.two_part import recast_pairs
from jaxframes.spatial import Rotation
from jaxframes.staging.arrays import default_float, on_device, unit
from jaxframes.tables.base import recast_records
from jaxframes.tables.evaluate import OUTSIDE
from jaxframes.tables.instants import pairs, past_reference, split
from jaxframes.tables.pool import concatenated, concatenated_arrays, stacked_arrays
from jaxframes.tables.records import RecordTable
from jaxframes.tables.sample_batches import over_batch
from jaxframes.tables.sample_checks import WIDTHS, checked_attitudes, checked_method, checked_samples, checked_steps
from jaxframes.tables.sample_records import SLERP, SampledRecords
from jaxframes.tables.sample_rows import (
    SampleGrid,
    grid_of,
    hermite_rows,
    lagrange_rows,
    of_near_signs,
    quaternion_rates,
    slerp_rows,
    spline_rates,
    with_rows,
)
from jaxframes.tables.sample_times import narrowed, sample_times
from jaxframes.time.epoch import Epoch

ENDS = ("not-a-knot", "natural")


@family(static=("method", "points", "ends", "outside", "longest_gap"), name="sampled")
class Sampled(Edge):
    """A trajectory known at given times: positions, attitudes or both, with the velocity and acceleration that belong to what lies between.

    =========== ============================================================ ============================================================
    method      positions                                                    attitudes
    =========== ============================================================ ============================================================
    linear      straight lines                                               slerp: constant angular velocity between two samples
    lagrange    polynomials through ``points`` neighbours, as in OEM files   the same on the quaternion's four numbers, at unit length
    hermite     cubic; quintic where accelerations are given                 cubic on the four numbers, by the angular velocities
    spline      C2 cubic                                                     C2 cubic on the four numbers, at unit length
    =========== ============================================================ ============================================================

    Positions are linear in the samples, and everything is differentiable by them, to any order: ``jax.grad`` by
    ``tree.get("craft.positions")`` fits a trajectory. Times count as constants. The velocity and the acceleration are the derivatives of
    what interpolates (at a sample those of the interval after it; zero accelerations for lines and slerp).

    Two samples at one instant are a break, as a manoeuvre makes one: the polynomials end there, and from that instant on the later
    sample counts. Attitudes near each other may have either sign. Thousands of trajectories of any lengths in one tree are evaluated
    together and compile once; of such a tree outside of transformations, records are made once.

    Attributes:
        positions: ``[n, 3]`` in the parent, m; leading axes are batch axes, here and below.
        attitudes: ``Rotation`` [n] of the child in the parent.
        velocities: ``[n, 3]``, m/s, derivatives of ``positions``.
        accelerations: ``[n, 3]``, m/s2.
        angular_velocities: ``[n, 3]``, rad/s, in the parent's axes.
        grid: Times and what follows from them; constants.
        reference: ``[2]``: the epoch from which times count, in two parts, seconds past J2000 TDB.
        span: ``[4]``: first and last instant that is covered, in two parts each, seconds past the reference.
        method: The interpolant (static), as ``points``, ``ends``, ``outside`` and ``longest_gap`` are.

    Args:
        times: ``Epoch`` [n], or seconds past J2000 TDB [n]; ascending, evenly spaced or not.
        positions: As above. None: the edge does not shift.
        attitudes: As above. None: the edge does not turn.
        velocities: As above, for ``method="hermite"``.
        accelerations: As above, with velocities.
        angular_velocities: As above, for attitudes with ``method="hermite"``.
        method: One of the table. Default: ``"hermite"`` where rates of all that is given are given, else ``"spline"``.
        points: For ``"lagrange"``: samples that a polynomial goes through, 2 or more (a degree of 7 takes 8).
        ends: For ``"spline"``: ``"not-a-knot"``, or ``"natural"`` (no acceleration at the ends, which orbits have: kilometres off there).
        outside: Before the first and after the last sample: ``"nan"`` (value and gradient), ``"hold"`` the pose there, at rest, or
            ``"extrapolate"`` the first or last polynomial. The coverage code is -1 or +1 in any case.
        longest_gap: Intervals between samples longer than this (s) are gaps: NaN, and code +1. Default: none are.
        start: First instant that is covered, where some samples before it only serve to interpolate: an ``Epoch``, seconds past J2000 TDB
            or text. Default: the first sample.
        stop: Last instant that is covered, likewise.

    Raises:
        EdgeError: Times not in order, too few samples for the method, shapes that do not fit, numbers that are not finite (their index is
            named), or neighbouring attitudes more than 90 degrees apart (180 for slerp and Hermite), which could be the other way round.

    Precision: 1e-13 of the value for positions; accelerations lose eps * position / step^2, as any interpolation does. In float32 times
    keep two parts.

    Example:
        >>> import numpy as np, jaxframes as jf
        >>> times = np.linspace(0.0, 6.0, 13)
        >>> circle = np.stack([np.cos(times), np.sin(times), 0 * times], -1)
        >>> b = jf.TreeBuilder()
        >>> b.add("craft", parent="world", edge=jf.tables.Sampled(times, circle))
        >>> tree = b.build()
        >>> x = tree.transform(tree.state(time=1.1), of="craft", relative_to="world").translation
        >>> bool(abs(x[0] - np.cos(1.1)) < 1e-3)
        True
    """

    stackable: ClassVar[bool] = False
    needs_time: ClassVar[bool] = True
    positions: jax.Array | None
    attitudes: Rotation | None
    velocities: jax.Array | None
    accelerations: jax.Array | None
    angular_velocities: jax.Array | None
    grid: SampleGrid
    reference: jax.Array
    span: jax.Array
    method: str
    points: int
    ends: str
    outside: str
    longest_gap: float | None

    def __init__(
        self,
        times: Any,
        positions: Any = None,
        attitudes: Any = None,
        *,
        velocities: Any = None,
        accelerations: Any = None,
        angular_velocities: Any = None,
        method: str | None = None,
        points: int = 8,
        ends: str = "not-a-knot",
        outside: str = "nan",
        longest_gap: float | None = None,
        start: Any = None,
        stop: Any = None,
    ):
        known = sample_times(times, longest_gap)
        given = {"positions": positions, "velocities": velocities, "accelerations": accelerations, "angular_velocities": angular_velocities}
        arrays = {name: None if value is None else checked_samples(name, value, len(known.past[0])) for name, value in given.items()}
        turns = None if attitudes is None else checked_attitudes(attitudes, len(known.past[0]))
        method = checked_method(method, arrays, turns is not None)
        for name, value, allowed in (("ends", ends, ENDS), ("outside", outside, OUTSIDE)):
            if value not in allowed:
                raise EdgeError(f"Sampled({name}=...) is one of {', '.join(map(repr, allowed))}, found {value!r}")
        if not isinstance(points, int) or points < 2:
            raise EdgeError(f"Sampled(points=...) is how many samples a polynomial goes through, 2 or more, found {points!r}")
        if turns is not None:
            checked_steps(turns, method, known)
        begin, end = narrowed(known, start, stop)
        for name, value in (
            *arrays.items(),
            *(("attitudes", turns), ("grid", grid_of(known, method, points, ends)), ("method", method)),
            *(("points", points if method == "lagrange" else 0), ("ends", ends if method == "spline" else ENDS[0]), ("outside", outside)),
            *(("longest_gap", None if longest_gap is None else float(longest_gap)),),
            *(("reference", on_device(np.array([known.reference, 0.0], default_float()))), ("span", pairs(begin, end))),
        ):
            object.__setattr__(self, name, value)

    def describe(self) -> str:
        what = " and ".join(word for word, held in (("positions", self.positions), ("attitudes", self.attitudes)) if held is not None)
        return f"sampled {what}, {self.grid.times.shape[-2]} samples, {self.method}"

    @property
    def has_gaps(self) -> bool:
        return bool(np.isnan(np.asarray(self.grid.index.rows)[..., -1]).any())

    @property
    def knots(self) -> Epoch:
        """The times of the samples, ``Epoch`` [n]: where derivatives may jump, for solvers of differential equations (on the host)."""
        hi, lo = split(*self._instants(), np.dtype(self.grid.times.dtype))
        return Epoch(jnp.asarray(hi), jnp.asarray(lo))

    def _instants(self) -> host_two_part.Pair:
        """Return the times of the samples in two float64 parts, seconds past J2000 TDB."""
        times = np.asarray(self.grid.times, np.float64)
        return past_reference(self.reference, times[:, 0], times[:, 1])

    @property
    def batch_shape(self) -> tuple[int, ...]:
        return np.broadcast_shapes(*(np.shape(leaf)[:-2] for leaf in self._samples().values()))

    def _samples(self) -> dict[str, jax.Array]:
        """Return the arrays of samples [..., n, k] that there are, by name."""
        found = {name: getattr(self, name) for name in WIDTHS}
        found["attitudes"] = None if self.attitudes is None else self.attitudes.wxyz
        return {name: array for name, array in found.items() if array is not None}

    def at(self, row: int) -> Self:
        return self._with_samples({name: array[row] if np.ndim(array) > 2 else array for name, array in self._samples().items()})

    def checkable(self) -> Self:
        rows = np.nan_to_num(np.asarray(self.grid.index.rows))
        return self.replace(grid=replace(self.grid, index=replace(self.grid.index.unmarked(), rows=rows)))

    def coverage_code(self, time: Any) -> jax.Array:
        return self._records_without_coefficients().coverage_code(time)

    def _records_without_coefficients(self) -> SampledRecords:
        return SampledRecords(self.grid.index, None, self.reference, self.span, self.outside)

    def astype(self, dtype: Any) -> Self:
        plain = super().astype(dtype)
        index = recast_records(self.grid.index, plain.grid.index, dtype)
        return plain.replace(
            grid=replace(plain.grid, times=recast_pairs(self.grid.times, dtype), index=index),
            reference=recast_pairs(self.reference, dtype),
            span=recast_pairs(self.span, dtype),
        )

    def arguments(self) -> dict[str, Any]:
        kept = {name: getattr(self, name) for name in (*WIDTHS, "attitudes", "method", "ends", "outside", "longest_gap")}
        times, span = self._instants(), np.asarray(self.span, np.float64)
        ends = past_reference(self.reference, span[[0, 2]], span[[1, 3]])
        covered = {}
        for i, name in ((0, "start"), (-1, "stop")):
            same = all(part[i] == own[i] for part, own in zip(times, ends, strict=True))
            covered[name] = None if same else Epoch(*(np.asarray(part[i]) for part in ends))  # pyright: ignore[reportArgumentType]
        return {"times": Epoch(*times), **kept, "points": self.points or 8, **covered}  # pyright: ignore[reportArgumentType]

    def kind(self) -> Hashable:
        index = self.grid.index
        forms = tuple((name, array.shape[-1], array.dtype.name) for name, array in self._samples().items())
        shape = index.first is None, index.rows.dtype.name, self.batch_shape
        return (Sampled, forms, shape, self.method, self.points, self.outside) if not self.batch_shape else None

    @classmethod
    def together(cls, edges: "Sequence[Edge]") -> Edge:
        """Return trajectories of one kind as one edge of many: all of their records are made at once."""
        given = [edge.normalized() for edge in edges if isinstance(edge, Sampled)]
        first, counts = given[0], np.array([edge.grid.times.shape[0] for edge in given])
        starts = np.repeat(np.cumsum(counts) - counts, [edge.grid.left.shape[0] for edge in given]).astype(np.int32)[:, None]
        grids = [edge.grid for edge in given]
        index = concatenated([grid.index for grid in grids])
        join = lambda name: concatenated_arrays([getattr(grid, name) for grid in grids])  # noqa: E731
        shift = lambda whole: None if whole is None else whole.astype(np.int32) + starts  # noqa: E731
        grid = SampleGrid(join("times"), shift(join("left")), join("bands"), shift(join("window")), join("weights"), index)  # pyright: ignore[reportArgumentType]
        parts = {name: concatenated_arrays([getattr(edge, name) for edge in given]) for name in WIDTHS}
        turns = [edge.attitudes.wxyz for edge in given if edge.attitudes is not None]
        whole = first.replace(**parts, attitudes=Rotation(concatenated_arrays(turns)) if turns else None, grid=grid)
        found = whole.replace(reference=stacked_arrays([e.reference for e in given]), span=stacked_arrays([e.span for e in given]))
        return found.records(len(given))

    def records(self, count: int | None = None) -> SampledRecords:
        """Return the trajectory as records: the same motion, with what lies between the samples worked out once.

        Args:
            count: How many trajectories the arrays hold one after the other; None for one.
        """
        if self.batch_shape:
            raise ShapeError(
                f"{self.describe()}: records of a batch of samples, shape {self.batch_shape}, are made one by one, by jax.vmap"
            )
        rates = tuple(part for part in (self.velocities, self.accelerations) if part is not None)
        wxyz = None if self.attitudes is None else unit(self.attitudes.wxyz)
        options = {"method": self.method, "points": self.points}
        position, attitude = _records(self.positions, rates, wxyz, self.angular_velocities, self.grid, **options)
        return SampledRecords(position, attitude, self.reference, self.span, self.outside, count)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        for name, array in self._samples().items():
            if array.shape[-2] != self.grid.times.shape[-2]:
                raise ShapeError(
                    f"{self.describe()}: {name} take an array [..., {self.grid.times.shape[-2]}, k], found shape {array.shape}"
                )
        if not self.batch_shape:
            return self.records().steps(inputs, order)
        return over_batch(
            lambda own, inputs: self._with_samples(own).records().steps(inputs, order), self._samples(), self.batch_shape, inputs
        )

    def _with_samples(self, samples: Mapping[str, jax.Array]) -> Self:
        """Return the trajectory with other samples, [n, k] each by the names of the fields."""
        return self.replace(**{name: Rotation(array) if name == "attitudes" else array for name, array in samples.items()})


@functools.partial(jax.jit, static_argnames=("method", "points"), inline=True)
def _records(
    positions: Any, rates: tuple[Any, ...], wxyz: Any, angular: Any, grid: SampleGrid, *, method: str, points: int
) -> tuple[RecordTable | None, RecordTable | None]:
    """Return the records of positions and of attitudes, made of samples [n, k] by one of ``METHODS``."""
    grid = jax.tree.map(jnp.asarray, grid)

    def of_series(samples: jax.Array, *rates: jax.Array) -> RecordTable:
        if method == "lagrange":
            rows = lagrange_rows(grid, samples, points)
        elif method == "spline":
            rows = hermite_rows(grid, samples, spline_rates(grid, samples))
        else:
            rows = hermite_rows(grid, samples, *rates)
        return with_rows(grid.index, rows, samples.shape[-1])

    position = None if positions is None else of_series(jnp.asarray(positions), *map(jnp.asarray, rates))
    if wxyz is None:
        return position, None
    near = of_near_signs(jnp.asarray(wxyz))
    if method == "linear":
        return position, with_rows(grid.index, slerp_rows(grid, near), SLERP)
    return position, of_series(near, *(() if method != "hermite" else (quaternion_rates(near, jnp.asarray(angular)),)))
