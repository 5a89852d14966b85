"""Steps: the elementary rigid motions that every edge is made of, and how one is added to a path.

An edge family lowers itself to a few steps: a joint to rotations about and translations along fixed axes, everything else to a motion
that is given outright, a ``Rigid``. What follows (composition, derivatives, walking by path or by level) knows steps only.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias

import jax

from jaxframes.numerics.components import IDENTITY, V3, ZERO, Component, Quat, cross, mul, quat_from, quat_linear, quat_mul, rotate
from jaxframes.numerics.rigid import Rigid, compose
from jaxframes.numerics.trig import sin_cos


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Coordinate:
    """A scalar coordinate with its first and second time derivatives."""

    value: Component
    rate: Component = 0.0
    rate2: Component = 0.0


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class RotationStep:
    """A fixed placement, then a rotation about a unit axis (axes of the placement) by an angle in radians.

    ``half`` holds sine and cosine of half the angle where these are worked out already.
    """

    axis: V3
    angle: Coordinate
    rotation: Quat = IDENTITY
    translation: V3 = ZERO
    half: tuple[Component, Component] | None = None


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class TranslationStep:
    """A fixed placement, then a translation along an axis (axes of the placement) by a length in metres."""

    axis: V3
    length: Coordinate
    rotation: Quat = IDENTITY
    translation: V3 = ZERO


Step: TypeAlias = RotationStep | TranslationStep | Rigid


def rotation_of(step: RotationStep) -> Quat:
    """Return the rotation of a step with the placement folded in: c q0 + s (q0 * axis), c and s of half the angle."""
    s, c = sin_cos(mul(step.angle.value, 0.5)) if step.half is None else step.half
    return quat_linear(c, step.rotation, s, quat_mul(step.rotation, quat_from(0.0, step.axis)))


def local_motion(step: Step, order: int) -> Rigid:
    """Return the motion of a step's child relative to its parent."""
    if isinstance(step, Rigid):
        return step
    axis = rotate(step.rotation, step.axis)
    if isinstance(step, RotationStep):
        rates = (axis * step.angle.rate, ZERO, axis * step.angle.rate2, ZERO)
        return _limited(rotation_of(step), step.translation, rates, order)
    rates = (ZERO, axis * step.length.rate, ZERO, axis * step.length.rate2)
    return _limited(step.rotation, step.translation + axis * step.length.value, rates, order)


def _limited(rotation: Quat, translation: V3, rates: tuple[V3, V3, V3, V3], order: int) -> Rigid:
    w, v, alpha, a = rates
    return Rigid(rotation, translation, *((w, v) if order > 0 else (ZERO, ZERO)), *((alpha, a) if order > 1 else (ZERO, ZERO)))


def append(motion: Rigid, step: Step, order: int) -> Rigid:
    """Return a motion extended by one step.

    Rotations and translations carry their axis, so that one rotation of the axis serves rate and acceleration alike.
    """
    if isinstance(step, Rigid) or order == 0:
        return compose(motion, local_motion(step, order), order)
    q, w = motion.rotation, motion.angular
    axis = rotate(quat_mul(q, step.rotation), step.axis)
    r = rotate(q, step.translation)
    if isinstance(step, RotationStep):
        w_rel, alpha_rel, v_rel, a_rel = axis * step.angle.rate, axis * step.angle.rate2, ZERO, ZERO
        rotation = quat_mul(q, rotation_of(step))
    else:
        w_rel, alpha_rel, v_rel, a_rel = ZERO, ZERO, axis * step.length.rate, axis * step.length.rate2
        rotation, r = quat_mul(q, step.rotation), r + axis * step.length.value
    w_x_r = cross(w, r)
    velocity = (w + w_rel, motion.linear + w_x_r + v_rel)
    if order == 1:
        return Rigid(rotation, motion.translation + r, *velocity)
    angular2 = motion.angular2 + alpha_rel + cross(w, w_rel)
    linear2 = motion.linear2 + a_rel + cross(motion.angular2, r) + cross(w, w_x_r + v_rel * 2.0)
    return Rigid(rotation, motion.translation + r, *velocity, angular2, linear2)


def append_all(motion: Rigid, steps: Iterable[Step], order: int) -> Rigid:
    """Return a motion extended by steps one after the other, in plain arithmetic (``extension.extend`` has the better derivatives)."""
    for step in steps:
        motion = append(motion, step, order)
    return motion
