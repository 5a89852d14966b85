"""The time derivative of a state: how every number of it moves along with the motion it describes."""

from dataclasses import replace

import jax
import jax.numpy as jnp

from jaxframes.model.state import Attachments, State
from jaxframes.model.structure import Structure
from jaxframes.numerics.components import V3, Component, Quat, quat_from, quat_mul
from jaxframes.numerics.lift import lift
from jaxframes.spatial import Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform


@lift(V3, Quat, out=Quat)
def _quaternion_rate(angular: V3, wxyz: Quat) -> Quat:
    """Return dq/dt = w q / 2 for an angular velocity in the outer axes."""
    return quat_mul(quat_from(0.0, angular * 0.5), wxyz)


def batch_of(array: jax.Array, rank: int) -> tuple[int, ...]:
    """Return the batch axes of an array of which so many trailing axes are none."""
    return array.shape[: array.ndim - rank]


def broadcast(state: State) -> State:
    """Return a state whose fields all have one batch shape."""
    return state.broadcast_to(state.shape)


def rate(tree: Structure, state: State) -> State:
    """Return the time derivative of a state, all fields of one batch shape; accelerations are taken as constant."""
    state = broadcast(state)
    clock = None if state.time is None else Epoch(jnp.ones_like(state.time.hi), jnp.zeros_like(state.time.lo))
    held = state.attachments
    attachments = None if held is None else Attachments(jnp.zeros_like(held.links), _motion_rate(held.motion))
    return replace(
        state,
        q=coordinate_rates(tree, state),
        qd=state.qdd,
        qdd=jnp.zeros_like(state.qdd),
        time=clock,
        prescribed=_motion_rate(state.prescribed),
        attachments=attachments,
    )


def _motion_rate(held: Motion) -> Motion:
    zero = jax.tree.map(jnp.zeros_like, held.acceleration)
    return Motion(
        Transform(Rotation(_quaternion_rate(held.velocity.angular, held.transform.rotation.wxyz)), held.velocity.linear),
        SpatialVelocity(held.acceleration.angular, held.acceleration.linear),
        SpatialAcceleration(zero.angular, zero.linear),
    )


def coordinate_rates(tree: Structure, state: State) -> jax.Array:
    """Return dq/dt [..., nq] from q and qd; a joint whose rates are not the derivatives of its coordinates converts them."""
    if all(nq == nv for _, nq, _, nv in tree.topology.coordinates):
        return state.qd
    parts: list[Component] = []
    for frame in tree.topology.joint_frames:
        first_q, nq, first_v, nv = tree.topology.coordinates[frame]
        q = tuple(state.q[..., first_q + i] for i in range(nq))
        qd = tuple(state.qd[..., first_v + i] for i in range(nv))
        parts.extend(tree.edge_of(frame).coordinate_rates(q, qd))
    return jnp.stack([jnp.broadcast_to(part, state.q.shape[:-1]) for part in parts], axis=-1)
