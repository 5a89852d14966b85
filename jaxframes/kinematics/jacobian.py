"""Jacobians: the velocity of a frame for a unit rate of each joint, by geometry."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxframes.kinematics.context import Context
from jaxframes.kinematics.edge_steps import AnySteps, Partitioned, Reading
from jaxframes.numerics.components import V3, ZERO, Component, cross, quat_conj, quat_mul, rotate
from jaxframes.numerics.packed import WIDEST, Packed, unpacked
from jaxframes.numerics.path_motion import half_angles, has_angles, with_halves
from jaxframes.numerics.programs import StagedProgram, run_program
from jaxframes.numerics.rigid import AT_REST, Rigid
from jaxframes.numerics.steps import Step, append_all
from jaxframes.numerics.trig import Half
from jaxframes.staging.columns import assemble
from jaxframes.staging.operation import Arrays
from jaxframes.staging.sharding import stack_arrays
from jaxframes.staging.traced_inputs import Operands, outline


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
    topology, operands, count = context.topology, Operands(), context.topology.nv
    ways = topology.route(of, relative_to)
    # Poses are all that is needed of the path; rates enter as units.
    steps = iter(context.edge_steps([frame for way in ways for frame in way], operands))
    edges = tuple(tuple(_Edge(next(steps), context.rates_of(frame)) for frame in way) for way in ways)
    recipe = _Parts(edges, context.reading)
    turned = () if axes is None else axes
    known = outline(recipe, operands.arrays)
    angles = has_angles(step for way in known for made, _ in way for step in made)
    program = _Jacobian(recipe, len(turned), context.shape, context.dtype, count, angles)
    parts = run_program(program, *turned, *operands.arrays)
    rows = [parts[i : i + len(program.spans)] for i in range(0, len(parts), len(program.spans))]
    whole = [row[0] if len(row) == 1 else jnp.concatenate(row, -1) for row in rows]
    return stack_arrays(whole, -2)


class _Edge(NamedTuple):
    """An edge on the path, and the index in ``qd`` of each rate that moves it."""

    steps: AnySteps
    rates: tuple[int, ...]


Made = tuple[tuple[Step, ...], list[tuple[V3, V3]]]
"""Steps and unit twists of an edge."""


@dataclass(frozen=True)
class _Parts:
    """What the Jacobian is made of: for the observer's side and the target's, steps and unit twists of each edge."""

    ways: tuple[tuple[_Edge, ...], ...]
    reading: Reading

    def __call__(self, *arrays: jax.Array) -> list[list[Made]]:
        arrays = Partitioned(arrays)
        made = lambda edge: (edge.steps.steps(arrays, self.reading), edge.steps.unit_twists(arrays, self.reading))  # noqa: E731
        return [[made(edge) for edge in way] for way in self.ways]


@dataclass(frozen=True)
class _Jacobian(StagedProgram):
    """Six rows, each cut into spans of columns that are written by one loop.

    Attributes:
        parts: What it is made of.
        turned: How many arrays hold the observer's pose in other axes.
        shape: Batch shape.
        dtype: Dtype.
        count: How many rates there are.
        has_angles: As in ``StagedProgram``.
    """

    parts: _Parts
    turned: int
    shape: tuple[int, ...]
    dtype: Any
    count: int
    has_angles: bool

    @property
    def spans(self) -> list[tuple[int, int]]:
        """The first column of each span, and the one after its last."""
        return [(first, min(first + WIDEST, self.count)) for first in range(0, self.count, WIDEST)]

    @property
    def results(self) -> list[jax.ShapeDtypeStruct]:
        return [jax.ShapeDtypeStruct((*self.shape, b - a), self.dtype) for _ in range(6) for a, b in self.spans]

    def angles(self, *arrays: jax.Array) -> list[jax.Array]:
        made = self.parts(*arrays[self.turned :])
        return half_angles(step for way in made for steps, _ in way for step in steps)

    def values(self, pair: Half, *arrays: jax.Array) -> Arrays:
        columns, observer = self._columns(pair, self.parts(*arrays[self.turned :]))
        turn = quat_conj(observer.rotation)
        if self.turned:
            turn = quat_mul(unpacked(arrays[: self.turned]).rotation, turn)
        found: list[tuple[Component, ...]] = [(0.0,) * 6] * self.count
        for index, twist in columns.items():
            found[index] = tuple(c for half in twist for c in rotate(turn, half))
        return tuple(assemble([column[row] for column in found[a:b]], self.shape, self.dtype) for row in range(6) for a, b in self.spans)

    def _columns(self, pair: Half, made: list[list[Made]]) -> tuple[dict[int, tuple[V3, V3]], Rigid]:
        """Return (angular, linear) of the relative velocity for a unit of each rate, in the axes of the common ancestor.

        A joint below the common ancestor turns and shifts everything above the target by its own twist, carried to the target's
        origin: w + (v + w x arm). A joint on the observer's side does the opposite.

        Returns:
            The columns by index in ``qd``, and the observer's pose in the common ancestor.
        """
        observer, target = (self._poses(way, pair) for way in made)
        end = target[-1].translation
        found: dict[int, tuple[V3, V3]] = {}
        for edges, way, poses, sign in zip(self.parts.ways, made, (observer, target), (-1.0, 1.0), strict=True):
            for edge, (_, twists), parent, child in zip(edges, way, poses, poses[1:], strict=False):
                for index, (w_rel, v_rel) in zip(edge.rates, twists, strict=True):
                    angular = rotate(parent.rotation, w_rel) * sign
                    linear = rotate(parent.rotation, v_rel) * sign + cross(angular, end - child.translation)
                    old = found.get(index, (ZERO, ZERO))
                    found[index] = (old[0] + angular, old[1] + linear)
        return found, observer[-1]

    @staticmethod
    def _poses(way: list[Made], pair: Half) -> list[Rigid]:
        poses = [AT_REST]
        for steps, _ in way:
            poses.append(append_all(poses[-1], with_halves(steps, pair), 0))
        return poses
