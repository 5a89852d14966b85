"""MJCF: MuJoCo compiles the model, its arrays become a tree (the extra ``mujoco``).

What the arrays mean: https://mujoco.readthedocs.io, "mjModel" and "Kinematic tree"; a body's joints act one after another in the
body's own axes, each about its own anchor point, after the body's fixed pose in its parent.
"""

import importlib
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from jaxframes import edges
from jaxframes.edges.base import Edge
from jaxframes.errors import FormatError, MissingExtraError
from jaxframes.io.xml_nodes import MOST_BYTES
from jaxframes.spatial import Rotation, Transform
from jaxframes.tree import FrameTree, TreeBuilder

FREE, BALL, SLIDE, HINGE = range(4)
Pose = tuple[np.ndarray, np.ndarray]
"""Quaternion wxyz [4] and position [3]."""


def load_mjcf(source: Any) -> FrameTree:
    """Return the tree of a model described in MJCF, as MuJoCo compiles it.

    Every body is a frame, and so is every site and camera (a camera looks along its -z). Joints keep their names: a hinge becomes
    ``Revolute``, a slide ``Prismatic``, a ball ``Ball``, a free joint ``Free``; a mocap body is ``Movable``. Where a body has
    several joints, or one whose anchor is not the body's origin, frames called ``body/joint`` stand between parent and body.
    Things without a name are called after their kind and number (``body_3``, with ``_`` after it while the model has that name); a site
    or camera whose name is taken gets ``site:`` or ``camera:`` before it. ``q`` is in MuJoCo's order of joints, with MuJoCo's values (a
    joint's ``ref`` included) but for free joints: (quaternion, position) here, (position, quaternion) there. Rates of free joints are
    (angular, linear) in the body's axes here; MuJoCo's are linear in the world's axes, then angular in the body's. Equality constraints,
    tendons and actuators are not looked at.

    Args:
        source: Path of an MJCF file (or of a URDF, which MuJoCo reads too), the text itself, or a compiled ``mujoco.MjModel``.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        FormatError: MuJoCo refuses the model; its message is part of ours.
    """
    mujoco = _mujoco()
    model: Any = source if isinstance(source, mujoco.MjModel) else _compiled(mujoco, source)
    names = _Names(mujoco, model)
    builder = TreeBuilder(root=names.body(0))
    for body in range(1, model.nbody):
        _add_body(builder, model, names, body)
    for kind, count in (("site", model.nsite), ("camera", model.ncam)):
        prefix = {"site": "site", "camera": "cam"}[kind]
        owner, quat, place = (getattr(model, f"{prefix}_{part}") for part in ("bodyid", "quat", "pos"))
        for i in range(count):
            parent = names.body(int(owner[i]))
            builder.add(
                names.extra(kind, i, builder), parent=parent, edge=edges.Fixed(_transform((quat[i], place[i]))), properties={"mjcf": kind}
            )
    builder.order_joints([names.joint(j) for j in range(model.njnt)])
    return builder.build()


def _mujoco() -> Any:
    try:
        return importlib.import_module("mujoco")
    except ImportError as error:
        raise MissingExtraError("reading MJCF needs the package 'mujoco': pip install 'jaxframes[mujoco]'") from error


def _compiled(mujoco: Any, source: Any) -> Any:
    if not isinstance(source, (str, PathLike)):
        raise FormatError(f"a path, text or a mujoco.MjModel is needed, found {type(source).__name__}")
    is_text = isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<")
    label = "the text given" if is_text else str(source)
    if not is_text and not Path(source).is_file():
        raise FormatError(f"{label!r} is no file; give the path of a file, or text that starts with '<'")
    size = len(str(source)) if is_text else Path(source).stat().st_size
    if size > MOST_BYTES:
        raise FormatError(f"{label} has {size} bytes, more than the {MOST_BYTES} that are read; is it the right file?")
    try:
        return mujoco.MjModel.from_xml_string(source) if is_text else mujoco.MjModel.from_xml_path(str(source))
    except ValueError as error:
        raise FormatError(f"{label}: MuJoCo refuses the model: {error}") from None


class _Names:
    """Names of frames and joints, made up where the model has none: other than all that it has."""

    def __init__(self, mujoco: Any, model: Any):
        counts = {"body": model.nbody, "joint": model.njnt, "site": model.nsite, "camera": model.ncam}
        kinds = {kind: getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}") for kind in counts}
        self._given = {kind: [mujoco.mj_id2name(model, kinds[kind], i) for i in range(count)] for kind, count in counts.items()}
        self._frames = {name for kind in ("body", "site", "camera") for name in self._given[kind] if name}
        joints = {name for name in self._given["joint"] if name}
        self._bodies = [name or _unlike(f"body_{i}", self._frames) for i, name in enumerate(self._given["body"])]
        self._joints = [name or _unlike(f"joint_{i}", joints) for i, name in enumerate(self._given["joint"])]

    def body(self, i: int) -> str:
        """Return the name of a body."""
        return self._bodies[i]

    def joint(self, i: int) -> str:
        """Return the name of a joint."""
        return self._joints[i]

    def between(self, body: int, joint: int) -> str:
        """Return a name for the frame between a body's parent and the body, below one of its joints."""
        return _unlike(f"{self._bodies[body]}/{self._joints[joint]}", self._frames)

    def extra(self, kind: str, i: int, builder: TreeBuilder) -> str:
        """Return a name for a site or camera that no frame has yet."""
        name = self._given[kind][i] or _unlike(f"{kind}_{i}", self._frames)
        while name in builder.names:
            name = f"{kind}:{name}"
        return name


def _unlike(name: str, taken: set[str]) -> str:
    """Return a name, with underscores after it while it is taken; it is taken then."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _add_body(builder: TreeBuilder, model: Any, names: _Names, body: int) -> None:
    """Add a body, with a frame for each of its joints but the last where the last can end in the body's own frame."""
    name, parent = names.body(body), names.body(int(model.body_parentid[body]))
    at: Pose = (model.body_quat[body], model.body_pos[body])
    if model.body_mocapid[body] >= 0:
        builder.add(name, parent=parent, edge=edges.Movable(_transform(at)))
        return
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    for j in range(first, first + count):
        joint, kind, anchor = names.joint(j), int(model.jnt_type[j]), np.array(model.jnt_pos[j])
        if kind in (FREE, SLIDE):  # their anchor moves nothing
            anchor = np.zeros(3)
        edge = _joint(model, j, (at[0], at[1] + _turned(at[0], anchor)))
        last = j == first + count - 1 and not anchor.any()
        frame = name if last else names.between(body, j)
        builder.add(frame, parent=parent, edge=edge, joint=joint)
        parent, at = frame, (np.array([1.0, 0.0, 0.0, 0.0]), -anchor)
        if last:
            return
    builder.add(name, parent=parent, edge=edges.Fixed(_transform(at)))


def _joint(model: Any, j: int, at: Pose) -> Edge:
    """Return the edge of a joint at a pose in what comes before it; a reference value is folded into the placement."""
    kind, axis = int(model.jnt_type[j]), np.array(model.jnt_axis[j])
    bounds = tuple(model.jnt_range[j]) if model.jnt_limited[j] else None
    if kind == FREE:
        return edges.Free()  # its coordinates are the pose in the world, whatever the model says of the body
    if kind == BALL:
        return edges.Ball(_transform(at))
    rest = float(model.qpos0[model.jnt_qposadr[j]])
    if kind == HINGE:
        turned = _product(at[0], np.array([np.cos(rest / 2), *(-np.sin(rest / 2) * axis)]))
        return edges.Revolute(axis, _transform((turned, at[1])), bounds)
    return edges.Prismatic(axis, _transform((at[0], at[1] - rest * _turned(at[0], axis))), bounds)


def _transform(at: Pose) -> Transform:
    wxyz = np.asarray(at[0], np.float64)
    return Transform(Rotation(wxyz / np.linalg.norm(wxyz)), np.array(at[1], np.float64))  # pyright: ignore[reportArgumentType]


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    scalar, vector = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([scalar, *vector])


def _turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    across = 2.0 * np.cross(q[1:], v)
    return v + q[0] * across + np.cross(q[1:], across)
