"""Keyframes of an MJCF model: joint values by name, kept as properties of the tree's root, and the states that they are."""

from collections.abc import Container
from typing import Any

import numpy as np

from jaxframes.io.mjcf_names import Names
from jaxframes.model.state import State
from jaxframes.numerics import host_quaternions
from jaxframes.spatial import Rotation, Transform
from jaxframes.staging.arrays import unit
from jaxframes.tree import FrameTree

FREE, BALL, SLIDE, HINGE = range(4)
"""MuJoCo's numbers of the kinds of joints."""


def mjcf_keyframes(tree: FrameTree) -> dict[str, State]:
    """Return the keyframes of a tree that ``load_mjcf`` returned, as states by name; empty where the model has none.

    They are kept in ``tree.properties[tree.root]["keyframes"]``: for each name ``q`` and ``qd`` by joint, ``moved`` (w, x, y, z, px, py,
    pz of each mocap body) and ``time`` (seconds of the simulation, which are no epoch). A joint that follows another has no entry.
    Where the tree has been included in another one, its joints have a prefix: make such states there with
    ``tree.state(q={"arm/" + joint: value, ...})``.

    Args:
        tree: The tree.
    """
    found = {}
    for name, held in tree.properties[tree.root].get("keyframes", {}).items():
        state = tree.state(q=dict(held["q"]), qd=dict(held["qd"]))
        moved = {frame: Transform(Rotation.from_quaternion_wxyz(at[:4]), np.array(at[4:])) for frame, at in held["moved"].items()}  # pyright: ignore[reportArgumentType]
        found[name] = tree.set_motions(state, moved)
    return found


def keyframe_facts(model: Any, names: Names, following: Container[int]) -> dict[str, Any]:
    """Return the keyframes of a model as properties.

    Args:
        model: The compiled model.
        names: Names of its things.
        following: The joints that follow others, which have no values of their own.
    """
    mocaps = {int(model.body_mocapid[body]): names.body(body) for body in range(model.nbody) if model.body_mocapid[body] >= 0}
    found: dict[str, Any] = {}
    for k in range(model.nkey):
        q, qd = joint_values(model, names, model.key_qpos[k], model.key_qvel[k], following)
        places, turns = np.reshape(model.key_mpos[k], (-1, 3)), np.reshape(model.key_mquat[k], (-1, 4))
        moved = {name: (*turns[i].tolist(), *places[i].tolist()) for i, name in mocaps.items()}
        found[names.keyframe(k)] = {"q": q, "qd": qd, "moved": moved, "time": float(model.key_time[k])}
    return found


def joint_values(
    model: Any, names: Names, qpos: np.ndarray, qvel: np.ndarray, following: Container[int] = ()
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return MuJoCo's coordinates and rates as ``q`` and ``qd`` by joint, in the conventions of the tree.

    Free joints have the quaternion first, then the position; their rates are angular, then linear, both in the body's axes.

    Args:
        model: The compiled model.
        names: Names of its things.
        qpos: MuJoCo's coordinates [nq].
        qvel: MuJoCo's rates [nv].
        following: Joints to leave out.
    """
    q: dict[str, Any] = {}
    qd: dict[str, Any] = {}
    for j in range(model.njnt):
        if j in following:
            continue
        kind, name, at, rate = int(model.jnt_type[j]), names.joint(j), int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
        if kind == FREE:
            wxyz = unit(qpos[at + 3 : at + 7])
            linear = host_quaternions.rotate(host_quaternions.conjugate(wxyz), qvel[rate : rate + 3])
            q[name] = (*wxyz.tolist(), *qpos[at : at + 3].tolist())
            qd[name] = (*qvel[rate + 3 : rate + 6].tolist(), *linear.tolist())
        elif kind == BALL:
            q[name], qd[name] = tuple(unit(qpos[at : at + 4]).tolist()), tuple(qvel[rate : rate + 3].tolist())
        else:
            q[name], qd[name] = float(qpos[at]), float(qvel[rate])
    return q, qd
