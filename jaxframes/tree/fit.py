"""Fitting a joint: the coordinates, rates and accelerations that bring its frame closest to a motion that is wanted.

The pose is found by Levenberg's and Marquardt's method on the joint's manifold: the residual is the rotation vector and the translation
from the pose that the joint has to the one wanted, and its derivative is the joint's Jacobian. Rates and accelerations are linear least
squares.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.base import Edge
from jaxframes.errors import ShapeError
from jaxframes.kinematics import queries
from jaxframes.model.compile import Declared, compile_frames
from jaxframes.model.joint_values import in_dtype, make_state, set_named
from jaxframes.model.parameters import Parameters
from jaxframes.model.state import State
from jaxframes.model.topology import Topology
from jaxframes.spatial import Epoch, Rotation, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.staging.arrays import widest

ROUNDS = 25
"""Rounds of the search: joints with one axis take one or two, spherical ones up to fifteen from half a turn away."""
TURN = 2.0 * np.pi


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class JointFit:
    """What ``tree.fit_joint`` found; arrays of a joint of one coordinate are [...], of one of k [..., k], as ``tree.set_q`` takes them.

    Attributes:
        state: The state with the joint's values replaced.
        q: Coordinates of the joint, rad or m.
        qd: Its rates; those of the state where no velocity was wanted.
        qdd: Its second derivatives; those of the state where no acceleration was wanted.
        residual: What is left of the pose, [..., 6]: rotation vector (rad), then translation (m), from the pose reached to the one wanted,
            in the parent's axes; zero to rounding where the joint can be there.
        velocity_residual: What is left of the velocity [..., 6], angular first; None where none was wanted.
        acceleration_residual: What is left of the acceleration, likewise.
    """

    state: State
    q: jax.Array
    qd: jax.Array
    qdd: jax.Array
    residual: jax.Array
    velocity_residual: jax.Array | None
    acceleration_residual: jax.Array | None


def fit_joint(
    tree: Parameters,
    state: State,
    joint: str,
    transform: Transform,
    velocity: SpatialVelocity | None,
    acceleration: SpatialAcceleration | None,
    weight: Any,
) -> JointFit:
    """Return the values of a joint that come closest to a motion of its frame (arguments as for ``tree.fit_joint``)."""
    for value, kind in ((transform, Transform), (velocity, SpatialVelocity), (acceleration, SpatialAcceleration)):
        if not isinstance(value, kind) and (value is not None or kind is Transform):
            raise ShapeError(f"fit_joint({joint!r}) takes a jf.{kind.__name__}, found {type(value).__name__}")
    topology = tree.topology
    frame = topology.joint_frames[topology.joint(joint)]
    first, nq, first_v, nv = topology.coordinates[frame]
    edge = tree.edge_of(frame).bare()  # without limits: joints that differ in these alone share a program
    alone, own = compile_frames(Declared({"parent": None, "child": "parent"}, {"child": edge}, {"child": "joint"}))
    values = (state.q[..., first : first + nq], *(rate[..., first_v : first_v + nv] for rate in (state.qd, state.qdd)))
    wanted = tuple(None if value is None else value.as_vector() for value in (velocity, acceleration))
    factor = in_dtype(weight, widest(tree.dtype, state.q.dtype))
    q, qd, qdd, residual, *more = _compiled(alone, own, *values, state.time, transform, *wanted, factor)
    found = {"q": _as_given(q), "qd": _as_given(qd), "qdd": _as_given(qdd)}
    fields = {kind: set_named(topology, _wide(getattr(state, kind), value), {joint: value}, kind) for kind, value in found.items()}
    return JointFit(state.replace(**fields), **found, residual=residual, velocity_residual=more[0], acceleration_residual=more[1])


def _as_given(values: jax.Array) -> jax.Array:
    return values[..., 0] if values.shape[-1] == 1 else values


def _wide(values: jax.Array, new: jax.Array) -> jax.Array:
    return values.astype(widest(values.dtype, new.dtype))


@partial(jax.jit, static_argnums=(1,))
def _compiled(
    edges: tuple[Edge, ...],
    topology: Topology,
    q: jax.Array,
    qd: jax.Array,
    qdd: jax.Array,
    time: Epoch | None,
    target: Transform,
    velocity: jax.Array | None,
    acceleration: jax.Array | None,
    weight: jax.Array,
) -> tuple[Any, ...]:
    """Return q, qd, qdd and the three residuals of a tree of one joint; one program for all joints of a family."""
    tree = Parameters(edges, topology)
    given = [*jax.tree.leaves((q, qd, qdd, target, velocity, acceleration, weight))]
    dtype = widest(tree.dtype, *(leaf.dtype for leaf in given))
    vectors = (q, qd, qdd, target.rotation.wxyz, target.translation, velocity, acceleration)
    shapes = [v.shape[:-1] for v in vectors if v is not None]
    batch = jnp.broadcast_shapes(tree.batch_shape, weight.shape, () if time is None else time.shape, *shapes)
    wide = lambda v: jnp.broadcast_to(v.astype(dtype), (*batch, v.shape[-1]))  # noqa: E731
    q, qd, qdd = wide(q), wide(qd), wide(qdd)
    lengths = jnp.broadcast_to(weight.astype(dtype)[..., None], (*batch, 3))
    scale = jnp.concatenate([jnp.ones_like(lengths), lengths], -1)
    fit = _Fit(tree, time, Transform(Rotation(wide(target.rotation.wxyz)), wide(target.translation)), scale)
    place = lax.stop_gradient(jax.tree.map(lax.stop_gradient, fit).found(q))
    q = fit.refined(place)
    jacobian = fit.jacobian(q)
    inverse = jnp.linalg.pinv(scale[..., None] * jacobian)
    left: list[jax.Array | None] = [None, None]
    if velocity is not None:
        qd = _times(inverse, scale * wide(velocity))
        left[0] = wide(velocity) - _times(jacobian, qd)
    if acceleration is not None:
        bias = queries.between(tree, make_state(tree, q, qd, None, time), of="child", relative_to="parent").acceleration.as_vector()
        qdd = _times(inverse, scale * (wide(acceleration) - bias))
        left[1] = wide(acceleration) - bias - _times(jacobian, qdd)
    return q, qd, qdd, fit.error(q), *left


def _times(matrix: jax.Array, vector: jax.Array) -> jax.Array:
    return (matrix @ vector[..., None])[..., 0]


@jax.tree_util.register_pytree_node_class
@dataclass(frozen=True)
class _Fit:
    """The pose that is wanted of a tree of one joint.

    Attributes:
        tree: The tree.
        time: The epoch, for a joint that reads it.
        target: The pose wanted.
        scale: Factors of the residual [..., 6].
    """

    tree: Parameters
    time: Epoch | None
    target: Transform
    scale: jax.Array

    def tree_flatten(self) -> tuple[tuple[Any, ...], Topology]:
        """Return the numbers, and the topology (for JAX)."""
        return (self.tree.frame_edges, self.time, self.target, self.scale), self.tree.topology

    @classmethod
    def tree_unflatten(cls, topology: Topology, parts: tuple[Any, ...]) -> "_Fit":
        """Return the fit of some numbers (for JAX)."""
        return cls(Parameters(tuple(parts[0]), topology), *parts[1:])

    def error(self, q: jax.Array) -> jax.Array:
        """Return the rotation vector and translation [..., 6] from the pose at q to the one wanted."""
        pose = queries.between(
            self.tree, make_state(self.tree, q, None, None, self.time), of="child", relative_to="parent", order=0
        ).transform
        turn = (self.target.rotation @ pose.rotation.inverse()).to_rotation_vector()
        shape = self.scale.shape[:-1]
        parts = (turn, self.target.translation - pose.translation)
        return jnp.concatenate([jnp.broadcast_to(part, (*shape, 3)) for part in parts], -1).astype(q.dtype)

    def jacobian(self, q: jax.Array) -> jax.Array:
        """Return the joint's Jacobian [..., 6, nv]."""
        found = queries.jacobian(self.tree, make_state(self.tree, q, None, None, self.time), of="child", relative_to="parent")
        return jnp.broadcast_to(found, (*self.scale.shape[:-1], *found.shape[-2:])).astype(q.dtype)

    def moved(self, q: jax.Array, step: jax.Array) -> jax.Array:
        """Return the coordinates after a step [..., nv] along the manifold."""
        return self.tree.edge_of(1).integrate(q, step)

    def found(self, q: jax.Array) -> jax.Array:
        """Return the coordinates [..., nq] of the least squares: downhill from q, and for a screw also from where the translation leads."""
        edge, near = self.tree.edge_of(1), self.search(q)
        if not any(turns and not returns for turns, returns in zip(edge.angles(), edge.periodic(), strict=True)):
            return near
        along = replace(self, scale=self.scale.at[..., :3].set(0.0)).search(q)
        far = self.search(along)
        better = self._cost(far) < self._cost(near)
        return jnp.where(better[..., None], far, near)

    def _cost(self, q: jax.Array) -> jax.Array:
        return jnp.sum(jnp.square(self.scale * self.error(q)), -1)

    def search(self, q: jax.Array) -> jax.Array:
        """Return the coordinates [..., nq] of the least squares that lie downhill from q."""
        identity = jnp.asarray(np.eye(self.tree.nv), q.dtype)

        def one(_: Any, carry: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
            q, error, damping = carry
            scaled = self.scale[..., None] * self.jacobian(q)
            across = jnp.swapaxes(scaled, -1, -2)
            square = across @ scaled
            size = jnp.max(jnp.abs(square), axis=(-1, -2), keepdims=True)
            held = square + damping[..., None, None] * jnp.where(size > 0, size, 1.0) * jnp.broadcast_to(identity, square.shape)
            new = self.moved(q, jnp.linalg.solve(held, across @ error[..., None])[..., 0])
            found = self.scale * self.error(new)
            better = jnp.sum(found * found, -1) < jnp.sum(error * error, -1)
            choose = lambda a, b: jnp.where(better[..., None], a, b)  # noqa: E731
            return choose(new, q), choose(found, error), jnp.where(better, damping * 0.1, damping * 10.0)

        start = (q, self.scale * self.error(q), jnp.full(q.shape[:-1], 1e-3, q.dtype))
        found = lax.fori_loop(0, ROUNDS, one, start)[0]
        for i, returns in enumerate(self.tree.edge_of(1).periodic()):  # of places that are one, the nearest to the start
            if returns:
                found = found.at[..., i].add(-TURN * jnp.round((found[..., i] - q[..., i]) / TURN))
        return found

    def refined(self, place: jax.Array) -> jax.Array:
        """Return the coordinates after Newton's step from the place found, whose derivative is that of the implicit equation.

        That equation is that the gradient of the squares vanishes: J' W (log R_wanted R', p_wanted - p) = 0.
        """
        still = jax.tree.map(lax.stop_gradient, self)

        def slope(fit: _Fit, step: jax.Array) -> jax.Array:
            q = fit.moved(place, step)
            across = jnp.swapaxes(fit.scale[..., None] * fit.jacobian(q), -1, -2)
            return _times(across, fit.scale * fit.error(q))

        zero = jnp.zeros((*place.shape[:-1], self.tree.nv), place.dtype)
        units = jnp.asarray(np.eye(self.tree.nv), place.dtype).reshape(self.tree.nv, *[1] * (place.ndim - 1), self.tree.nv)
        units = jnp.broadcast_to(units, (self.tree.nv, *zero.shape))
        columns = jax.vmap(lambda unit: jax.jvp(partial(slope, still), (zero,), (unit,))[1])(units)
        inverse = lax.stop_gradient(jnp.linalg.pinv(jnp.moveaxis(columns, 0, -1)))
        return self.moved(place, -_times(inverse, slope(self, zero)))
