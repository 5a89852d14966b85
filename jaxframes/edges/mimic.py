"""Joints that follow another joint: mimic joints of URDF, dependent joints of RobWork."""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import jax

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.edges.joint import Joint, one_number
from jaxframes.errors import EdgeError, TopologyError, UnknownJointError, suggest
from jaxframes.numerics.components import Component, add, mul
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Transform
from jaxframes.staging.columns import parameters

Row = tuple[Component, ...]


@family(static=("joint", "coordinate"), name="mimic")
class Mimic(Edge):
    """A joint whose coordinates follow those of another one: ``q = multiplier * q_of_joint + offset``.

    It takes no entries of ``q``, ``qd`` and ``qdd``: rates and accelerations follow with the multiplier, and the Jacobian shows
    what it does in the columns of the joint that it follows. That joint may follow another one in turn; a ring is refused when
    the tree is built. A joint of several coordinates follows as many in a row, from ``coordinate`` on, each with the same
    multiplier and offset. Quaternion joints can neither follow nor be followed. Mobility 0, state size 0.

    Attributes:
        edge: The joint as it would be on its own (axis, placement, limits).
        multiplier: Factor [1].
        offset: What is added [1], rad or m.
        joint: Name of the joint that it follows.
        coordinate: Which of that joint's coordinates is followed (the first).

    Example:
        >>> import jaxframes as jf
        >>> b = jf.TreeBuilder(root="palm")
        >>> b.add("left", parent="palm", edge=jf.edges.Prismatic(axis=(0, 1, 0)))
        >>> b.add("right", parent="palm", edge=jf.edges.Mimic("left", jf.edges.Prismatic(axis=(0, 1, 0)), multiplier=-1.0))
        >>> b.build().joint_names
        ('left',)
    """

    nq: ClassVar[int] = 0
    nv: ClassVar[int] = 0
    edge: Edge
    multiplier: jax.Array
    offset: jax.Array
    joint: str
    coordinate: int

    def __init__(self, joint: str, edge: Edge, multiplier: Any = 1.0, offset: Any = 0.0, coordinate: int = 0):
        if not isinstance(joint, str) or not joint:
            raise EdgeError(f"Mimic(joint=...) takes the name of the joint to follow, found {joint!r}")
        if not isinstance(edge, Edge) or edge.follows is not None:
            raise EdgeError(f"Mimic(edge=...) takes the joint as it would be on its own, such as jf.edges.Revolute(), found {edge!r}")
        if not edge.nq or edge.nq != edge.nv or (edge.is_manifold and edge.nq > 1):
            why = "it has no coordinates" if not edge.nq else "a quaternion cannot be scaled"
            raise EdgeError(f"a joint that is {edge.describe()} cannot follow {joint!r}: {why}")
        if edge.needs_time:
            raise EdgeError(f"a joint that is {edge.describe()} cannot follow {joint!r}: it reads the time")
        if not isinstance(coordinate, int) or coordinate < 0:
            raise EdgeError(f"Mimic(coordinate=...) takes 0 or more, found {coordinate!r}")
        for name, value in (
            *(("edge", edge), ("joint", joint), ("coordinate", coordinate)),
            *(("multiplier", one_number(multiplier, "a multiplier")), ("offset", one_number(offset, "an offset"))),
        ):
            object.__setattr__(self, name, value)

    @property
    def follows(self) -> str | None:
        return self.joint

    @property
    def placement(self) -> Transform:
        """Pose of the joint in the parent where its own coordinates would be zero."""
        if not isinstance(self.edge, Joint):
            raise EdgeError(f"{self.edge.describe()} has no placement of its own to read")
        return self.edge.placement

    @property
    def supports_accelerations(self) -> bool:
        return self.edge.supports_accelerations

    def follow(self, q: Row, qd: Row, qdd: Row, batch_rank: int) -> tuple[Row, Row, Row]:
        """Return its own coordinates and their derivatives from all of those of the joint that it follows."""
        (m,), (o,) = parameters(self.multiplier, batch_rank), parameters(self.offset, batch_rank)
        window = slice(self.coordinate, self.coordinate + self.edge.nq)
        scaled = [tuple(mul(value, m) for value in row[window]) for row in (q, qd, qdd)]
        return tuple(add(value, o) for value in scaled[0]), scaled[1], scaled[2]

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        return self.edge.steps(inputs, order)

    def wiring(self) -> dict[str, Any]:
        return {"joint": self.joint, "coordinate": self.coordinate}

    def renamed(self, rename: Callable[[str], str]) -> "Mimic":
        return self.replace(joint=rename(self.joint))

    def replace(self, **changes: Any) -> "Mimic":
        """Return a copy with fields replaced; ``placement`` is passed on to the joint inside."""
        if "placement" in changes:
            changes["edge"] = changes.get("edge", self.edge).replace(placement=changes.pop("placement"))
        return super().replace(**changes)

    def preceded_by(self, change: Transform) -> "Mimic | None":
        moved = self.edge.preceded_by(change)
        return None if moved is None else self.replace(edge=moved)

    def normalized(self) -> "Mimic":
        return self.replace(edge=self.edge.normalized())

    def directions(self) -> dict[str, Any]:
        return {f"edge.{name}": axis for name, axis in self.edge.directions().items()}

    def bare(self) -> "Mimic":
        """Return the edge without limits and without the name that it follows: where the coordinates come from, the topology says."""
        return self.replace(edge=self.edge.bare(), joint="")

    def describe(self) -> str:
        return f"{self.edge.describe()}, follows {self.joint}"


Dependent = Mimic
"""RobWork's word for the same: DependentRevoluteJoint is ``Dependent(owner, Revolute(...), multiplier=scale, offset=offset)``."""


def sources(edges: Mapping[str, Edge], joints: Mapping[str, str], index: Mapping[str, int]) -> tuple[int, ...]:
    """Return, for each frame, the index of the frame whose edge its own edge follows, or -1.

    Args:
        edges: Edge above each frame.
        joints: Name of the edge above each frame that has one.
        index: Index of each frame.

    Raises:
        UnknownJointError: A joint that is followed does not exist.
        TopologyError: Joints follow each other in a ring.
        EdgeError: The joint that is followed has no such coordinate, or a quaternion.
    """
    frames = {joint: frame for frame, joint in joints.items()}
    found = dict.fromkeys(index, -1)
    followers = {joints[name]: edge for name, edge in edges.items() if isinstance(edge, Mimic)}
    followed = {joint: edge.joint for joint, edge in followers.items()}
    if ring := ring_in(followed):
        raise TopologyError(f"joint {ring[0]!r} follows itself: {' -> '.join(ring)}; one of them needs coordinates of its own")
    for joint, edge in followers.items():
        if edge.joint not in frames:
            raise UnknownJointError(f"joint {joint!r} follows {edge.joint!r}, which does not exist.{suggest(edge.joint, frames)}")
        _check(joint, edge, edges[frames[edge.joint]])
        found[frames[joint]] = index[frames[edge.joint]]
    return tuple(found[name] for name in index)


def ring_in(followed: Mapping[str, str]) -> tuple[str, ...]:
    """Return joints that follow each other in a ring, the first one again at the end; empty where there is none.

    Args:
        followed: The joint that each joint follows, by name, for those that follow one.
    """
    settled: set[str] = set()
    for joint in followed:
        line: dict[str, None] = {}  # in the order in which they are met
        here: str | None = joint
        while here is not None and here not in settled:
            if here in line:
                met = list(line)
                return (*met[met.index(here) :], here)
            line[here] = None
            here = followed.get(here)
        settled.update(line)
    return ()


def _check(joint: str, edge: Mimic, source: Edge) -> None:
    """Refuse a source that cannot be followed."""
    plain = source.edge if isinstance(source, Mimic) else source
    needed = edge.coordinate + edge.edge.nq
    if plain.nq != plain.nv or (plain.is_manifold and plain.nq > 1):
        raise EdgeError(f"joint {joint!r} cannot follow {edge.joint!r}, which is {plain.describe()}: a quaternion cannot be scaled")
    if plain.nq < needed:
        raise EdgeError(
            f"joint {joint!r} follows coordinate {edge.coordinate} of {edge.joint!r}, which is {source.describe()} "
            f"and has {plain.nq or 'none'}; follow a joint that moves"
        )
