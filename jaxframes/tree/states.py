"""States of a tree: made, changed by name, checked."""

from collections.abc import Mapping
from typing import Any

import jax

from jaxframes.edges.mimic import Mimic
from jaxframes.errors import MissingInputError, TopologyError
from jaxframes.model import joint_values
from jaxframes.model.joint_space import Manifold, same_batch
from jaxframes.model.state import State
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform


class Stateful(Manifold):
    """What a tree can do with states: all pure functions that return a new state."""

    def state(self, *, q: Any = None, qd: Any = None, qdd: Any = None, time: Any = None) -> State:
        """Return a state of this tree.

        Args:
            q: Joint coordinates [..., nq] in the order of ``joint_names``, or a mapping of joint names to values; joints that
                are not named rest at zero. rad and m. Plain numbers and lists take the tree's dtype, arrays of floats keep theirs, in
                either form; a query computes in the widest dtype of tree and state.
            qd: Joint rates, likewise [..., nv]. Default: zero.
            qdd: Second derivatives, likewise [..., nv]. Default: zero.
            time: ``Epoch``, or seconds past J2000 TDB [...]. Needed by queries that cross a table.

        Raises:
            ShapeError: An array does not fit the tree's joint_values.
            UnknownJointError: A mapping names a joint that does not exist.
        """
        return joint_values.make_state(self, q, qd, qdd, time)

    def set_q(self, state: State, values: Mapping[str, Any]) -> State:
        """Return a state with the coordinates of the joints named replaced (UnknownJointError, ShapeError)."""
        return state.replace(q=joint_values.set_named(self.topology, state.q, values, "q"))

    def set_qd(self, state: State, values: Mapping[str, Any]) -> State:
        """Return a state with the rates of the joints named replaced (UnknownJointError, ShapeError)."""
        return state.replace(qd=joint_values.set_named(self.topology, state.qd, values, "qd"))

    def set_qdd(self, state: State, values: Mapping[str, Any]) -> State:
        """Return a state with the second derivatives of the joints named replaced (UnknownJointError, ShapeError)."""
        return state.replace(qdd=joint_values.set_named(self.topology, state.qdd, values, "qdd"))

    def get_q(self, state: State, name: str) -> jax.Array:
        """Return the coordinates [..., k] of a joint, also of one that follows another (UnknownJointError)."""
        t = self.topology
        frame = t.edge_index.get(name, 0)
        if t.sources and t.sources[frame] >= 0 and isinstance(edge := self._edge(frame), Mimic):
            followed = self.get_q(state, t.edge_names[t.sources[frame]] or "")[..., edge.coordinate : edge.coordinate + edge.edge.nq]
            factor, offset, followed = same_batch(edge.multiplier, edge.offset, followed)
            return factor * followed + offset
        first, count, _, _ = t.coordinates[t.joint_frames[t.joint(name)]]
        return state.q[..., first : first + count]

    def move_to(self: Any, state: State, name: str, transform: Transform, *, relative_to: str | None = None) -> State:
        """Return a state in which a movable frame has a pose given in any frame (RobWork's moveTo); at what rate, stays.

        Args:
            state: The state to start from.
            name: Child frame of a ``Movable``, ``Prescribed`` or ``Attachable`` edge.
            transform: Its new pose in ``relative_to``.
            relative_to: Frame that the pose is given in, by default the root. It must not hang on the frame that moves.

        Raises:
            UnknownFrameError: A name is not in the tree.
            EdgeError: The frame's edge is none of these.
            TopologyError: ``relative_to`` hangs on the frame.
        """
        observer = self.root if relative_to is None else relative_to
        if self.is_ancestor(name, observer):
            raise TopologyError(f"cannot place {name!r} relative to {observer!r}, which hangs on it and moves along; name another frame")
        parent_T_observer = self.transform(state, of=observer, relative_to=self.parent(name, state))
        return self.set_motion(state, name, parent_T_observer @ transform)

    def extract(self, root: str, *, prefix: str = "") -> Any:
        """Return a frame and all that hangs on it as a tree of its own: the inverse of ``TreeBuilder.include``.

        Extracted copies of one robot have equal topologies (and that of the robot itself), so they share compiled programs.

        Args:
            root: Frame that becomes the root.
            prefix: Text taken off the front of every frame and joint name that starts with it.

        Raises:
            UnknownFrameError: No such frame.
            UnknownJointError: A joint inside follows one outside.
        """
        from jaxframes.tree.extract import extract

        return extract(self, root, prefix)

    def extract_state(self, state: State, root: str) -> State:
        """Return the part of a state that the tree ``extract(root)`` takes (EdgeError where attachable frames are inside)."""
        from jaxframes.tree.extract import extract_state

        return extract_state(self, state, root)

    def set_motion(
        self,
        state: State,
        name: str,
        transform: Transform | None = None,
        velocity: SpatialVelocity | None = None,
        acceleration: SpatialAcceleration | None = None,
    ) -> State:
        """Return a state with the motion of a prescribed or attachable frame in its parent replaced; what is not given stays.

        Args:
            state: The state to start from.
            name: Child frame of a ``Prescribed``, ``Movable`` or ``Attachable`` edge.
            transform: Pose of the frame in its parent.
            velocity: Velocity relative to the parent, in the parent's axes, leaves [..., 3].
            acceleration: Derivative of that velocity's coordinates, leaves [..., 3].

        Raises:
            UnknownFrameError: No such frame.
            EdgeError: The frame's edge is none of these.
        """
        motion = Motion(transform, velocity, acceleration)  # pyright: ignore[reportArgumentType]
        return joint_values.set_motions(self.topology, state, {name: motion})

    def set_motions(self, state: State, motions: Mapping[str, Motion | Transform]) -> State:
        """Return a state with the motions of many prescribed or attachable frames replaced at once.

        Args:
            state: The state to start from.
            motions: For each child frame of a ``Prescribed``, ``Movable`` or ``Attachable`` edge its pose in its parent, or its ``Motion``
                relative to the parent in the parent's axes, of which what is None stays.

        Raises:
            UnknownFrameError: No such frame.
            EdgeError: A frame's edge is none of these.
            ShapeError: A motion is none, or its arrays do not fit.
        """
        return joint_values.set_motions(self.topology, state, motions)

    def coverage(self, state: State) -> Mapping[str, jax.Array]:
        """Return -1 before, 0 inside, +1 after the span of each edge that reads the time, by frame name: int32 [...]."""
        timed = {name: edge for name, edge in self.edges.items() if edge.needs_time}
        if timed and state.time is None:
            raise MissingInputError(f"frame {next(iter(timed))!r} hangs on a table, and the state has no time; pass time= to tree.state")
        return {name: edge.coverage_code(state.time) for name, edge in timed.items()}
