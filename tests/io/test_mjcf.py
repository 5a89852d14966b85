"""MJCF through MuJoCo: every body, site and camera against MuJoCo's own poses and velocities."""

import sys

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors

mujoco = pytest.importorskip("mujoco")

MODEL = """
<mujoco model="all kinds">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <site name="mark" pos="1 2 3" euler="0.1 0.2 0.3"/>
    <body name="craft" pos="0.3 0.1 0.2" euler="0.3 0 0.1">
      <freejoint name="float"/>
      <geom size="0.1"/>
      <body name="arm" pos="0.1 0.2 0.3" quat="0.9 0.1 -0.2 0.3">
        <joint name="hinge" axis="1 2 3" pos="0.05 -0.02 0.1" range="-2 2" ref="0.4"/>
        <geom size="0.1"/>
        <body name="two" pos="0 0.1 0.5">
          <joint name="slide" type="slide" axis="0 1 1" ref="0.2"/>
          <joint name="turn" axis="0 0 1" pos="0 0 0.1"/>
          <joint name="last" axis="1 0 0"/>
          <geom size="0.1"/>
          <site name="tip" pos="0.1 0 0" euler="0 0 1"/>
          <camera name="eye" pos="0 0 0.2" euler="0.5 0 0"/>
          <body pos="0.2 0 0">
            <joint name="ball" type="ball" pos="0.01 0.02 0.03"/>
            <geom size="0.1"/>
            <site name="craft" pos="0 0 1"/>
          </body>
        </body>
      </body>
    </body>
    <body name="target" mocap="true" pos="0 0 2"><geom size="0.1" contype="0" conaffinity="0"/></body>
    <body name="stone" pos="4 0 0"><geom size="0.1"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(MODEL)


def state_of(tree, model, rng, dtype):
    """A random state for both: MuJoCo's (qpos, qvel) and ours."""
    qpos, qvel = rng.normal(size=model.nq), rng.normal(size=model.nv)
    for first in (3, model.nq - 4):
        qpos[first : first + 4] /= np.linalg.norm(qpos[first : first + 4])
    q, qd = qpos.copy(), qvel.copy()
    q[:7] = [*qpos[3:7], *qpos[:3]]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, qpos[3:7])
    qd[:6] = [*qvel[3:6], *(turn.reshape(3, 3).T @ qvel[:3])]
    return qpos, qvel, tree.state(q=q.astype(dtype), qd=qd.astype(dtype))


def test_poses_and_velocities_are_mujocos(model, rng, dtype):
    tree = jf.load_mjcf(MODEL)
    assert tree.joint_names == ("float", "hinge", "slide", "turn", "last", "ball")
    data = mujoco.MjData(model)
    bound = 1e-12 if dtype == np.float64 else 2e-5
    for _ in range(3):
        qpos, qvel, state = state_of(tree, model, rng, dtype)
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_forward(model, data)
        with jax.disable_jit():
            poses, speeds = tree.world_transforms(state), tree.world_velocities(state)
        frames = {"body": data.xpos, "site": data.site_xpos, "camera": data.cam_xpos}
        matrices = {"body": data.xmat, "site": data.site_xmat, "camera": data.cam_xmat}
        for kind, places in frames.items():
            for i in range(len(places)):
                name = mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), i) or f"{kind}_{i}"
                at = tree.names.index("site:craft" if (kind, name) == ("site", "craft") else name)
                np.testing.assert_allclose(poses.translation[at], places[i], atol=bound, err_msg=name)
                np.testing.assert_allclose(poses.rotation[at].to_matrix().reshape(9), matrices[kind][i], atol=bound)
                velocity = np.zeros(6)
                if kind != "camera":
                    own = mujoco.mjtObj.mjOBJ_XBODY if kind == "body" else mujoco.mjtObj.mjOBJ_SITE
                    mujoco.mj_objectVelocity(model, data, own, i, velocity, 0)
                    mine = np.concatenate([speeds.angular[at], speeds.linear[at]])
                    np.testing.assert_allclose(mine, velocity, atol=20 * bound, err_msg=name)


def test_the_tree_keeps_names_limits_and_kinds():
    tree = jf.load_mjcf(MODEL)
    assert {"world", "craft", "arm", "two", "body_4", "target", "stone", "mark", "tip", "eye", "site:craft"} <= set(tree.names)
    assert tree.parent("tip") == "two"
    assert tree.parent("two") == "two/turn"
    np.testing.assert_allclose(tree.edge(tree.frame_of("hinge")).limits, [-2, 2])
    assert type(tree.edge("target")).__name__ == "Movable"
    state = tree.state()
    np.testing.assert_allclose(tree.transform(state, of="target", relative_to="world").translation, [0, 0, 2])
    assert tree.properties["eye"]["mjcf"] == "camera"


def test_compiled_models_and_files_are_read_too(model, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(MODEL)
    assert jf.load_mjcf(model).topology == jf.load_mjcf(path).topology == jf.load_mjcf(MODEL).topology


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>", "MuJoCo"),
        ("<mujoco>", "MuJoCo"),
        ('<mujoco><worldbody><body pos="0 0 0" rotation="1 0 0"/></worldbody></mujoco>', "rotation"),
        ("no.xml", "no file"),
        (3, "int"),
    ],
)
def test_broken_models_are_refused(source, words):
    with pytest.raises(errors.FormatError, match=words):
        jf.load_mjcf(source)


def test_without_mujoco_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(errors.MissingExtraError, match=r"jaxframes\[mujoco\]"):
        jf.load_mjcf(MODEL)


def test_names_that_are_made_up_are_none_that_the_model_has(dtype):
    two = '<joint name="{}" axis="1 0 0"/><joint {} axis="0 1 0"/><geom size="0.1"/>'
    text = f"""<mujoco><worldbody>
      <body>{two.format("a", "")}
        <body name="body_1" pos="0 0 1"><joint name="joint_1" axis="1 0 0"/><geom size="0.1"/><site name="body_1/a"/></body>
        <body name="s" pos="0 1 0">{two.format("a2", 'name="b2"')}<site/><site name="site_1"/></body>
        <body name="s/a2" pos="1 1 0"><geom size="0.1"/></body>
      </body>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    tree = jf.load_mjcf(model)
    assert len(set(tree.names)) == len(tree.names)
    assert tree.joint_names == ("a", "joint_1_", "joint_1", "a2", "b2")
    assert {"body_1", "body_1_", "s", "s/a2", "s/a2_", "site_1", "site_1_"} <= set(tree.names)
    data, q = mujoco.MjData(model), np.linspace(-0.8, 0.9, model.nq)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    for i, name in ((1, "body_1_"), (2, "body_1"), (3, "s"), (4, "s/a2")):
        pose = tree.transform(tree.state(q=q.astype(dtype)), of=name, relative_to="world")
        np.testing.assert_allclose(pose.translation, data.xpos[i], atol=1e-5)
        np.testing.assert_allclose(pose.rotation.to_matrix().reshape(-1), data.xmat[i], atol=1e-5)


def test_a_kind_before_a_name_takes_the_place_of_no_other_thing():
    sites = '<site name="a"/><site name="site:a" pos="1 0 0"/>'
    text = f'<mujoco><worldbody><body name="a"><geom size="1"/>{sites}<camera name="site:a"/></body></worldbody></mujoco>'
    tree = jf.load_mjcf(text)
    assert tree.names == ("world", "a", "site:a_", "site:a", "camera:site:a")
    place = tree.transform(tree.state(), of="site:a", relative_to="a").translation
    np.testing.assert_array_equal(place, [1, 0, 0])
