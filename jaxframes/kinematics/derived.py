"""Edges that read other frames: the motions that they need, worked out along the tree they stand in, each once for a computation."""

import jax
import jax.numpy as jnp

from jaxframes.edges.base import Inputs, Seen
from jaxframes.edges.two_vector import TwoVector
from jaxframes.errors import NoAccelerationError
from jaxframes.kinematics.attachments import between
from jaxframes.kinematics.context import Context
from jaxframes.kinematics.state_rate import rate
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.numerics.components import V3, cross, dot
from jaxframes.numerics.packed import Packed, unpacked
from jaxframes.staging.columns import take_apart


def context_of(tree: Structure, state: State, order: int) -> Context:
    """Return what a computation over a tree reads, edges that read other frames included.

    Args:
        tree: The tree.
        state: Values at one instant or a batch of them.
        order: 0 for poses, 1 with velocities, 2 with accelerations.
    """
    return Context(tree, state, order, motions_read)


def motions_read(context: Context, frame: int) -> tuple[Seen, ...]:
    """Return the motions that the edge above a frame reads."""
    reads = context.topology.reads[frame]
    found = {read: _seen(context, frame, *read) for read in sorted(reads, key=lambda read: not read[2])}  # those with more serve the others
    return tuple(found[read] for read in reads)


def _seen(context: Context, frame: int, of: int, relative_to: int, further: bool) -> Seen:
    if not further:
        motion = context.worked_out(("motion", of, relative_to), lambda: _between(context, of, relative_to))
        return Seen(unpacked(motion))
    if context.order < 2:
        more = context.worked_out(("context", 1), lambda: context_of(context.tree, context.state, context.order + 1))
        motion = more.worked_out(("motion", of, relative_to), lambda: _between(more, of, relative_to))
        context.worked_out(("motion", of, relative_to), lambda: motion[: 1 + context.order])
        return Seen(unpacked(motion))
    _check_further(context, frame, of, relative_to)
    motion, jerk = context.worked_out(("jerk", of, relative_to), lambda: _with_jerk(context, of, relative_to))
    context.worked_out(("motion", of, relative_to), lambda: motion)
    return Seen(unpacked(motion), V3(*take_apart(jerk)[3:]))


def _between(context: Context, of: int, relative_to: int) -> Packed:
    return between(context, of, relative_to) if of != relative_to else ()


def _with_jerk(context: Context, of: int, relative_to: int) -> tuple[Packed, jax.Array]:
    """Return a motion, and the derivative by time of its acceleration [..., 6]."""
    state = context.state.broadcast_to(context.shape)

    def moving(state: State) -> Packed:
        return _between(context_of(context.tree, state, 2), of, relative_to)

    motion, change = jax.jvp(moving, (state,), (rate(context.tree, state),))
    return motion, change[2]


def _check_further(context: Context, frame: int, of: int, relative_to: int) -> None:
    """Refuse edges whose acceleration's derivative a state does not hold (NoAccelerationError names the first)."""
    topology, ahead, seen = context.topology, [(of, relative_to)], set[tuple[int, int]]()
    while ahead:
        pair = ahead.pop()
        if pair in seen:
            continue
        seen.add(pair)
        ends = {topology.static_components[end] for end in pair}
        crossed = [*ends] if len(ends) > 1 else [edge for way in topology.route(*pair) for edge in way]
        for edge in (edge for edge in crossed if edge):
            if not context.tree.edge_of(edge).has_further_derivatives:
                name, lacking, other = topology.names[frame], topology.names[edge], context.tree.edge_of(edge)
                pair_text = f"{topology.names[of]!r} relative to {topology.names[relative_to]!r}"
                raise NoAccelerationError(
                    f"the angular acceleration of frame {name!r} needs the derivative of the acceleration of {pair_text}, and the edge "
                    f"of frame {lacking!r} between them ({other.describe()}) has none: states end at accelerations. Ask for the velocity, "
                    "or put a function of time there"
                )
            ahead += [(a, b) for a, b, _ in topology.reads[edge]]


def angle_between(tree: Structure, state: State, frame: int) -> jax.Array:
    """Return the angle [...] in rad between the two vectors that define a frame; NaN where one of them is zero."""
    context = context_of(tree, state, 0)
    edge = context.reading.edge(tree.edge_of(frame))
    assert isinstance(edge, TwoVector)
    (a,), (b,) = edge.vectors(Inputs(motions=motions_read(context, frame), batch_rank=len(context.shape)), 0)
    normal, square = cross(a, b), jnp.asarray(dot(a, a)) * jnp.asarray(dot(b, b))
    angle = jnp.arctan2(jnp.sqrt(jnp.asarray(dot(normal, normal))), jnp.asarray(dot(a, b)))
    return jnp.broadcast_to(jnp.where(square > 0, angle, jnp.nan), context.shape)
