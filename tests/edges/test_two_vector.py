"""Frames defined by frames: axes and rates against SPICE and MuJoCo, rates of rates, joints, links, rings, parallel vectors."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import spiceypy

import jaxframes as jf
from jaxframes.errors import EdgeError, NoAccelerationError, TopologyError, UnknownFrameError
from jaxframes.view.local_motions import local_motions

E = jf.edges
MU, TIME = 3.986004418e14, 1234.5
ORBIT = {"periapsis": 7e6, "eccentricity": 0.1, "inclination": 0.9, "node": 0.4, "argument": 1.3, "mu": MU}
Z = (0.0, 0.0, 1.0)


def orbit_tree():
    b = jf.TreeBuilder(root="earth")
    b.add("craft", parent="earth", edge=E.Kepler(**ORBIT))
    b.add("sun", parent="earth", edge=E.Fixed(jf.Transform.from_translation((1.5e8, 2e7, 1e7))))
    b.add("lvlh", parent="craft", edge=E.LVLH("craft", "earth"))
    b.add("rtn", parent="craft", edge=E.RTN("craft", "earth"))
    b.add("vnc", parent="craft", edge=E.VNC("craft", "earth"))
    b.add("panel", parent="lvlh", edge=E.Pointing(at="sun", craft="craft", axis="-y", up=E.Velocity("craft", "earth")))
    b.add("tool", parent="panel", edge=E.Revolute((0, 0, 1), jf.Transform.from_translation((1.0, 0.5, 0.0))))
    return b.build()


TREE = orbit_tree()


def state_of(tree, time=TIME):
    return tree.state(time=time, q={"tool": 0.3}, qd={"tool": 0.01})


@pytest.mark.float64
@pytest.mark.parametrize(
    ("name", "axis", "plane", "signs"), [("lvlh", 3, 1, (-1, 1)), ("rtn", 1, 2, (1, 1)), ("vnc", 1, 3, (1, 1)), ("panel", 2, 1, None)]
)
def test_axes_and_angular_velocity_are_spices(name, axis, plane, signs):
    state = state_of(TREE)
    craft = TREE.motion(state, of="craft", relative_to="earth")
    r, v, a = craft.transform.translation, craft.velocity.linear, craft.acceleration.linear
    place, speed = np.r_[r, v], np.r_[v, a]
    if name == "panel":
        first, second = np.r_[r, v] - np.r_[TREE.transform(state, of="sun", relative_to="earth").translation, 0, 0, 0], speed
    else:
        first, second = (speed, place) if name == "vnc" else (place, speed)
        first, second = signs[0] * first, signs[1] * second
    turned, w = spiceypy.xf2rav(spiceypy.twovxf(first, axis, second, plane))
    found = TREE.motion(state, of=name, relative_to="earth")
    np.testing.assert_allclose(found.transform.rotation.to_matrix().T, turned, atol=2e-15)
    np.testing.assert_allclose(found.velocity.angular, w, atol=1e-14 * np.abs(w).max() + 1e-18)
    np.testing.assert_allclose(found.transform.translation, r, rtol=1e-15)


@pytest.mark.float64
@pytest.mark.parametrize("pair", [("lvlh", "earth"), pytest.param(("tool", "lvlh"), marks=pytest.mark.slow)])
def test_rates_are_derivatives_of_frames_on_frames(pair):
    of, relative_to = pair
    ask = lambda t: TREE.motion(state_of(TREE, t).replace(q=jnp.reshape(0.3 + 0.01 * (t - TIME), 1)), of=of, relative_to=relative_to)
    found, change = jax.jit(lambda t: jax.jvp(ask, (t,), (jnp.ones_like(t),)))(jnp.asarray(TIME))
    pairs = [(change.transform.translation, found.velocity.linear), (change.velocity.linear, found.acceleration.linear)]
    pairs.append((change.velocity.angular, found.acceleration.angular))
    for rate, value in pairs:
        np.testing.assert_allclose(rate, value, atol=1e-11 * max(float(np.abs(value).max()), 1e-9))
    assert np.abs(found.acceleration.angular).max() > 1e-9


def test_batches_vmap_jit_and_all_frames_agree(dtype):
    b = jf.TreeBuilder(root="earth")
    b.add("craft", parent="earth", edge=E.Kepler(**ORBIT))
    b.add("eye", parent="craft", edge=E.Pointing(at="earth", craft="craft", up=(Z, "earth")))
    tree = b.build()
    times = jnp.asarray([0.0, TIME], dtype)
    state = tree.state(time=times)
    ask = lambda t: tree.velocity(tree.state(time=t), of="eye", relative_to="earth").as_vector()
    one = jax.jit(ask)(times)
    scale = 1e-11 if dtype == np.float64 else 1e-4
    for found in (jax.vmap(ask)(times), tree.world_velocities(state).as_vector()[:, tree.names.index("eye")]):
        np.testing.assert_allclose(found, one, rtol=scale, atol=scale * 1e-3)
    turn = tree.transform(state, of="eye", relative_to="craft").rotation
    np.testing.assert_allclose(local_motions(tree, state)[:, tree.names.index("eye"), :4], turn.wxyz, atol=scale)


def arm(parts=4):
    """Two arms of joints; a camera on one looks at the tip of the other, held level with the base."""
    b = jf.TreeBuilder(root="base")
    for side in ("a", "b"):
        for i in range(parts):
            place = jf.Transform.from_translation((0.3, 0.1 if side == "a" else -0.4, 0.2))
            b.add(f"{side}{i}", parent=f"{side}{i - 1}" if i else "base", edge=E.Revolute(np.eye(3)[i % 3], place))
    edge = E.TwoVector(E.Direction(f"b{parts - 1}", f"a{parts - 1}"), E.Constant((0.1, 0.2, 2.0), "base"), ("-z", "y"))
    b.add("camera", parent=f"a{parts - 1}", edge=edge)
    b.add("lens", parent="camera", edge=E.Fixed(jf.Transform.from_translation((0.0, 0.05, -0.1))))
    return b


ARM = arm(1).build()


def arm_numbers(tree, dtype):
    rng = np.random.default_rng(1)
    return [jnp.asarray(rng.normal(size=tree.nq), dtype) for _ in range(3)]


def test_over_joints_directions_have_exact_rates(dtype, tol):
    q, qd, qdd = arm_numbers(ARM, dtype)

    def along(t):
        state = ARM.state(q=q + t * qd + t * t * qdd / 2, qd=qd + t * qdd)
        return ARM.velocity(state, of="lens", relative_to="base").as_vector(), ARM.transform(
            state, of="lens", relative_to="base"
        ).translation

    (velocity, _), (change, rate) = jax.jit(lambda t: jax.jvp(along, (t,), (jnp.ones_like(t),)))(jnp.zeros((), dtype))
    found = ARM.acceleration(ARM.state(q=q, qd=qd, qdd=qdd), of="lens", relative_to="base")
    np.testing.assert_allclose(rate, velocity[3:], atol=100 * tol)
    np.testing.assert_allclose(change, found.as_vector(), atol=200 * tol)
    state = ARM.state(q=q, qd=qd)
    jacobian = ARM.jacobian(state, of="lens", relative_to="base")
    np.testing.assert_allclose(jacobian @ qd, velocity, atol=100 * tol)
    look = ARM.transform(state, of="b0", relative_to="camera").translation
    np.testing.assert_allclose(look[:2], 0.0, atol=20 * tol)
    assert look[2] < 0


def test_derivatives_by_numbers(dtype):
    q, *_ = arm_numbers(ARM, dtype)
    names = ("camera.secondary.vector", "b0.placement.translation")

    def place(values):
        tree = ARM.with_values(dict(zip(names, values, strict=True)))
        return jnp.sum(tree.transform(tree.state(q=q), of="lens", relative_to="base").translation * jnp.arange(1.0, 4.0, dtype=dtype))

    values = tuple(ARM.get(name) for name in names)
    slopes, value = jax.jit(jax.grad(place))(values), jax.jit(place)
    h, rough = (1e-5, 1e-7) if dtype == np.float64 else (1e-2, 3e-3)
    for k, slope in enumerate(slopes):
        step = jnp.asarray([0.3, -0.5, 0.2], dtype)
        up, down = (value(tuple(v + s * h * step if j == k else v for j, v in enumerate(values))) for s in (1, -1))
        np.testing.assert_allclose(jnp.sum(slope * step), (up - down) / (2 * h), atol=rough)


def test_large_trees_and_deep_paths(dtype, tol):
    b = arm(9)
    b.add("second", parent="base", edge=E.Pointing(at="lens", craft="b3", axis="x", up=(Z, "camera")))
    tree = b.build()
    assert "by level" in tree.explain()
    q, qd, _ = arm_numbers(tree, dtype)
    state = tree.state(q=q, qd=qd)
    whole = tree.world_transforms(state)
    one = tree.transform(state, of="second", relative_to="base")
    np.testing.assert_allclose(whole.rotation.wxyz[tree.names.index("second")], one.rotation.wxyz, atol=200 * tol)


def test_velocities_over_joints_have_no_angular_acceleration():
    b = arm(1)
    b.add("moving", parent="base", edge=E.TwoVector(E.Velocity("a0", "base"), E.Constant(Z, "base")))
    tree = b.build()
    tree.velocity(tree.state(qd={"a0": 1.0}), of="moving", relative_to="base")
    with pytest.raises(NoAccelerationError, match=r"'moving' needs the derivative of the acceleration of 'a0'.*frame 'a0'.*revolute"):
        tree.acceleration(tree.state(), of="moving", relative_to="base")
    b.add("held", parent="base", edge=E.Prescribed(supports_accelerations=False))
    b.add("behind", parent="base", edge=E.TwoVector(E.Direction("held", "base"), E.Constant(Z, "base")))
    with pytest.raises(NoAccelerationError, match="frame 'held'"):
        (tree := b.build()).acceleration(tree.state(), of="behind", relative_to="base")
    numbers = local_motions(tree, tree.state())
    assert np.isnan(numbers[tree.names.index("moving"), 13:]).all()


def test_links_that_change(dtype, tol):
    b = jf.TreeBuilder()
    for i, at in enumerate(((1.0, 0, 0), (0, 2.0, 0))):
        b.add(f"seat{i}", parent="world", edge=E.Fixed(jf.Transform.from_translation(at)))
    b.add("cup", parent="seat0", edge=E.Attachable(jf.Transform.from_translation((0, 0, 0.5)), candidates=("seat0", "seat1")))
    b.add("eye", parent="world", edge=E.Pointing(at="cup", craft="world", axis="x", up=(Z, "world"), up_axis="z"))
    tree = b.build()
    for seat, place in (("seat0", (1.0, 0, 0.5)), ("seat1", (0, 2.0, 0.5))):
        state = tree.attach(tree.state(), "cup", seat)
        np.testing.assert_allclose(tree.transform(state, of="cup", relative_to="eye").translation, [np.linalg.norm(place), 0, 0], atol=tol)
    free = jf.TreeBuilder.from_tree(tree)
    free.add("ball", parent="eye", edge=E.Attachable())  # may hang on "other" too
    free.add("other", parent="world", edge=E.Pointing(at="ball", craft="world", axis="x", up=(Z, "world")))
    with pytest.raises(TopologyError, match=r"other -> other.*Attachable\(candidates="):
        free.build()
    held = jf.TreeBuilder.from_tree(tree)  # within what hangs on a link, paths are static
    held.add("lid", parent="cup", edge=E.Fixed(jf.Transform.from_translation((0, 0.1, 0))))
    held.add("gaze", parent="cup", edge=E.Pointing(at="lid", craft="cup", axis="x", up=(Z, "cup")))
    found = held.build()
    turn = found.transform(found.state(), of="gaze", relative_to="cup").rotation
    np.testing.assert_allclose(turn @ np.eye(3)[0], [0, 1, 0], atol=tol)


def test_rings_are_refused():
    b = jf.TreeBuilder()
    b.add("stand", parent="world", edge=E.Fixed(jf.Transform.from_translation((1, 0, 0))))
    b.add("lvlh", parent="stand", edge=E.Pointing(at="panel", craft="stand", up=(Z, "world")))
    b.add("arm", parent="lvlh", edge=E.Fixed(jf.Transform.from_translation((1, 0, 0))))
    b.add("panel", parent="arm", edge=E.Revolute())
    with pytest.raises(TopologyError, match="frames that need each other: lvlh -> lvlh"):
        b.build()
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=E.Pointing(at="tip", craft="world", up=(Z, "b")))
    b.add("tip", parent="world", edge=E.Fixed(jf.Transform.from_translation((1, 0, 0))))
    b.add("b", parent="world", edge=E.Pointing(at="tip", craft="world", up=(Z, "a")))
    with pytest.raises(TopologyError, match="a -> b -> a; each reads a motion along a path"):
        b.build()
    b.remove("b")
    with pytest.raises(UnknownFrameError, match="frame 'a' reads the motion of 'b', which does not exist"):
        b.build()


def test_names_follow_parts_and_files_keep_them():
    outer = jf.TreeBuilder(root="hall")
    outer.include(ARM, parent="hall", prefix="robot/")
    tree = outer.build()
    assert [read.of for read in tree.edge("robot/camera").reads] == ["robot/b0", "robot/a0", "robot/base"]
    part = tree.extract("robot/base", prefix="robot/")
    assert part.topology == ARM.topology
    again = jf.from_json(jf.to_json(ARM))
    assert again.topology == ARM.topology
    np.testing.assert_array_equal(again.get("camera.secondary.vector"), ARM.get("camera.secondary.vector"))
    assert "-z along the direction to b0 from a0, y near a constant in base" in str(ARM)
    assert "needs motions of b0, a0, base" in ARM.explain(of="lens", relative_to="base")
    with pytest.raises(UnknownFrameError, match="'robot/camera' reads the motion of 'robot/b0'"):
        tree.extract("robot/a0")


def test_parallel_vectors_are_nan_with_a_code(dtype):
    b = jf.TreeBuilder()
    b.add("ball", parent="world", edge=E.Movable())
    b.add("eye", parent="world", edge=E.Pointing(at="ball", craft="world", axis="x", up=(Z, "world")))
    tree = b.build()
    places = jnp.asarray([[1.0, 0, 0], [0, 0, 2.0], [0, 0, 0], [0, 0, -1.0], [1e-3, 0, 1.0]], dtype)
    state = tree.set_motion(tree.state(), "ball", jf.Transform.from_translation(places))
    np.testing.assert_array_equal(tree.axes_defined(state)["eye"], [True, False, False, False, True])
    found = tree.motion(state, of="eye", relative_to="world")
    assert np.isnan(found.transform.rotation.wxyz).all(-1).tolist() == [False, True, True, True, False]
    assert np.isnan(found.acceleration.angular).all(-1).tolist() == [False, True, True, True, False]

    def turn(place):
        moved = tree.set_motion(tree.state(), "ball", jf.Transform.from_translation(place))
        return jnp.sum(tree.transform(moved, of="eye", relative_to="world").rotation.wxyz)

    slope = jax.jit(jax.grad(turn))
    assert np.isnan(slope(places[1])).any()
    assert np.isfinite(slope(places[0])).all()
    text = tree.check(jax.tree.map(lambda x: x, state[1]))
    assert any("frame 'eye': its two vectors are 0 rad apart: parallel" in line for line in text)
    assert any("zero" in line for line in tree.check(state[2]))


CAMERAS = """<mujoco><worldbody>
<body name="target" pos="1 2 0.3"><freejoint/><geom size="0.1"/></body>
<body name="carrier" pos="-1 0.5 1" euler="20 30 40"><freejoint/><geom size="0.1"/>
<camera name="targeting" mode="targetbody" target="target" pos="0.1 0.2 0.3"/>
<camera name="tracking" mode="track" pos="0.5 -0.2 0.4" euler="10 20 30"/></body>
</worldbody></mujoco>"""


@pytest.mark.float64
def test_cameras_of_mujoco():
    model = mujoco.MjModel.from_xml_string(CAMERAS)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    axes, offset = data.cam("tracking").xmat.reshape(3, 3).copy(), data.cam("tracking").xpos - data.body("carrier").xpos
    b = jf.TreeBuilder()
    for body in ("target", "carrier"):
        b.add(body, parent="world", edge=E.Free())
    b.add("mount", parent="carrier", edge=E.Fixed(jf.Transform.from_translation((0.1, 0.2, 0.3))))
    b.add("targeting", parent="mount", edge=E.Pointing(at="target", craft="mount", axis="-z", up=(Z, "world")))
    b.add("level", parent="carrier", edge=E.TwoVector(E.Constant((1, 0, 0), "world"), E.Constant((0, 1, 0), "world")))
    b.add("tracking", parent="level", edge=E.Fixed(jf.Transform(jf.Rotation.from_matrix(axes), offset)))
    tree = b.build()
    rng = np.random.default_rng(3)
    for body in ("target", "carrier"):
        data.body(body).xpos[:] = 0
        at = model.jnt_qposadr[model.body_jntadr[model.body(body).id]]
        wxyz = rng.normal(size=4)
        data.qpos[at : at + 7] = np.r_[rng.normal(size=3), wxyz / np.linalg.norm(wxyz)]
    mujoco.mj_forward(model, data)
    q = {}
    for body in ("target", "carrier"):
        at = model.jnt_qposadr[model.body_jntadr[model.body(body).id]]
        q[body] = np.r_[data.qpos[at + 3 : at + 7], data.qpos[at : at + 3]]
    state = tree.state(q=q)
    for name in ("targeting", "tracking"):
        pose = tree.transform(state, of=name, relative_to="world")
        np.testing.assert_allclose(pose.rotation.to_matrix(), data.cam(name).xmat.reshape(3, 3), atol=1e-12)
        np.testing.assert_allclose(pose.translation, data.cam(name).xpos, atol=1e-12)


REFUSED = [
    (lambda: E.TwoVector(E.Direction("a", "b"), E.Constant(Z, "c"), ("x", "-x")), "two different ones"),
    (lambda: E.TwoVector(E.Direction("a", "b"), E.Constant(Z, "c"), "xy"), "two different ones"),
    (lambda: E.TwoVector("a", E.Constant(Z, "c")), "takes jf.edges.Direction, Velocity or Constant, found str"),
    (lambda: E.TwoVector(E.Direction("a", "a"), E.Constant(Z, "c")), "'a' relative to itself"),
    (lambda: E.TwoVector(E.Direction("a", 3), E.Constant(Z, "c")), "named by text"),
    (lambda: E.Constant((0, 0, 0), "c"), "not zero"),
]


@pytest.mark.parametrize(("make", "words"), REFUSED, ids=[words[:20] for _, words in REFUSED])
def test_what_is_wrong_is_said(make, words):
    with pytest.raises(EdgeError, match=words):
        make()
