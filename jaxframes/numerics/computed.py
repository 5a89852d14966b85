"""Programs computed as a whole: operations whose derivatives keep nothing but their inputs.

Forward, a program is one loop for each of its arrays, sines and cosines included. Differentiated, sines and cosines are worked out
first, for the program and its change to read, and the change is a stage of its own, which works what it needs out anew from the same
inputs: reverse mode keeps inputs only, and the adjoint is one loop for each array of coordinates.
"""

from collections.abc import Sequence
from typing import Any

import jax

from jaxframes.numerics.operation import Arrays, changes_of, elementwise, run
from jaxframes.numerics.stages import stage
from jaxframes.numerics.trig import Half, given_pairs, guarded, sin_cos, sin_cos_of


class Program:
    """Arrays as a function of arrays, by way of components.

    Attributes:
        results: Shapes and dtypes of what it returns.
        has_angles: Whether it takes the sine and cosine of anything that is not known while tracing.
    """

    results: Sequence[jax.ShapeDtypeStruct]
    has_angles: bool

    def angles(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        """Return the angles whose sine and cosine it takes, in that order."""
        raise NotImplementedError

    def values(self, pair: Half, *arrays: jax.Array) -> Arrays:
        """Return the results; ``pair`` gives sine and cosine."""
        raise NotImplementedError

    def change(self, pair: Half, primals: Arrays, tangents: Sequence[jax.Array | None]) -> Arrays:
        """Return the change of the results: that of the arithmetic, unless something better is known."""
        return changes_of(lambda *arrays: tuple(self.values(pair, *arrays)), primals, tangents)


def computed(program: Program, *arrays: jax.Array) -> tuple[jax.Array, ...]:
    """Return the results of a program, all in one stage."""
    operation = _Computed(program)
    return tuple(run(operation, *arrays) if arrays else operation.compute())


class _Computed:
    """The operation."""

    def __init__(self, program: Program):
        self._program = program

    def compute(self, *arrays: jax.Array) -> Arrays:
        return guarded(self._program.values, self._program.angles, *arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return self._program.results

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        pairs = sin_cos_of(self._program.angles, *primals) if self._program.has_angles else ()
        return _WithPairs(self._program, len(primals)).derivative((*primals, *pairs), (*tangents, *(None for _ in pairs)))

    def mapped(self, count: int, axes: Sequence[int | None], *arrays: jax.Array) -> Arrays:
        return elementwise(self)(count, axes, *arrays)


class _WithPairs:
    """The same operation, of the arrays and then the sines and cosines of its angles. How these change, it knows from the arrays."""

    def __init__(self, program: Program, count: int):
        self._program, self._count = program, count

    def _pair(self, arrays: Arrays) -> Half:
        if len(arrays) == self._count:
            return sin_cos
        sines, cosines = arrays[self._count :]
        return given_pairs(sines, cosines)

    def compute(self, *arrays: jax.Array) -> Arrays:
        return stage(lambda *xs: self._program.values(self._pair(xs), *xs[: self._count]))(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        return self._program.results

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Arrays]:
        moved = [i for i, tangent in enumerate(tangents[: self._count]) if tangent is not None]

        def change(primals: Arrays, given: Arrays) -> Arrays:
            full: list[jax.Array | None] = [None] * self._count
            for i, tangent in zip(moved, given, strict=True):
                full[i] = tangent
            return self._program.change(self._pair(primals), primals[: self._count], full)

        return run(self, *primals), stage(change)(tuple(primals), tuple(tangents[i] for i in moved))

    def mapped(self, count: int, axes: Sequence[int | None], *arrays: jax.Array) -> Arrays:
        return elementwise(self)(count, axes, *arrays)
