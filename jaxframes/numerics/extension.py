"""Extending a motion by steps: composed forward, differentiated by geometry (``variation``)."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeGuard

import jax

from jaxframes.numerics.components import mul
from jaxframes.numerics.computed import Program, computed
from jaxframes.numerics.packed import Kind, Packed, unpacked, unpacked_change
from jaxframes.numerics.rigid import Rigid, compose
from jaxframes.numerics.steps import Step, Turn, append_all
from jaxframes.numerics.trig import Half, sin_cos
from jaxframes.numerics.variation import varied
from jaxframes.staging.operation import Arrays
from jaxframes.staging.traced_inputs import Operands, Parts, Source, changes, outline


class StepsRecipe:
    """Makes steps of arrays: the recipe of a ``Source``; a frozen dataclass without arrays, equal by value."""

    def __call__(self, *arrays: jax.Array) -> tuple[Step, ...]:
        """Return the steps."""
        raise NotImplementedError

    @property
    def numbers(self) -> frozenset[int]:
        """Places of the arrays that are a tree's own numbers."""
        return frozenset()

    @property
    def count(self) -> int:
        """How many edges make the steps."""
        return 1

    def part(self, first: int, last: int) -> "tuple[StepsRecipe, tuple[int, ...]]":
        """Return the recipe for some of the edges, and the places of the arrays that these read."""
        raise NotImplementedError


@dataclass(frozen=True)
class MadeSteps(StepsRecipe):
    """Steps that were worked out before."""

    made: Parts

    def __call__(self, *arrays: jax.Array) -> tuple[Step, ...]:
        """Return the steps."""
        return tuple(self.made.of(arrays))


def made(steps: Sequence[Step]) -> Source:
    """Return steps that are worked out already as a source."""
    operands = Operands()
    return Source(MadeSteps(operands.components(tuple(steps))), tuple(operands.arrays))


def extend(start: Packed, source: Source, kind: Kind) -> Packed:
    """Return a motion extended by steps one after the other.

    Args:
        start: The motion of the frame that the first step starts from; no arrays for the identity, at rest.
        source: The steps: a ``StepsRecipe`` and its arrays.
        kind: What the result is like.
    """
    recipe, arrays = source
    program = _Extension(recipe, len(start), kind, has_angles(outline(recipe, arrays)))  # pyright: ignore[reportArgumentType]
    return computed(program, *start, *arrays)


EDGES_BY_NUMBERS = 2
"""Edges whose own numbers may change within one stage. A change of a mount takes six numbers where one of a joint takes one, and compilers
take exponentially longer for the adjoint of a long path of them."""


@dataclass(frozen=True)
class _Extension(Program):
    """The motion extended, of its arrays and then those that the steps are made of."""

    recipe: StepsRecipe
    starts: int
    kind: Kind
    has_angles: bool

    @property
    def results(self) -> Sequence[jax.ShapeDtypeStruct]:
        return self.kind.results

    def _steps(self, arrays: Arrays) -> tuple[Step, ...]:
        return self.recipe(*arrays[self.starts :])

    def angles(self, *arrays: jax.Array) -> list[jax.Array]:
        return half_angles(self._steps(arrays))

    def values(self, pair: Half, *arrays: jax.Array) -> Packed:
        steps = with_halves(self._steps(arrays), pair)
        return self.kind.packed(append_all(unpacked(arrays[: self.starts]), steps, self.kind.order))

    def change(self, pair: Half, primals: Arrays, tangents: Sequence[jax.Array | None]) -> Packed:
        start, dstart = primals[: self.starts], tangents[: self.starts]
        steps = with_halves(self._steps(primals), pair)
        dsteps = changes(self.recipe, primals[self.starts :], tangents[self.starts :])
        return self.kind.packed(varied(unpacked(start), unpacked_change(dstart), steps, dsteps, self.kind.order))

    def in_pieces(self, moved: Sequence[int]) -> Callable[..., Arrays] | None:
        numbers = {self.starts + place for place in self.recipe.numbers}
        if self.recipe.count <= EDGES_BY_NUMBERS or not numbers.intersection(moved):
            return None

        def pieces(*arrays: jax.Array) -> Packed:
            found, rest = tuple(arrays[: self.starts]), arrays[self.starts :]
            for first in range(0, self.recipe.count, EDGES_BY_NUMBERS):
                part, places = self.recipe.part(first, first + EDGES_BY_NUMBERS)
                found = extend(found, Source(part, tuple(rest[place] for place in places)), self.kind)
            return found

        return pieces


def half_angles(steps: Iterable[Step]) -> list[jax.Array]:
    """Return half the angle of each turn, those that are known left out."""
    halves = (mul(step.angle.value, 0.5) for step in steps if isinstance(step, Turn))
    return [half for half in halves if not isinstance(half, float | int)]


def has_angles(outline: Iterable[Step]) -> bool:
    """Return whether any step turns by an angle that is not known, which is NaN in the outline of a source."""
    return any(isinstance(step, Turn) and math.isnan(step.angle.value) for step in outline)


def with_halves(steps: Iterable[Step], pair: Half) -> tuple[Step, ...]:
    """Return steps whose turns hold sine and cosine of half their angles."""

    def held(step: Step) -> Step:
        if not isinstance(step, Turn):
            return step
        angle = mul(step.angle.value, 0.5)
        return replace(step, half=sin_cos(angle) if isinstance(angle, float) else pair(angle))

    return tuple(map(held, steps))


def folded(steps: Iterable[Step]) -> tuple[Step, ...]:
    """Return steps in which every known rigid mount is part of the placement that follows it, worked out while tracing."""
    found: list[Step] = []
    mount: Rigid | None = None
    for step in steps:
        if _is_mount(step):
            mount = step if mount is None else compose(mount, step, 0)
        elif mount is None:
            found.append(step)
        elif isinstance(step, Rigid):
            found += [mount, step]
            mount = None
        else:
            placed = compose(mount, Rigid(step.rotation, step.translation), 0)
            found.append(replace(step, rotation=placed.rotation, translation=placed.translation))
            mount = None
    return tuple(found if mount is None else [*found, mount])


def _is_mount(step: Step) -> TypeGuard[Rigid]:
    """Whether a step is a pose known while tracing, at rest."""
    if not isinstance(step, Rigid) or any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(step)):
        return False
    return all(v.is_known_zero for v in (step.angular, step.linear, step.angular2, step.linear2))
