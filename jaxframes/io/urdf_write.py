"""Trees written as URDF: what the format can say of them, with every number exactly."""

import math
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import numpy as np

from jaxframes import edges
from jaxframes.edges.joint import AxisJoint, Joint
from jaxframes.errors import FormatError
from jaxframes.io.urdf_attributes import IN_LINK, KEPT_IN_JOINT
from jaxframes.numerics import host_quaternions
from jaxframes.spatial import Transform
from jaxframes.staging.arrays import is_concrete
from jaxframes.tree import FrameTree

KINDS: dict[type, str] = {
    **{edges.Fixed: "fixed", edges.Revolute: "revolute", edges.Continuous: "continuous", edges.Prismatic: "prismatic"},
    **{edges.Planar: "planar", edges.Free: "floating"},
}
HUGE = 1.7976931348623157e308
"""Written for a limit that is infinite, which URDF cannot say; ``load_urdf`` reads it back as infinite."""


def to_urdf(tree: FrameTree, *, name: str | None = None) -> str:
    """Return a tree as URDF text: a link for each frame, a joint for each edge.

    ``load_urdf`` of the text gives the same frames, joints and kinematics. What ``load_urdf`` kept as properties (inertial,
    visual, collision, dynamics) is written too. Edges without a name become joints called after their frame with ``_joint``
    added. A revolute joint without any limits becomes a continuous one. A joint's ``rest`` has no word in URDF and is not written.

    Args:
        tree: The tree; its numbers must be known (not traced) and without batch axes.
        name: Name of the robot. Default: the one it was loaded with, or its root's.

    Raises:
        FormatError: An edge is of a kind that URDF has no joint for (the frame is named), or its numbers are traced or batched.
    """
    held = tree.properties
    robot = ElementTree.Element("robot", name=name or str(held[tree.root].get("robot") or tree.root))
    for frame in tree.names:
        link = ElementTree.SubElement(robot, "link", name=frame)
        for tag in IN_LINK:
            _write_facts(link, tag, held[frame].get(tag))
    names = _joint_names(tree)
    moving, listed = iter(tree.joint_names), set(tree.joint_names)
    for frame in tree.names[1:]:  # in the order of frames, but joints with coordinates in the order of their coordinates
        joint = next(moving) if names[frame] in listed else names[frame]
        below = tree.frame_of(joint) if joint in listed else frame
        _write_joint(robot, tree, below, joint, held[below].get("joint") or {})
    ElementTree.indent(robot)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(robot, encoding="unicode") + "\n"


def _joint_names(tree: FrameTree) -> dict[str, str]:
    """Return a name for the joint above each frame, made up where the tree has none."""
    found: dict[str, str] = {}
    taken = set(tree.topology.edge_index)
    for frame in tree.names[1:]:
        made = tree.joint_of(frame)
        if made is None:
            made = f"{frame}_joint"
            while made in taken:
                made += "_"
            taken.add(made)
        found[frame] = made
    return found


def _write_joint(robot: Any, tree: FrameTree, frame: str, name: str, about: Mapping[str, Any]) -> None:
    edge, follower = tree.edge(frame), None
    if isinstance(edge, edges.Mimic):
        edge, follower = edge.edge, edge
    if not isinstance(edge, (edges.Fixed, Joint)) or type(edge) not in KINDS or (follower is not None and follower.coordinate):
        known = ", ".join(kind.__name__ for kind in KINDS)
        raise FormatError(f"frame {frame!r} hangs on {edge.describe()}, which URDF has no joint for; it knows {known} and Mimic of these")
    kind = KINDS[type(edge)]
    limits = None if isinstance(edge, (edges.Fixed, edges.Planar, edges.Free)) else _limits(edge)
    if kind == "revolute" and limits is not None and not any(map(math.isfinite, limits[:2])):
        kind = "continuous"
    joint = ElementTree.SubElement(robot, "joint", name=name, type=kind)
    ElementTree.SubElement(joint, "parent", link=tree.parent(frame))
    ElementTree.SubElement(joint, "child", link=frame)
    placement = edge.placement if isinstance(edge, Joint) else edge.transform
    xyz, rpy = _origin(placement, about.get("rpy"), frame)
    ElementTree.SubElement(joint, "origin", xyz=_text(xyz), rpy=_text(rpy))
    if isinstance(edge, AxisJoint):
        ElementTree.SubElement(joint, "axis", xyz=_text(_known(edge.axis, frame)))
    if limits is not None:
        _write_limits(joint, kind, limits)
    if follower is not None:
        factor, offset = (_text(_known(values, frame)) for values in (follower.multiplier, follower.offset))
        ElementTree.SubElement(joint, "mimic", joint=follower.joint, multiplier=factor, offset=offset)
    for tag in (*KEPT_IN_JOINT, *(("limit",) if limits is None else ())):
        _write_facts(joint, tag, about.get(tag))


def _limits(edge: Joint) -> tuple[float, ...]:
    """Return lower, upper, velocity and effort limits."""
    return (*edge.limits, *edge.velocity_limits, *edge.effort_limits)


def _write_limits(joint: Any, kind: str, limits: tuple[float, ...]) -> None:
    words = dict(zip(("lower", "upper", "velocity", "effort"), limits, strict=True))
    if kind == "continuous":
        words = {key: value for key, value in words.items() if key in ("velocity", "effort") and math.isfinite(value)}
    if words:
        text = {key: _text([math.copysign(HUGE, value) if math.isinf(value) else value]) for key, value in words.items()}
        ElementTree.SubElement(joint, "limit", text)


def _origin(placement: Transform, written: Any, frame: str) -> tuple[Any, Any]:
    """Return xyz and rpy of a placement: the angles that it was loaded with where they still say the same."""
    wxyz, xyz = _known(placement.rotation.wxyz, frame), _known(placement.translation, frame)
    if written is not None and np.array_equal(host_quaternions.from_rpy(written).astype(wxyz.dtype), wxyz):
        return xyz, written
    return xyz, host_quaternions.to_rpy(wxyz.astype(np.float64))


def _known(values: Any, frame: str) -> np.ndarray:
    if not is_concrete(values) or np.ndim(values) != 1:
        raise FormatError(f"the numbers of frame {frame!r} are traced or have batch axes; write one tree of known numbers")
    return np.asarray(values)


def _text(values: Any) -> str:
    return " ".join(repr(float(v)) for v in values)


def _write_facts(parent: Any, tag: str, value: Any) -> None:
    """Write what was kept of an element: the inverse of ``facts``."""
    for item in value if isinstance(value, tuple) else (value,):
        if not isinstance(item, Mapping):
            continue
        node = ElementTree.SubElement(parent, tag)
        for key, inner in item.items():
            if isinstance(inner, Mapping) or (isinstance(inner, tuple) and inner and isinstance(inner[0], Mapping)):
                _write_facts(node, key, inner)
            else:
                node.set(key, inner if isinstance(inner, str) else _text(inner if isinstance(inner, tuple) else (inner,)))
