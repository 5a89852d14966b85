"""Jacobians: the velocity of a frame for a unit rate of each joint, by geometry."""

import jax
import jax.numpy as jnp

from jaxframes.kinematics.context import Context
from jaxframes.numerics.boundary import assemble
from jaxframes.numerics.components import V3, ZERO, Quat, cross, quat_conj, quat_mul, rotate
from jaxframes.numerics.rigid import AT_REST, Rigid
from jaxframes.numerics.steps import append_all


def columns(context: Context, of: int, relative_to: int) -> tuple[dict[int, tuple[V3, V3]], Rigid]:
    """Return (angular, linear) of the relative velocity for a unit of each rate, in the axes of the common ancestor.

    A joint below the common ancestor turns and shifts everything above the target by its own twist, carried to the target's
    origin: w + (v + w x arm). A joint on the observer's side does the opposite.

    Returns:
        The columns by index in ``qd``, and the observer's pose in the common ancestor.
    """
    to_observer, to_target = context.topology.route(of, relative_to)
    observer, target = _poses(context, to_observer), _poses(context, to_target)
    end = target[-1].translation
    found: dict[int, tuple[V3, V3]] = {}
    for frames, poses, sign in ((to_observer, observer, -1.0), (to_target, target, 1.0)):
        for frame, parent, child in zip(frames, poses, poses[1:], strict=False):
            for index, twist in context.unit_twists(frame):
                angular = rotate(parent.rotation, twist.angular) * sign
                linear = rotate(parent.rotation, twist.linear) * sign + cross(angular, end - child.translation)
                old = found.get(index, (ZERO, ZERO))
                found[index] = (old[0] + angular, old[1] + linear)
    return found, observer[-1]


def _poses(context: Context, frames: tuple[int, ...]) -> list[Rigid]:
    poses = [AT_REST]
    for frame in frames:
        poses.append(append_all(poses[-1], context.steps(frame), 0))
    return poses


def jacobian(context: Context, of: int, relative_to: int, axes: Quat | None) -> jax.Array:
    """Return the Jacobian [..., 6, nv], angular rows first.

    Args:
        context: Tree and state.
        of: Frame asked about.
        relative_to: Frame of the observer, whose axes resolve the result.
        axes: A further rotation of both halves into other axes.
    """
    found, observer = columns(context, of, relative_to)
    turn = quat_conj(observer.rotation) if axes is None else quat_mul(axes, quat_conj(observer.rotation))
    nothing = jnp.zeros((*context.shape, 6), context.dtype)
    made = [nothing] * context.topology.nv
    for index, twist in found.items():
        made[index] = assemble(tuple(c for half in twist for c in rotate(turn, half)), context.shape, context.dtype)
    return jnp.stack(made, axis=-1) if made else jnp.zeros((*context.shape, 6, 0), context.dtype)
