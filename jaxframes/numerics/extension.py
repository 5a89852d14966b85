"""Extending a motion by steps, with the derivative that geometry gives.

The derivative of a path is not that of its arithmetic: a change of a joint turns everything after it by a small rotation phi, so
arms change by phi x arm and axes by phi x axis (Murray, Li and Sastry 1994, ch. 3). One short linear recursion from frame to frame
carries the changes of pose, velocity and acceleration; transposed by reverse mode it gathers a wrench at each joint. It takes a half
of the instructions of the adjoint of all arithmetic, and its memory grows linearly with the path.

Rotations are unit quaternions: derivatives are along the sphere, and a change of a quaternion or an axis along itself counts as none.
"""

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeGuard

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from jaxframes.numerics.boundary import assemble, take_apart
from jaxframes.numerics.components import V3, ZERO, Component, Quat, cross, mul, quat_conj, quat_from, quat_mul, rotate
from jaxframes.numerics.rigid import Rigid, compose
from jaxframes.numerics.steps import Slide, Step, Turn, append, append_all
from jaxframes.numerics.trig import sin_cos_all

LONGEST = {0: 20, 1: 14, 2: 10}
"""Steps that are extended by in one piece, for each order: longer paths are cut, because XLA:CPU slows down by orders of magnitude on
fused computations of some thousand instructions."""
PIECE = {0: 10, 1: 6, 2: 4}
"""Steps in a piece of a path that is cut (measured: small pieces make the fastest gradients)."""


def extend(motion: Rigid, steps: Iterable[Step], order: int) -> Rigid:
    """Return a motion extended by steps one after the other.

    Args:
        motion: The motion of the frame that the first step starts from.
        steps: The steps.
        order: 0 for poses, 1 with velocities, 2 with accelerations.
    """
    listed = tuple(_with_halves(folded(steps)))
    if len(listed) <= LONGEST[order]:
        return _piece(motion, listed, order)
    for first in range(0, len(listed), PIECE[order]):
        if first:
            motion = materialized(motion, order)
        motion = _piece(motion, _apart(listed[first : first + PIECE[order]]), order)
    return motion


def _apart(steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """Return the same steps, whose derivatives pass through a fence: those of a long path do not all meet in one computation."""
    leaves, structure = jax.tree.flatten(steps)
    arrays = [i for i, leaf in enumerate(leaves) if isinstance(leaf, jax.Array)]
    shape = jnp.broadcast_shapes(*(leaves[i].shape for i in arrays))
    whole = [i for i in arrays if leaves[i].shape == shape]
    for i, leaf in zip(whole, _fenced_derivative(tuple(leaves[i] for i in whole)), strict=True):
        leaves[i] = leaf
    return jax.tree.unflatten(structure, leaves)


@jax.custom_jvp
def _fenced_derivative(arrays: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
    return arrays


@_fenced_derivative.defjvp
def _fenced_derivative_jvp(primals: Any, tangents: Any) -> tuple[tuple[jax.Array, ...], tuple[jax.Array, ...]]:
    # A few at a time: an assembly works out all its components for each of its columns.
    groups = (tangents[0][i : i + 4] for i in range(0, len(tangents[0]), 4))
    return primals[0], tuple(component for group in groups for component in take_apart(assemble(group)))


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


def _with_halves(steps: tuple[Step, ...]) -> list[Step]:
    """Return steps whose turns hold sine and cosine of half their angles."""
    turns = [i for i, step in enumerate(steps) if isinstance(step, Turn)]
    halves = sin_cos_all([mul(steps[i].angle.value, 0.5) for i in turns])  # pyright: ignore[reportAttributeAccessIssue]
    found = list(steps)
    for i, half in zip(turns, halves, strict=True):
        found[i] = replace(steps[i], half=half)  # pyright: ignore[reportCallIssue]
    return found


def _is_mount(step: Step) -> TypeGuard[Rigid]:
    """Whether a step is a pose known while tracing, at rest."""
    if not isinstance(step, Rigid) or any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(step)):
        return False
    return all(v.is_known_zero for v in (step.angular, step.linear, step.angular2, step.linear2))


def parts_of(motion: Rigid, order: int) -> tuple[Quat | V3, ...]:
    """Return the parts of a motion that an order holds: pose, velocity, acceleration."""
    parts = (motion.rotation, motion.translation, motion.angular, motion.linear, motion.angular2, motion.linear2)
    return parts[: 2 + 2 * order]


def materialized(motion: Rigid, order: int) -> Rigid:
    """Return a motion whose numbers are computed once, behind a fence, however many read them."""
    found: list[tuple[Component, ...]] = []
    for part in parts_of(motion, order):
        components = tuple(part)
        arrays = [c for c in components if isinstance(c, jax.Array)]
        found.append(take_apart(assemble(components)) if arrays else components)
    quat, *vectors = found
    return Rigid(Quat(*quat), *(V3(*v) for v in vectors))


@dataclass(frozen=True)
class _Template:
    """What is known of a motion and its steps while tracing: everything but the arrays, hashable."""

    structure: Any
    known: tuple[float | None, ...]
    kinds: tuple[str, ...]  # structures of different steps may compare equal in jax 0.10
    order: int

    def fill(self, arrays: Iterable[Component]) -> tuple[Rigid, tuple[Step, ...]]:
        """Return motion and steps, the arrays in the places of what is not known."""
        rest = iter(arrays)
        return jax.tree.unflatten(self.structure, [next(rest) if value is None else value for value in self.known])

    @property
    def of_changes(self) -> "_Template":
        """The template of the changes of motion and steps: what is known does not change."""
        return replace(self, known=tuple(None if value is None else 0.0 for value in self.known))


def _piece(motion: Rigid, steps: tuple[Step, ...], order: int) -> Rigid:
    leaves, structure = jax.tree.flatten((motion, steps))
    arrays = tuple(leaf for leaf in leaves if isinstance(leaf, jax.Array))
    if not arrays:
        return append_all(motion, steps, order)
    known = tuple(None if isinstance(leaf, jax.Array) else float(leaf) for leaf in leaves)
    quat, *vectors = _outcome(_Template(structure, known, tuple(type(step).__name__ for step in steps), order), arrays)
    return Rigid(Quat(*quat), *(V3(*v) for v in vectors))


Outcome = tuple[tuple[jax.Array, ...], ...]


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _outcome(template: _Template, arrays: tuple[jax.Array, ...]) -> Outcome:
    """Return the components of the parts of the extended motion, all of one shape."""
    return _as_arrays(append_all(*template.fill(arrays), template.order), template, arrays)


def _as_arrays(motion: Rigid, template: _Template, arrays: Sequence[jax.Array]) -> Outcome:
    shape, dtype = jnp.broadcast_shapes(*(a.shape for a in arrays)), arrays[0].dtype
    return tuple(tuple(jnp.broadcast_to(jnp.asarray(c, dtype), shape) for c in part) for part in parts_of(motion, template.order))


@functools.partial(_outcome.defjvp, symbolic_zeros=True)
def _outcome_jvp(template: _Template, primals: Any, tangents: Any) -> tuple[Outcome, Outcome]:
    (arrays,), (rates,) = primals, tangents
    changes = [0.0 if isinstance(rate, SymbolicZero) else rate for rate in rates]
    motion, steps = template.fill(arrays)
    dmotion, dsteps = template.of_changes.fill(changes)
    change = _first_change(motion, dmotion)
    for step, dstep in zip(steps, dsteps, strict=True):
        change = _next_change(motion, change, step, dstep, template.order)
        motion = append(motion, step, template.order)
    rotation = quat_mul(quat_from(0.0, change.angle * 0.5), motion.rotation)
    moved = Rigid(rotation, change.translation, change.angular, change.linear, change.angular2, change.linear2)
    return _outcome(template, arrays), _as_arrays(moved, template, arrays)


@dataclass(frozen=True)
class _Change:
    """How a motion changes: the small rotation of its frame (outer axes), and the changes of its vectors."""

    angle: V3
    translation: V3
    angular: V3 = ZERO
    linear: V3 = ZERO
    angular2: V3 = ZERO
    linear2: V3 = ZERO


def _small_turn(change: Quat, rotation: Quat) -> V3:
    """Return the small rotation (outer axes) that a change of a unit quaternion stands for: 2 vec(dq q*)."""
    return quat_mul(change, quat_conj(rotation)).vector * 2.0


def _first_change(motion: Rigid, change: Rigid) -> _Change:
    angle = _small_turn(change.rotation, motion.rotation)
    return _Change(angle, change.translation, change.angular, change.linear, change.angular2, change.linear2)


def _next_change(before: Rigid, change: _Change, step: Step, dstep: Any, order: int) -> _Change:
    """Return how the motion after a step changes, from the motion before it and the changes of both."""
    turn = functools.partial(_turned, before.rotation, change.angle)
    if isinstance(step, Rigid):
        angle = change.angle + rotate(before.rotation, _small_turn(dstep.rotation, step.rotation))
        arm, spin, slip, spin2, slip2 = (
            turn(vector, dvector)
            for vector, dvector in (
                (step.translation, dstep.translation),
                (step.angular, dstep.angular),
                (step.linear, dstep.linear),
                (step.angular2, dstep.angular2),
                (step.linear2, dstep.linear2),
            )
        )
        return _carried(before, change, angle, arm, (spin, slip, spin2, slip2), order)
    hinge = quat_mul(before.rotation, step.rotation)
    tilt = change.angle + rotate(before.rotation, _small_turn(dstep.rotation, step.rotation))
    axis = _turned(hinge, tilt, step.axis, dstep.axis)
    arm = turn(step.translation, dstep.translation)
    still = (ZERO, ZERO)
    if isinstance(step, Slide):
        along = _scaled(axis, step.length.value, dstep.length.value)
        arm = (arm[0] + along[0], arm[1] + along[1])
        slip, slip2 = (_scaled(axis, *pair) for pair in _rates(step.length, dstep.length))
        return _carried(before, change, tilt, arm, (still, slip, still, slip2), order)
    angle = tilt + axis[0] * dstep.angle.value + rotate(hinge, _swing(step, dstep))
    spin, spin2 = (_scaled(axis, *pair) for pair in _rates(step.angle, dstep.angle))
    return _carried(before, change, angle, arm, (spin, still, spin2, still), order)


Varied = tuple[V3, V3]
"""A vector with its change."""


def _turned(rotation: Quat, angle: V3, vector: V3, change: V3) -> Varied:
    """Return a vector turned by a rotation that itself turns by a small angle."""
    turned = rotate(rotation, vector)
    return turned, cross(angle, turned) + rotate(rotation, change)


def _scaled(vector: Varied, scale: Component, change: Component) -> Varied:
    return vector[0] * scale, vector[1] * scale + vector[0] * change


def _rates(coordinate: Any, change: Any) -> tuple[tuple[Component, Component], ...]:
    return (coordinate.rate, change.rate), (coordinate.rate2, change.rate2)


def _swing(step: Turn, dstep: Turn) -> V3:
    """Return the small rotation (axes of the placement) that a change da of the axis a causes: 2 (s c da + s^2 a x da), half angles."""
    if dstep.axis.is_known_zero:
        return ZERO
    assert step.half is not None
    s, c = step.half
    return (dstep.axis * c + cross(step.axis, dstep.axis) * s) * mul(s, 2.0)


def _carried(before: Rigid, change: _Change, angle: V3, arm: Varied, local: tuple[Varied, Varied, Varied, Varied], order: int) -> _Change:
    """Return the change of the composed motion (see ``rigid.compose``) from those of the motion before and of what the step adds."""
    r, dr = arm
    translation = change.translation + dr
    if order == 0:
        return _Change(angle, translation)
    (spin, dspin), (slip, dslip), (_, dspin2), (_, dslip2) = local
    w, dw = before.angular, change.angular
    whirl, dwhirl = cross(w, r), cross(dw, r) + cross(w, dr)
    angular, linear = dw + dspin, change.linear + dwhirl + dslip
    if order == 1:
        return _Change(angle, translation, angular, linear)
    angular2 = change.angular2 + dspin2 + cross(dw, spin) + cross(w, dspin)
    linear2 = change.linear2 + dslip2 + cross(change.angular2, r) + cross(before.angular2, dr)
    linear2 = linear2 + cross(dw, whirl + slip * 2.0) + cross(w, dwhirl + dslip * 2.0)
    return _Change(angle, translation, angular, linear, angular2, linear2)
