"""Context: a state taken apart into components of one dtype and one batch shape, ready for any edge to read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.errors import MissingInputError, NoAccelerationError, ShapeError
from jaxframes.kinematics.arrays import motion_of
from jaxframes.numerics.boundary import parameters
from jaxframes.numerics.columns import column
from jaxframes.numerics.components import V3, Component, mul
from jaxframes.numerics.extension import folded
from jaxframes.numerics.packed import Kind
from jaxframes.numerics.rigid import AT_REST, Rigid
from jaxframes.numerics.source import Source, source_of
from jaxframes.numerics.steps import Step, append_all
from jaxframes.spatial import Motion
from jaxframes.tree.edges.base import Edge, Inputs
from jaxframes.tree.edges.mimic import Mimic
from jaxframes.tree.joints import float_dtype
from jaxframes.tree.state import State
from jaxframes.tree.tree import FrameTree

JOINT_FIELDS: tuple[str, ...] = ("q", "qd", "qdd")


class Within(NamedTuple):
    """What a context within a stage knows from the one outside.

    Attributes:
        steps: Steps of edges, by frame, that were worked out before: tables have stages of their own.
        firsts: For ``q``, ``qd`` and ``qdd`` the first column that the state still holds: only those that are read go into a stage.
    """

    steps: Mapping[int, tuple[Step, ...]]
    firsts: Mapping[str, int]


class Context:
    """What a computation over a tree reads: the tree, the state's components, the batch shape and the dtype."""

    def __init__(self, tree: FrameTree, state: State, order: int, within: Within | None = None):
        self.tree, self.topology, self.order = tree, tree.topology, order
        self.dtype = jnp.promote_types(float_dtype(tree.parameters), float_dtype(state))
        self._firsts: Mapping[str, int] = dict.fromkeys(JOINT_FIELDS, 0) if within is None else within.firsts
        if within is None:
            self._check_joints(state)
        self.shape = self._batch_shape(state)
        self.state = state
        self._steps: dict[int, tuple[Step, ...]] = {} if within is None else dict(within.steps)

    @property
    def time(self) -> tuple[jax.Array, jax.Array] | None:
        """The epoch in two parts."""
        time = self.state.time
        return None if time is None else (self._ranked(time.hi, 0), self._ranked(time.lo, 0))

    @property
    def kind(self) -> Kind:
        """What the motions computed are like."""
        return Kind(self.shape, self.dtype, self.order)

    def source(self, frames: Sequence[int], make: "Callable[[Context], Any] | None" = None) -> Source:
        """Return what a function makes of a context within a stage, as a source of whole arrays.

        Args:
            frames: The frames whose edges it reads.
            make: Returns a structure of components. Default: the steps of the edges above the frames, one after the other.
        """
        for frame in frames:
            self.check(frame)
        given = {frame: self.steps(frame) for frame in frames if self.tree._edge(frame).needs_time}
        state, firsts = self.state, {}
        for kind in JOINT_FIELDS:
            first, last = self._window(kind, frames)
            firsts[kind] = first
            array = getattr(state, kind)
            if last - first < array.shape[-1]:
                state = replace(state, **{kind: lax.slice_in_dim(array, first, last, axis=array.ndim - 1)})

        def steps(inside: Context) -> tuple[Step, ...]:
            return folded(step for frame in frames for step in inside.steps(frame))

        return self._inside(make or steps, state, given, firsts)

    def inside(self, make: "Callable[[Context], Any]", state: State) -> Source:
        """Return what a function makes of a context within a stage, of a state like this one's and edges that need no time."""
        return self._inside(make, state, {}, dict.fromkeys(JOINT_FIELDS, 0))

    def _inside(
        self, make: "Callable[[Context], Any]", state: State, given: Mapping[int, tuple[Step, ...]], firsts: Mapping[str, int]
    ) -> Source:
        def made(tree: FrameTree, state: State, given: Mapping[int, tuple[Step, ...]]) -> Any:
            return make(Context(tree, state, self.order, Within(given, firsts)))

        return source_of(made, self.tree, state, given)

    def _window(self, kind: str, frames: Sequence[int]) -> tuple[int, int]:
        """Return the first column of ``q``, ``qd`` or ``qdd`` that edges read, and the one after the last."""
        spans = []
        for frame in frames:
            while self.topology.sources[frame] >= 0:
                frame = self.topology.sources[frame]
            first_q, nq, first_v, nv = self.topology.coordinates[frame]
            spans.append((first_q, nq) if kind == "q" else (first_v, nv))
        used = [(first, first + count) for first, count in spans if count]
        return (min(first for first, _ in used), max(last for _, last in used)) if used else (0, 0)

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
        first -= self._firsts[kind]
        array = self._ranked(getattr(self.state, kind), 1)
        return tuple(column(array, first + i) for i in range(count))

    def gathered(self, kind: str, columns: np.ndarray) -> jax.Array:
        """Return some columns of ``q``, ``qd`` or ``qdd`` as one component [*batch, n]."""
        return self._whole(picked(self._ranked(getattr(self.state, kind), 1), columns, -1), 0)

    def _whole(self, array: jax.Array, trailing: int) -> jax.Array:
        """Return an array of several frames, [n] or [*batch, n] before its trailing axes, with all batch axes."""
        return lax.expand_dims(array, range(len(self.shape) + 1 + trailing - array.ndim))

    def prescribed(self, rows: np.ndarray) -> Rigid:
        """Return several of the motions that the state holds for prescribed edges, components [*batch, n]."""
        ranked = (self._ranked(leaf, 2) for leaf in self._leaves(self.state.prescribed))
        return motion_of(self._whole(picked(leaf, rows, -2), 1) for leaf in ranked)

    def attachment(self, row: int) -> tuple[jax.Array, Rigid]:
        """Return the parent's index and the motion relative to it of an attachable frame, by its row in the state."""
        held = self.state.attachments
        assert held is not None
        parents = held.parents[..., row]
        missing = len(self.shape) - parents.ndim if parents.ndim else 0
        return (lax.expand_dims(parents, range(missing)) if missing else parents), self._held(held.motion, row)

    def _held(self, held: Motion, row: int) -> Rigid:
        """Return one of the motions that a state holds, as far as the order asks."""
        return motion_of(self._ranked(lax.index_in_dim(leaf, row, leaf.ndim - 2, keepdims=False), 1) for leaf in self._leaves(held))

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
        return jax.tree.map(self.converted, self.tree._edge(frame))

    def converted(self, leaf: Any) -> Any:
        """Return a parameter in the common dtype, if it is a float."""
        return leaf.astype(self.dtype) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf

    def steps(self, frame: int) -> tuple[Step, ...]:
        """Return the steps of the edge above a frame; those of tables are worked out once, however often they are asked for.

        Raises:
            NoAccelerationError: Accelerations are asked for and the edge has none.
            MissingInputError: The edge needs the time and the state has none.
        """
        if frame in self._steps:
            return self._steps[frame]
        self.check(frame)
        edge = self.edge(frame)
        steps = edge.steps(self.inputs(frame), self.order)
        if edge.needs_time:
            self._steps[frame] = steps
        return steps

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

    def rates_of(self, frame: int) -> tuple[int, ...]:
        """Return the index in ``qd`` of each rate that moves the edge above a frame."""
        first, _ = self._driver(frame)
        return tuple(first + i for i in range(len(self.coordinates(frame)[1])))

    def unit_twists(self, frame: int) -> list[tuple[V3, V3]]:
        """Return, for each rate of the edge above a frame, the edge's velocity (angular, linear) for a unit of it."""
        _, scale = self._driver(frame)
        edge, own = self.edge(frame), self.inputs(frame)
        count = len(own.qd)
        ones = [tuple(scale if i == j else 0.0 for j in range(count)) for i in range(count)]
        steps = (edge.steps(own._replace(qd=one, qdd=(0.0,) * count), 1) for one in ones)
        moved = (append_all(AT_REST, each, 1) for each in steps)
        return [(motion.angular, motion.linear) for motion in moved]

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
            prescribed=None if row < 0 else self._held(self.state.prescribed, row),
            batch_rank=len(self.shape),
        )


def picked(array: jax.Array, places: np.ndarray, axis: int) -> jax.Array:
    """Return places along an axis: the array itself, a slice where they are evenly spaced, else a gather."""
    step = int(places[1] - places[0]) if len(places) > 1 else 1
    if step > 0 and np.all(np.diff(places) == step):
        if len(places) == array.shape[axis]:
            return array
        return lax.slice_in_dim(array, int(places[0]), int(places[-1]) + 1, step, axis=axis)
    index = (..., places.astype(np.int32), *[slice(None)] * (-1 - axis))
    return array.at[index].get(mode="promise_in_bounds", unique_indices=len(np.unique(places)) == len(places))
