"""Jacobians: the velocity of a frame for a unit rate of each joint, by geometry."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.kinematics.context import Context
from jaxframes.numerics.boundary import assemble
from jaxframes.numerics.components import V3, ZERO, Component, cross, quat_conj, quat_mul, rotate
from jaxframes.numerics.computed import Program, computed
from jaxframes.numerics.extension import half_angles, has_angles, with_halves
from jaxframes.numerics.layout import stacked
from jaxframes.numerics.operation import Arrays
from jaxframes.numerics.packed import WIDEST, Packed, unpacked
from jaxframes.numerics.rigid import AT_REST, Rigid
from jaxframes.numerics.source import Source
from jaxframes.numerics.steps import append_all
from jaxframes.numerics.trig import Half


def jacobian(context: Context, of: int, relative_to: int, axes: Packed | None) -> jax.Array:
    """Return the Jacobian [..., 6, nv], angular rows first.

    Args:
        context: Tree and state.
        of: Frame asked about.
        relative_to: Frame of the observer, whose axes resolve the result.
        axes: The observer's pose in another frame, whose axes resolve the result instead.
    """
    if not context.topology.nv:
        return jnp.zeros((*context.shape, 6, 0), context.dtype)
    program = _Jacobian(context, of, relative_to, () if axes is None else axes)
    parts = computed(program, *program.arrays)
    rows = [parts[i : i + len(program.spans)] for i in range(0, len(parts), len(program.spans))]
    whole = [row[0] if len(row) == 1 else jnp.concatenate(row, -1) for row in rows]
    return stacked(whole, -2)


class _Jacobian(Program):
    """Six rows, each cut into spans of columns that are written by one loop."""

    def __init__(self, context: Context, of: int, relative_to: int, axes: Packed):
        self._context, count = context, context.topology.nv
        self._ways = context.topology.route(of, relative_to)
        frames = [frame for way in self._ways for frame in way]
        self._indices = {frame: context.rates_of(frame) for frame in frames}

        def make(inside: Context) -> Any:
            return {frame: (inside.steps(frame), inside.unit_twists(frame)) for frame in frames}

        self._source: Source = context.source(frames, make)
        outline = self._source.outline
        self.has_angles = has_angles(step for frame in frames for step in outline[frame][0])
        self._turned, self.arrays = len(axes), (*axes, *self._source.arrays)
        self.spans = [(first, min(first + WIDEST, count)) for first in range(0, count, WIDEST)]
        self.results = [jax.ShapeDtypeStruct((*context.shape, b - a), context.dtype) for _ in range(6) for a, b in self.spans]

    def _made(self, arrays: Arrays) -> Any:
        return self._source(*arrays[self._turned :])

    def angles(self, *arrays: jax.Array) -> list[jax.Array]:
        made = self._made(arrays)
        return half_angles(step for way in self._ways for frame in way for step in made[frame][0])

    def values(self, pair: Half, *arrays: jax.Array) -> Arrays:
        columns, observer = self._columns(pair, self._made(arrays))
        turn = quat_conj(observer.rotation)
        if self._turned:
            turn = quat_mul(unpacked(arrays[: self._turned]).rotation, turn)
        found: list[tuple[Component, ...]] = [(0.0,) * 6] * self._context.topology.nv
        for index, twist in columns.items():
            found[index] = tuple(c for half in twist for c in rotate(turn, half))
        shape, dtype = self._context.shape, self._context.dtype
        return tuple(assemble([column[row] for column in found[a:b]], shape, dtype) for row in range(6) for a, b in self.spans)

    def _columns(self, pair: Half, made: Any) -> tuple[dict[int, tuple[V3, V3]], Rigid]:
        """Return (angular, linear) of the relative velocity for a unit of each rate, in the axes of the common ancestor.

        A joint below the common ancestor turns and shifts everything above the target by its own twist, carried to the target's
        origin: w + (v + w x arm). A joint on the observer's side does the opposite.

        Returns:
            The columns by index in ``qd``, and the observer's pose in the common ancestor.
        """
        observer, target = (self._poses(way, pair, made) for way in self._ways)
        end = target[-1].translation
        found: dict[int, tuple[V3, V3]] = {}
        for frames, poses, sign in zip(self._ways, (observer, target), (-1.0, 1.0), strict=True):
            for frame, parent, child in zip(frames, poses, poses[1:], strict=False):
                for index, (spin, slip) in zip(self._indices[frame], made[frame][1], strict=True):
                    angular = rotate(parent.rotation, spin) * sign
                    linear = rotate(parent.rotation, slip) * sign + cross(angular, end - child.translation)
                    old = found.get(index, (ZERO, ZERO))
                    found[index] = (old[0] + angular, old[1] + linear)
        return found, observer[-1]

    @staticmethod
    def _poses(frames: Sequence[int], pair: Half, made: Any) -> list[Rigid]:
        poses = [AT_REST]
        for frame in frames:
            poses.append(append_all(poses[-1], with_halves(made[frame][0], pair), 0))
        return poses
