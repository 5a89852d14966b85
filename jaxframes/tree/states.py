"""States of a tree: made, changed by name, checked."""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.mimic import Mimic
from jaxframes.edges.two_vector import TwoVector
from jaxframes.errors import EdgeError, FrameError, MissingInputError, ShapeError, TopologyError, says_keywords
from jaxframes.kinematics import queries
from jaxframes.model import joint_values
from jaxframes.model.attachment_graph import check_target, hangs_on
from jaxframes.model.joint_space import JointSpace, same_batch
from jaxframes.model.state import State
from jaxframes.numerics.two_vector import LEAST_SINE
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.staging.arrays import is_concrete
from jaxframes.tree.fit import JointFit, fit_joint

KEEP = ("relative", "world", "motion")


@says_keywords
class States(JointSpace):
    """What a tree can do with states: all pure functions that return a new state."""

    def state(self, *, q: Any = None, qd: Any = None, qdd: Any = None, time: Any = None) -> State:
        """Return a state of this tree.

        Args:
            q: Joint coordinates [..., nq] in the order of ``joint_names``, or a mapping of joint names to values; joints that
                are not named keep their ``rest``, zero unless the joint says another. rad and m. Plain numbers and lists take the tree's
                dtype, arrays of floats keep theirs, in either form; a query computes in the widest dtype of tree and state.
            qd: Joint rates, likewise [..., nv]. Default: zero.
            qdd: Second derivatives, likewise [..., nv]. Default: zero.
            time: ``Epoch``, or seconds past J2000 TDB [...]. Needed by queries that cross a table.

        Raises:
            ShapeError: An array does not fit the tree's joints.
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
        if t.sources and t.sources[frame] >= 0 and isinstance(edge := self.edge_of(frame), Mimic):
            followed = self.get_q(state, t.edge_names[t.sources[frame]] or "")[..., edge.coordinate : edge.coordinate + edge.edge.nq]
            factor, offset, followed = same_batch(edge.multiplier, edge.offset, followed)
            return factor * followed + offset
        first, count, _, _ = t.coordinates[t.joint_frames[t.joint(name)]]
        return state.q[..., first : first + count]

    def move_to(self, state: State, name: str, transform: Transform, *, relative_to: str | None = None) -> State:
        """Return a state in which a movable frame has a pose given in any frame (RobWork's moveTo); at what rate, stays.

        Args:
            state: The state to start from.
            name: Child frame of a ``Movable``, ``Prescribed`` or ``Attachable`` edge.
            transform: Its new pose in ``relative_to``.
            relative_to: Frame that the pose is given in, by default the root. It must not hang on the frame that moves.

        Raises:
            UnknownFrameError: A name is not in the tree.
            EdgeError: The frame's edge is none of these.
            TopologyError: ``relative_to`` hangs on the frame in this state. Where what it hangs on is traced, the pose is NaN instead.
        """
        observer = self.root if relative_to is None else relative_to
        parents = self.attachments_in(state).parents if self.topology.attachables else np.zeros(0, np.int32)
        follows = hangs_on(self.topology, parents, self.topology.index(observer), self.topology.index(name))
        if is_concrete(follows) and np.any(follows):
            raise TopologyError(f"cannot place {name!r} relative to {observer!r}, which hangs on it and moves along; name another frame")
        pose = queries.between(self, state, observer, self.parent_name(name, state), order=0).transform @ transform
        if not is_concrete(follows):
            pose = jax.tree.map(lambda leaf: jnp.where(follows[..., None], jnp.nan, leaf), pose)
        return self.set_motion(state, name, pose)

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

    def fit_joint(
        self,
        state: State,
        joint: str,
        *,
        transform: Transform,
        velocity: SpatialVelocity | None = None,
        acceleration: SpatialAcceleration | None = None,
        weight: Any = 1.0,
    ) -> JointFit:
        """Return the values of one joint that bring its frame closest to a motion wanted of it, and what is left of that motion.

        So the result of ``chain.solve_transform`` and its like is put into a joint. Closest means: the smallest sum of squares of the angle
        (rad) and of ``weight`` times the distance (m) between the two poses; then the same of the velocities, then of the accelerations.
        What the joint can do it does exactly. Limits are not looked at (``tree.clamp``).

        Args:
            state: Where the search starts: of several places that are closest around, that one is found which lies downhill.
            joint: Name of the joint.
            transform: Pose wanted of the frame below the joint in its parent.
            velocity: Velocity wanted of it relative to the parent, in the parent's axes. Default: the state's rates stay.
            acceleration: Acceleration wanted, likewise (the classical one). Default: the state's second derivatives stay.
            weight: Radians that a metre counts for [...].

        Returns:
            A ``JointFit``: ``state`` with the joint's values, ``q``, ``qd``, ``qdd``, and residuals [..., 6].

        Raises:
            UnknownJointError: No such joint, or it is fixed or follows another.
            ShapeError: A motion is of another type.

        Gradients: exact first derivatives by all numbers but those of the start, also where the motion is out of reach.
        """
        return fit_joint(self, state, joint, transform, velocity, acceleration, weight)

    def coverage(self, state: State) -> Mapping[str, jax.Array]:
        """Return -1 before, 0 inside, +1 after the span of each edge that reads the time, by frame name: int32 [...]."""
        timed = {name: edge for name, edge in self.edges.items() if edge.needs_time}
        if timed and state.time is None:
            raise MissingInputError(f"frame {next(iter(timed))!r} hangs on a table, and the state has no time; pass time= to tree.state")
        return {name: edge.coverage_code(state.time) for name, edge in timed.items()}

    def axes_defined(self, state: State) -> Mapping[str, jax.Array]:
        """Return where the two vectors of each ``TwoVector`` frame define its axes, by frame name: bool [...].

        False where they are parallel to rounding, or one is zero or not a number: everything about the frame is NaN there.
        """
        found = {}
        for name, edge in self.edges.items():
            if isinstance(edge, TwoVector):
                angle = queries.angle_between_vectors(self, state, self.topology.index(name))
                found[name] = jnp.sin(angle) > LEAST_SINE * float(np.finfo(angle.dtype).eps)
        return found

    def attach(self, state: State, frame: str, to: Any, *, keep: str = "relative") -> State:
        """Return a state in which an attachable frame hangs on another frame; nothing retraces when the parent changes.

        Args:
            state: Where everything is now.
            frame: The attachable frame.
            to: The new parent: a name, or frame indices [...] that may be traced (``tree.topology.index(name)``).
            keep: ``"relative"`` keeps the motion relative to the parent, so the frame jumps with its parent's pose. ``"world"``
                keeps the pose in the world and puts the frame at rest on the new parent: a grip. ``"motion"`` keeps pose,
                velocity and acceleration (where every edge of the tree has one) at this instant; it assumes that the caller
                moves the frame on, because a state holds values of one instant only.

        Returns:
            A new state; the old one is as it was, also after an error.

        Raises:
            UnknownFrameError: A name is not in the tree.
            EdgeError: ``frame`` is not attachable.
            TopologyError: ``to`` is the frame itself, hangs on it, or is not among its candidates. For traced indices nothing can
                be raised: poses that depend on the frame are then NaN, and ``attachments_valid`` says where.
        """
        if keep not in KEEP:
            raise FrameError(f"attach(keep=...) takes one of {', '.join(map(repr, KEEP))}, not {keep!r}")
        index = self._attachable(frame, to)
        held = self.attachments_in(state)
        target = self.topology.index(to) if isinstance(to, str) else to
        if not np.issubdtype(jnp.result_type(target), np.integer):
            found = f"an array of {jnp.result_type(target)}{list(np.shape(target))}" if np.ndim(target) else repr(target)
            raise ShapeError(f"attach {frame!r} to a frame's name or to frame indices (integers), found {found}")
        known = not isinstance(target, jax.Array) or is_concrete(target)
        if known:
            check_target(self.topology, held, index, np.asarray(target))
        return queries.attach(self, state, index, jnp.asarray(target, jnp.int32), keep)

    def detach(self, state: State, frame: str, *, keep: str = "world") -> State:
        """Return a state in which an attachable frame hangs on the root (arguments and errors as for ``attach``)."""
        return self.attach(state, frame, self.root, keep=keep)

    def attachments_valid(self, state: State) -> jax.Array:
        """Return where all attachable frames hang, link by link, on the root: bool [...], also under jit."""
        if not self.topology.attachables:
            return jnp.ones((), bool)
        return queries.attachments_valid(self, state)

    def _attachable(self, frame: str, to: Any) -> int:
        index = self.topology.index(frame)
        if index not in self.topology.attachables:
            what = "is the root" if index == 0 else f"is {self.edge_of(index).describe()} on {self.parent(frame)!r}"
            attachable = ", ".join(repr(self.names[i]) for i in self.topology.attachables) or "none"
            raise EdgeError(
                f"cannot attach {frame!r} to {to!r}: {frame!r} {what}, so it stays there; attachable frames: {attachable}. "
                f"Use jf.edges.Attachable()"
            )
        return index
