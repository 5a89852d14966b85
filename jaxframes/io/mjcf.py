"""MJCF: MuJoCo compiles the model, its arrays become a tree (the extra ``mujoco``).

What the arrays mean: https://mujoco.readthedocs.io, "mjModel" and "Kinematic tree"; a body's joints act one after another in the
body's own axes, each about its own anchor point, after the body's fixed pose in its parent.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxframes import edges
from jaxframes.edges.base import Edge
from jaxframes.io import mjcf_source
from jaxframes.io.mjcf_equality import Following, followers
from jaxframes.io.mjcf_keyframes import BALL, FREE, HINGE, SLIDE, joint_values, keyframe_facts
from jaxframes.io.mjcf_names import Names
from jaxframes.numerics import host_quaternions
from jaxframes.spatial import Rotation, Transform
from jaxframes.tree import FrameTree, TreeBuilder

Pose = tuple[np.ndarray, np.ndarray]
"""Quaternion wxyz [4] and position [3]."""
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def load_mjcf(source: Any, *, mimic: bool = True) -> FrameTree:
    """Return the tree of a model described in MJCF, as MuJoCo compiles it.

    Every body is a frame, and so is every site and every camera that is fixed to its body (a camera looks along its -z). Cameras of the
    modes ``track``, ``trackcom``, ``targetbody`` and ``targetbodycom`` move by what other bodies do: they are left out and named in
    ``properties["ignored"]``; lights of any mode are no frames. Joints keep their names: a hinge becomes ``Revolute``, a slide
    ``Prismatic``, a ball ``Ball``, a free joint ``Free``; a mocap body is ``Movable``. Where a body has several joints, or one whose
    anchor is not the body's origin, frames called ``body/joint`` stand between parent and body. Things without a name are called after
    their kind and number (``body_3``, with ``_`` after it while the model has that name); a site or camera whose name is taken gets
    ``site:`` or ``camera:`` before it.

    ``tree.state()`` is the model's ``qpos0``; ``jf.mjcf_keyframes(tree)`` holds the states of its keyframes. ``q`` is in MuJoCo's order of
    joints, with MuJoCo's values (a joint's ``ref`` included) but for free joints: (quaternion, position) here, (position, quaternion)
    there. Rates of free joints are (angular, linear) in the body's axes here; MuJoCo's are linear in the world's axes, then angular in the
    body's. A joint that an equality constraint ties to another, linearly and so that ``qpos0`` and all keyframes obey it, becomes a
    ``Mimic`` without entries in ``q``. Tendons and actuators are not looked at.

    Args:
        source: Path of an MJCF file, the text itself, a ``mujoco.MjSpec``, or a compiled ``mujoco.MjModel``.
        mimic: Whether joints follow by equality constraints. With False each one has coordinates of its own, as in MuJoCo's ``qpos``.

    Returns:
        A tree rooted in the world body. Properties of the root: ``keyframes``, and ``ignored``, why each thing by name (``"camera 'eye'"``,
        ``"equality 'rope'"``) is left out; of a site or camera ``mjcf``, its kind.

    Raises:
        MissingExtraError: MuJoCo is not installed.
        FormatError: MuJoCo refuses the model (its message is part of ours); it is text that includes files, which could be any; or it is a
            URDF: MuJoCo would fuse fixed links away and drop mimic joints, so ``jf.load_urdf`` reads those.

    What MuJoCo warns of is a ``FrameWarning``.
    """
    mujoco, model = mjcf_source.mujoco(), mjcf_source.compiled(source)
    names = Names(mujoco, model)
    tied, ignored = followers(mujoco, model, names)
    follow = tied if mimic else {}
    builder = TreeBuilder(root=names.body(0))
    rest, _ = joint_values(model, names, model.qpos0, np.zeros(model.nv))
    for body in range(1, model.nbody):
        _add_body(builder, model, names, body, follow, rest)
    for kind, count in (("site", model.nsite), ("camera", model.ncam)):
        prefix = {"site": "site", "camera": "cam"}[kind]
        owner, quat, place = (getattr(model, f"{prefix}_{part}") for part in ("bodyid", "quat", "pos"))
        for i in range(count):
            name = names.extra(kind, i)
            if kind == "camera" and model.cam_mode[i] != mujoco.mjtCamLight.mjCAMLIGHT_FIXED:
                mode = mujoco.mjtCamLight(int(model.cam_mode[i])).name.removeprefix("mjCAMLIGHT_").lower()
                ignored[f"camera {name!r}"] = f"mode {mode}: its pose depends on that of other bodies"
                continue
            edge = edges.Fixed(_transform((quat[i], place[i])))
            builder.add(name, parent=names.body(int(owner[i])), edge=edge, properties={"mjcf": kind})
    builder.order_joints([names.joint(j) for j in range(model.njnt)])
    facts = {"keyframes": keyframe_facts(model, names, follow), "ignored": ignored}
    builder.set_properties(builder.root, {key: value for key, value in facts.items() if value})
    return builder.build()


def _add_body(builder: TreeBuilder, model: Any, names: Names, body: int, follow: Mapping[int, Following], rest: Mapping[str, Any]) -> None:
    """Add a body, with a frame for each of its joints but the last where the last can end in the body's own frame.

    Args:
        builder: Where it goes.
        model: The compiled model.
        names: Names of its things.
        body: Number of the body.
        follow: What joints follow.
        rest: Coordinates at ``qpos0`` by joint.
    """
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
        edge = _joint(model, j, (at[0], at[1] + host_quaternions.rotate(at[0], anchor)), rest[joint])
        if j in follow:
            edge = edges.Mimic(names.joint(follow[j].joint), edge, follow[j].multiplier, follow[j].offset)
        last = j == first + count - 1 and not anchor.any()
        frame = name if last else names.between(body, j)
        builder.add(frame, parent=parent, edge=edge, joint=joint)
        parent, at = frame, (IDENTITY, -anchor)
        if last:
            return
    builder.add(name, parent=parent, edge=edges.Fixed(_transform(at)))


def _joint(model: Any, j: int, at: Pose, rest: Any) -> Edge:
    """Return the edge of a joint at a pose in what comes before it; a reference value is folded into the placement."""
    kind, axis = int(model.jnt_type[j]), np.array(model.jnt_axis[j])
    bounds = tuple(model.jnt_range[j]) if model.jnt_limited[j] else None
    if kind == FREE:
        return edges.Free(rest=rest)  # its coordinates are the pose in the world, whatever the model says of the body
    if kind == BALL:
        return edges.Ball(_transform(at), angle_limit=None if bounds is None else max(bounds))
    own = rest or None  # zero is where a joint starts anyway
    if kind == HINGE:
        back = host_quaternions.from_rotation_vector(-rest * axis)
        return edges.Revolute(axis, _transform((host_quaternions.multiply(at[0], back), at[1])), bounds, rest=own)
    return edges.Prismatic(axis, _transform((at[0], at[1] - rest * host_quaternions.rotate(at[0], axis))), bounds, rest=own)


def _transform(at: Pose) -> Transform:
    wxyz = np.asarray(at[0], np.float64)
    return Transform(Rotation(wxyz / np.linalg.norm(wxyz)), np.array(at[1], np.float64))  # pyright: ignore[reportArgumentType]
