"""Joint coordinates as a manifold: moving along rates, differences, random and neutral places, limits."""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.edges.mimic import Mimic
from jaxframes.errors import ShapeError
from jaxframes.model.parameters import Parameters
from jaxframes.model.structure import Structure
from jaxframes.staging.arrays import as_float, is_concrete, widest

SPAN = {True: 2.0 * np.pi, False: 2.0}
"""How wide ``random`` draws where a coordinate has no limits: a whole turn for an angle (rad), two metres for a length."""


class JointSpace(Parameters):
    """What a tree can do with joint coordinates ``q`` [..., nq] and rates [..., nv]: pure functions that jit, vmap, differentiate.

    Most joints are flat: their coordinates add up. Quaternion joints move along the rotation group (``Ball``) or along screw
    motions (``Free``), continuous ones take the shorter way round where their followers let them.
    """

    def neutral(self) -> jax.Array:
        """Return the coordinates [nq] of all joints at rest: zeros and identity quaternions, unless a joint's ``rest`` says others."""
        return as_float(np.asarray(self.rest, np.float64)).astype(self.dtype)

    def integrate(self, q: Any, v: Any, dt: Any = 1.0) -> jax.Array:
        """Return the coordinates [..., nq] that constant rates lead to: q + v dt, on the manifold.

        Args:
            q: Coordinates [..., nq]; quaternions need not be unit.
            v: Rates [..., nv], constant for the duration (in the joint's own axes, as ``qd``).
            dt: Duration in s [...].

        Raises:
            ShapeError: An array does not fit the tree's joints.

        Gradients: exact, at v = 0 and at the identity too.
        """
        q, v = self._taken(q, "q"), self._taken(v, "v")
        dt = as_float(dt).astype(v.dtype)
        q, v, dt = same_batch(q, v, jnp.broadcast_to(dt[..., None], (*dt.shape, v.shape[-1])))
        step = v * dt
        rates = _columns(self, "v")
        moved = q + (step if rates is None else step[..., rates])
        return self._on_manifolds(moved, 0, lambda edge, cut: edge.integrate(cut(q, 0), cut(step, 2)))

    def difference(self, q0: Any, q1: Any) -> jax.Array:
        """Return the rates [..., nv] that lead from q0 to q1 in one second, the shorter way: ``integrate(q0, difference) == q1``.

        For a continuous joint and for quaternions the equality is one of places, those of every frame: whole turns and signs of quaternions
        may differ. A continuous joint that others follow takes the shorter way only if all of these are back where they were after a whole
        turn: rotations with whole multipliers.

        Args:
            q0: Coordinates to start from [..., nq].
            q1: Coordinates to reach [..., nq].

        Raises:
            ShapeError: An array does not fit the tree's joints.

        Gradients: exact, except where two rotations are half a turn apart, where there is no shorter way.
        """
        q0, q1 = same_batch(self._taken(q0, "q"), self._taken(q1, "q"))
        places = _columns(self, "q")
        step = q1 - q0
        step = step if places is None else step[..., places]
        found = self._on_manifolds(step, 2, lambda edge, cut: edge.difference(cut(q0, 0), cut(q1, 0)))
        for frame, returns in _with_followers(self).items():
            at = self.topology.coordinates[frame][2]
            found, step, back = same_batch(found, step, returns.astype(found.dtype))
            found = found.at[..., at].set(jnp.where(back[..., 0] > 0, found[..., at], step[..., at]))
        return found

    def clamp(self, q: Any) -> jax.Array:
        """Return coordinates [..., nq] moved inside the limits, quaternions normalised; NaN stays NaN.

        A ball's ``angle_limit`` brings its angle down about the same axis. Limits of joints that follow others are not looked at.

        Gradients: 1 inside and exactly at a limit, 0 outside.
        """
        q = self._taken(q, "q")
        low, high = self.limits()
        low, high, q = same_batch(low.astype(q.dtype), high.astype(q.dtype), q)
        inside = jnp.where(q < low, low, jnp.where(q > high, high, q))
        return self._on_manifolds(inside, 0, lambda edge, cut: edge.clamp(cut(inside, 0)))

    def random(self, key: jax.Array, batch: Sequence[int] = ()) -> jax.Array:
        """Return random coordinates [*batch, nq], uniform within limits.

        Without limits angles lie within half a turn and lengths within a metre of zero (or of the one limit there is);
        quaternions are uniform over all rotations, or over those within a ball's ``angle_limit``. Limits of joints that follow others
        are not looked at.

        Args:
            key: A key of ``jax.random``.
            batch: Shape of the batch.
        """
        low, high = self.limits()
        span = np.array([SPAN[turns] for edge in self._joint_edges() for turns in edge.angles()], np.float64)
        span = jnp.broadcast_to(jnp.asarray(span, low.dtype), low.shape)
        start = jnp.where(jnp.isfinite(low), low, jnp.where(jnp.isfinite(high), high - span, -span / 2))
        stop = jnp.where(jnp.isfinite(high), high, jnp.where(jnp.isfinite(low), low + span, span / 2))
        shape = jnp.broadcast_shapes((*batch, low.shape[-1]), low.shape)
        first, *others = jax.random.split(key, 1 + len(self.topology.joint_frames))
        drawn = jax.random.uniform(first, shape, low.dtype)
        start, stop = (jnp.broadcast_to(bound, shape) for bound in (start, stop))
        flat = jnp.minimum(start + drawn * (stop - start), stop)
        keys = iter(others)
        return self._on_manifolds(flat, 0, lambda edge, cut: edge.random(next(keys), cut(flat, 0)))

    def limits(self) -> tuple[jax.Array, jax.Array]:
        """Return the lower and upper bounds [..., nq] of all coordinates, infinite where there are none."""
        dtype, sides = self.dtype, ([], [])
        for edge in self._joint_edges():
            bounds = edge.limits_of() or (np.full(edge.nq, -np.inf), np.full(edge.nq, np.inf))
            for side, bound in zip(sides, bounds, strict=True):
                side.append(jnp.asarray(bound, dtype))
        if not sides[0]:
            return jnp.zeros(0, dtype), jnp.zeros(0, dtype)
        low, high = (jnp.concatenate(same_batch(*side), -1) for side in sides)
        return low, high

    def _joint_edges(self) -> list[Edge]:
        return [self.edge_of(frame) for frame in self.topology.joint_frames]

    def _taken(self, values: Any, kind: str) -> jax.Array:
        array, count = as_float(values), self.topology.nq if kind == "q" else self.topology.nv
        if array.ndim == 0 or array.shape[-1] != count:
            raise ShapeError(f"{kind} has shape {array.shape}, but the tree's joints need [..., {count}]")
        return array

    def _on_manifolds(self, values: jax.Array, place: int, make: Callable[[Edge, Callable[[jax.Array, int], jax.Array]], Any]) -> jax.Array:
        """Return values with those of joints on a manifold replaced; ``place`` is 0 for coordinates, 2 for rates."""
        for frame in self.topology.joint_frames:
            edge, where = self.edge_of(frame), self.topology.coordinates[frame]
            if edge.is_manifold:
                cut = lambda array, at, where=where: array[..., where[at] : where[at] + where[at + 1]]  # noqa: E731
                first = where[place]
                values = values.at[..., first : first + where[place + 1]].set(make(edge, cut))
        return values


def _with_followers(tree: Structure) -> dict[int, jax.Array]:
    """Return, for each joint of one coordinate on a manifold that others follow, whether all of these are back after a whole turn of it.

    Returns:
        Truth values [..., 1] by frame; joints of which it is known that all are back are left out.
    """
    found: dict[int, jax.Array] = {}
    sources = tree.topology.sources
    for frame, source in enumerate(sources):
        if source < 0 or not isinstance(edge := tree.edge_of(frame), Mimic):
            continue
        factors, last = [edge.multiplier], source
        while sources[last] >= 0 and isinstance(between := tree.edge_of(last), Mimic):
            factors.append(between.multiplier)
            last = sources[last]
        joint = tree.edge_of(last)
        if joint.nq != 1 or not joint.is_manifold:
            continue
        turns = joint.periodic()[0] and edge.edge.periodic()[0]
        if all(map(is_concrete, factors)):
            factor = functools.reduce(np.multiply, map(np.asarray, factors))
            if np.all(factor == (np.round(factor) if turns else 0.0)):
                continue
        factor = functools.reduce(jnp.multiply, same_batch(*factors))
        returns = factor == (jnp.round(factor) if turns else 0.0)
        found[last] = returns if last not in found else jnp.logical_and(*jnp.broadcast_arrays(found[last], returns))
    return found


def _columns(tree: Structure, kind: str) -> np.ndarray | None:
    """Return which rate belongs to each coordinate (``v``), or which coordinate to each rate (``q``); None for the same."""
    rows = [tree.topology.coordinates[frame] for frame in tree.topology.joint_frames]
    if all(nq == nv for _, nq, _, nv in rows):
        return None
    if kind == "v":
        return np.array([first + min(i, nv - 1) for _, nq, first, nv in rows for i in range(nq)])
    return np.array([first + i for first, _, _, nv in rows for i in range(nv)])


def same_batch(*arrays: jax.Array) -> tuple[jax.Array, ...]:
    """Return arrays [..., k] with one batch shape and one dtype."""
    dtype = widest(*(a.dtype for a in arrays))
    batch = jnp.broadcast_shapes(*(a.shape[:-1] for a in arrays))
    return tuple(jnp.broadcast_to(a.astype(dtype), (*batch, a.shape[-1])) for a in arrays)
