"""States of a tree: made, changed by name, checked."""

from collections.abc import Mapping
from typing import Any

import jax

from jaxframes.errors import MissingInputError
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.tree import joints
from jaxframes.tree.state import State
from jaxframes.tree.structure import Structure


class Stateful(Structure):
    """What a tree can do with states: all pure functions that return a new state."""

    @property
    def dtype(self) -> Any:
        """Float dtype of the tree's numbers."""
        return joints.float_dtype(self.parameters)

    def state(self, *, q: Any = None, qd: Any = None, qdd: Any = None, time: Any = None) -> State:
        """Return a state of this tree.

        Args:
            q: Joint coordinates [..., nq] in the order of ``joint_names``, or a mapping of joint names to values; joints that
                are not named rest at zero. rad and m.
            qd: Joint rates, likewise [..., nv]. Default: zero.
            qdd: Second derivatives, likewise [..., nv]. Default: zero.
            time: ``Epoch``, or seconds past J2000 TDB [...]. Needed by queries that cross a table.

        Raises:
            ShapeError: An array does not fit the tree's joints.
            UnknownJointError: A mapping names a joint that does not exist.
        """
        return joints.make_state(self, q, qd, qdd, time)

    def set_q(self, state: State, values: Mapping[str, Any]) -> State:
        """Return a state with the coordinates of the joints named replaced (UnknownJointError, ShapeError)."""
        return state.replace(q=joints.set_named(self.topology, state.q, values, "q"))

    def set_qd(self, state: State, values: Mapping[str, Any]) -> State:
        """Return a state with the rates of the joints named replaced (UnknownJointError, ShapeError)."""
        return state.replace(qd=joints.set_named(self.topology, state.qd, values, "qd"))

    def set_qdd(self, state: State, values: Mapping[str, Any]) -> State:
        """Return a state with the second derivatives of the joints named replaced (UnknownJointError, ShapeError)."""
        return state.replace(qdd=joints.set_named(self.topology, state.qdd, values, "qdd"))

    def get_q(self, state: State, name: str) -> jax.Array:
        """Return the coordinates [..., k] of a joint (UnknownJointError)."""
        first, count, _, _ = self.topology.coordinates[self.topology.joint_frames[self.topology.joint(name)]]
        return state.q[..., first : first + count]

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
            name: Child frame of a ``Prescribed`` or ``Attachable`` edge.
            transform: Pose of the frame in its parent.
            velocity: Velocity relative to the parent, in the parent's axes, leaves [..., 3].
            acceleration: Derivative of that velocity's coordinates, leaves [..., 3].

        Raises:
            UnknownFrameError: No such frame.
            EdgeError: The frame's edge is neither.
        """
        return joints.set_motion(self.topology, state, name, Motion(transform, velocity, acceleration))  # pyright: ignore[reportArgumentType]

    def coverage(self, state: State) -> Mapping[str, jax.Array]:
        """Return -1 before, 0 inside, +1 after the span of each edge that reads the time, by frame name: int32 [...]."""
        timed = {name: edge for name, edge in self.edges.items() if edge.needs_time}
        if timed and state.time is None:
            raise MissingInputError(f"frame {next(iter(timed))!r} hangs on a table, and the state has no time; pass time= to tree.state")
        return {name: edge.coverage_code(state.time) for name, edge in timed.items()}
