"""Translation tables: the position of a body relative to another over time, with velocity and acceleration."""

import functools
from typing import Any

import jax
import numpy as np

from jaxframes.edges.base import Inputs
from jaxframes.edges.family import family
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.tables import evaluate, two_part_position
from jaxframes.tables.base import Table, checked_order, two_parts
from jaxframes.tables.evaluate import Run
from jaxframes.tables.info import Info
from jaxframes.tables.records import RecordTable


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

    record_tables: tuple[RecordTable, ...]
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


@functools.partial(jax.jit, static_argnums=0)
def _translation(order: int, run: Run, hi: Any, lo: Any) -> tuple[jax.Array, ...]:
    return evaluate.evaluate(run, hi, lo, order, vectors=True)


def place_at_rest(table: Table) -> np.ndarray | None:
    """Return the position [3] of what a table says does not move at all, None where it moves."""
    total = np.zeros(3)
    for records in table.record_tables:
        rows = np.asarray(records.rows)
        places, rest = rows[:, :3], rows[:, records.series : -3]
        if (places != places[0]).any() or (rest != 0).any() or (rows[:, 3 : records.series] != 0).any():
            return None
        total = total + places[0]
    return total
