"""Who follows whom: the joints that mimic joints take their coordinates from, resolved by name when a tree is built."""

from collections.abc import Mapping

from jaxframes.errors import EdgeError, TopologyError, UnknownJointError, suggest
from jaxframes.tree.edges.base import Edge
from jaxframes.tree.edges.mimic import Mimic


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
    followers = {name: edge for name, edge in edges.items() if isinstance(edge, Mimic)}
    for name, edge in followers.items():
        joint = joints[name]
        if edge.joint not in frames:
            raise UnknownJointError(f"joint {joint!r} follows {edge.joint!r}, which does not exist.{suggest(edge.joint, frames)}")
        line, at = [joint], frames[edge.joint]
        while isinstance(follower := edges[at], Mimic) and joints[at] not in line:
            line.append(joints[at])
            if follower.joint not in frames:
                break
            at = frames[follower.joint]
        if joints[at] in line:
            ring = " -> ".join([*line, joints[at]])
            raise TopologyError(f"joint {joint!r} follows itself: {ring}; one of them needs coordinates of its own")
        _check(joint, edge, edges[frames[edge.joint]])
        found[name] = index[frames[edge.joint]]
    return tuple(found[name] for name in index)


def _check(joint: str, edge: Mimic, source: Edge) -> None:
    """Refuse a source that cannot be followed."""
    plain = source.edge if isinstance(source, Mimic) else source
    needed = edge.coordinate + edge.edge.nq
    if plain.nq != plain.nv or (plain.curved and plain.nq > 1):
        raise EdgeError(f"joint {joint!r} cannot follow {edge.joint!r}, which is {plain.describe()}: a quaternion cannot be scaled")
    if plain.nq < needed:
        raise EdgeError(
            f"joint {joint!r} follows coordinate {edge.coordinate} of {edge.joint!r}, which is {source.describe()} "
            f"and has {plain.nq or 'none'}; follow a joint that moves"
        )
