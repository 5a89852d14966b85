"""Context: a tree and a state as edges read them, of one dtype and one batch shape."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.base import Edge, Inputs, Seen
from jaxframes.edges.mimic import Mimic
from jaxframes.errors import MissingInputError, NoAccelerationError, ShapeError
from jaxframes.kinematics.arrays import motion_of
from jaxframes.kinematics.edge_steps import AnySteps, EdgeSteps, PathSteps, PrecomputedSteps, Reading, StateColumns, unit_twists
from jaxframes.model.families import float_dtype
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.numerics.packed import Kind, Packed
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Motion
from jaxframes.staging.arrays import widest
from jaxframes.staging.traced_inputs import Operands, TracedInput

JOINT_FIELDS: tuple[str, ...] = ("q", "qd", "qdd")


class Context:
    """What a computation over a tree reads: the tree, the state's arrays, the batch shape and the dtype.

    Args:
        tree: The tree.
        state: Values at one instant or a batch of them.
        order: 0 for poses, 1 with velocities, 2 with accelerations.
        motions_read: Returns the motions that the edge above a frame reads (``kinematics.derived`` has it).
    """

    def __init__(self, tree: Structure, state: State, order: int, motions_read: Callable[["Context", int], tuple[Seen, ...]]):
        if not isinstance(state, State):
            raise ShapeError(f"a query takes a state, made by tree.state(...), and found {type(state).__name__}")
        self.tree, self.topology, self.order = tree, tree.topology, order
        held = state.attachments  # the numbers of parents, floats among the leaves, are none that are computed with
        self.dtype = widest(tree.dtype, float_dtype((replace(state, attachments=None), held and held.motion)))
        self._check_joints(state)
        self.shape = self._batch_shape(state)
        self.state = state
        self._motions_read = motions_read
        self._worked_out: dict[Any, Any] = {}
        self._edges: dict[int, Edge] = {}

    @property
    def time(self) -> tuple[jax.Array, jax.Array] | None:
        """The epoch in two parts."""
        time = self.state.time
        return None if time is None else (self.reading.ranked(time.hi, 0), self.reading.ranked(time.lo, 0))

    @property
    def kind(self) -> Kind:
        """What the motions computed are like."""
        return Kind(self.shape, self.dtype, self.order)

    @property
    def reading(self) -> Reading:
        """How arrays are read."""
        return Reading(len(self.shape), np.dtype(self.dtype).name, self.order)

    def steps_of(self, frames: Sequence[int]) -> TracedInput:
        """Return the steps of the edges above frames, one after the other, made of whole arrays where they are read."""
        operands = Operands()
        edges = self.edge_steps(frames, operands)
        return TracedInput(PathSteps(edges, self.reading), tuple(operands.arrays))

    def edge_steps(self, frames: Sequence[int], operands: Operands, whole: bool = False) -> tuple[AnySteps, ...]:
        """Return the steps of the edges above frames as functions of arrays.

        Args:
            frames: The frames.
            operands: Takes the arrays.
            whole: Whether to take a state's arrays as they are. Else only the columns go in that the edges read.
        """
        for frame in frames:
            self.check(frame)
        windows = {kind: self._window(kind, frames, whole) for kind in JOINT_FIELDS[: 1 + self.order]}
        return tuple(self._edge_steps(frame, operands, windows) for frame in frames)

    def _edge_steps(self, frame: int, operands: Operands, windows: Mapping[str, tuple[int, jax.Array]]) -> AnySteps:
        edge = self.tree.edge_of(frame)
        if edge.needs_time or edge.reads:
            steps, twists = self._precomputed_steps(frame)
            return PrecomputedSteps(operands.components(steps), operands.components(twists))
        driver, followers = frame, []
        while self.topology.sources[driver] >= 0:
            followers.append(operands.parts(self._read(driver)))
            driver = self.topology.sources[driver]
        first_q, nq, first_v, nv = self.topology.coordinates[driver]
        kept = []
        for kind, (start, array) in windows.items():
            first, count = (first_q, nq) if kind == "q" else (first_v, nv)
            kept.append(StateColumns(operands.place(array) if count else 0, first - start, count))
        row, held = self.topology.prescribed[frame], None
        if row >= 0:
            held = tuple(operands.place(leaf) for leaf in self._leaves(self.state.prescribed)), row
        edge = operands.parts(self._read(frame))
        return EdgeSteps(edge, tuple(kept), (nq, nv), tuple(reversed(followers)), held)

    def _read(self, frame: int) -> Edge:
        """Return the edge above a frame as programs read it: at unit length where it lies on a sphere, without limits."""
        if frame not in self._edges:
            self._edges[frame] = self.tree.edge_of(frame).bare().normalized()
        return self._edges[frame]

    def _window(self, kind: str, frames: Sequence[int], whole: bool) -> tuple[int, jax.Array]:
        """Return the columns of ``q``, ``qd`` or ``qdd`` between the first and the last that edges read, and where they start."""
        array, spans = getattr(self.state, kind), []
        for frame in frames:
            while self.topology.sources[frame] >= 0:
                frame = self.topology.sources[frame]
            first_q, nq, first_v, nv = self.topology.coordinates[frame]
            spans.append((first_q, nq) if kind == "q" else (first_v, nv))
        used = [(first, first + count) for first, count in spans if count]
        first, last = (min(first for first, _ in used), max(last for _, last in used)) if used else (0, 0)
        if whole or last - first == array.shape[-1] or not used:
            return 0, array
        return first, lax.slice_in_dim(array, first, last, axis=array.ndim - 1)

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

        attachable, given = len(self.topology.attachables), state.attachments
        if (0 if given is None else given.links.shape[-1]) != attachable:
            found = "none" if given is None else given.links.shape[-1]
            raise ShapeError(f"this tree has {attachable} attachable frames, the state holds {found}; make it with this tree.state(...)")

    def _batch_shape(self, state: State) -> tuple[int, ...]:
        shapes = [values.shape[:-1] for values in (state.q, state.qd, state.qdd)]
        shapes += [leaf.shape[:-2] for leaf in jax.tree.leaves(state.prescribed)]
        shapes += [part.shape for part in jax.tree.leaves(state.time)]
        if state.attachments is not None:
            shapes += [state.attachments.links.shape[:-1]]
            shapes += [leaf.shape[:-2] for leaf in jax.tree.leaves(state.attachments.motion)]
        shapes.append(self.tree.batch_shape)
        try:
            return jnp.broadcast_shapes(*shapes)
        except ValueError:
            fields = {"q": state.q.shape[:-1], "qd": state.qd.shape[:-1], "qdd": state.qdd.shape[:-1]}
            fields["time"] = () if state.time is None else state.time.shape
            fields["prescribed"] = state.prescribed.transform.shape[:-1]
            text = ", ".join(f"{name} {shape}" for name, shape in fields.items())
            raise ShapeError(f"the batch axes of the state and the tree do not broadcast: {text}") from None

    def gathered(self, kind: str, columns: np.ndarray) -> jax.Array:
        """Return some columns of ``q``, ``qd`` or ``qdd`` as one component [*batch, n]."""
        array = take(self.reading.ranked(getattr(self.state, kind), 1), columns, -1)
        return lax.expand_dims(array, range(len(self.shape) + 1 - array.ndim))

    def attachment(self, row: int) -> tuple[jax.Array, Rigid]:
        """Return the parent's index and the motion relative to it of an attachable frame, by its row in the state."""
        held = self.state.attachments
        assert held is not None
        parents = held.parents[..., row]
        missing = len(self.shape) - parents.ndim if parents.ndim else 0
        return (lax.expand_dims(parents, range(missing)) if missing else parents), self._held(held.motion, row)

    def held_motions(self) -> tuple[jax.Array, ...]:
        """Return the arrays of the motions that the state holds for prescribed edges, as far as the order asks."""
        return self._leaves(self.state.prescribed)

    def packed_motions(self, held: Motion, kind: Kind) -> Packed:
        """Return motions that a state holds, leaves [..., n, 4 or 3], as arrays of a kind [*batch, n]."""
        leaves = [jnp.broadcast_to(leaf, (*kind.shape, leaf.shape[-1])).astype(kind.dtype) for leaf in self._leaves(held)]
        return tuple(jnp.concatenate(leaves[i : i + 2], -1) for i in range(0, len(leaves), 2))

    def _held(self, held: Motion, row: int) -> Rigid:
        """Return one of the motions that a state holds, as far as the order asks."""
        return motion_of(self.reading.ranked(lax.index_in_dim(leaf, row, leaf.ndim - 2, keepdims=False), 1) for leaf in self._leaves(held))

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

    def _precomputed_steps(self, frame: int) -> tuple[tuple[Step, ...], Any]:
        """Return the steps and unit twists of an edge that reads the time or other frames; they are worked out once."""
        return self.worked_out(("steps", frame), lambda: self._steps_beforehand(frame))

    def _steps_beforehand(self, frame: int) -> tuple[tuple[Step, ...], Any]:
        edge, operands = self.tree.edge_of(frame), Operands()
        first_q, nq, first_v, nv = self.topology.coordinates[frame]
        kept = tuple(
            StateColumns(operands.place(getattr(self.state, kind)), *((first_q, nq) if kind == "q" else (first_v, nv)))
            for kind in JOINT_FIELDS[: 1 + self.order]
        )
        own = EdgeSteps(operands.parts(self._read(frame)), kept, (nq, nv)).inputs(operands.arrays, self.reading)
        edge, inputs = self.reading.edge(edge.normalized()), own._replace(time=self.time, motions=self._motions_read(self, frame))
        return edge.steps(inputs, self.order), unit_twists(edge, inputs) if nv else []

    def worked_out(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return what a function makes, which is kept under a key: made once for this computation."""
        if key not in self._worked_out:
            self._worked_out[key] = make()
        return self._worked_out[key]

    def family_steps(self, group: int) -> TracedInput:
        """Return the steps of all edges of a family that reads the time and does not stack, each component [*batch, n_edges]."""
        members = self.topology.members[group]
        self.check(members[0])
        reading = replace(self.reading, rank=len(self.shape) + 1)
        edge = reading.edge(self.tree.together(group).normalized())
        return self.precomputed_input(edge.steps(Inputs(time=self.times(len(members)), batch_rank=reading.rank), self.order), reading)

    def times(self, count: int) -> tuple[jax.Array, jax.Array]:
        """Return the epoch in two parts, for so many edges [*batch, n_edges]."""
        assert self.time is not None
        hi, lo = (jnp.broadcast_to(part[..., None], (*part.shape, count)) for part in self.time)
        return hi, lo

    def precomputed_input(self, steps: tuple[Step, ...], reading: Reading) -> TracedInput:
        """Return steps that were worked out before as a traced input, without unit twists."""
        operands = Operands()
        given = PrecomputedSteps(operands.components(steps), operands.components([]))
        return TracedInput(PathSteps((given,), reading), tuple(operands.arrays))

    def fixed_steps(self, frame: int) -> tuple[Step, ...]:
        """Return the steps of a fixed edge, which reads nothing but its own numbers."""
        return self.reading.edge(self._read(frame)).steps(Inputs(batch_rank=len(self.shape)), self.order)

    def check(self, frame: int) -> None:
        """Raise NoAccelerationError or MissingInputError where the edge above a frame cannot answer."""
        edge, name = self.tree.edge_of(frame), self.topology.names[frame]
        if self.order > 1 and not edge.supports_accelerations:
            raise NoAccelerationError(
                f"the edge of frame {name!r} ({edge.describe()}) supports no accelerations; ask for transform or velocity, "
                f"or put an edge there that does"
            )
        if edge.needs_time and self.time is None:
            raise MissingInputError(f"frame {name!r} hangs on {edge.describe()}, and the state has no time; pass time= to tree.state")

    def rates_of(self, frame: int) -> tuple[int, ...]:
        """Return the index in ``qd`` of each rate that moves the edge above a frame."""
        first, count = 0, self.topology.coordinates[frame][3]
        while (source := self.topology.sources[frame]) >= 0:
            edge = self.tree.edge_of(frame)
            assert isinstance(edge, Mimic)
            first, count, frame = first + edge.coordinate, count or edge.edge.nv, source
        return tuple(self.topology.coordinates[frame][2] + first + i for i in range(count))


def take(array: jax.Array, places: np.ndarray, axis: int) -> jax.Array:
    """Return places along an axis: the array itself, a slice where they are evenly spaced, else a gather."""
    step = int(places[1] - places[0]) if len(places) > 1 else 1
    if step > 0 and np.all(np.diff(places) == step):
        if len(places) == array.shape[axis]:
            return array
        return lax.slice_in_dim(array, int(places[0]), int(places[-1]) + 1, step, axis=axis)
    index = (..., places.astype(np.int32), *[slice(None)] * (-1 - axis))
    return array.at[index].get(mode="promise_in_bounds", unique_indices=len(np.unique(places)) == len(places))
