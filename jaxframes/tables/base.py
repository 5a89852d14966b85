"""Edges made of Chebyshev tables: where a body is, and how a frame is turned."""

import dataclasses
import functools
from collections.abc import Hashable, Sequence
from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs, family
from jaxframes.errors import EdgeError, MissingInputError
from jaxframes.numerics.components import V3, Component, Quat
from jaxframes.numerics.packed import Kind, Packed
from jaxframes.numerics.path_motion import extend, made
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Coordinate, Step, Turn
from jaxframes.numerics.two_part import recast_pair
from jaxframes.staging.columns import parameters
from jaxframes.tables import evaluate, two_part_position
from jaxframes.tables.evaluate import Run
from jaxframes.tables.info import Info
from jaxframes.tables.records import Leg, two_part_columns
from jaxframes.tables.report import report
from jaxframes.time import seconds
from jaxframes.time.epoch import EPOCH


class Table(Edge):
    """What both kinds of table share. Time is an ``Epoch``; outside the coverage everything is NaN, gradients included.

    Attributes:
        legs: Chebyshev runs whose sum is the table's value (SI units).
        reference: ``[2]``: reference epoch in two parts, seconds past J2000 TDB.
        span: ``[4]``: start and stop of the coverage, each in two parts, seconds past the reference.
        info: Names, ids, coverage and kernels; static.
        by_record: Names of the fields beside the legs that hold a row for each record.
    """

    stacks: ClassVar[bool] = False
    needs_time: ClassVar[bool] = True
    by_record: ClassVar[tuple[str, ...]] = ()
    legs: tuple[Leg, ...]
    reference: jax.Array
    span: jax.Array
    info: Info

    def astype(self, dtype: Any) -> Self:
        """Return a copy with numbers of another dtype; times, kept in two parts, lose no more than they must."""
        plain = super().astype(dtype)
        return plain.replace(
            reference=_recast_pairs(self.reference, dtype),
            span=_recast_pairs(self.span, dtype),
            legs=tuple(_recast_leg(old, new, dtype) for old, new in zip(self.legs, plain.legs, strict=True)),
        )

    @property
    def has_gaps(self) -> bool:
        """Whether there are instants without data between its first and its last."""
        return any(leg.gaps.any() for leg in self.legs)

    def checkable(self) -> Self:
        """Return the table without the marks of its gaps and of the open end of its last record."""
        return self.replace(legs=tuple(leg.unmarked() for leg in self.legs))

    def kind(self) -> Hashable:
        """Return what tables have in common that are evaluated as one, whatever the number of their records."""
        own = tuple(getattr(self, f.name) for f in dataclasses.fields(self) if f.name not in (*self.parameter_fields(), "info"))  # pyright: ignore[reportArgumentType]
        legs = tuple((leg.series, leg.rows.shape[-1], leg.rows.dtype.name, leg.first is None, leg.low is None) for leg in self.legs)
        return type(self), own, legs

    @classmethod
    def together(cls, edges: Sequence[Edge]) -> Edge:
        """Return tables of one kind as one edge of many."""
        from jaxframes.tables.pool import pooled

        return pooled(edges)  # pyright: ignore[reportArgumentType]

    @property
    def run(self) -> Run:
        """The arrays that an evaluation reads."""
        return Run(self.legs, self.reference, self.span)

    def coverage_code(self, time: Any) -> jax.Array:
        """Return -1 where an ``Epoch`` (or ET seconds) lies before the coverage, 0 inside, +1 after: int32 [...]; -1 for NaN."""
        return evaluate.coverage_code(self.run, *two_parts(time))

    def report(self) -> str:
        """Return what the table is made of, in lines: method, records, degree, bytes, coverage, kernels, jumps between records."""
        return report(self.info, self.legs)

    def values(self, inputs: Inputs, order: int) -> tuple[V3, ...]:
        """Return the table's value and its derivatives at the epoch of a state, as components."""
        if inputs.time is None:
            raise MissingInputError(f"{self.describe()} depends on time: give the state one, tree.state(time=...).")
        return _triples(evaluate.evaluate(self.run, *inputs.time, order))


def _recast_pairs(values: Any, dtype: Any) -> Any:
    """Return numbers [..., 2 n], two parts each, in another dtype."""
    numpy = np if isinstance(values, np.ndarray) else jnp
    hi, lo = recast_pair(values[..., 0::2], values[..., 1::2], dtype)
    return numpy.stack([hi, lo], -1).reshape(values.shape)


def _recast_leg(old: Leg, plain: Leg, dtype: Any) -> Leg:
    """Return a leg whose times and lowest coefficients are converted as pairs; ``plain`` holds everything else converted."""
    numpy: Any = np if isinstance(old.rows, np.ndarray) else jnp
    middle = _recast_pairs(old.rows[..., -3:-1], dtype)
    rows = numpy.concatenate([plain.rows[..., :-3], middle, plain.rows[..., -1:]], -1)
    grid = numpy.concatenate([_recast_pairs(old.grid[..., :2], dtype), plain.grid[..., 2:]], -1)
    ends = None if old.ends is None else _recast_pairs(old.ends, dtype)
    low = plain.low
    if low is not None and low.dtype != old.rows.dtype:  # a wider number holds both parts; the empty low part keeps the tree's structure
        whole = plain.rows[..., two_part_columns(rows.shape[-1], old.series)] + low
        rows = numpy.concatenate([whole[..., :-1], rows[..., low.shape[-1] - 1 : -1], whole[..., -1:]], -1)
        low = low * 0
    return Leg(rows, grid, plain.first, ends, old.series, old.compares, low)


@family(static=("info",))
class TranslationTable(Table):
    """Where a body is relative to another: a pure translation between frames with the axes of one inertial frame.

    Made by ``Kernels.translation`` or ``jf.spice.load``. Position, velocity and acceleration in m, m/s, m/s2; velocity and
    acceleration are the derivatives of the records' polynomials (for SPK type 3 the velocity is the kernel's own series).

    Example:
        >>> import jaxframes as jf
        >>> with jf.spice.Kernels(jf.spice.find_kernels("de440")) as kernels:
        ...     moon = kernels.translation(target="MOON", center="EARTH", start="2026-01-01", stop="2026-02-01")
        >>> bool(3.5e8 < jax.numpy.linalg.norm(moon.evaluate(jf.Epoch.from_tdb("2026-01-15"), order=0)[0]) < 4.1e8)
        True
    """

    legs: tuple[Leg, ...]
    reference: jax.Array
    span: jax.Array
    info: Info

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return one motion: the translation, without rotation."""
        position, *rates = self.values(inputs, order)
        linear = dict(zip(("linear", "linear2"), rates, strict=False))
        return (Rigid(translation=position, **linear),)

    def describe(self) -> str:
        """Return the kind of the edge, its bodies and its axes."""
        return f"table: {self.info.of} from {self.info.relative_to} in {self.info.axes}"

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return position, velocity and acceleration, each [..., 3]; the first ``order + 1`` of them.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2.
        """
        return _translation(checked_order(order), self.run, *two_parts(time))

    def evaluate_two_part(self, time: Any) -> tuple[jax.Array, jax.Array]:
        """Return the position in two parts [..., 3], hi + lo in m: what float32 alone cannot hold.

        The lowest terms of the series are held and summed in double-single arithmetic. In float32 the Moon comes within a millimetre
        so, instead of tens of metres, where the table was made or loaded in float32; one converted by ``astype`` has lost these digits.
        Subtract high parts from high parts first. Derivatives are those of ``evaluate``, in hi.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
        """
        return two_part_position.position(self.run, *two_parts(time))


@family(static=("info",))
class OrientationTable(Table):
    """How a body-fixed frame is turned relative to an inertial one: a pure rotation by three Euler angles in time.

    The pose ``o_T_p`` maps coordinates of the body-fixed frame p to the inertial frame o: R = placement Rz(phi) Rx(theta) Rz(psi).
    This is the transpose of SPICE's ``eul2m(psi, theta, phi, 3, 1, 3)``, turned from the segment's own base frame.

    Attributes:
        placement: ``[4]``: quaternion wxyz of the segment's base frame in the frame asked for.
    """

    legs: tuple[Leg, ...]
    reference: jax.Array
    span: jax.Array
    placement: jax.Array
    info: Info

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return three turns, by phi about z, theta about x and psi about z."""
        placement = Quat(*parameters(self.placement, inputs.batch_rank))
        return turns(placement, self.values(inputs, order))

    def describe(self) -> str:
        """Return the kind of the edge and its frames."""
        return f"table: {self.info.of} from {self.info.relative_to}"

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return the quaternion wxyz [..., 4], angular velocity and angular acceleration [..., 3] in the inertial frame's axes.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2; the first ``order + 1`` of the three are returned.
        """
        return _orientation(checked_order(order), self.run, self.placement, *two_parts(time))


def turns(placement: Quat, angles: tuple[V3, ...]) -> tuple[Step, ...]:
    """Return the three turns that Euler angles (phi, theta, psi) with their derivatives stand for."""
    phi, theta, psi = (Coordinate(*parts) for parts in zip(*angles, strict=True))
    x, z = V3(1.0, 0.0, 0.0), V3(0.0, 0.0, 1.0)
    return Turn(z, phi, rotation=placement), Turn(x, theta), Turn(z, psi)


def _triples(values: tuple[Component, ...]) -> tuple[V3, ...]:
    return tuple(V3(*values[i : i + 3]) for i in range(0, len(values), 3))


def checked_order(order: int) -> int:
    """Return the order that a caller asks for (EdgeError unless it is 0, 1 or 2)."""
    if order not in (0, 1, 2):
        raise EdgeError(f"order={order!r}: tables give order 0 (value), 1 (and rate) or 2 (and acceleration)")
    return order


def two_parts(time: Any) -> tuple[Any, Any]:
    """Return the parts of an ``Epoch``; plain seconds keep what one number cannot hold, and nothing else is taken (FrameError)."""
    if hasattr(time, "hi"):
        return time.hi, time.lo
    return seconds.two_parts(time, None, EPOCH)


@functools.partial(jax.jit, static_argnums=0)
def _translation(order: int, run: Run, hi: Any, lo: Any) -> tuple[jax.Array, ...]:
    return evaluate.evaluate(run, hi, lo, order, vectors=True)


@functools.partial(jax.jit, static_argnums=0)
def _orientation(order: int, run: Run, placement: jax.Array, hi: Any, lo: Any) -> tuple[jax.Array, ...]:
    values = evaluate.evaluate(run, hi, lo, order)
    steps = turns(Quat(*parameters(placement)), _triples(values))
    return attitude_of(extend((), made(steps), Kind(values[0].shape, values[0].dtype, order)))


def attitude_of(motion: Packed) -> tuple[jax.Array, ...]:
    """Return the quaternion [..., 4], angular velocity and angular acceleration [..., 3] of a motion."""
    pose, *sixes = motion
    return pose[..., :4], *(six[..., :3] for six in sixes)
