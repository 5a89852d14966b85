"""Along a long path whose edges repeat: one piece of it, compiled once, that a scan takes over the path.

A snake of sixty joints is the same few edges over and over, with other numbers. Unrolled, each would be compiled by itself: half a minute
for the derivatives of its acceleration. A scan compiles one piece and runs it on every stretch of the path in turn, over the whole batch.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.kinematics.context import JOINT_FIELDS, Context, picked
from jaxframes.numerics.columns import column
from jaxframes.numerics.extension import extend
from jaxframes.numerics.layout import like
from jaxframes.numerics.packed import Packed
from jaxframes.numerics.rigid import AT_REST
from jaxframes.numerics.source import source_of
from jaxframes.numerics.steps import Step
from jaxframes.tree.edges.base import Inputs
from jaxframes.tree.ways import Repeats


def down(context: Context, frames: Sequence[int], found: Repeats) -> Packed:
    """Return the motion of the last frame of a path that repeats relative to the frame above its first edge."""
    context.check(frames[0])
    size, topology = len(found.groups), context.topology
    moving = [i for i in range(size) if topology.coordinates[frames[i]][1]]

    def numbers(place: int) -> list[jax.Array]:
        rows = np.array([topology.locations[frame][1] for frame in frames[place::size]])
        return [picked(jnp.asarray(leaf), rows, -2) for leaf in context.tree.parameters[found.groups[place]]]

    def coordinates(kind: str) -> jax.Array:
        first = 0 if kind == "q" else 2
        columns = np.array([topology.coordinates[frames[p * size + i]][first] for p in range(found.pieces) for i in moving])
        whole = context.gathered(kind, columns)
        return jnp.moveaxis(whole.reshape(*whole.shape[:-1], found.pieces, len(moving)), -2, 0)

    def steps(edges: Sequence[Sequence[jax.Array]], values: Sequence[jax.Array]) -> tuple[Step, ...]:
        made: list[Step] = []
        for place, leaves in enumerate(edges):
            edge = jax.tree.map(context.converted, jax.tree.unflatten(topology.groups[found.groups[place]], leaves))
            inputs = Inputs(batch_rank=len(context.shape))
            if place in moving:
                own = [(column(value, moving.index(place)),) for value in values]
                inputs = Inputs(*own, *[(0.0,)] * (2 - context.order), batch_rank=len(context.shape))  # pyright: ignore[reportArgumentType]
            made += edge.steps(inputs, context.order)
        return tuple(made)

    def piece(motion: Packed, given: Any) -> tuple[Packed, None]:
        return extend(motion, source_of(steps, *given), context.kind), None

    edges = [numbers(place) for place in range(size)]
    values = [coordinates(kind) for kind in JOINT_FIELDS[: 1 + context.order]]
    start = tuple(like(a, *jax.tree.leaves(values)) for a in context.kind.packed(AT_REST))
    return lax.scan(piece, start, (edges, values))[0]
