"""Traced inputs: components that are made of whole arrays within the stage that reads them.

What a stage is given must lie in memory. Given a state's array [..., n] it reads the columns that it needs and works out what they become
in the loop that uses them; given the columns, each would be copied first, and each gradient put back by itself.
"""

import functools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.core
import numpy as np

from jaxframes.staging.arrays import is_concrete
from jaxframes.staging.jaxprs import Program
from jaxframes.staging.operation import changes_of

Made = Any
"""What a traced input is read as: a structure whose leaves are components."""
Recipe = Callable[..., Made]
"""Makes a structure of components of arrays; hashable, equal by value, and without arrays of its own."""


class TracedInput(NamedTuple):
    """A structure of components as a function of arrays.

    Attributes:
        recipe: Makes the structure.
        arrays: What it is made of.
    """

    recipe: Recipe
    arrays: tuple[jax.Array, ...]


class _Outline(NamedTuple):
    """What is known of a structure without its arrays: the program of its components, its kind, and the numbers known while tracing."""

    needs: tuple[frozenset[int], ...]
    structure: Any
    known: tuple[float | None, ...]

    def filled(self, leaves: Sequence[Any], known: Sequence[float | None]) -> Made:
        rest = iter(leaves)
        return jax.tree.unflatten(self.structure, [next(rest) if value is None else value for value in known])


def outline(recipe: Recipe, arrays: Sequence[Any]) -> Made:
    """Return the structure that a recipe makes of arrays of some types, with NaN for the components that are not known."""
    found = _outline(recipe, *map(jax.typeof, arrays))
    return found.filled([float("nan")] * len(found.needs), found.known)


def changes(recipe: Recipe, primals: Sequence[jax.Array], tangents: Sequence[jax.Array | None]) -> Made:
    """Return the change of a structure with the arrays: its leaves are known zeros where nothing changes."""
    found = _outline(recipe, *map(jax.typeof, primals))
    moved = {i for i, tangent in enumerate(tangents) if tangent is not None}
    given = changes_of(lambda *arrays: _leaves(recipe, arrays), primals, tangents) if moved else [0.0] * len(found.needs)
    leaves = [change if needs & moved else 0.0 for change, needs in zip(given, found.needs, strict=True)]
    return found.filled(leaves, [None if value is None else 0.0 for value in found.known])


def _leaves(recipe: Recipe, arrays: Sequence[jax.Array]) -> list[jax.Array]:
    return [leaf for leaf in jax.tree.leaves(recipe(*arrays)) if isinstance(leaf, jax.Array)]


@functools.lru_cache(maxsize=1024)
def _outline(recipe: Recipe, *kinds: Any) -> _Outline:
    made: list[Any] = []

    def flat(*arrays: jax.Array) -> list[jax.Array]:
        out, structure = jax.tree.flatten(recipe(*arrays))
        made[:] = structure, tuple(None if isinstance(leaf, jax.Array) else float(leaf) for leaf in out)
        return [leaf for leaf in out if isinstance(leaf, jax.Array)]

    return _Outline(Program(jax.make_jaxpr(flat)(*kinds)).needs(), *made)


@dataclass(frozen=True)
class Known:
    """An array whose numbers are known while tracing, as a value of Python."""

    values: Any
    dtype: str

    @property
    def array(self) -> np.ndarray:
        """The array."""
        return np.array(self.values, self.dtype)


Leaf = Known | int
"""A leaf of a structure: known, or the place of an array among inputs."""


class Operands:
    """The arrays that a program takes, each once."""

    def __init__(self) -> None:
        self.arrays: list[jax.Array] = []
        self._places: dict[int, int] = {}

    def place(self, array: jax.Array) -> int:
        """Return the place of an array, which is added if it is not there."""
        key = id(array)
        if key not in self._places:
            self._places[key] = len(self.arrays)
            self.arrays.append(array)
        return self._places[key]

    def leaf(self, array: Any) -> Leaf:
        """Return a leaf of a structure: numbers that are known fold into the program, unless there are many."""
        if is_concrete(array) and np.ndim(array) <= 1:
            values = np.asarray(array)
            return Known(tuple(values.tolist()) if values.ndim else values.item(), values.dtype.name)
        return self.place(array)

    def parts(self, value: Any) -> "Parts":
        """Return a structure of parameters taken apart: the numbers of those that are known fold into the program."""
        leaves, kind = jax.tree.flatten(value)
        return Parts(kind, tuple(map(self.leaf, leaves)))

    def components(self, value: Any) -> "Parts":
        """Return a structure of components taken apart: plain numbers stay plain, arrays are inputs."""
        leaves, kind = jax.tree.flatten(value)
        return Parts(kind, tuple(Known(leaf, "float") if isinstance(leaf, float) else self.place(leaf) for leaf in leaves))


@dataclass(frozen=True)
class Parts:
    """A structure taken apart: what kind it is, and its leaves."""

    kind: Hashable
    leaves: tuple[Leaf, ...]

    def of(self, arrays: Sequence[Any]) -> Any:
        """Return the structure with its arrays in place; numbers that were plain stay plain."""
        return jax.tree.unflatten(self.kind, [_filled(leaf, arrays) for leaf in self.leaves])

    @property
    def places(self) -> frozenset[int]:
        """The places of its arrays."""
        return frozenset(leaf for leaf in self.leaves if isinstance(leaf, int))

    def moved(self, places: dict[int, int]) -> "Parts":
        """Return the same with arrays at other places."""
        return Parts(self.kind, tuple(places[leaf] if isinstance(leaf, int) else leaf for leaf in self.leaves))


def _filled(leaf: Leaf, arrays: Sequence[Any]) -> Any:
    if isinstance(leaf, int):
        return arrays[leaf]
    return leaf.values if leaf.dtype == "float" else leaf.array
