"""Equality constraints between joints of an MJCF model: linear ones make a joint follow another, others are said to be left out.

The constraint of two joints is ``y - y0 = a0 + a1 (x - x0) + a2 (x - x0)^2 + ...`` with the values at ``qpos0``
(https://mujoco.readthedocs.io, "equality/joint").
"""

from typing import Any, NamedTuple

import numpy as np

from jaxframes.io.mjcf_names import Names

CLOSE = 1e-12
"""How well the model's own poses must obey a constraint, relative to the values."""


class Following(NamedTuple):
    """What a joint follows: ``q = multiplier * q_of_joint + offset``."""

    joint: int
    multiplier: float
    offset: float


def followers(mujoco: Any, model: Any, names: Names) -> tuple[dict[int, Following], dict[str, str]]:
    """Return what each joint follows that an equality constraint ties to another, and why other constraints are left out, by name.

    A joint follows where its constraint is linear, active at the start, and obeyed by ``qpos0`` and by every keyframe: these are poses that
    the tree must be able to take. MuJoCo's constraints are soft, a follower's is exact.

    Args:
        mujoco: The module.
        model: The compiled model.
        names: Names of its things.
    """
    found: dict[int, Following] = {}
    ignored: dict[str, str] = {}
    poses = np.concatenate([model.qpos0[None], np.asarray(model.key_qpos).reshape(model.nkey, model.nq)])
    for i in range(model.neq):
        kind = mujoco.mjtEq(int(model.eq_type[i])).name.removeprefix("mjEQ_").lower()
        why = "no joint follows another by it"
        if model.eq_type[i] == mujoco.mjtEq.mjEQ_JOINT:
            first, second = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
            following = _following(model, i, first, second)
            why = _refused(model, i, first, following, found, poses)
            if not why and following is not None:
                found[first] = following
                continue
        ignored[f"equality {names.equality(i)!r}"] = f"{kind}: {why}"
    return found, ignored


def _following(model: Any, i: int, first: int, second: int) -> Following | None:
    """Return what a constraint says where it is linear and between two joints."""
    shift, factor, *higher = map(float, model.eq_data[i][:5])
    if second < 0 or any(higher):
        return None
    y, x = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (first, second))
    return Following(second, factor, y + shift - factor * x)


def _refused(model: Any, i: int, first: int, following: Following | None, found: dict[int, Following], poses: np.ndarray) -> str:
    """Return why a joint does not follow; empty where it does."""
    if following is None:
        return "it holds one joint alone" if model.eq_obj2id[i] < 0 else "it is not linear"
    if not model.eq_active0[i]:
        return "it is not active at the start"
    if first in found:
        return "its joint follows by another one"
    line = [following.joint]
    while line[-1] in found:
        line.append(found[line[-1]].joint)
    if first in line:
        return "the joint that it would follow follows it"
    y, x = (poses[:, model.jnt_qposadr[j]] for j in (first, following.joint))
    off = np.abs(following.multiplier * x + following.offset - y)
    if np.any(off > CLOSE * (1.0 + np.abs(y))):
        return "the model's own poses do not obey it"
    return ""
