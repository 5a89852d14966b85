"""FrameTree: the compiled tree that users hold; its numbers are leaves, its topology is static."""

from collections.abc import Sequence
from typing import Any, TypeVar

import jax

from jaxframes.errors import says_keywords
from jaxframes.kinematics import queries
from jaxframes.kinematics.apparent import ApparentState, checked
from jaxframes.kinematics.plan import over_all_frames
from jaxframes.model.group import Group
from jaxframes.model.state import State
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench
from jaxframes.tree import edit
from jaxframes.tree.chain import Chain, make_chain
from jaxframes.tree.check import check
from jaxframes.tree.states import States
from jaxframes.tree.text import DumpOptions, explain, format_tree

SpatialQuantity = TypeVar("SpatialQuantity", Twist, Wrench)


@jax.tree_util.register_pytree_with_keys_class
@says_keywords
class FrameTree(States):
    """A named tree of reference frames; made by ``TreeBuilder.build``.

    Queries name their frames with keywords: ``of`` is the frame asked about, ``relative_to`` the observer, ``expressed_in``
    only the axes of the result (default: ``relative_to``). Every query is a pure function of the tree's numbers and a
    ``State``: it jits, vmaps, scans and differentiates, and broadcasts leading batch axes of tree and state. Paths go through
    the lowest common ancestor, never through the root. Outside the coverage of a table the value and its gradient are NaN.
    """

    # --- queries ------------------------------------------------------------------------------------------------------------

    def transform(self, state: State, *, of: str | Group, relative_to: str) -> Transform:
        """Return the pose of one frame in another, ``relative_to_T_of``: it maps coordinates of ``of`` to ``relative_to``.

        Args:
            state: Values at one instant or a batch of them.
            of: Frame asked about, or a group of frames: the result then has a leading axis over them.
            relative_to: Frame of the observer.

        Returns:
            A ``Transform``: rotation.wxyz [..., 4], translation [..., 3] in metres.

        Raises:
            UnknownFrameError: A name is not in the tree (close names are suggested).
            MissingInputError: The path crosses a table and the state has no time.

        Cost: one composition for each edge on the static path through the common ancestor.
        Gradients: smooth in every input; NaN outside a table's span.
        """
        return queries.between(self, state, of, relative_to, None, 0).transform

    def velocity(self, state: State, *, of: str | Group, relative_to: str, expressed_in: str | None = None) -> SpatialVelocity:
        """Return the velocity of one frame relative to another.

        ``angular`` is the angular velocity of ``of`` relative to ``relative_to``; ``linear`` is the rate of change of the
        coordinates of the origin of ``of``, as an observer fixed in ``relative_to`` sees it.

        Args:
            state: Values at one instant or a batch of them.
            of: Frame asked about, or a group of frames: the result then has a leading axis over them.
            relative_to: Frame of the observer.
            expressed_in: Frame whose axes resolve the result. Default: ``relative_to``.

        Returns:
            A ``SpatialVelocity``: angular [..., 3] in rad/s, linear [..., 3] in m/s.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
        """
        return queries.between(self, state, of, relative_to, expressed_in, 1).velocity

    def acceleration(self, state: State, *, of: str | Group, relative_to: str, expressed_in: str | None = None) -> SpatialAcceleration:
        """Return the acceleration of one frame relative to another: the classical second derivative, not Featherstone's.

        ``angular`` and ``linear`` are the derivatives of the coordinates of ``velocity`` in the axes of ``relative_to``;
        ``expressed_in`` then only turns both vectors. The result is therefore not the time derivative of a velocity that is
        expressed in turning axes.

        Args:
            state: Values at one instant or a batch of them.
            of: Frame asked about, or a group of frames: the result then has a leading axis over them.
            relative_to: Frame of the observer.
            expressed_in: Frame whose axes resolve the result. Default: ``relative_to``.

        Returns:
            A ``SpatialAcceleration``: angular [..., 3] in rad/s2, linear [..., 3] in m/s2.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
            NoAccelerationError: An edge on the path has no accelerations.
        """
        return queries.between(self, state, of, relative_to, expressed_in, 2).acceleration

    def motion(self, state: State, *, of: str | Group, relative_to: str) -> Motion:
        """Return pose, velocity and acceleration of one frame relative to another, in the axes of ``relative_to``.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
            NoAccelerationError: An edge on the path has no accelerations.
        """
        return queries.between(self, state, of, relative_to, None, 2)

    def apparent(
        self,
        state: State,
        *,
        of: str,
        relative_to: str,
        expressed_in: str | None = None,
        light_time: bool | str = True,
        aberration: bool = False,
        direction: str = "reception",
        order: int = 2,
    ) -> ApparentState:
        """Return where a frame's origin appears to an observer at the origin of another, by light that takes its time.

        The root's axes must be inertial and its origin one that does not accelerate (the Solar System barycentre): nothing can check it.
        The observer is at the state's time t, the target at t - light time (reception) or t + light time (transmission); joints and
        prescribed motions on the way to the target count as those of that instant. Light travels straight (no delay by gravity).

        Args:
            state: Values at one instant or a batch of them; needs a time.
            of: Frame looked at.
            relative_to: Frame of the observer.
            expressed_in: Frame whose axes, as they are at t, resolve all vectors. Default: the root, not ``relative_to``.
            light_time: True solves the light time to convergence (SPICE's "CN"); "LT" takes one step as SPICE's "LT" does (its
                velocity is not the derivative of its position, and there is no acceleration); False is geometric.
            aberration: Whether the velocity of the observer turns the line of sight (stellar aberration, "+S").
            direction: "reception" of light at t, or "transmission" ("X") of light at t.
            order: 0 for the position, 1 with the velocity, 2 with the acceleration.

        Returns:
            An ``ApparentState`` with leaves [..., 3] and [...].

        Raises:
            UnknownFrameError: A name is not in the tree.
            FrameError: An option has a value that it does not take, or both frames are one.
            MissingInputError: The state has no time.
            NoAccelerationError: An edge on a path has no accelerations that are needed (by ``order=2``, or aberration with order 1).

        Gradients: exact, in forward and reverse mode; the light time by differentiating its equation, not the steps that solve it.
        Precision: float64 meets SPICE's own rounding (a few mm); float32 holds distances from the root to 6e-8 only, 9 km at 1 au.
        """
        options = {"light_time": light_time, "aberration": aberration, "direction": direction, "order": order}
        return queries.apparent(self, state, checked(self, of, relative_to, expressed_in, options))

    def world_transforms(self, state: State) -> Transform:
        """Return the poses of all frames in the root, in the order of ``names``: leaves [..., n_frames, 4] and [..., n_frames, 3]."""
        return queries.all_frames(self, state, self.root, 0).transform

    def world_velocities(self, state: State) -> SpatialVelocity:
        """Return the velocities of all frames relative to the root, leaves [..., n_frames, 3]."""
        return queries.all_frames(self, state, self.root, 1).velocity

    def world_motions(self, state: State) -> Motion:
        """Return the motions of all frames relative to the root, leaves [..., n_frames, 4 or 3] (NoAccelerationError)."""
        return queries.all_frames(self, state, self.root, 2)

    def relative_transforms(self, state: State, *, relative_to: str) -> Transform:
        """Return the poses of all frames in one frame, leaves [..., n_frames, 4 or 3] in the order of ``names``.

        Paths start at ``relative_to``: near frames keep their precision even where the root is far away.
        """
        return queries.all_frames(self, state, relative_to, 0).transform

    def transforms_between(self, state: State, *, of: Sequence[str], relative_to: Sequence[str]) -> Transform:
        """Return the poses of several frames in several others: leaves [..., len(relative_to), len(of), 4 or 3]."""
        return queries.pairs(self, state, of, relative_to)

    def transform_across(self, *, of: str, of_state: State, relative_to: str, relative_to_state: State, fixed: str) -> Transform:
        """Return the pose of a frame at one state in another frame at another state, through a frame taken as fixed.

        For example the pose of a camera when the picture was taken, in the base as it stands now, with the world fixed.

        Args:
            of: Frame asked about, at ``of_state``.
            of_state: Values when ``of`` is looked at.
            relative_to: Frame of the observer, at ``relative_to_state``.
            relative_to_state: Values when the observer looks.
            fixed: Frame that is taken not to move between the two.
        """
        then = self.transform(of_state, of=of, relative_to=fixed)
        return self.transform(relative_to_state, of=fixed, relative_to=relative_to) @ then

    def jacobian(self, state: State, *, of: str, relative_to: str, expressed_in: str | None = None) -> jax.Array:
        """Return the Jacobian [..., 6, nv] of ``velocity`` with respect to ``qd``: angular rows first, then linear.

        ``jacobian @ qd`` is the part of the velocity that the joints cause; it is all of it where nothing else moves.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
        """
        return queries.jacobian(self, state, of, relative_to, expressed_in)

    def jacobians(self, state: State, *, of: Sequence[str], relative_to: str, expressed_in: str | None = None) -> jax.Array:
        """Return the Jacobians of several frames in one call, [..., len(of), 6, nv] (ShapeError if none; else as for ``jacobian``)."""
        return queries.jacobians(self, state, of, relative_to, expressed_in)

    def jacobian_dot(self, state: State, *, of: str, relative_to: str, expressed_in: str | None = None) -> jax.Array:
        """Return the time derivative [..., 6, nv] of ``jacobian`` as the joints, tables and prescribed frames move.

        Where only joints move, ``acceleration`` is ``jacobian @ qdd + jacobian_dot @ qd``.
        """
        return queries.jacobian_dot(self, state, of, relative_to, expressed_in)

    def rate(self, state: State) -> State:
        """Return the time derivative of a state, field by field: the tangent that moves it along (for ``jax.jvp``)."""
        return queries.rate(self, state)

    def express(self, state: State, vector: Any, *, of: str, relative_to: str) -> jax.Array:
        """Return a free vector [..., 3] given in the axes of one frame, ``of``, in those of another, ``relative_to``; no origin enters."""
        return self.transform(state, of=of, relative_to=relative_to).rotation @ vector

    def transport(self, state: State, value: SpatialQuantity, *, of: str, relative_to: str) -> SpatialQuantity:
        """Return a twist or wrench given in the axes and about the origin of one frame, ``of``, in those of another, ``relative_to``."""
        return value.transform(self.transform(state, of=of, relative_to=relative_to))

    def chain(self, *, of: str, relative_to: str, oriented: bool = False, state: State | None = None) -> Chain:
        """Return the path between two frames as a view of this tree.

        Args:
            of: Frame at the far end.
            relative_to: Frame at the near end, the observer.
            oriented: Demand that ``of`` descends from ``relative_to``.
            state: Where attachable frames stand between the two, the state that says what they hang on; the chain is that of this state.

        Raises:
            UnknownFrameError: A name is not in the tree.
            TopologyError: ``oriented`` and ``of`` is no descendant; or attachable frames stand between the two and there is no state.
        """
        return make_chain(self, of, relative_to, oriented, state)

    def reattached(self, state: State, frame: str, to: str, *, keep: str = "relative") -> "FrameTree":
        """Return a new static tree in which a frame, with all that hangs on it, hangs on another frame (on the host).

        Args:
            state: Where everything is now.
            frame: The frame to move.
            to: Its new parent.
            keep: ``"relative"`` keeps the edge as it is; ``"world"`` keeps the pose that the frame has in ``state``: a joint
                keeps its axis and coordinate and gets another placement, an attachable frame becomes fixed.

        Raises:
            UnknownFrameError: A name is not in the tree.
            TopologyError: The frame is the root, or ``to`` hangs on it.
            EdgeError: ``keep="world"`` and the edge has no placement that could take up the difference.
        """
        return edit.reattached(self, state, frame, to, keep)

    def extract(self, root: str, *, prefix: str = "") -> "FrameTree":
        """Return a frame and all that hangs on it as a tree of its own: the inverse of ``TreeBuilder.include``.

        Extracted copies of one robot have equal topologies (and that of the robot itself), so they share compiled programs.

        Args:
            root: Frame that becomes the root.
            prefix: Text taken off the front of every frame and joint name that starts with it.

        Raises:
            UnknownFrameError: No such frame.
            UnknownJointError: A joint inside follows one outside.
        """
        return edit.extract(self, root, prefix)

    def extract_state(self, state: State, root: str) -> State:
        """Return the part of a state that the tree ``extract(root)`` takes (EdgeError where attachable frames are inside)."""
        return edit.extract_state(self, state, root)

    def format(self, options: DumpOptions | None = None, *, state: State | None = None, frame: str | None = None, prefix: str = "") -> str:
        """Return the tree as text, one line a frame.

        Args:
            options: What each line says. Default: names and edges.
            state: With a state, attachable frames stand where they hang in it, and each line gives the pose in the parent (one instant).
            frame: The frame to begin at. Default: the root.
            prefix: Text put before each line.

        Raises:
            UnknownFrameError: No such frame.
            MissingInputError: The options ask for health, and there is no state.
        """
        return format_tree(self, options or DumpOptions(), state, frame, prefix)

    def explain(self, *, of: str | None = None, relative_to: str | None = None, state: State | None = None) -> str:
        """Return text that says which edges a query between two frames touches, in which direction, and what each needs.

        Without ``of``: how queries about all frames go through the tree, and why. Where attachable frames stand between two
        frames, the path depends on the state: pass one to see its path.
        """
        if of is None:
            return over_all_frames(self.topology)
        return explain(self, of, self.root if relative_to is None else relative_to, state)

    def describe(self, state: State, *, of: str, relative_to: str) -> dict[str, Any]:
        """Return all read-outs of a pair of frames.

        Returns:
            ``of``, ``relative_to``, ``path``, ``frames``, ``oriented``, ``edges``, ``supports_accelerations``, ``transform``,
            ``velocity``, ``acceleration`` (None where the chain has none), and the ``parent`` of ``of``.
        """
        path = self.path(of=of, relative_to=relative_to, state=state)
        frames = [relative_to]
        for name, direction in path:
            frames.append(name if direction > 0 else self.parent_name(name, state))
        accelerates = all(self.edge(name).supports_accelerations for name, _ in path)
        names = {"of": of, "relative_to": relative_to}
        return {
            **names,
            "parent": None if of == self.root else self.parent_name(of, state),
            "path": path,
            "frames": tuple(frames),
            "oriented": all(direction > 0 for _, direction in path),
            "edges": {name: self.edge(name).describe() for name, _ in path},
            "supports_accelerations": accelerates,
            "transform": self.transform(state, **names),
            "velocity": self.velocity(state, **names),
            "acceleration": self.acceleration(state, **names) if accelerates else None,
        }

    def check(self, state: State) -> tuple[str, ...]:
        """Return what is wrong with a state and with this tree's numbers, a sentence each, by name; empty if nothing is.

        Looked for: numbers that are not finite, quaternions that are not unit, epochs outside a table, joint limits exceeded.
        Runs on the host: not under jit.
        """
        return check(self, state)

    def __str__(self) -> str:
        return self.format()

    def __repr__(self) -> str:
        return f"FrameTree({len(self.names)} frames below {self.root!r}, {len(self.joint_names)} joints)"
