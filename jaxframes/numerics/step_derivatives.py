"""How a motion changes when what it is made of changes: by geometry, one short linear recursion from step to step.

The derivative of a path is not that of its arithmetic: a change of a joint turns everything after it by a small rotation phi, so
arms change by phi x arm and axes by phi x axis (Murray, Li and Sastry 1994, ch. 3). One recursion
carries the changes of pose, velocity and acceleration; transposed by reverse mode it gathers a wrench at each joint. It takes a half
of the instructions of the adjoint of all arithmetic.

Rotations are unit quaternions: derivatives are along the sphere, and a change of a quaternion or an axis along itself counts as none.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from jaxframes.numerics.components import V3, ZERO, Component, Quat, cross, mul, quat_conj, quat_from, quat_mul, rotate
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import RotationStep, Step, TranslationStep, append


def varied(motion: Rigid, dmotion: Rigid, steps: Sequence[Step], dsteps: Sequence[Any], order: int) -> Rigid:
    """Return the change of a motion extended by steps, as the change of each component.

    Args:
        motion: The motion that the first step starts from.
        dmotion: Its change.
        steps: The steps; turns hold sine and cosine of half their angles.
        dsteps: Their changes, in the same structure; known zeros where nothing changes.
        order: 0 for poses, 1 with velocities, 2 with accelerations.
    """
    motion, change = extended(motion, first_change(motion, dmotion), steps, dsteps, order)
    return of_rotation(motion, change)


def extended(motion: Rigid, change: "Change", steps: Sequence[Step], dsteps: Sequence[Any], order: int) -> "tuple[Rigid, Change]":
    """Return a motion extended by steps, and its change (arguments as for ``varied``)."""
    for step, dstep in zip(steps, dsteps, strict=True):
        change = next_change(motion, change, step, dstep, order)
        motion = append(motion, step, order)
    return motion, change


def of_rotation(motion: Rigid, change: "Change") -> Rigid:
    """Return the change of a motion as the change of each component: a small rotation phi changes a quaternion by phi q / 2."""
    rotation = quat_mul(quat_from(0.0, change.angle * 0.5), motion.rotation)
    return Rigid(rotation, change.translation, change.angular, change.linear, change.angular2, change.linear2)


@dataclass(frozen=True)
class Change:
    """How a motion changes: the small rotation of its frame (outer axes), and the changes of its vectors."""

    angle: V3
    translation: V3
    angular: V3 = ZERO
    linear: V3 = ZERO
    angular2: V3 = ZERO
    linear2: V3 = ZERO

    @property
    def groups(self) -> tuple[tuple[Component, ...], ...]:
        """The components, six for the pose, the velocity and the acceleration."""
        return (*self.angle, *self.translation), (*self.angular, *self.linear), (*self.angular2, *self.linear2)


NO_CHANGE = Change(ZERO, ZERO)


def _small_turn(change: Quat, rotation: Quat) -> V3:
    """Return the small rotation (outer axes) that a change of a unit quaternion stands for: 2 vec(dq q*)."""
    return quat_mul(change, quat_conj(rotation)).vector * 2.0


def first_change(motion: Rigid, change: Rigid) -> Change:
    """Return the change of a motion, given as that of each component."""
    angle = _small_turn(change.rotation, motion.rotation)
    return Change(angle, change.translation, change.angular, change.linear, change.angular2, change.linear2)


def next_change(before: Rigid, change: Change, step: Step, dstep: Any, order: int) -> Change:
    """Return how the motion after a step changes, from the motion before it and the changes of both."""
    turn = functools.partial(_rotated, before.rotation, change.angle)
    if isinstance(step, Rigid):
        angle = change.angle + rotate(before.rotation, _small_turn(dstep.rotation, step.rotation))
        arm, w_rel, v_rel, alpha_rel, a_rel = (
            turn(vector, dvector)
            for vector, dvector in (
                (step.translation, dstep.translation),
                (step.angular, dstep.angular),
                (step.linear, dstep.linear),
                (step.angular2, dstep.angular2),
                (step.linear2, dstep.linear2),
            )
        )
        return _carried(before, change, angle, arm, (w_rel, v_rel, alpha_rel, a_rel), order)
    hinge = quat_mul(before.rotation, step.rotation)
    tilt = change.angle + rotate(before.rotation, _small_turn(dstep.rotation, step.rotation))
    axis = _rotated(hinge, tilt, step.axis, dstep.axis)
    arm = turn(step.translation, dstep.translation)
    still = (ZERO, ZERO)
    if isinstance(step, TranslationStep):
        along = _scaled(axis, step.length.value, dstep.length.value)
        arm = (arm[0] + along[0], arm[1] + along[1])
        v_rel, a_rel = (_scaled(axis, *pair) for pair in _rates(step.length, dstep.length))
        return _carried(before, change, tilt, arm, (still, v_rel, still, a_rel), order)
    angle = tilt + axis[0] * dstep.angle.value + rotate(hinge, _swing(step, dstep))
    w_rel, alpha_rel = (_scaled(axis, *pair) for pair in _rates(step.angle, dstep.angle))
    return _carried(before, change, angle, arm, (w_rel, still, alpha_rel, still), order)


Varied = tuple[V3, V3]
"""A vector with its change."""


def _rotated(rotation: Quat, angle: V3, vector: V3, change: V3) -> Varied:
    """Return a vector turned by a rotation that itself turns by a small angle."""
    turned = rotate(rotation, vector)
    return turned, cross(angle, turned) + rotate(rotation, change)


def _scaled(vector: Varied, scale: Component, change: Component) -> Varied:
    return vector[0] * scale, vector[1] * scale + vector[0] * change


def _rates(coordinate: Any, change: Any) -> tuple[tuple[Component, Component], ...]:
    return (coordinate.rate, change.rate), (coordinate.rate2, change.rate2)


def _swing(step: RotationStep, dstep: RotationStep) -> V3:
    """Return the small rotation (axes of the placement) that a change da of the axis a causes: 2 (s c da + s^2 a x da), half angles."""
    if dstep.axis.is_known_zero:
        return ZERO
    assert step.half is not None
    s, c = step.half
    return (dstep.axis * c + cross(step.axis, dstep.axis) * s) * mul(s, 2.0)


def _carried(before: Rigid, change: Change, angle: V3, arm: Varied, local: tuple[Varied, Varied, Varied, Varied], order: int) -> Change:
    """Return the change of the composed motion (see ``rigid.compose``) from those of the motion before and of what the step adds."""
    r, dr = arm
    translation = change.translation + dr
    if order == 0:
        return Change(angle, translation)
    (w_rel, dw_rel), (v_rel, dv_rel), (_, dalpha_rel), (_, da_rel) = local
    w, dw = before.angular, change.angular
    w_x_r, dw_x_r = cross(w, r), cross(dw, r) + cross(w, dr)
    angular, linear = dw + dw_rel, change.linear + dw_x_r + dv_rel
    if order == 1:
        return Change(angle, translation, angular, linear)
    angular2 = change.angular2 + dalpha_rel + cross(dw, w_rel) + cross(w, dw_rel)
    linear2 = change.linear2 + da_rel + cross(change.angular2, r) + cross(before.angular2, dr)
    linear2 = linear2 + cross(dw, w_x_r + v_rel * 2.0) + cross(w, dw_x_r + dv_rel * 2.0)
    return Change(angle, translation, angular, linear, angular2, linear2)
