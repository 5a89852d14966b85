"""Extending a motion by steps: composed forward, differentiated by geometry (``variation``)."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TypeGuard

import jax

from jaxframes.numerics.components import mul
from jaxframes.numerics.computed import Program, computed
from jaxframes.numerics.operation import Arrays
from jaxframes.numerics.packed import Kind, Packed, unpacked, unpacked_change
from jaxframes.numerics.rigid import Rigid, compose
from jaxframes.numerics.source import Source
from jaxframes.numerics.steps import Step, Turn, append_all
from jaxframes.numerics.trig import Half, sin_cos
from jaxframes.numerics.variation import varied


def extend(start: Packed, source: Source, kind: Kind) -> Packed:
    """Return a motion extended by steps one after the other.

    Args:
        start: The motion of the frame that the first step starts from; no arrays for the identity, at rest.
        source: The steps.
        kind: What the result is like.
    """
    return computed(_Extension(source, len(start), kind), *start, *source.arrays)


class _Extension(Program):
    """The motion extended, of its arrays and then those that the steps are made of."""

    def __init__(self, source: Source, count: int, kind: Kind):
        self._source, self._count, self._kind, self.results = source, count, kind, kind.results
        self.has_angles = has_angles(source.outline)

    def _steps(self, arrays: Arrays) -> tuple[Step, ...]:
        return self._source(*arrays[self._count :])

    def angles(self, *arrays: jax.Array) -> list[jax.Array]:
        return half_angles(self._steps(arrays))

    def values(self, pair: Half, *arrays: jax.Array) -> Packed:
        steps = with_halves(self._steps(arrays), pair)
        return self._kind.packed(append_all(unpacked(arrays[: self._count]), steps, self._kind.order))

    def change(self, pair: Half, primals: Arrays, tangents: Sequence[jax.Array | None]) -> Packed:
        start, dstart = primals[: self._count], tangents[: self._count]
        steps = with_halves(self._steps(primals), pair)
        dsteps = self._source.changes(primals[self._count :], tangents[self._count :])
        return self._kind.packed(varied(unpacked(start), unpacked_change(dstart), steps, dsteps, self._kind.order))


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
