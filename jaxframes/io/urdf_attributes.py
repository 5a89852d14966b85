"""Attributes of URDF elements: which are read, which are refused, which are counted as ignored; and the poses that they say."""

import difflib
import math
from collections.abc import Iterable

import numpy as np

from jaxframes.errors import suggest
from jaxframes.io.xml_nodes import Node
from jaxframes.numerics import host_quaternions
from jaxframes.spatial import Rotation, Transform
from jaxframes.staging.arrays import unit

IN_LINK = ("inertial", "visual", "collision")
IN_JOINT = ("parent", "child", "origin", "axis", "limit", "mimic")
KEPT_IN_JOINT = ("dynamics", "safety_controller", "calibration")
READ = {
    "joint": ("name", "type", "dont_collapse"),  # the last asks simulators not to fuse a fixed joint away; here none is
    "parent": ("link",),
    "child": ("link",),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "axis": ("xyz",),
    "mimic": ("joint", "multiplier", "offset"),
}
"""Attributes of the elements that say where a link is; any other there could move it, so it is refused."""
LIMITS = ("lower", "upper", "velocity", "effort")
OFF_UNIT = 1e-3
"""How far the length of a quaternion may be from 1: more than three written digits explain."""
ZERO = (0.0, 0.0, 0.0)


def check_attributes(robot: Node) -> dict[str, int]:
    """Return how often each attribute occurs that is not understood and moves no link, as ``"link/@group"``.

    Attributes of ``inertial``, ``visual``, ``collision``, ``dynamics`` and their like are all kept as properties, so none is ignored.

    Raises:
        FormatError: An attribute is not understood on an element that says where a link is, such an element holds others, or the name of an
            element in a joint is one of these misspelled.
    """
    ignored: dict[str, int] = {}
    _count(robot, ("name", "version"), "robot", ignored)
    for link in robot.all("link"):
        _count(link, ("name",), "link", ignored)
    for joint in robot.all("joint"):
        _refuse_others(joint)
        for node in joint:
            if node.tag == "limit":
                _count(node, LIMITS, "joint/limit", ignored)
            elif node.tag in READ:
                _refuse_others(node)
                for inner in node:
                    inner.fail(f"<{node.tag}> holds no elements, so this one is not understood; write it as an attribute, or remove it")
            elif node.tag not in KEPT_IN_JOINT and (close := _misspelled(node.tag, IN_JOINT)):
                node.fail(f"a joint has no such element. Did you mean <{close}>? Rename it, or remove it")
    return ignored


def _refuse_others(node: Node) -> None:
    """Refuse attributes that are not understood where they could move a link."""
    for name in node.attributes:
        if name not in READ[node.tag]:
            node.fail(f"the attribute {name!r} is not understood, and could move a link.{suggest(name, READ[node.tag])}")


def _misspelled(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that another is most likely meant to be; None where none is near."""
    return next(iter(difflib.get_close_matches(word, list(known), n=1, cutoff=0.75)), None)


def _count(node: Node, known: Iterable[str], path: str, ignored: dict[str, int]) -> None:
    for name in node.attributes:
        if name not in known and not name.startswith("xmlns"):
            ignored[f"{path}/@{name}"] = ignored.get(f"{path}/@{name}", 0) + 1


def placement(joint: Node) -> Transform:
    """Return the pose that a joint's <origin> says: ``xyz`` and ``rpy``, or ``xyz`` and ``quat_xyzw`` (URDF 1.1)."""
    node = joint.one("origin")
    if node is None:
        return Transform(Rotation(host_quaternions.from_rpy(ZERO)), np.zeros(3))  # pyright: ignore[reportArgumentType]
    turned = host_quaternions.from_rpy(node.numbers("rpy", 3, ZERO))
    if "quat_xyzw" in node.attributes:
        turned = _quaternion(node)
    return Transform(Rotation(turned), np.array(node.numbers("xyz", 3, ZERO)))  # pyright: ignore[reportArgumentType]


def _quaternion(node: Node) -> np.ndarray:
    if "rpy" in node.attributes:
        node.fail("both 'rpy' and 'quat_xyzw' are given, and each is a rotation; keep one")
    x, y, z, w = node.numbers("quat_xyzw", 4, (0.0, 0.0, 0.0, 1.0))
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if abs(length - 1.0) > OFF_UNIT:
        node.fail(
            f"quat_xyzw={node.attributes['quat_xyzw']!r} has length {length:.6g}, so it is no rotation; give a unit quaternion (x y z w)"
        )
    return unit(np.array([w, x, y, z]))


def bounds_of(joint: Node, limit: Node) -> tuple[float, float]:
    """Return the lower and upper limit as they are written; 0 where one is not given.

    Raises:
        FormatError: A limit is no finite number, or one is missing beside an attribute that is not understood.
    """
    for name in ("lower", "upper"):
        strange = _misspelled(name, [other for other in limit.attributes if other not in LIMITS])
        if name not in limit.attributes and strange:
            limit.fail(f"{name!r} is missing, and the attribute {strange!r} is not understood. Did you mean {name!r}?")
        if limit.attributes.get(name, "").strip().lower().lstrip("+-") in ("inf", "infinity", ".inf"):
            turns = "a joint that turns without end is type='continuous'; " if joint.attributes.get("type") == "revolute" else ""
            limit.fail(f"{name}={limit.attributes[name]!r} is no finite number; {turns}a limit of 1e300 or more means none")
    return limit.number("lower", 0.0), limit.number("upper", 0.0)
