"""FrameTree: the compiled tree that users hold; its numbers are leaves, its topology is static."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import jax

from jaxframes.edges.base import Edge
from jaxframes.errors import EdgeError, ShapeError
from jaxframes.kinematics.apparent import ApparentState, checked
from jaxframes.model import parameters
from jaxframes.model.parameter_names import Parameters
from jaxframes.model.state import State
from jaxframes.model.topology import Topology
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench
from jaxframes.tree.attaching import Attaching
from jaxframes.tree.chain import Chain, make_chain
from jaxframes.tree.describe import Described
from jaxframes.tree.engine import engine

Screw = TypeVar("Screw", Twist, Wrench)


@jax.tree_util.register_pytree_with_keys_class
@dataclass(frozen=True, eq=False)
class FrameTree(Parameters, Described, Attaching):
    """A named tree of reference frames; made by ``TreeBuilder.build``.

    Queries name their frames with keywords: ``of`` is the frame asked about, ``relative_to`` the observer, ``expressed_in``
    only the axes of the result (default: ``relative_to``). Every query is a pure function of the tree's numbers and a
    ``State``: it jits, vmaps, scans and differentiates, and broadcasts leading batch axes of tree and state. Paths go through
    the lowest common ancestor, never through the root. Outside the coverage of a table the value and its gradient are NaN.

    Attributes:
        frame_edges: The edge above each frame but the root, in the order of ``names``.
        topology: Names, parents and layout; static, hashable, equal by value.

    As a pytree a tree's children are its edges, and their keys the frames' names: the path of a leaf reads
    ``['camera'].placement.translation``, so whatever stores numbers by their paths keeps each with its frame.
    """

    frame_edges: tuple[Edge, ...]
    topology: Topology

    def tree_flatten(self) -> tuple[tuple[Edge, ...], Topology]:
        """Return the edges, and the topology (for JAX)."""
        return self.frame_edges, self.topology

    def tree_flatten_with_keys(self) -> tuple[list[tuple[Any, Edge]], Topology]:
        """Return the edges with the names of their frames, and the topology (for JAX)."""
        return list(zip(self.topology.keys, self.frame_edges, strict=True)), self.topology

    @classmethod
    def tree_unflatten(cls, topology: Topology, edges: Any) -> "FrameTree":
        """Return the tree of some edges (for JAX)."""
        return cls(tuple(edges), topology)

    def with_edge(self, name: str, edge: Edge) -> "FrameTree":
        """Return a tree with the numbers of one edge replaced by those of an edge of the same family; nothing retraces.

        Raises:
            UnknownFrameError: No such frame.
            EdgeError: The new edge is of another family; build another tree for that.
        """
        frame, old = self.topology.index(name), self.edge(name)
        if not isinstance(edge, Edge):
            raise EdgeError(f"frame {name!r}: expected an edge, found {type(edge).__name__}")
        fresh = parameters.like(edge, old)
        if fresh is None:
            raise EdgeError(f"frame {name!r} hangs on {old.describe()}, which cannot become {edge.describe()}; build another tree")
        return FrameTree((*self.frame_edges[: frame - 1], fresh, *self.frame_edges[frame:]), self.topology)

    def astype(self, dtype: Any) -> "FrameTree":
        """Return the tree with its float numbers converted, e.g. to compute in float32."""
        converted = {id(edge): edge.astype(dtype) for edge in self.distinct_edges}
        return FrameTree(tuple(converted[id(edge)] for edge in self.frame_edges), self.topology)

    def _with_edges(self, edges: tuple[Edge, ...]) -> "FrameTree":
        return FrameTree(edges, self.topology)

    # --- queries ------------------------------------------------------------------------------------------------------------

    def transform(self, state: State, *, of: str, relative_to: str) -> Transform:
        """Return the pose of one frame in another, ``relative_to_T_of``: it maps coordinates of ``of`` to ``relative_to``.

        Args:
            state: Values at one instant or a batch of them.
            of: Frame asked about.
            relative_to: Frame of the observer.

        Returns:
            A ``Transform``: rotation.wxyz [..., 4], translation [..., 3] in metres.

        Raises:
            UnknownFrameError: A name is not in the tree (close names are suggested).
            MissingInputError: The path crosses a table and the state has no time.

        Cost: one composition for each edge on the static path through the common ancestor.
        Gradients: smooth in every input; NaN outside a table's span.
        """
        return self._between(state, of, relative_to, None, 0).transform

    def velocity(self, state: State, *, of: str, relative_to: str, expressed_in: str | None = None) -> SpatialVelocity:
        """Return the velocity of one frame relative to another.

        ``angular`` is the angular velocity of ``of`` relative to ``relative_to``; ``linear`` is the rate of change of the
        coordinates of the origin of ``of``, as an observer fixed in ``relative_to`` sees it.

        Args:
            state: Values at one instant or a batch of them.
            of: Frame asked about.
            relative_to: Frame of the observer.
            expressed_in: Frame whose axes resolve the result. Default: ``relative_to``.

        Returns:
            A ``SpatialVelocity``: angular [..., 3] in rad/s, linear [..., 3] in m/s.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
        """
        return self._between(state, of, relative_to, expressed_in, 1).velocity

    def acceleration(self, state: State, *, of: str, relative_to: str, expressed_in: str | None = None) -> SpatialAcceleration:
        """Return the acceleration of one frame relative to another: the classical second derivative, not Featherstone's.

        ``angular`` and ``linear`` are the derivatives of the coordinates of ``velocity`` in the axes of ``relative_to``;
        ``expressed_in`` then only turns both vectors. The result is therefore not the time derivative of a velocity that is
        expressed in turning axes.

        Args:
            state: Values at one instant or a batch of them.
            of: Frame asked about.
            relative_to: Frame of the observer.
            expressed_in: Frame whose axes resolve the result. Default: ``relative_to``.

        Returns:
            A ``SpatialAcceleration``: angular [..., 3] in rad/s2, linear [..., 3] in m/s2.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
            NoAccelerationError: An edge on the path has no accelerations.
        """
        return self._between(state, of, relative_to, expressed_in, 2).acceleration

    def motion(self, state: State, *, of: str, relative_to: str) -> Motion:
        """Return pose, velocity and acceleration of one frame relative to another, in the axes of ``relative_to``.

        Raises:
            UnknownFrameError: A name is not in the tree.
            MissingInputError: The path crosses a table and the state has no time.
            NoAccelerationError: An edge on the path has no accelerations.
        """
        return self._between(state, of, relative_to, None, 2)

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
        return engine().apparent(self, state, looking=checked(self, of, relative_to, expressed_in, options))

    def world_transforms(self, state: State) -> Transform:
        """Return the poses of all frames in the root, in the order of ``names``: leaves [..., n_frames, 4] and [..., n_frames, 3]."""
        return engine().all_frames(self, state, relative_to=0, order=0).transform

    def world_velocities(self, state: State) -> SpatialVelocity:
        """Return the velocities of all frames relative to the root, leaves [..., n_frames, 3]."""
        return engine().all_frames(self, state, relative_to=0, order=1).velocity

    def world_motions(self, state: State) -> Motion:
        """Return the motions of all frames relative to the root, leaves [..., n_frames, 4 or 3] (NoAccelerationError)."""
        return engine().all_frames(self, state, relative_to=0, order=2)

    def relative_transforms(self, state: State, *, relative_to: str) -> Transform:
        """Return the poses of all frames in one frame, leaves [..., n_frames, 4 or 3] in the order of ``names``.

        Paths start at ``relative_to``: near frames keep their precision even where the root is far away.
        """
        return engine().all_frames(self, state, relative_to=self.topology.index(relative_to), order=0).transform

    def transforms_between(self, state: State, *, of: Sequence[str], relative_to: Sequence[str]) -> Transform:
        """Return the poses of several frames in several others: leaves [..., len(relative_to), len(of), 4 or 3]."""
        if isinstance(of, str) or isinstance(relative_to, str) or not of or not relative_to:
            raise ShapeError(
                f"transforms_between takes lists of frame names that are not empty, found of={of!r}, relative_to={relative_to!r}"
            )
        index = self.topology.index
        return engine().pairs(self, state, of=tuple(map(index, of)), relative_to=tuple(map(index, relative_to)))

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
        return engine().jacobian(self, state, **self._indices(of, relative_to, expressed_in))

    def jacobian_dot(self, state: State, *, of: str, relative_to: str, expressed_in: str | None = None) -> jax.Array:
        """Return the time derivative [..., 6, nv] of ``jacobian`` as the joints, tables and prescribed frames move.

        Where only joints move, ``acceleration`` is ``jacobian @ qdd + jacobian_dot @ qd``.
        """
        return engine().jacobian_dot(self, state, **self._indices(of, relative_to, expressed_in))

    def rate(self, state: State) -> State:
        """Return the time derivative of a state, field by field: the tangent that moves it along (for ``jax.jvp``)."""
        return engine().rate(self, state)

    def express(self, vector: Any, state: State, *, from_: str, to: str) -> jax.Array:
        """Return a free vector [..., 3] given in the axes of one frame in those of another; no origin enters."""
        return self.transform(state, of=from_, relative_to=to).rotation @ vector

    def transport(self, value: Screw, state: State, *, from_: str, to: str) -> Screw:
        """Return a twist or wrench given in the axes and about the origin of one frame in those of another."""
        return value.transform(self.transform(state, of=from_, relative_to=to))

    def chain(self, *, of: str, relative_to: str, oriented: bool = False) -> Chain:
        """Return the static path between two frames as a view of this tree.

        Args:
            of: Frame at the far end.
            relative_to: Frame at the near end, the observer.
            oriented: Demand that ``of`` descends from ``relative_to``.

        Raises:
            UnknownFrameError: A name is not in the tree.
            TopologyError: ``oriented`` and ``of`` is no descendant.
        """
        return make_chain(self, of, relative_to, oriented)

    def rebuild(self) -> Any:
        """Return a ``TreeBuilder`` that holds this tree's frames, edges, joint names and properties, ready to be changed."""
        from jaxframes.tree.builder import TreeBuilder

        return TreeBuilder.from_tree(self)

    def reattached(self, frame: str, to: str, state: State, *, keep: str = "relative") -> "FrameTree":
        """Return a new static tree in which a frame, with all that hangs on it, hangs on another frame (on the host).

        Args:
            frame: The frame to move.
            to: Its new parent.
            state: Where everything is now.
            keep: ``"relative"`` keeps the edge as it is; ``"world"`` keeps the pose that the frame has in ``state``: a joint
                keeps its axis and coordinate and gets another placement, an attachable frame becomes fixed.

        Raises:
            UnknownFrameError: A name is not in the tree.
            TopologyError: The frame is the root, or ``to`` hangs on it.
            EdgeError: ``keep="world"`` and the edge has no placement that could take up the difference.
        """
        from jaxframes.tree.reattach import reattached

        return reattached(self, frame, to, state, keep)

    def _indices(self, of: str, relative_to: str, expressed_in: str | None) -> dict[str, int]:
        index = self.topology.index
        axes = relative_to if expressed_in is None else expressed_in
        return {"of": index(of), "relative_to": index(relative_to), "expressed_in": index(axes)}

    def _between(self, state: State, of: str, relative_to: str, expressed_in: str | None, order: int) -> Motion:
        return engine().between(self, state, order=order, **self._indices(of, relative_to, expressed_in))

    def __str__(self) -> str:
        return self.format()

    def __repr__(self) -> str:
        return f"FrameTree({len(self.names)} frames below {self.root!r}, {len(self.joint_names)} joints)"
