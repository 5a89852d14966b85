"""Motions of all edges relative to their parents, worked out at once and without a compiler: the numbers of a page.

A query between two frames compiles a program; a page that opens on 5 000 frames cannot wait for that. Here every family of edges
says its steps on NumPy components, one array over all its edges, and nothing is composed: a page composes the few edges of the
pair that somebody looks at. Tables over time are evaluated by the operation that queries use, which is compiled once.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.mimic import Mimic
from jaxframes.errors import MissingInputError, NoAccelerationError
from jaxframes.kinematics import queries
from jaxframes.model.state import State
from jaxframes.numerics.components import V3, Quat
from jaxframes.numerics.path_motion import with_halves
from jaxframes.numerics.rigid import AT_REST, Rigid
from jaxframes.numerics.steps import Step, append_all
from jaxframes.numerics.trig import numpy_sin_cos
from jaxframes.spatial import Motion, SpatialAcceleration
from jaxframes.staging.columns import OnHost
from jaxframes.tree import FrameTree

WIDTH = 19
"""Numbers a frame: wxyz, position, angular and linear velocity, angular and linear acceleration."""
FIELDS = {"rotation": 4, "translation": 3, "angular": 3, "linear": 3, "angular2": 3, "linear2": 3}
NO_ACCELERATION = WIDTH - 6
Row = tuple[Any, ...]
NOTHING = Rigid(Quat(*[np.nan] * 4), *(V3(*[np.nan] * 3) for _ in range(5)))
"""The motion of what has none."""


def local_motions(tree: FrameTree, state: State) -> np.ndarray:
    """Return the motion of every frame relative to its parent in a state, float64 [..., n_frames, 19] in the order of ``names``.

    A row holds wxyz, position (m), angular and linear velocity (rad/s, m/s), angular and linear acceleration (rad/s2, m/s2), all in the
    axes of the parent: what ``tree.motion`` says of a frame and its parent. The root's row is the identity at rest.

    Args:
        tree: The tree, its numbers known.
        state: One instant, or a batch of them. An attachable frame's parent is the one that it has there.

    Returns:
        The rows. Accelerations are NaN where an edge has none, rows are NaN outside a table's span and where a state has no time
        that the edge needs.
    """
    shape = np.broadcast_shapes(state.shape, tree.batch_shape)
    found = np.zeros((*shape, len(tree.names), WIDTH))
    found[..., 0] = 1.0
    reader = _Reader(tree, state, len(shape))
    with np.errstate(all="ignore"):  # what is not finite is said by tree.check
        for group, members in enumerate(tree.topology.members):
            if tree.topology.reads[members[0]]:
                for frame in members:
                    _write(found, [frame], *_of_derived(tree, state, frame))
            elif members[0] not in tree.topology.attachables:
                _write(found, members, *reader.family(group, members))
    if state.attachments is not None and tree.topology.attachables:
        _write(found, tree.topology.attachables, _motion(state.attachments.motion, slice(None), len(shape)), True)
    return found


def _write(found: np.ndarray, frames: Sequence[int], motion: Rigid, accelerates: bool) -> None:
    """Put the motions of several edges where they belong."""
    first = 0
    for name, count in FIELDS.items():
        for i, component in enumerate(getattr(motion, name)):
            found[..., list(frames), first + i] = component
        first += count
    if not accelerates:
        found[..., list(frames), NO_ACCELERATION:] = np.nan


def _of_derived(tree: FrameTree, state: State, frame: int) -> tuple[Rigid, bool]:
    """Return the motion of a frame that reads others relative to its parent, and whether it has an acceleration: by a query."""
    names = tree.names[frame], tree.names[tree.topology.parents[frame]]
    try:
        motion, accelerates = queries.between(tree, state, *names), True
    except NoAccelerationError:
        motion, accelerates = queries.between(tree, state, *names, order=1), False
        motion = motion.replace(
            acceleration=jax.tree.map(jnp.zeros_like, SpatialAcceleration(motion.velocity.angular, motion.velocity.linear))
        )
    except MissingInputError:
        return NOTHING, False
    rows = jax.tree.map(lambda leaf: leaf[..., None, :], motion)
    return _motion(rows, slice(None), len(np.shape(motion.transform.translation)) - 1), accelerates


class _Reader:
    """Edges of a tree as functions of a state, on NumPy components with a last axis over the edges."""

    def __init__(self, tree: FrameTree, state: State, rank: int):
        self.tree, self.state, self.rank = tree, state, rank
        self.arrays = [self._ranked(np.asarray(getattr(state, kind), np.float64), 1) for kind in ("q", "qd", "qdd")]

    def _ranked(self, array: np.ndarray, own: int) -> np.ndarray:
        """Return an array with its batch axes padded on the left to the rank."""
        return array.reshape((1,) * (self.rank + own - array.ndim) + array.shape)

    def family(self, group: int, members: Sequence[int]) -> tuple[Rigid, bool]:
        """Return the motions of a family's edges, and whether they have accelerations."""
        topology = self.tree.topology
        first = self.tree.edge_of(members[0])
        if first.needs_time and self.state.time is None:
            return NOTHING, False
        if topology.stacked[group]:
            edge = self._on_host(jax.tree.unflatten(topology.groups[group], self.tree.numbers(members)).normalized())
        else:
            edge = (self.tree.together(group) if len(members) > 1 else first.bare()).normalized()
        alone = not topology.stacked[group] and len(members) == 1
        return self._motion_of(edge, members, alone), first.supports_accelerations

    def _on_host(self, edge: Edge) -> Edge:
        """Return an edge of many with its numbers [*batch, n_edges, k] as NumPy arrays, floats in float64."""
        wide = lambda leaf: np.asarray(leaf, np.float64 if jnp.issubdtype(leaf.dtype, jnp.floating) else None)  # noqa: E731
        return jax.tree.map(lambda leaf: self._ranked(wide(leaf), 2).view(OnHost), edge)

    def _motion_of(self, edge: Edge, members: Sequence[int], alone: bool = False) -> Rigid:
        """Return the motions of a family's edges; ``alone``: the edge is the only one, and its numbers have no axis over edges."""
        order = 2 if self.tree.edge_of(members[0]).supports_accelerations else 1
        row = self.tree.topology.prescribed[members[0]]
        held = None
        if row >= 0:
            held = _motion(self.state.prescribed, [self.tree.topology.prescribed[frame] for frame in members], self.rank)
        q, qd, qdd = self._coordinates(members, edge)
        inputs = Inputs(q, qd, qdd, self._time(len(members)), held, self.rank + 1)
        if alone and inputs.time is not None:
            q, qd, qdd = (tuple(component[..., 0] for component in row) for row in (q, qd, qdd))
            inputs = Inputs(q, qd, qdd, (jnp.asarray(inputs.time[0])[..., 0], jnp.asarray(inputs.time[1])[..., 0]), None, self.rank)
            motion = append_all(AT_REST, with_halves(map(_on_numpy, edge.steps(inputs, order)), numpy_sin_cos), order)
            return jax.tree.map(lambda x: x if isinstance(x, float) else np.asarray(x)[..., None], motion)
        return append_all(AT_REST, with_halves(map(_on_numpy, edge.steps(inputs, order)), numpy_sin_cos), order)

    def _time(self, count: int) -> tuple[jax.Array, jax.Array] | None:
        time = self.state.time
        if time is None:
            return None
        parts = (self._ranked(np.asarray(part), 0)[..., None] for part in (time.hi, time.lo))
        hi, lo = (jnp.asarray(np.broadcast_to(part, (*part.shape[:-1], count))) for part in parts)
        return hi, lo

    def _coordinates(self, members: Sequence[int], edge: Edge) -> tuple[Row, Row, Row]:
        """Return the coordinates, rates and second derivatives that edges of one family read, edge by edge along the last axis."""
        sources = self.tree.topology.sources
        if sources[members[0]] < 0:
            return self._own(members)
        drivers = [sources[frame] for frame in members]
        # Followers of unlike joints are of one family all the same: each reads the first coordinates that it needs of its own source.
        assert isinstance(edge, Mimic)
        rows = [np.empty((*self._extent(), len(members), edge.coordinate + edge.edge.nq)) for _ in range(3)]
        for width in dict.fromkeys(map(self._likeness, drivers)):
            places = [i for i, driver in enumerate(drivers) if self._likeness(driver) == width]
            for out, values in zip(rows, self._values([drivers[i] for i in places]), strict=True):
                for i, value in enumerate(values[: out.shape[-1]]):
                    out[..., places, i] = value
        q, qd, qdd = (tuple(np.moveaxis(row, -1, 0)) for row in rows)
        return edge.follow(q, qd, qdd, self.rank + 1)

    def _likeness(self, frame: int) -> tuple[Any, ...]:
        """Return what edges have in common whose coordinates are read together."""
        topology = self.tree.topology
        return topology.coordinates[frame][1::2], topology.locations[frame][0] if topology.sources[frame] >= 0 else -1

    def _values(self, frames: Sequence[int]) -> tuple[Row, Row, Row]:
        """Return the coordinates with their derivatives of edges that others follow; they may follow others themselves."""
        topology = self.tree.topology
        if topology.sources[frames[0]] < 0:
            return self._own(frames)
        edge = jax.tree.unflatten(topology.groups[topology.locations[frames[0]][0]], self.tree.numbers(frames))
        return self._coordinates(frames, self._on_host(edge))

    def _own(self, frames: Sequence[int]) -> tuple[Row, Row, Row]:
        places = np.array([self.tree.topology.coordinates[frame] for frame in frames])
        rows = []
        for array, at in zip(self.arrays, (0, 2, 2), strict=True):
            rows.append(tuple(array[..., places[:, at] + i] for i in range(places[0, at + 1])))
        return rows[0], rows[1], rows[2]

    def _extent(self) -> tuple[int, ...]:
        return np.broadcast_shapes(*(array.shape[:-1] for array in self.arrays), (1,) * self.rank)


def _on_numpy(step: Step) -> Step:
    """Return a step on NumPy components."""
    return jax.tree.map(lambda x: x if isinstance(x, float) else np.asarray(x, np.float64), step)


def _motion(held: Motion, rows: Any, rank: int) -> Rigid:
    """Return motions that a state holds, leaves [..., n, 4 or 3], on NumPy components."""
    leaves = (held.transform.rotation.wxyz, held.transform.translation, held.velocity.angular, held.velocity.linear)
    parts = []
    for leaf in (*leaves, held.acceleration.angular, held.acceleration.linear):
        array = np.asarray(leaf, np.float64)
        array = array.reshape((1,) * (rank + 2 - array.ndim) + array.shape)[..., rows, :]
        parts.append(np.moveaxis(array, -1, 0))
    return Rigid(Quat(*parts[0]), *[V3(*part) for part in parts[1:]])
