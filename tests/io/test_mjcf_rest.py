"""MJCF poses that a model brings: its rest, its keyframes, joints tied to others, limits of balls; against MuJoCo's own."""

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors

mujoco = pytest.importorskip("mujoco")

MODEL = """
<mujoco model="rest">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="craft" pos="1 2 3" quat="0.6 0.8 0 0">
      <freejoint name="float"/>
      <geom size="0.1"/>
      <body name="lid" pos="0.1 0 0"><joint name="hinge" axis="1 2 3" pos="0.05 0 0.1" ref="0.4"/><geom size="0.1"/>
        <body name="rod" pos="0 0.1 0.5" quat="0.8 0 0.6 0"><joint name="slide" type="slide" axis="0 1 1" ref="0.2"/><geom size="0.1"/>
          <camera name="fixed" pos="0 0 0.2"/>
          <camera name="track" mode="track" pos="0 0 0.2"/>
          <camera name="com" mode="trackcom" pos="0 0 0.2"/>
          <camera name="look" mode="targetbody" target="craft" pos="1 0 0.2"/>
          <camera mode="targetbodycom" target="craft" pos="1 0 0.2"/>
          <light name="lamp" mode="targetbody" target="craft" pos="0 0 1"/>
        </body>
      </body>
    </body>
    <body name="head" pos="0 0 5"><joint name="neck" type="ball" range="0 0.5"/><geom size="0.1"/></body>
    <body name="left" pos="0 1 0"><joint name="left" axis="0 0 1"/><geom size="0.1"/></body>
    <body name="right" pos="0 -1 0"><joint name="right" type="slide" axis="1 0 0" ref="0.1"/><geom size="0.1"/>
      <body name="far" pos="0 0 1"><joint name="far" axis="0 1 0"/><geom size="0.1"/></body>
    </body>
    <body name="odd" pos="3 0 0"><joint name="odd" axis="0 0 1"/><geom size="0.1"/></body>
    <body name="goal" mocap="true" pos="0 0 2" quat="0 0 1 0"><geom size="0.1" contype="0" conaffinity="0"/></body>
  </worldbody>
  <equality>
    <joint name="mirror" joint1="right" joint2="left" polycoef="0 -0.25 0 0 0"/>
    <joint name="on" joint1="far" joint2="right" polycoef="0 3 0 0 0"/>
    <joint name="back" joint1="left" joint2="far" polycoef="0 1 0 0 0"/>
    <joint name="curved" joint1="odd" joint2="left" polycoef="0 1 2 0 0"/>
    <joint name="off" joint1="odd" joint2="left" active="false"/>
    <joint name="alone" joint1="odd"/>
    <joint name="shifted" joint1="odd" joint2="left" polycoef="0.3 1 0 0 0"/>
    <weld name="glue" body1="odd" body2="left" active="false"/>
  </equality>
  <keyframe>
    <key name="home" time="1.5" qpos="4 5 6 0 0.6 0 0.8  0.7 -0.3  1 0 0 0  0.8 -0.1 -0.6 0.2" qvel="1 2 3 4 5 6 7 8 1 2 3 0.4 -0.1 -0.3 9"
      mpos="7 8 9" mquat="0.6 0 0 0.8"/>
    <key qpos="0 0 1 1 0 0 0  0 0  0.8 0.6 0 0  0 0.1 0 0" />
  </keyframe>
</mujoco>
"""
BOUND = {"float64": 1e-12, "float32": 2e-6}


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(MODEL)


@pytest.fixture(scope="module")
def tree(model):
    return jf.load_mjcf(model)


def assert_bodies(tree, state, model, data, dtype):
    """Compare all bodies, with their velocities, and the fixed camera."""
    mujoco.mj_forward(model, data)
    with jax.disable_jit():
        poses, speeds = tree.world_transforms(state), tree.world_velocities(state)
    bound = BOUND[dtype.name]
    for i in range(model.nbody):
        at, velocity = tree.names.index(mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, i)), np.zeros(6)
        np.testing.assert_allclose(poses.translation[at], data.xpos[i], atol=10 * bound)
        np.testing.assert_allclose(poses.rotation[at].to_matrix().reshape(9), data.xmat[i], atol=bound)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, i, velocity, 0)
        np.testing.assert_allclose(np.concatenate([speeds.angular[at], speeds.linear[at]]), velocity, atol=100 * bound)
    np.testing.assert_allclose(poses.translation[tree.names.index("fixed")], data.cam_xpos[0], atol=10 * bound)


def test_a_tree_starts_where_mujoco_resets_to(model, tree, dtype):
    data = mujoco.MjData(model)
    mujoco.mj_resetData(model, data)
    assert_bodies(tree, tree.state(), model, data, dtype)
    np.testing.assert_array_equal(tree.neutral(), tree.state().q)
    moved = tree.state(q={"neck": [0.8, 0.0, 0.6, 0.0]})  # what is not named stays where the model starts
    np.testing.assert_allclose(tree.get_q(moved, "hinge"), [0.4], rtol=1e-6)


def test_keyframes_are_states_by_name(model, tree, dtype):
    frames = jf.mjcf_keyframes(tree)
    assert list(frames) == ["home", "key_1"]
    data = mujoco.MjData(model)
    for i, state in enumerate(frames.values()):
        mujoco.mj_resetDataKeyframe(model, data, i)
        assert_bodies(tree, state, model, data, dtype)
    assert tree.properties["world"]["keyframes"]["home"]["time"] == 1.5
    assert tree.properties["world"]["keyframes"]["home"]["q"]["hinge"] == 0.7
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=jf.edges.Fixed())
    assert jf.mjcf_keyframes(b.build()) == {}


def test_rest_and_keyframes_are_kept_by_what_is_made_of_the_tree(tree):
    again = jf.from_json(jf.to_json(tree))
    assert again.topology == tree.topology
    np.testing.assert_array_equal(again.neutral(), tree.neutral())
    assert again.edge("head").angle_limit == 0.5
    b = jf.TreeBuilder()
    b.include(tree, parent="world", prefix="m/")
    both = b.build()
    np.testing.assert_array_equal(both.neutral(), tree.neutral())
    np.testing.assert_array_equal(both.extract("m/world", prefix="m/").neutral(), tree.neutral())
    home = both.properties["m/world"]["keyframes"]["home"]["q"]
    np.testing.assert_array_equal(both.state(q={f"m/{joint}": value for joint, value in home.items()}).q, jf.mjcf_keyframes(tree)["home"].q)


def test_cameras_that_follow_bodies_are_left_out_and_named(tree):
    assert "fixed" in tree.names
    ignored = tree.properties["world"]["ignored"]
    assert not {"track", "com", "look", "camera_4"} & set(tree.names)
    modes = {name: ignored[f"camera {name!r}"].split(":")[0] for name in ("track", "com", "look", "camera_4")}
    assert modes == {"track": "mode track", "com": "mode trackcom", "look": "mode targetbody", "camera_4": "mode targetbodycom"}


def test_linear_constraints_make_followers_and_others_are_named(model, tree, dtype):
    assert tree.joint_names == ("float", "hinge", "slide", "neck", "left", "odd")
    assert (tree.edge("right").joint, tree.edge("far").joint) == ("left", "right")
    ignored = {key: value for key, value in tree.properties["world"]["ignored"].items() if key.startswith("equality")}
    reasons = {"back": "follows it", "curved": "not linear", "off": "not active", "alone": "alone", "shifted": "own poses", "glue": "weld"}
    assert set(ignored) == {f"equality {name!r}" for name in reasons}
    for name, word in reasons.items():
        assert word in ignored[f"equality {name!r}"]
    # the solver's own answer: with nothing else acting, stiff constraints hold to the solver's accuracy
    data, state = mujoco.MjData(model), tree.state(q={"left": 0.6})
    data.qpos[:] = model.qpos0
    for name in ("left", "right", "far"):
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = tree.get_q(state, name)[0]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.efc_pos[: data.ne][:2], 0.0, atol=BOUND[dtype.name])
    free = jf.load_mjcf(model, mimic=False)
    assert free.nq == model.nq
    assert free.properties["world"]["ignored"] == tree.properties["world"]["ignored"]


def test_a_ball_keeps_to_its_angle(tree, dtype):
    q = tree.random(jax.random.key(2), (4000,))
    state = tree.state(q=q)
    assert not any("neck" in sentence for sentence in tree.check(state))
    ball = np.asarray(tree.get_q(state, "neck"), np.float64)
    angle = 2 * np.arctan2(np.linalg.norm(ball[:, 1:], axis=-1), np.abs(ball[:, 0]))
    assert angle.max() <= 0.5 + 1e-6
    # uniform over rotations: the share below a is (a - sin a) / (limit - sin limit), and axes point everywhere alike
    for a in (0.2, 0.35, 0.45):
        assert abs(np.mean(angle < a) - (a - np.sin(a)) / (0.5 - np.sin(0.5))) < 0.03
    assert np.abs(np.mean(ball[:, 1:] / np.linalg.norm(ball[:, 1:], axis=-1, keepdims=True), 0)).max() < 0.03
    low, high = np.cos(0.25), np.sin(0.25)
    for given, expected in (((0.8, 0.6, 0, 0), (low, high, 0, 0)), ((-0.8, 0, 0.6, 0), (-low, 0, high, 0))):
        outside = tree.state(q={"neck": given})
        (sentence,) = tree.check(outside)
        assert sentence.startswith("joint 'neck': its angle = 1.287 is outside its limits [0, 0.5]")
        inside = tree.state(q=tree.clamp(outside.q))
        np.testing.assert_allclose(tree.get_q(inside, "neck"), expected, atol=BOUND[dtype.name])
        assert tree.check(inside) == ()
    slopes = jax.jit(jax.vmap(jax.jacrev(jf.edges.Ball(angle_limit=0.5).clamp)))(np.array([(1, 0, 0, 0), (0.8, 0.6, 0, 0)], dtype))
    assert np.isfinite(slopes).all()
    with pytest.raises(errors.EdgeError, match="angle limits are magnitudes"):
        jf.edges.Ball(angle_limit=-0.1)


@pytest.mark.parametrize("kind", ["text", "file"])
def test_a_urdf_is_refused_and_the_function_for_it_named(kind, tmp_path):
    text = '<?xml version="1.0"?><!-- a robot --><robot name="r"><link name="base"/></robot>'
    path = tmp_path / "r.urdf"
    path.write_text(text)
    with pytest.raises(errors.FormatError, match=r"is a URDF .*jf\.load_urdf"):
        jf.load_mjcf(text if kind == "text" else path)


def test_specs_are_taken(model, tree):
    spec = mujoco.MjSpec.from_string(MODEL)
    assert jf.load_mjcf(spec).topology == tree.topology
    spec.worldbody.add_body(name="ghost").add_freejoint()  # a moving body without mass
    with pytest.raises(errors.FormatError, match="MjSpec given: MuJoCo refuses"):
        jf.load_mjcf(spec)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: jf.edges.Revolute(rest=(1.0, 2.0)), "rest takes 1 finite number, found"),
        (lambda: jf.edges.Planar(rest=(1.0, 2.0, np.nan)), "rest takes 3 finite numbers"),
        (lambda: jf.edges.Free(rest=(0.0,) * 7), "quaternion .* is zero"),
        (lambda: jf.edges.Prismatic(rest="far"), "rest takes 1"),
    ],
)
def test_coordinates_at_rest_are_checked(make, words):
    with pytest.raises(errors.EdgeError, match=words):
        make()


def test_rest_may_be_set_by_name(dtype):
    b = jf.TreeBuilder()
    b.add("arm", parent="world", edge=jf.edges.Revolute(rest=0.3))
    tree = b.build()
    np.testing.assert_array_equal(tree.neutral(), np.array([0.3], dtype))
    np.testing.assert_array_equal(tree.with_values({"arm.rest": -0.5}).state().q, np.array([-0.5], dtype))
    np.testing.assert_array_equal(tree.with_edge("arm", jf.edges.Revolute()).state().q, np.zeros(1, dtype))
