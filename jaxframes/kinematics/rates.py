"""The time derivative of a state: how every number of it moves along with the motion it describes."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics.components import V3, Component, Quat, quat_from, quat_mul
from jaxframes.numerics.lift import lift
from jaxframes.spatial import Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.tree.state import Attachments, State
from jaxframes.tree.tree import FrameTree


@lift(V3, Quat, out=Quat)
def _quaternion_rate(angular: V3, wxyz: Quat) -> Quat:
    """Return dq/dt = w q / 2 for an angular velocity in the outer axes."""
    return quat_mul(quat_from(0.0, angular * 0.5), wxyz)


def broadcast(state: State) -> State:
    """Return a state whose fields all have one batch shape."""
    per_joint, per_frame = (state.q, state.qd, state.qdd), state.prescribed
    shapes = [a.shape[:-1] for a in per_joint] + [a.shape[:-2] for a in jax.tree.leaves(per_frame)]
    held = state.attachments
    if held is not None:
        shapes += [held.parents.shape[:-1], *(a.shape[:-2] for a in jax.tree.leaves(held.motion))]
    batch = jnp.broadcast_shapes(*shapes, *(a.shape for a in jax.tree.leaves(state.time)))

    def full(array: jax.Array, trailing: int) -> jax.Array:
        return jnp.broadcast_to(array, (*batch, *array.shape[array.ndim - trailing :]))

    q, qd, qdd = (full(a, 1) for a in per_joint)
    time = jax.tree.map(lambda a: full(a, 0), state.time)
    if held is not None:
        held = Attachments(full(held.parents, 1), jax.tree.map(lambda a: full(a, 2), held.motion))
    per_frame = jax.tree.map(lambda a: full(a, 2), per_frame)
    return replace(state, q=q, qd=qd, qdd=qdd, time=time, prescribed=per_frame, attachments=held)


def rate(tree: FrameTree, state: State) -> State:
    """Return the time derivative of a state, all fields of one batch shape; accelerations are taken as constant."""
    state = broadcast(state)
    clock = None if state.time is None else Epoch(jnp.ones_like(state.time.hi), jnp.zeros_like(state.time.lo))
    held = state.attachments
    attachments = None if held is None else Attachments(np.zeros(held.parents.shape, jax.dtypes.float0), _motion_rate(held.motion))  # pyright: ignore[reportArgumentType]
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


def coordinate_rates(tree: FrameTree, state: State) -> jax.Array:
    """Return dq/dt [..., nq] from q and qd; a joint whose rates are not the derivatives of its coordinates converts them."""
    if all(nq == nv for _, nq, _, nv in tree.topology.coordinates):
        return state.qd
    parts: list[Component] = []
    for frame in tree.topology.joint_frames:
        first_q, nq, first_v, nv = tree.topology.coordinates[frame]
        q = tuple(state.q[..., first_q + i] for i in range(nq))
        qd = tuple(state.qd[..., first_v + i] for i in range(nv))
        parts.extend(tree._edge(frame).coordinate_rates(q, qd))
    return jnp.stack([jnp.broadcast_to(part, state.q.shape[:-1]) for part in parts], axis=-1)
