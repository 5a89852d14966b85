"""Two more collections of robots: URDFs against Pinocchio, MJCFs against MuJoCo. Opt-in: ``pytest -m robots`` (extra ``collections``).

Only files are read, so ``pip install --no-deps hello-robot-stretch-urdf robosuite`` is enough beside the extras ``robots`` and ``mujoco``.
"""

import importlib.metadata
import zlib
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.io.mjcf_keyframes import joint_values
from jaxframes.io.mjcf_names import Names
from tests.io.robot_checks import assert_motions

pytestmark = [pytest.mark.robots, pytest.mark.float64]
BOUND = 1e-11
"""Allowed difference, relative to the largest number of its kind."""


def files_of(package, ending, folder=""):
    """The files of an installed package, or none."""
    try:
        found = importlib.metadata.files(package) or ()
    except importlib.metadata.PackageNotFoundError:
        return []
    return sorted(Path(str(file.locate())) for file in found if str(file).endswith(ending) and folder in str(file))


def ask_for(files, package):
    if not files:
        pytest.skip(f"needs the package {package}: pip install --no-deps {package}")


def test_stretch_against_pinocchio(capsys):
    oracle = pytest.importorskip("tests.pinocchio_oracle")
    files = files_of("hello-robot-stretch-urdf", ".urdf")
    ask_for(files, "hello-robot-stretch-urdf")
    links = joints = 0
    for path in files:
        tree, robot = jf.load_urdf(path), oracle.Robot(path)
        rng = np.random.default_rng(zlib.crc32(path.name.encode()))
        q, (qd, qdd) = np.asarray(tree.random(jax.random.key(len(path.name)))), rng.normal(size=(2, tree.nv))
        named = [dict(zip(tree.joint_names, map(float, row), strict=True)) for row in (q, qd, qdd)]
        theirs = robot.motions(tree.names, *named)
        assert_motions(tree, tree.state(q=q, qd=qd, qdd=qdd), theirs, int(rng.integers(len(tree.names))), BOUND)
        again = jf.load_urdf(jf.to_urdf(tree))
        assert (again.joint_names, set(again.names)) == (tree.joint_names, set(tree.names))
        links, joints = links + len(tree.names), joints + tree.nv
    assert len(files) >= 13
    with capsys.disabled():
        print(f"\nhello-robot-stretch-urdf: {len(files)} files, {links} links, {joints} joints agree with Pinocchio")


def assert_bodies(mujoco, model, data, tree, state, velocities):
    """Compare all bodies that have a name, and every fixed site and camera, at what MuJoCo's data hold."""
    mujoco.mj_forward(model, data)
    with jax.disable_jit():
        poses, speeds = tree.world_transforms(state), tree.world_velocities(state)
    places, turns = np.asarray(poses.translation), np.asarray(poses.rotation.to_matrix()).reshape(-1, 9)
    mine = np.concatenate([speeds.angular, speeds.linear], -1)
    index = {name: i for i, name in enumerate(tree.names)}
    names = Names(mujoco, model)
    for i in range(model.nbody):
        at, velocity = index[names.body(i)], np.zeros(6)
        assert np.abs(places[at] - data.xpos[i]).max() <= BOUND * (1 + np.abs(data.xpos[i]).max()), names.body(i)
        assert np.abs(turns[at] - data.xmat[i]).max() <= BOUND, names.body(i)
        if velocities:
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, i, velocity, 0)
            assert np.abs(mine[at] - velocity).max() <= BOUND * (1 + np.abs(velocity).max()), names.body(i)
    for kind, where in (("site", data.site_xpos), ("camera", data.cam_xpos)):
        for i, place in enumerate(where):
            if (name := names.extra(kind, i)) in index:
                assert np.abs(places[index[name]] - place).max() <= BOUND * (1 + np.abs(place).max()), name
    return model.nbody


def compiled(mujoco, path):
    """The model in a file, or None for a part of one, which MuJoCo refuses by itself."""
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return None


def test_robosuite_against_mujoco(capsys, tmp_path, monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings into a file where it runs
    files = files_of("robosuite", ".xml", "assets/")
    ask_for(files, "robosuite")
    models = bodies = keyframes = left_out = 0
    for path in files:
        if (model := compiled(mujoco, path)) is None:
            continue
        tree, data = jf.load_mjcf(model), mujoco.MjData(model)
        mujoco.mj_resetData(model, data)
        bodies += assert_bodies(mujoco, model, data, tree, tree.state(), velocities=False)
        for i, state in enumerate(jf.mjcf_keyframes(tree).values()):
            mujoco.mj_resetDataKeyframe(model, data, i)
            assert_bodies(mujoco, model, data, tree, state, velocities=True)
            keyframes += 1
        rng, free = np.random.default_rng(zlib.crc32(path.name.encode())), jf.load_mjcf(model, mimic=False)
        mujoco.mj_integratePos(model, data.qpos, rng.normal(size=model.nv), 0.7)
        data.qvel[:] = rng.normal(size=model.nv)
        q, qd = joint_values(model, Names(mujoco, model), data.qpos, data.qvel)
        assert_bodies(mujoco, model, data, free, free.state(q=q, qd=qd), velocities=True)
        models, left_out = models + 1, left_out + len(tree.properties[tree.root].get("ignored", {}))
    assert models >= 40
    with capsys.disabled():
        counts = f"{models} of {len(files)} files are models, {bodies} bodies, {keyframes} keyframes"
        print(f"\nrobosuite: {counts} agree with MuJoCo at rest and moved; {left_out} things named as ignored")
