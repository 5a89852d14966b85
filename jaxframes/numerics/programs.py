"""Programs computed as a whole: operations whose derivatives keep nothing but their inputs.

Forward, a program is one loop for each of its arrays, sines and cosines included. Differentiated, sines and cosines are worked out
first, for the program and its change to read, and the change is a stage of its own, which works what it needs out anew from the same
inputs: reverse mode keeps inputs only, and the adjoint is one loop for each array of coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax

from jaxframes.numerics.trig import Half, precomputed_pairs, sin_cos, sin_cos_of
from jaxframes.staging.blocks import Batch, Work, run_work
from jaxframes.staging.operation import Arrays, Operation, changes_of, run
from jaxframes.staging.stages import stage


class StagedProgram:
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

    def takes_numbers(self, moved: frozenset[int]) -> bool:
        """Whether so many inputs are among those that change that one stage is too small for the change of the results."""
        return False

    def change_by_numbers(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> Arrays:
        """Return the change of the results where too many inputs change for one stage, worked out in several."""
        raise NotImplementedError

    def batch(self, arrays: Arrays) -> tuple[bool, ...] | None:
        """Return which arrays have the batch as their leading axis; None where there is no batch of one axis."""
        return None

    def sized(self, count: int) -> "StagedProgram":
        """Return the program for a batch of another size."""
        raise NotImplementedError


def run_program(program: StagedProgram, *arrays: jax.Array) -> tuple[jax.Array, ...]:
    """Return the results of a program, all in one stage."""
    return tuple(run(_Computed(program), *arrays) if arrays else _Computed(program).compute())


@dataclass(frozen=True)
class _Computed(Operation):
    """The operation."""

    program: StagedProgram

    def compute(self, *arrays: jax.Array) -> Arrays:
        return stage(lambda *xs: self.program.values(sin_cos, *xs))(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return self.program.results

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        moved = tuple(i for i, tangent in enumerate(tangents) if tangent is not None)
        if self.program.takes_numbers(frozenset(moved)):
            along, given = self.program.batch(primals), [tangent for tangent in tangents if tangent is not None]
            batch = None
            if along is not None:
                results = self.program.results
                batch = Batch(results[0].shape[0], (*along, *(along[i] for i in moved)), (True,) * len(results))
            return run(self, *primals), run_work(_ByNumbers(self.program, moved, along), batch, *primals, *given)
        pairs = sin_cos_of(_Angles(self.program), *primals) if self.program.has_angles else ()
        return _WithPairs(self.program, len(primals)).derivative((*primals, *pairs), (*tangents, *(None for _ in pairs)))


@dataclass(frozen=True)
class _ByNumbers(Work):
    """The change of a program's results by too many inputs for one stage: of the inputs, then the tangents of some of them.

    Attributes:
        program: The program.
        moved: Those inputs.
        along: Which inputs have the batch as their leading axis; None without such a batch.
    """

    program: StagedProgram
    moved: tuple[int, ...]
    along: tuple[bool, ...] | None

    def __call__(self, *arrays: jax.Array) -> Arrays:
        """Return the changes."""
        count = len(arrays) - len(self.moved)
        primals, tangents = arrays[:count], dict(zip(self.moved, arrays[count:], strict=True))
        program = self.program if self.along is None else self.program.sized(arrays[self.along.index(True)].shape[0])
        return program.change_by_numbers(primals, [tangents.get(i) for i in range(count)])


@dataclass(frozen=True)
class _WithPairs(Operation):
    """The same operation, of the arrays and then the sines and cosines of its angles. How these change, it knows from the arrays."""

    program: StagedProgram
    count: int

    def _pair(self, arrays: Arrays) -> Half:
        if len(arrays) == self.count:
            return sin_cos
        sines, cosines = arrays[self.count :]
        return precomputed_pairs(sines, cosines)

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

    program: StagedProgram

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        return self.program.angles(*arrays)
