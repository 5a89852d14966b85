"""Sources: components that are made of whole arrays within the stage that reads them.

What a stage is given must lie in memory. Given a state's array [..., n] it reads the columns that it needs and works out what they become
in the loop that uses them; given the columns, each would be copied first, and each gradient put back by itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.core

from jaxframes.numerics.boundary import is_concrete
from jaxframes.numerics.operation import changes_of

Made = Any
"""What a source makes: a structure whose leaves are components."""


@dataclass(frozen=True, eq=False)
class Source:
    """A structure of components as a function of arrays; ``source_of`` makes it.

    Attributes:
        arrays: The arrays that it is made of.
    """

    arrays: tuple[jax.Array, ...]
    _program: Any
    _places: tuple[int, ...]  # of the arrays among the program's inputs
    _needs: tuple[frozenset[int], ...]  # for each leaf, which of the program's inputs it depends on
    _structure: Any
    _known: tuple[float | None, ...]

    def __call__(self, *arrays: jax.Array) -> Made:
        """Return the structure made of arrays like the source's."""
        return self._filled(self._leaves(*arrays), self._known)

    @property
    def outline(self) -> Made:
        """The structure with NaN for the components that are not known."""
        return self._filled([float("nan")] * len(self._needs), self._known)

    def changes(self, primals: Sequence[jax.Array], tangents: Sequence[jax.Array | None]) -> Made:
        """Return the change of the structure with the arrays: its leaves are known zeros where nothing changes."""
        moved = {place for place, tangent in zip(self._places, tangents, strict=True) if tangent is not None}
        found = changes_of(self._leaves, primals, tangents) if moved else [0.0] * len(self._needs)
        leaves = [change if needs & moved else 0.0 for change, needs in zip(found, self._needs, strict=True)]
        return self._filled(leaves, [None if value is None else 0.0 for value in self._known])

    def _leaves(self, *arrays: jax.Array) -> list[jax.Array]:
        inputs: list[Any] = [None] * len(self._program.jaxpr.invars)  # those that are not among the arrays are never read
        for place, array in zip(self._places, arrays, strict=True):
            inputs[place] = array
        return jax.core.eval_jaxpr(self._program.jaxpr, self._program.consts, *inputs)

    def _filled(self, leaves: Sequence[Any], known: Sequence[float | None]) -> Made:
        rest = iter(leaves)
        return jax.tree.unflatten(self._structure, [next(rest) if value is None else value for value in known])


class Opened:
    """Values whose traced arrays are taken out, to be put in again.

    Attributes:
        arrays: The traced arrays.
        places: Where they are among the leaves.
    """

    def __init__(self, *values: Any):
        self._leaves, self._structure = jax.tree.flatten(values)
        self.places = [i for i, leaf in enumerate(self._leaves) if not is_concrete(leaf)]
        self.arrays = tuple(self._leaves[i] for i in self.places)

    def __call__(self, *arrays: jax.Array) -> tuple[Any, ...]:
        """Return the values with other arrays."""
        full = list(self._leaves)
        for i, array in zip(self.places, arrays, strict=True):
            full[i] = array
        return jax.tree.unflatten(self._structure, full)


def source_of(make: Callable[..., Made], *values: Any) -> Source:
    """Return what a function makes of values as a source.

    Args:
        make: Returns a structure whose leaves are components: arrays, or numbers known while tracing.
        values: What it takes. Only the traced arrays in it that ``make`` reads count as the source's arrays.
    """
    opened = Opened(*values)
    made: list[Any] = []

    def flat(*arrays: jax.Array) -> list[jax.Array]:
        out, kind = jax.tree.flatten(make(*opened(*arrays)))
        made[:] = kind, tuple(None if isinstance(leaf, jax.Array) else float(leaf) for leaf in out)
        return [leaf for leaf in out if isinstance(leaf, jax.Array)]

    traced = jax.make_jaxpr(flat)(*opened.arrays)
    program = traced.replace(jaxpr=_used(traced.jaxpr))
    needs, read = _dependencies(program.jaxpr)
    return Source(tuple(opened.arrays[i] for i in read), program, read, needs, *made)


def _variables(atoms: Sequence[Any]) -> list[Any]:
    return [atom for atom in atoms if not hasattr(atom, "val")]  # the others are numbers written into the program


def _used(program: Any) -> Any:
    """Return a program without what its outputs do not need."""
    needed, kept = set(_variables(program.outvars)), []
    for equation in reversed(program.eqns):
        if needed.intersection(equation.outvars):
            needed.update(_variables(equation.invars))
            kept.append(equation)
    return program.replace(eqns=kept[::-1])


def _dependencies(program: Any) -> tuple[tuple[frozenset[int], ...], tuple[int, ...]]:
    """Return the inputs that each output of a program depends on, and the inputs that are read at all."""
    needs = {variable: frozenset([i]) for i, variable in enumerate(program.invars)}
    none = frozenset[int]()
    read = set(_variables(program.outvars))
    for equation in program.eqns:
        inputs = _variables(equation.invars)
        read.update(inputs)
        needs.update(dict.fromkeys(equation.outvars, none.union(*(needs.get(v, none) for v in inputs))))
    outputs = tuple(none.union(*(needs.get(v, none) for v in _variables([atom]))) for atom in program.outvars)
    return outputs, tuple(i for i, variable in enumerate(program.invars) if variable in read)
