"""Apparent states: where a frame is seen, by light that takes its time and from an observer that moves.

With r = T(t + s tau) - O(t), c tau = |r|, u = r / |r|, s = -1 for light that arrives and +1 for light that departs:
tau' = u.(v_T - v_O) / (c - s u.v_T), r' = v_T (1 + s tau') - v_O, r'' = a_T (1 + s tau')^2 + s v_T tau'' - a_O, and c tau'' is the
second derivative of |r|. Light time is Newtonian: straight lines, no delay by gravity (SPICE's ``abcorr`` required reading).
"""

import functools
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.errors import MissingInputError
from jaxframes.kinematics.apparent import SPEED_OF_LIGHT, ApparentState, Looking
from jaxframes.kinematics.attachments import between
from jaxframes.kinematics.derived import context_of
from jaxframes.kinematics.state_rate import rate
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.numerics.components import V3, Component, cross, dot, mul, rotate, select
from jaxframes.numerics.packed import Packed, unpacked
from jaxframes.numerics.rigid import Rigid
from jaxframes.spatial import Epoch
from jaxframes.staging.columns import assemble, take_apart
from jaxframes.staging.stages import stage

STEPS = 3
"""Steps of the fixed point after the geometric guess. Each gains a factor of v/c, four digits: three leave nothing to gain."""


def apparent(tree: Structure, state: State, looking: Looking) -> ApparentState:
    """Return what an observer sees, as ``FrameTree.apparent`` says."""
    _time(state)
    context = context_of(tree, state, 0)
    state, dtype = state.broadcast_to(context.shape), context.dtype  # of the tree's batch too: the light time has it
    time = _time(state)
    observer = _at_root(tree, state, looking.relative_to, min(looking.order + int(looking.aberration), 2))
    shape = time.shape
    if looking.light_time is False:
        tau = jnp.zeros(shape, dtype)
        coverage = _first(_coverage(tree, looking.relative_to, time), _coverage(tree, looking.of, time))
    else:
        tau = _delay(looking, tree, state)
        coverage = _coverages(looking, tree, state, tau)
    target = _at_root(tree, _later(state, looking.sign * tau), looking.of, looking.order)
    jerk = _jerk(looking, tree, state) if looking.aberration and looking.order == 2 and looking.light_time != "LT" else None
    axes = between(context_of(tree, state, 0), 0, looking.expressed_in) if looking.expressed_in else ()

    def work() -> tuple[list[jax.Array], jax.Array | None, jax.Array | None]:
        line, rates = _line_of_sight(looking, unpacked(observer), unpacked(target))
        one_step = None
        if looking.light_time == "LT":
            one_step, line = _length(line[0]) * (1 / SPEED_OF_LIGHT), line[:2]
        if looking.aberration:
            line = _aberrated(looking, unpacked(observer), jerk, line)
        if looking.expressed_in:
            line = [rotate(unpacked(axes).rotation, vector) for vector in line]
        speed = None if looking.order == 0 else jnp.broadcast_to(jnp.asarray(rates[0], dtype), shape)
        return [assemble(tuple(vector), shape, dtype) for vector in line], speed, one_step

    vectors, speed, one_step = stage(work)()
    position, velocity, acceleration = [*vectors, None, None][:3]
    tau = jnp.broadcast_to(tau if one_step is None else one_step, shape)
    return ApparentState(position, velocity, acceleration, tau, speed, coverage)  # pyright: ignore[reportArgumentType]


def _at_root(tree: Structure, state: State, frame: int, order: int) -> Packed:
    """Return the motion of a frame relative to the root."""
    return between(context_of(tree, state, order), frame, 0)


def _time(state: State) -> Epoch:
    if state.time is None:
        raise MissingInputError("light time needs the time of the observation, and the state has none; pass time= to tree.state")
    return state.time


def _later(state: State, seconds: jax.Array) -> State:
    """Return the state at another time; the small step goes to the low part, where none of it is lost."""
    time = _time(state)
    return replace(state, time=Epoch(time.hi, time.lo + seconds))


def _length_and_inverse(vector: V3) -> tuple[jax.Array, jax.Array]:
    """Return the length of a vector and one over it; both 0 for no length, with derivatives 0: what coincides is seen where it is."""
    square = jnp.asarray(dot(vector, vector))
    nothing = square == 0
    length = jnp.sqrt(select(nothing, jnp.ones_like(square), square))
    zero = jnp.zeros_like(square)
    return select(nothing, zero, length), select(nothing, zero, 1 / length)


def _length(vector: V3) -> jax.Array:
    return _length_and_inverse(vector)[0]


def _travel(looking: Looking, tree: Structure, state: State, tau: jax.Array | None) -> jax.Array:
    """Return how long light takes from where the target is, tau away from the state's time, to the observer of that time."""
    there = _at_root(tree, state if tau is None else _later(state, looking.sign * tau), looking.of, 0)
    here = _at_root(tree, state, looking.relative_to, 0)
    return stage(lambda: _length(unpacked(there).translation - unpacked(here).translation) * (1 / SPEED_OF_LIGHT))()


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _delay(looking: Looking, tree: Structure, state: State) -> jax.Array:
    """Return the light time by fixed-point steps: the target's epoch is off by less than the last step's change."""
    tau = _travel(looking, tree, state, None)
    if looking.light_time == "LT":
        return tau
    # A loop, so that the tables are compiled once for all steps; it is never differentiated.
    return lax.fori_loop(0, STEPS, lambda _, tau: _travel(looking, tree, state, tau), tau)


@_delay.defjvp
def _delay_jvp(looking: Looking, primals: tuple[Structure, State], tangents: Any) -> tuple[jax.Array, jax.Array]:
    """Differentiate the equation c tau = |T(t + s tau) - O(t)| and not the steps that solved it."""
    tau = _delay(looking, *primals)
    if looking.light_time == "LT":  # one step is no solution of the equation: its derivative is that of the step
        return tau, jax.jvp(lambda tree, state: _travel(looking, tree, state, None), primals, tangents)[1]
    along = jax.jvp(lambda tree, state: _travel(looking, tree, state, tau), primals, tangents)[1]
    slope = jax.jvp(lambda delay: _travel(looking, *primals, delay), (tau,), (jnp.ones_like(tau),))[1]
    return tau, along / (1 - slope)


def _line_of_sight(looking: Looking, observer: Rigid, target: Rigid) -> tuple[list[V3], list[Component]]:
    """Return the vector to the target and its derivatives, and the derivatives of the light time."""
    line, rates = [target.translation - observer.translation], list[Component]()
    s = float(looking.sign) if looking.light_time else 0.0
    if looking.order == 0:
        return line, rates
    _, inverse = _length_and_inverse(line[0])
    u = line[0] * inverse
    opening = SPEED_OF_LIGHT - s * jnp.asarray(dot(u, target.linear))
    first = dot(u, target.linear - observer.linear) / opening if s else 0.0
    line.append(target.linear * (1 + s * first) - observer.linear)
    rates.append(first)
    if looking.order == 1:
        return line, rates
    plain = target.linear2 * ((1 + s * first) ** 2) - observer.linear2
    across = cross(u, line[1])  # |r'|^2 - (u.r')^2 without the cancellation
    second = (mul(dot(across, across), inverse) + dot(u, plain)) / opening if s else 0.0
    line.append(plain + target.linear * mul(s, second))
    rates.append(second)
    return line, rates


def _turned_by_motion(line: V3, beta: V3) -> V3:
    """Return a vector turned towards a velocity (in units of light's) by asin |u x beta|: SPICE's ``stelab``.

    With h = u x beta, the turned vector is r sqrt(1 - h.h) + h x r: without a quotient by |h|, so smooth at zero.
    """
    u = line * _length_and_inverse(line)[1]
    h = cross(u, beta)
    return line * jnp.sqrt(1 - jnp.asarray(dot(h, h))) + cross(h, line)


def _jerk(looking: Looking, tree: Structure, state: State) -> jax.Array:
    """Return the derivative of the observer's acceleration, [..., 6]: angular, linear."""
    acceleration = lambda moving: _at_root(tree, moving, looking.relative_to, 2)[2]  # noqa: E731
    return jax.jvp(acceleration, (state,), (rate(tree, state),))[1]


def _aberrated(looking: Looking, observer: Rigid, jerk: jax.Array | None, line: list[V3]) -> list[V3]:
    """Return the line of sight and its derivatives with the aberration by the observer's velocity relative to the root."""
    scale = -looking.sign / SPEED_OF_LIGHT
    beta = [observer.linear * scale]
    if len(line) > 1:
        beta.append(observer.linear2 * scale)
    if len(line) > 2:
        assert jerk is not None
        beta.append(V3(*take_apart(jerk)[3:]) * scale)
    out = [_turned_by_motion(line[0], beta[0])]
    whole = tuple(_filled(v, out[0]) for v in (line[0], beta[0]))

    def first(r: V3, b: V3, dr: V3, db: V3) -> V3:
        return jax.jvp(_turned_by_motion, (r, b), (dr, db))[1]

    if len(line) > 1:
        slopes = tuple(_filled(v, out[0]) for v in (line[1], beta[1]))
        out.append(first(*whole, *slopes))
        if len(line) > 2:
            bends = tuple(_filled(v, out[0]) for v in (line[2], beta[2]))
            out.append(jax.jvp(first, (*whole, *slopes), (*slopes, *bends))[1])
    return out


def _filled(vector: V3, like: V3) -> V3:
    """Return a vector whose components are all arrays, of one shape: tangents must match."""
    return V3(*(jnp.broadcast_to(jnp.asarray(c, jnp.asarray(full).dtype), jnp.shape(full)) for c, full in zip(vector, like, strict=True)))


def _coverages(looking: Looking, tree: Structure, state: State, tau: jax.Array) -> jax.Array:
    """Return the coverage code of an apparent state: of both paths now, then of the target's at the instant it is looked at."""
    time = _time(state)
    tau = lax.stop_gradient(tau)
    guess = lax.stop_gradient(_travel(looking, tree, state, None))
    lost = jnp.isnan(tau) & ~jnp.isnan(guess)
    then = Epoch(time.hi, time.lo + looking.sign * jnp.where(jnp.isnan(tau), guess, tau))
    late = jnp.where(jnp.isnan(guess), 0, _coverage(tree, looking.of, then))
    # The guess may lie inside where the next step does not: the end it ran over is known from its direction.
    late = jnp.where(lost & (late == 0), looking.sign, late)
    return _first(_coverage(tree, looking.relative_to, time), _coverage(tree, looking.of, time), late)


def _first(*codes: jax.Array) -> jax.Array:
    return functools.reduce(lambda a, b: jnp.where(a == 0, b, a), codes)


def _coverage(tree: Structure, frame: int, time: Epoch) -> jax.Array:
    """Return the coverage code of the tables between a frame and the root: int32, the first that is not 0."""
    edges = (tree.edge_of(child) for child in tree.topology.ancestors(frame) if child)
    codes = [edge.coverage_code(time) for edge in edges if edge.needs_time]
    return _first(jnp.zeros(time.shape, jnp.int32), *codes)
