"""Chain: the path between two frames as a view of a tree."""

from dataclasses import dataclass, field

import jax

from jaxframes.errors import TopologyError
from jaxframes.kinematics import queries
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.spatial import Motion, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.tree import solve


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class Chain:
    """The edges between an observer and a frame; ``tree.chain(of=, relative_to=)`` makes one.

    Attributes:
        tree: The tree that it is a view of.
        of: Frame at the far end.
        relative_to: Frame at the near end, the observer.
        path: (name of the edge's child frame, +1 downwards or -1 upwards) for each edge, from ``relative_to`` to ``of``.
        frames: The frames that the chain passes, from ``relative_to`` to ``of``.
    """

    tree: Structure
    of: str = field(metadata={"static": True})
    relative_to: str = field(metadata={"static": True})
    path: tuple[tuple[str, int], ...] = field(metadata={"static": True})
    frames: tuple[str, ...] = field(metadata={"static": True})

    def __len__(self) -> int:
        return len(self.path)

    @property
    def oriented(self) -> bool:
        """Whether the chain only goes down: ``of`` descends from ``relative_to``."""
        return all(direction > 0 for _, direction in self.path)

    @property
    def supports_accelerations(self) -> bool:
        """Whether every edge of the chain can say its acceleration (static)."""
        return all(self.tree.edge(name).supports_accelerations for name, _ in self.path)

    def transform(self, state: State) -> Transform:
        """Return the pose of ``of`` in ``relative_to``."""
        return queries.between(self.tree, state, self.of, self.relative_to, order=0).transform

    def velocity(self, state: State, *, expressed_in: str | None = None) -> SpatialVelocity:
        """Return the velocity of ``of`` relative to ``relative_to``."""
        return queries.between(self.tree, state, self.of, self.relative_to, expressed_in, 1).velocity

    def acceleration(self, state: State, *, expressed_in: str | None = None) -> SpatialAcceleration:
        """Return the acceleration of ``of`` relative to ``relative_to`` (NoAccelerationError names the edge that has none)."""
        return queries.between(self.tree, state, self.of, self.relative_to, expressed_in, 2).acceleration

    def motion(self, state: State) -> Motion:
        """Return pose, velocity and acceleration of ``of`` relative to ``relative_to``."""
        return queries.between(self.tree, state, self.of, self.relative_to)

    def subchain_orientation(self, other: "Chain") -> bool | None:
        """Return True if another chain lies on this one in the same direction, False if reversed, None if it does not.

        Static: a Python bool, never traced. A chain without edges counts as True where its frame lies on the path.
        """
        frames = self.frames
        if other.relative_to not in frames or other.of not in frames:
            return None
        return frames.index(other.relative_to) <= frames.index(other.of)

    def solve_transform(self, sub: "Chain", transform: Transform, state: State) -> Transform:
        """Return the pose that ``sub`` must have so that the whole chain has ``transform``; the rest keeps its pose in ``state``.

        Args:
            sub: An oriented part of this chain that starts or ends where this chain does.
            transform: The pose wanted, of ``of`` in ``relative_to``.
            state: Values of the rest of the chain.

        Raises:
            TopologyError: ``sub`` does not start or end where this chain does, or runs against it.
        """
        first, rest = self._split(sub)
        return solve.transform(transform, rest.transform(state), first)

    def solve_velocity(
        self, sub: "Chain", velocity: SpatialVelocity, state: State, *, sub_transform: Transform | None = None
    ) -> SpatialVelocity:
        """Return the velocity that ``sub`` must have so that the whole chain has ``velocity``.

        Args:
            sub: An oriented part of this chain that starts or ends where this chain does.
            velocity: The velocity wanted, of ``of`` as ``relative_to`` sees it, in its axes.
            state: Values of the rest of the chain.
            sub_transform: Pose of ``sub``: solve for it first if it is wanted too. Default: the one that it has in ``state``.

        Raises:
            TopologyError: ``sub`` does not start or end where this chain does, or runs against it.
        """
        first, rest = self._split(sub)
        sub_transform = sub.transform(state) if sub_transform is None else sub_transform
        return solve.velocity(velocity, sub_transform, rest.transform(state), rest.velocity(state), first)

    def solve_acceleration(
        self,
        sub: "Chain",
        acceleration: SpatialAcceleration,
        state: State,
        *,
        sub_transform: Transform | None = None,
        sub_velocity: SpatialVelocity | None = None,
    ) -> SpatialAcceleration:
        """Return the acceleration that ``sub`` must have so that the whole chain has ``acceleration``.

        Args:
            sub: An oriented part of this chain that starts or ends where this chain does.
            acceleration: The acceleration wanted, of ``of`` as ``relative_to`` sees it, in its axes.
            state: Values of the rest of the chain.
            sub_transform: Pose of ``sub``. Default: the one that it has in ``state``.
            sub_velocity: Velocity of ``sub``. Default: the one that it has in ``state``. With pose and velocity solved for first, any
                target is reached exactly.

        Raises:
            TopologyError: ``sub`` does not start or end where this chain does, or runs against it.
        """
        first, rest = self._split(sub)
        sub_transform = sub.transform(state) if sub_transform is None else sub_transform
        sub_velocity = sub.velocity(state) if sub_velocity is None else sub_velocity
        return solve.acceleration(acceleration, sub_transform, sub_velocity, rest.motion(state), first)

    def _split(self, sub: "Chain") -> tuple[bool, "Chain"]:
        if self.subchain_orientation(sub):
            if sub.relative_to == self.relative_to:
                return True, self._part(self.frames.index(sub.of), len(self.path))
            if sub.of == self.of:
                return False, self._part(0, self.frames.index(sub.relative_to))
        raise TopologyError(
            f"cannot solve for the chain {sub.relative_to!r} -> {sub.of!r}: it must be a part of {self.relative_to!r} -> {self.of!r} "
            f"({' -> '.join(self.frames)}) in the same direction, from its start or to its end"
        )

    def _part(self, first: int, last: int) -> "Chain":
        """Return the part of the chain between two of its frames."""
        frames = self.frames[first : last + 1]
        return Chain(self.tree, frames[-1], frames[0], self.path[first:last], frames)

    def __repr__(self) -> str:
        return f"Chain({' -> '.join(self.frames)})"


def make_chain(tree: Structure, of: str, relative_to: str, oriented: bool = False, state: State | None = None) -> Chain:
    """Return the chain between two frames, as attachable frames hang in a state; an oriented one must only go down (TopologyError)."""
    path = tree.path(of=of, relative_to=relative_to, state=state)
    if oriented and any(direction < 0 for _, direction in path):
        line = ", ".join(repr(name) for name in tree.ancestors(of, state)) or "none: it is the root"
        raise TopologyError(
            f"no oriented chain {relative_to!r} -> {of!r}: {of!r} does not descend from {relative_to!r}; its ancestors: {line}"
        )
    frames = (relative_to, *(name if direction > 0 else tree.parent_name(name, state) for name, direction in path))
    return Chain(tree, of, relative_to, path, frames)
