"""URDF: a robot's links and joints as a tree of frames, read with the standard library only.

The format is that of ROS (https://wiki.ros.org/urdf/XML): every link is a frame, every joint the edge from its parent link to its
child link. Kinematics is read strictly; inertial, visual and collision data are kept as properties without being looked at.
"""

import functools
import heapq
import math
from collections.abc import Callable
from os import PathLike
from typing import Any

from jaxframes import edges
from jaxframes.edges.base import Edge
from jaxframes.edges.mimic import ring_in
from jaxframes.errors import (
    DuplicateNameError,
    EdgeError,
    FrameError,
    TopologyError,
    UnknownFrameError,
    UnknownJointError,
    suggest,
)
from jaxframes.io.urdf_attributes import IN_JOINT, IN_LINK, KEPT_IN_JOINT, ZERO, bounds_of, check_attributes, placement
from jaxframes.io.xml_nodes import Node, facts, parse, read
from jaxframes.spatial import Transform
from jaxframes.tree import FrameTree, TreeBuilder

TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
UNLIMITED = 1e300
"""Limits of at least this magnitude mean none (URDF has no word for a prismatic joint without limits)."""


def load_urdf(source: str | PathLike[str] | bytes, *, mimic: bool = True) -> FrameTree:
    """Return the tree of a robot described in URDF.

    Every link is a frame with the link's name, every joint the edge above its child link with the joint's name; the two are
    separate name spaces. Fixed joints stay frames of their own. ``q`` is in the file's order of joints. Joints that mimic
    another take no entries in ``q``. A floating joint becomes ``Free``, a planar one ``Planar`` in the plane across its axis, as
    the format says (Pinocchio 4 always takes z). Rotations are ``rpy``, or ``quat_xyzw`` of URDF 1.1. Meshes are not looked for,
    ``package://`` is not resolved, nothing is fetched.

    Args:
        source: Path of a file, or the text itself (which starts with ``<``).
        mimic: Whether mimic joints follow the joint that they name. With False each one has coordinates of its own.

    Returns:
        A tree rooted in the link that is no joint's child. Properties: of a frame ``inertial``, ``visual``, ``collision`` and
        ``joint`` (what the joint above it says beside its motion); of the root also ``robot`` (the name) and ``ignored``
        (how often each unknown element was met, and each unknown attribute, as ``"joint/limit/@current"``).

    Raises:
        FormatError: The text is no URDF: not XML, xacro, a document type, an unknown joint type, numbers that are none, or
            an attribute that is not understood on an element that says where a link is.
        TopologyError: Links do not form one tree, or joints mimic each other in a ring.
        DuplicateNameError: Two links or two joints share a name.
        UnknownFrameError: A joint names a link that does not exist.
        UnknownJointError: A joint mimics one that does not exist.
        EdgeError: A zero axis, or limits that are reversed.
    """
    data, label = read(source)
    robot = parse(data, label)
    _check_root(robot)
    links, joints, ignored = _collect(robot)
    root, ordered = _ordered(robot, links, joints)
    followed = _followed(joints) if mimic else {}
    builder = TreeBuilder(root=root)
    builder.set_properties(root, {**_link_facts(links[root]), "robot": robot.attributes.get("name", ""), "ignored": ignored})
    moving = set()
    for joint in ordered:
        child, edge = _end(joint, "child", links), _edge(joint, followed)
        about = {**_link_facts(links[child]), "joint": _joint_facts(joint)}
        try:
            builder.add(child, parent=_end(joint, "parent", links), edge=edge, joint=joint.text("name"), properties=about)
        except FrameError as error:
            joint.fail(str(error), type(error))
        if edge.nq:
            moving.add(joint.text("name"))
    builder.order_joints([name for name in (node.text("name") for node in joints) if name in moving])
    try:
        return builder.build()
    except FrameError as error:
        raise type(error)(f"{label}: {error}") from None


def _check_root(robot: Node) -> None:
    if robot.tag.startswith("xacro:"):
        robot.fail("this is xacro, not URDF; expand it first: xacro file.xacro > file.urdf")
    if robot.tag != "robot":
        other = {"mujoco": "; read MJCF with jf.load_mjcf", "sdf": "; convert SDF to URDF first"}.get(robot.tag, "")
        robot.fail(f"the outermost element of a URDF is <robot>{other}")


def _collect(robot: Node) -> tuple[dict[str, Node], list[Node], dict[str, int]]:
    """Return the links by name, the joints in order, and how often unknown elements occur."""
    links: dict[str, Node] = {}
    joints: dict[str, Node] = {}
    ignored: dict[str, int] = check_attributes(robot)
    for node in robot:
        if node.tag.startswith("xacro:"):
            node.fail("this is xacro, not URDF; expand it first: xacro file.xacro > file.urdf")
        table = {"link": links, "joint": joints}.get(node.tag)
        if table is None:
            ignored[node.tag] = ignored.get(node.tag, 0) + 1
            continue
        name = node.text("name")
        if "${" in name or "$(" in name:
            node.fail("the name holds a xacro expression; expand the file with xacro first")
        if name in table:
            node.fail(f"a second {node.tag} of this name, after line {table[name].line}; rename one", DuplicateNameError)
        table[name] = node
        known = IN_LINK if node.tag == "link" else (*IN_JOINT, *KEPT_IN_JOINT)
        for inner in node:
            if inner.tag.startswith("xacro:"):
                inner.fail("this is xacro, not URDF; expand it first: xacro file.xacro > file.urdf")
            if inner.tag not in known:
                key = f"{node.tag}/{inner.tag}"
                ignored[key] = ignored.get(key, 0) + 1
    if not links:
        robot.fail("the robot has no <link>; a URDF needs at least one")
    return links, list(joints.values()), ignored


def _end(joint: Node, side: str, links: dict[str, Node]) -> str:
    """Return the link that a joint's <parent> or <child> names."""
    node = joint.one(side)
    if node is None:
        joint.fail(f"it has no <{side}>; add <{side} link=.../>")
    name = node.attributes.get("link")
    if not name:
        joint.fail(f"its <{side}> of line {node.line} names no link; add link=...")
    if name not in links:
        joint.fail(f"its {side} link {name!r} does not exist.{suggest(name, links)}", UnknownFrameError)
    return name


def _ordered(robot: Node, links: dict[str, Node], joints: list[Node]) -> tuple[str, list[Node]]:
    """Return the root link, and the joints in the file's order as far as parents can come before their children."""
    above: dict[str, Node] = {}
    below: dict[str, list[int]] = {name: [] for name in links}
    for i, joint in enumerate(joints):
        parent, child = _end(joint, "parent", links), _end(joint, "child", links)
        if child == parent:
            joint.fail(f"link {child!r} hangs on itself; name another parent or child", TopologyError)
        if child in above:
            other = above[child]
            joint.fail(
                f"link {child!r} has two parents: joint {other.text('name')!r} of line {other.line} holds it too; "
                f"remove one of the two joints (URDF has no closed loops)",
                TopologyError,
            )
        above[child] = joint
        below[parent].append(i)
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        shown = ", ".join(repr(name) for name in roots[:5])
        unread = "".join(_unread(node) for node in robot if node.tag not in ("link", "joint") and _is_joint(node))
        links[roots[1]].fail(f"{len(roots)} links hang on nothing: {shown}; one root is needed: connect the others{unread}", TopologyError)
    order: list[int] = []
    ahead = list(below[roots[0]]) if roots else []
    while ahead:
        i = heapq.heappop(ahead)
        order.append(i)
        for j in below[_end(joints[i], "child", links)]:
            heapq.heappush(ahead, j)
    if len(order) < len(joints):
        seen = set(order)
        ring = _ring(next(i for i in range(len(joints)) if i not in seen), joints, above, links)
        ring[0].fail(f"a cycle of joints: {' -> '.join(repr(j.text('name')) for j in ring)}; remove one of them", TopologyError)
    return roots[0], [joints[i] for i in order]


def _is_joint(node: Node) -> bool:
    """Whether an element that is not read looks like a joint: by its name, or because it names a parent and a child."""
    return "joint" in node.tag.lower() or {"parent", "child"} <= {inner.tag for inner in node}


def _unread(node: Node) -> str:
    what = "".join(f" {key}={node.attributes[key]!r}" for key in ("name", "type") if key in node.attributes)
    return f". <{node.tag}{what}> of line {node.line} is not read: URDF's element is <joint>, of type {', '.join(TYPES)}"


def _ring(start: int, joints: list[Node], above: dict[str, Node], links: dict[str, Node]) -> list[Node]:
    """Return the joints of the cycle that is reached upwards from one of them."""
    seen: dict[str, Node] = {}
    at = joints[start]
    while at.text("name") not in seen:
        seen[at.text("name")] = at
        at = above[_end(at, "parent", links)]
    names = list(seen)
    return [seen[name] for name in names[names.index(at.text("name")) :]]


def _followed(joints: list[Node]) -> dict[str, Node]:
    """Return the <mimic> of each joint that follows another; unknown joints and rings are refused."""
    kinds = {joint.text("name"): joint.attributes.get("type") for joint in joints}
    by_name = {joint.text("name"): joint for joint in joints}
    followed = {}
    for name, joint in by_name.items():
        node = joint.one("mimic")
        if node is not None and kinds[name] != "fixed":  # some real files have the tag on joints that were fixed afterwards
            followed[name] = node
    targets = {name: node.attributes.get("joint", "") for name, node in followed.items()}
    for name, node in followed.items():
        joint, target = by_name[name], node.attributes.get("joint")
        if not target:
            joint.fail(f"its <mimic> of line {node.line} names no joint; add joint=...")
        if target not in by_name:
            known = suggest(target, (other for other in by_name if other != name))
            joint.fail(f"it mimics {target!r}, which does not exist.{known} Or load with mimic=False", UnknownJointError)
        if kinds[target] == "fixed":
            joint.fail(f"it mimics {target!r}, which is fixed; mimic a joint that moves, or load with mimic=False", EdgeError)
    if ring := ring_in(targets):
        by_name[ring[0]].fail(f"it mimics itself: {' -> '.join(ring)}; one of them must move on its own", TopologyError)
    return followed


def _edge(joint: Node, followed: dict[str, Node]) -> Edge:
    """Return the edge that a joint stands for."""
    kind = joint.text("type")
    if kind not in TYPES:
        joint.fail(f"unknown joint type {kind!r}.{suggest(kind, TYPES)} URDF knows {', '.join(TYPES)}")
    name, at = joint.text("name"), placement(joint)
    if kind == "fixed":
        return edges.Fixed(at)
    make, node = _moving(joint, kind, at, joint.one("limit")), followed.get(name)
    factors = (1.0, 0.0) if node is None else (node.number("multiplier", 1.0), node.number("offset", 0.0))
    try:
        return make() if node is None else edges.Mimic(node.text("joint"), make(), *factors)
    except EdgeError as error:  # what an edge refuses; what the file says wrongly has been refused with its place above
        joint.fail(str(error), EdgeError)


def _moving(joint: Node, kind: str, at: Transform, limit: Node | None) -> Callable[[], Edge]:
    """Return a function that makes the edge of a joint that moves; what the file says of it is read and checked before."""
    if kind == "floating":
        return functools.partial(edges.Free, at)
    axis = _axis(joint)
    if kind == "planar":
        return functools.partial(edges.Planar, axis, at)
    velocity, effort = (_magnitude_limit(limit, name) for name in ("velocity", "effort"))
    magnitude_limits: dict[str, Any] = {"velocity_limits": velocity, "effort_limits": effort}
    if kind == "continuous":
        return functools.partial(edges.Continuous, axis, at, **magnitude_limits)
    if limit is None:
        joint.fail(f"a {kind} joint needs <limit lower=... upper=.../>; add it" + ", or use type='continuous'" * (kind == "revolute"))
    bounds = bounds_of(joint, limit)
    if bounds[0] > bounds[1]:
        limit.fail(f"the limits of joint {joint.text('name')!r} are reversed: lower {bounds[0]:g} is above upper {bounds[1]:g}", EdgeError)
    free = tuple(math.copysign(math.inf, b) if abs(b) >= UNLIMITED else b for b in bounds)
    return functools.partial(edges.Revolute if kind == "revolute" else edges.Prismatic, axis, at, free, **magnitude_limits)


def _magnitude_limit(limit: Node | None, name: str) -> float:
    """Return a velocity or effort limit: infinite where it is not given."""
    value = math.inf if limit is None else limit.number(name, math.inf)
    return math.inf if abs(value) >= UNLIMITED else abs(value)


def _axis(joint: Node) -> tuple[float, ...]:
    node = joint.one("axis")
    axis = (1.0, 0.0, 0.0) if node is None else node.numbers("xyz", 3, (1.0, 0.0, 0.0))
    if not any(axis):
        joint.fail(f"its <axis> of line {node.line if node else joint.line} is zero; give a direction such as '0 0 1'", EdgeError)
    return axis


def _link_facts(link: Node) -> dict[str, Any]:
    return {tag: value for tag, value in facts(link).items() if tag in IN_LINK}


def _joint_facts(joint: Node) -> dict[str, Any]:
    """Return what a joint says beside its motion, and its rpy angles as written, so that they can be written again."""
    found = {tag: value for tag, value in facts(joint).items() if tag in KEPT_IN_JOINT}
    if joint.attributes["type"] in ("planar", "floating") and (limit := joint.one("limit")) is not None:
        found["limit"] = facts(limit)
    origin = joint.one("origin")
    if origin is not None and any(rpy := origin.numbers("rpy", 3, ZERO)):
        found["rpy"] = rpy
    return {"type": joint.attributes["type"], **found}
