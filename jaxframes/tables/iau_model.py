"""IAU orientation models of planets and moons (text PCK files): pole, prime meridian and their periodic terms, evaluated under jit."""

import functools
from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Inputs
from jaxframes.edges.family import family
from jaxframes.numerics.components import V3, Component, Quat
from jaxframes.numerics.packed import Kind
from jaxframes.numerics.path_motion import extend, steps_at_hand
from jaxframes.numerics.steps import Step
from jaxframes.numerics.two_part import recast_pairs, two_sum
from jaxframes.staging.arrays import default_float, is_concrete
from jaxframes.staging.columns import assemble, parameters, take_apart
from jaxframes.staging.stages import stage
from jaxframes.tables.base import checked_order, two_parts
from jaxframes.tables.evaluate import DEVICE, recast
from jaxframes.tables.formulas import euler_steps, model_angles
from jaxframes.tables.info import Info
from jaxframes.tables.instants import split
from jaxframes.tables.orientation import attitude_of
from jaxframes.tables.table_edge import TableEdge

PAIRED = ("polynomials", "phases", "reference")


@family(static=("info",))
class IauOrientation(TableEdge):
    """How a body-fixed frame is turned relative to an inertial one, by the analytic model of a text PCK: at every instant, without end.

    Made by ``Kernels.orientation`` or ``jf.spice.load``. Right ascension and declination of the pole and the angle of the prime
    meridian are polynomials in time plus sums over phase angles (sines for the first and the last, cosines for the declination):
    Archinal et al. 2018 (the IAU report of 2015) and NAIF's ``pck.req``. The pose ``o_T_p`` maps coordinates of the body-fixed
    frame p to the inertial frame o: R = placement Rz(ra + 90 deg) Rx(90 deg - dec) Rz(w).

    Whole turns are taken out of rate times time before anything is rounded: in float64 the rotation is within 1e-14 rad of exact
    arithmetic decades from J2000 (CSPICE: 1e-10 rad), in float32 within 3e-6 rad. Rate and acceleration are the exact derivatives.
    Gradients: in time, and in every number of the model.

    Attributes:
        polynomials: ``[3, terms, 2]``: right ascension, declination, prime meridian; constant in turns, rate in turns/s, further
            ones in turns per Julian century to the power; each number in two parts.
        phases: ``[m, terms, 2]``: the phase angles, likewise.
        amplitudes: ``[m, 3]``: amplitude of each phase in right ascension (sine), declination (cosine), prime meridian (sine), rad.
        reference: ``[2]``: the epoch that time counts from, seconds past J2000 TDB in two parts.
        placement: ``[4]``: quaternion wxyz of the model's inertial frame in the frame asked for.
        info: Names, ids and kernels; static. Its ``start`` and ``stop`` are empty: there is no end to the coverage.

    Example:
        >>> import jaxframes as jf
        >>> with jf.spice.Kernels("tests/data/iau_2015.tpc") as kernels:
        ...     mars = kernels.orientation(frame="IAU_MARS")
        >>> wxyz, angular_velocity, angular_acceleration = mars.evaluate(jf.Epoch.from_tdb("2026-03-01"))
    """

    stackable: ClassVar[bool] = False
    needs_time: ClassVar[bool] = True
    polynomials: jax.Array
    phases: jax.Array
    amplitudes: jax.Array
    reference: jax.Array
    placement: jax.Array
    info: Info

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return three rotations: about z by ra + 90 deg, about x by 90 deg - dec, about z by the prime meridian."""
        hi, lo = inputs.epoch_for(self)
        values = take_apart(stage(lambda: assemble(self._angles(hi, lo, order)))())
        triples = tuple(V3(*values[i : i + 3]) for i in range(0, len(values), 3))
        return euler_steps(Quat(*parameters(self.placement, inputs.batch_rank)), triples)

    def describe(self) -> str:
        """Return the kind of the edge and its frames."""
        return f"IAU model: {self.info.of} from {self.info.relative_to}"

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return the quaternion wxyz [..., 4], angular velocity and angular acceleration [..., 3] in the inertial frame's axes.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2; the first ``order + 1`` of the three are returned.
        """
        return _evaluate(checked_order(order), self, *two_parts(time))

    def astype(self, dtype: Any) -> Self:
        """Return a copy with numbers of another dtype; those kept in two parts lose no more than they must."""
        return super().astype(dtype).replace(**{name: recast_pairs(getattr(self, name), dtype) for name in PAIRED})

    def report(self) -> str:
        """Return what the model is made of, in lines."""
        lines = [
            f"orientation of {self.info.of} ({self.info.of_id}) relative to {self.info.relative_to} ({self.info.relative_id})",
            f"method:   analytic model of a text PCK, {self.phases.shape[0]} phase angles, evaluated at any instant",
            f"coverage: {self.info.coverage}",
            f"size:     {sum(leaf.nbytes for leaf in jax.tree.leaves(self))} bytes, {self.phases.dtype.name}",
            *(f"measured: {name}: {value:.3g}" for name, value in self.info.measured),
            *(f"kernel:   {source.name} sha256 {source.sha256}" for source in self.info.sources),
            f"read by:  {self.info.toolkit}",
        ]
        return "\n".join(lines)

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return the numbers as float64 arrays; exact, so that ``from_arrays`` gives the same edge again."""
        arrays = {name: np.array(getattr(self, name), np.float64) for name in (*PAIRED, "amplitudes", "placement")}
        for name in PAIRED:
            arrays[name] = np.stack(split(arrays[name][..., 0], arrays[name][..., 1], np.dtype(np.float64)), -1)
        return arrays

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray], info: Info) -> "IauOrientation":
        """Return the edge of float64 arrays, in the default float dtype."""
        dtype = np.dtype(default_float())
        made = {name: arrays[name].astype(dtype) for name in ("amplitudes", "placement")}
        for name in PAIRED:
            made[name] = np.stack(split(arrays[name][..., 0], arrays[name][..., 1], dtype), -1)
        fields: dict[str, Any] = {name: jnp.asarray(array) for name, array in made.items()}
        return cls(**fields, info=info)

    def _angles(self, hi: Component, lo: Component, order: int) -> list[Component]:
        """Return phi, theta and psi, then their first and second derivatives, rad and seconds."""
        dtype = self.phases.dtype
        dt_hi, error = two_sum(jnp.asarray(hi, dtype), -jnp.asarray(self.reference[0]))
        time = dt_hi, error + (lo - self.reference[1])
        polynomials, phases = ([_numbers(row) for row in _rows(array)] for array in (self.polynomials, self.phases))
        amplitudes = [[_number(row[i]) for i in range(3)] for row in _rows(self.amplitudes)]
        return model_angles(polynomials, phases, amplitudes, time, order, DEVICE)


def _rows(array: jax.Array) -> list[Any]:
    """Return the rows of an array: of NumPy where the numbers are known, so that zeros fold away."""
    known = np.asarray(array) if is_concrete(array) else array
    return [known[i] for i in range(array.shape[0])]


def _number(value: Any) -> Component:
    return value if isinstance(value, jax.Array) else float(value)


def _numbers(row: Any) -> list[tuple[Component, Component]]:
    return [(_number(row[i, 0]), _number(row[i, 1])) for i in range(row.shape[0])]


@functools.partial(jax.jit, static_argnums=0)
def _evaluate(order: int, edge: IauOrientation, hi: Any, lo: Any) -> tuple[jax.Array, ...]:
    dtype = edge.phases.dtype
    hi, lo = recast(hi, lo, dtype)
    steps = steps_at_hand(edge.steps(Inputs(time=(hi, lo)), order))
    return attitude_of(extend((), steps, Kind(hi.shape, dtype, order)))
