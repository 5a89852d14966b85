"""Context: a state taken apart into components of one dtype and one batch shape, ready for any edge to read."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.errors import MissingInputError, NoAccelerationError, ShapeError
from jaxframes.kinematics.arrays import motion_of
from jaxframes.numerics.boundary import column, parameters
from jaxframes.numerics.components import Component, mul
from jaxframes.numerics.rigid import AT_REST, Rigid
from jaxframes.numerics.steps import Step, append_all
from jaxframes.spatial import Motion
from jaxframes.tree.edges.base import Edge, Inputs
from jaxframes.tree.edges.mimic import Mimic
from jaxframes.tree.joints import float_dtype
from jaxframes.tree.state import State
from jaxframes.tree.tree import FrameTree


class Context:
    """What a computation over a tree reads: the tree, the state's components, the batch shape and the dtype."""

    def __init__(self, tree: FrameTree, state: State, order: int):
        self.tree, self.topology, self.order = tree, tree.topology, order
        self.dtype = jnp.promote_types(float_dtype(tree.parameters), float_dtype(state))
        self._check_joints(state)
        self.shape = self._batch_shape(state)
        self._joints = {kind: self._ranked(getattr(state, kind), 1) for kind in ("q", "qd", "qdd")}
        self.time = None if state.time is None else (self._ranked(state.time.hi, 0), self._ranked(state.time.lo, 0))
        self._state = state
        self._steps: dict[int, tuple[Step, ...]] = {}

    def _check_joints(self, state: State) -> None:
        for kind, count in (("q", self.topology.nq), ("qd", self.topology.nv), ("qdd", self.topology.nv)):
            found = jnp.shape(getattr(state, kind))
            if not found or found[-1] != count:
                raise ShapeError(
                    f"the state's {kind} has shape {found}, but this tree needs [..., {count}]; make it with this tree.state(...)"
                )
        held, found = sum(i >= 0 for i in self.topology.prescribed), state.prescribed.transform.translation.shape
        if found[-2:-1] != (held,):
            raise ShapeError(
                f"the state holds prescribed motions of shape {found}, but this tree has {held}; make it with this tree.state(...)"
            )

        loose, given = len(self.topology.attachables), state.attachments
        if (0 if given is None else given.parents.shape[-1]) != loose:
            found = "none" if given is None else given.parents.shape[-1]
            raise ShapeError(f"this tree has {loose} attachable frames, the state holds {found}; make it with this tree.state(...)")

    def _batch_shape(self, state: State) -> tuple[int, ...]:
        shapes = [values.shape[:-1] for values in (state.q, state.qd, state.qdd)]
        shapes += [leaf.shape[:-2] for leaf in jax.tree.leaves(state.prescribed)]
        shapes += [part.shape for part in jax.tree.leaves(state.time)]
        if state.attachments is not None:
            shapes += [state.attachments.parents.shape[:-1]]
            shapes += [leaf.shape[:-2] for leaf in jax.tree.leaves(state.attachments.motion)]
        for leaves, stacked in zip(self.tree.parameters, self.topology.stacked, strict=True):
            shapes += [leaf.shape[:-2] for leaf in leaves if stacked]
        try:
            return jnp.broadcast_shapes(*shapes)
        except ValueError:
            fields = {"q": state.q.shape[:-1], "qd": state.qd.shape[:-1], "qdd": state.qdd.shape[:-1]}
            fields["time"] = () if state.time is None else state.time.shape
            fields["prescribed"] = state.prescribed.transform.shape[:-1]
            text = ", ".join(f"{name} {shape}" for name, shape in fields.items())
            raise ShapeError(f"the batch axes of the state and the tree do not broadcast: {text}") from None

    def _ranked(self, array: jax.Array, trailing: int) -> jax.Array:
        """Return an array in the common dtype, its batch axes padded on the left to the common rank (none stays none)."""
        own = array.ndim - trailing
        missing = len(self.shape) - own if own else 0
        converted = array.astype(self.dtype)
        return lax.expand_dims(converted, range(missing)) if missing else converted

    def _columns(self, kind: str, first: int, count: int) -> tuple[Component, ...]:
        return tuple(column(self._joints[kind], first + i) for i in range(count))

    def gathered(self, kind: str, columns: np.ndarray) -> jax.Array:
        """Return some columns of ``q``, ``qd`` or ``qdd`` as one component [*batch, n]."""
        return self._whole(picked(self._joints[kind], columns, -1), 0)

    def _whole(self, array: jax.Array, trailing: int) -> jax.Array:
        """Return an array of several frames, [n] or [*batch, n] before its trailing axes, with all batch axes."""
        return lax.expand_dims(array, range(len(self.shape) + 1 + trailing - array.ndim))

    def prescribed(self, rows: np.ndarray) -> Rigid:
        """Return several of the motions that the state holds for prescribed edges, components [*batch, n]."""
        ranked = (self._ranked(leaf, 2) for leaf in self._leaves(self._state.prescribed))
        return motion_of(self._whole(picked(leaf, rows, -2), 1) for leaf in ranked)

    def attachment(self, row: int) -> tuple[jax.Array, Rigid]:
        """Return the parent's index and the motion relative to it of an attachable frame, by its row in the state."""
        held = self._state.attachments
        assert held is not None
        parents = held.parents[..., row]
        missing = len(self.shape) - parents.ndim if parents.ndim else 0
        return (lax.expand_dims(parents, range(missing)) if missing else parents), self._held(held.motion, row)

    def _held(self, held: Motion, row: int) -> Rigid:
        """Return one of the motions that a state holds, as far as the order asks."""
        return motion_of(self._ranked(leaf[..., row, :], 1) for leaf in self._leaves(held))

    def _leaves(self, held: Motion) -> tuple[jax.Array, ...]:
        """Return the arrays of motions that a state holds, as far as the order asks."""
        leaves = (
            held.transform.rotation.wxyz,
            held.transform.translation,
            held.velocity.angular,
            held.velocity.linear,
            held.acceleration.angular,
            held.acceleration.linear,
        )
        return leaves[: 2 + 2 * self.order]

    def edge(self, frame: int) -> Edge:
        """Return the edge above a frame, float parameters in the common dtype."""
        return jax.tree.map(self._converted, self.tree._edge(frame))

    def _converted(self, leaf: Any) -> Any:
        return leaf.astype(self.dtype) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf

    def steps(self, frame: int) -> tuple[Step, ...]:
        """Return the steps of the edge above a frame (once each, however often it is asked).

        Raises:
            NoAccelerationError: Accelerations are asked for and the edge has none.
            MissingInputError: The edge needs the time and the state has none.
        """
        if frame not in self._steps:
            self.check(frame)
            self._steps[frame] = self.edge(frame).steps(self.inputs(frame), self.order)
        return self._steps[frame]

    def check(self, frame: int) -> None:
        """Raise NoAccelerationError or MissingInputError where the edge above a frame cannot answer."""
        edge, name = self.tree._edge(frame), self.topology.names[frame]
        if self.order > 1 and not edge.supports_accelerations:
            raise NoAccelerationError(
                f"the edge of frame {name!r} ({edge.describe()}) supports no accelerations; ask for transform or velocity, "
                f"or put an edge there that does"
            )
        if edge.needs_time and self.time is None:
            raise MissingInputError(f"frame {name!r} hangs on {edge.describe()}, and the state has no time; pass time= to tree.state")

    def unit_twists(self, frame: int) -> list[tuple[int, Rigid]]:
        """Return, for each rate of the edge above a frame, its index in ``qd`` and the edge's velocity for a unit of it."""
        first, scale = self._driver(frame)
        edge, found, own = self.edge(frame), [], self.inputs(frame)
        count = len(own.qd)
        for i in range(count):
            one = tuple(scale if i == j else 0.0 for j in range(count))
            inputs = own._replace(qd=one, qdd=(0.0,) * count)
            found.append((first + i, append_all(AT_REST, edge.steps(inputs, 1), 1)))
        return found

    def _driver(self, frame: int) -> tuple[int, Component]:
        """Return the index in ``qd`` of the first rate that moves an edge, and by how much: 1 unless it follows others."""
        source, edge = self.topology.sources[frame], self.edge(frame)
        if source < 0 or not isinstance(edge, Mimic):
            return self.topology.coordinates[frame][2], 1.0
        first, scale = self._driver(source)
        return first + edge.coordinate, mul(scale, parameters(edge.multiplier, len(self.shape))[0])

    def coordinates(self, frame: int) -> tuple[tuple[Component, ...], tuple[Component, ...], tuple[Component, ...]]:
        """Return the coordinates of an edge and their first and second derivatives: its own, or those that it follows."""
        source, edge = self.topology.sources[frame], self.edge(frame)
        if source >= 0 and isinstance(edge, Mimic):
            return edge.follow(*self.coordinates(source), len(self.shape))
        first_q, nq, first_v, nv = self.topology.coordinates[frame]
        return self._columns("q", first_q, nq), self._columns("qd", first_v, nv), self._columns("qdd", first_v, nv)

    def inputs(self, frame: int) -> Inputs:
        """Return what the edge above a frame may read."""
        row = self.topology.prescribed[frame]
        q, qd, qdd = self.coordinates(frame)
        return Inputs(
            q=q,
            qd=qd,
            qdd=qdd,
            time=self.time,
            prescribed=None if row < 0 else self._held(self._state.prescribed, row),
            batch_rank=len(self.shape),
        )


def picked(array: jax.Array, places: np.ndarray, axis: int) -> jax.Array:
    """Return places along an axis: the array itself, a slice where they are evenly spaced, else a gather."""
    step = int(places[1] - places[0]) if len(places) > 1 else 1
    if step > 0 and np.all(np.diff(places) == step):
        if len(places) == array.shape[axis]:
            return array
        return lax.slice_in_dim(array, int(places[0]), int(places[-1]) + 1, step, axis=axis)
    return jnp.take(array, places.astype(np.int32), axis=axis, mode="clip", unique_indices=len(np.unique(places)) == len(places))
