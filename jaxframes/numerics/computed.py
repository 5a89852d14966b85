"""Programs computed as a whole: operations whose derivatives keep nothing but their inputs.

Forward, a program is one loop for each of its arrays, sines and cosines included. Differentiated, sines and cosines are worked out
first, for the program and its change to read, and the change is a stage of its own, which works what it needs out anew from the same
inputs: reverse mode keeps inputs only, and the adjoint is one loop for each array of coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax

from jaxframes.numerics.trig import Half, given_pairs, sin_cos, sin_cos_of
from jaxframes.staging.operation import Arrays, Operation, changes_of, run
from jaxframes.staging.stages import stage


class Program:
    """Arrays as a function of arrays, by way of components: a frozen dataclass without arrays, equal by value.

    Attributes:
        has_angles: Whether it takes the sine and cosine of anything that is not known while tracing.
    """

    has_angles: bool

    @property
    def results(self) -> Sequence[jax.ShapeDtypeStruct]:
        """Shapes and dtypes of what it returns."""
        raise NotImplementedError

    def angles(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        """Return the angles whose sine and cosine it takes, in that order."""
        raise NotImplementedError

    def values(self, pair: Half, *arrays: jax.Array) -> Arrays:
        """Return the results; ``pair`` gives sine and cosine."""
        raise NotImplementedError

    def change(self, pair: Half, primals: Arrays, tangents: Sequence[jax.Array | None]) -> Arrays:
        """Return the change of the results: that of the arithmetic, unless something better is known."""
        return changes_of(lambda *arrays: tuple(self.values(pair, *arrays)), primals, tangents)

    def change_by_numbers(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> Arrays | None:
        """Return the change of the results where too many inputs change for one stage, worked out in several; None elsewhere."""
        return None


def computed(program: Program, *arrays: jax.Array) -> tuple[jax.Array, ...]:
    """Return the results of a program, all in one stage."""
    return tuple(run(_Computed(program), *arrays) if arrays else _Computed(program).compute())


@dataclass(frozen=True)
class _Computed(Operation):
    """The operation."""

    program: Program

    def compute(self, *arrays: jax.Array) -> Arrays:
        return stage(lambda *xs: self.program.values(sin_cos, *xs))(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return self.program.results

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        changes = self.program.change_by_numbers(primals, tangents)
        if changes is not None:
            return run(self, *primals), changes
        pairs = sin_cos_of(_Angles(self.program), *primals) if self.program.has_angles else ()
        return _WithPairs(self.program, len(primals)).derivative((*primals, *pairs), (*tangents, *(None for _ in pairs)))


@dataclass(frozen=True)
class _WithPairs(Operation):
    """The same operation, of the arrays and then the sines and cosines of its angles. How these change, it knows from the arrays."""

    program: Program
    count: int

    def _pair(self, arrays: Arrays) -> Half:
        if len(arrays) == self.count:
            return sin_cos
        sines, cosines = arrays[self.count :]
        return given_pairs(sines, cosines)

    def compute(self, *arrays: jax.Array) -> Arrays:
        return stage(lambda *xs: self.program.values(self._pair(xs), *xs[: self.count]))(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return self.program.results

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        moved = [i for i, tangent in enumerate(tangents[: self.count]) if tangent is not None]

        def change(primals: Arrays, given: Arrays) -> Arrays:
            full: list[jax.Array | None] = [None] * self.count
            for i, tangent in zip(moved, given, strict=True):
                full[i] = tangent
            return self.program.change(self._pair(primals), primals[: self.count], full)

        return run(self, *primals), stage(change)(tuple(primals), tuple(tangents[i] for i in moved))


@dataclass(frozen=True)
class _Angles:
    """The angles of a program as a function that is equal by value, which a method is not."""

    program: Program

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        return self.program.angles(*arrays)
