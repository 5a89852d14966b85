"""Real robots: every link's motion and the Jacobians against Pinocchio's results, compiled queries, copies, round trips."""

import importlib.metadata
from pathlib import Path

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests.io.robot_checks import assert_motions
from tests.random_trees import parts

FOLDER = Path(__file__).parent.parent / "data" / "robots"
ROBOTS = sorted(path.stem for path in FOLDER.glob("*.urdf"))
SLOW = {"allegro_right_hand", "anymal", "baxter"}
"""More of what others have: fixed, revolute and prismatic joints and mimics (panda), continuous joints (kinova), joints listed from the tip
down (so101), negative axes (panda), many branches and enough frames to go by level (simple_humanoid). ``-m slow`` and ``-m robots`` have
them, and every normal run their text."""
RESULTS = dict(np.load(FOLDER / "pinocchio.npz"))


def load(name):
    return jf.load_urdf(FOLDER / f"{name}.urdf")


def stored(name, i):
    """The i-th state of a robot's stored results, and the motions of all links in the root."""
    values = {kind: RESULTS[f"{name}/{kind}"][i] for kind in ("q", "qd", "qdd")}
    rows = RESULTS[f"{name}/motion"][i]
    return values, (rows[:, :9].reshape(-1, 3, 3), *np.split(rows[:, 9:], 5, -1))


def bound(dtype):
    return 1e-11 if dtype == np.float64 else 1e-4


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in ROBOTS])
def test_every_link_moves_as_pinocchio_says(name, dtype):
    tree = load(name)
    for i in range(2):
        values, theirs = stored(name, i)
        state = tree.state(**{kind: jnp.asarray(row, dtype) for kind, row in values.items()})
        observer = int(np.random.default_rng(i).integers(len(tree.names)))
        assert_motions(tree, state, theirs, observer, bound(dtype))
        with jax.disable_jit():
            jacobian = tree.jacobian(state, of=tree.names[-1], relative_to=tree.root)
        np.testing.assert_allclose(jacobian, RESULTS[f"{name}/jacobian"][i], atol=bound(dtype))


@pytest.mark.parametrize("name", ["panda", "so101", "kinova"])
def test_compiled_queries_agree_too(name, dtype):
    tree = load(name)
    values, theirs = stored(name, 0)
    state = tree.state(**{kind: jnp.asarray(row, dtype) for kind, row in values.items()})
    tip = tree.names[-1]
    ask = jax.jit(lambda s: (tree.motion(s, of=tip, relative_to=tree.root), tree.jacobian(s, of=tip, relative_to=tree.root)))
    motion, jacobian = ask(state)
    for mine, other in zip(parts(motion), theirs, strict=True):
        np.testing.assert_allclose(mine, other[-1], atol=bound(dtype) * max(1.0, np.abs(other).max()))
    np.testing.assert_allclose(jacobian, RESULTS[f"{name}/jacobian"][0], atol=bound(dtype))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_round_trip_through_text_loses_nothing(name, dtype):
    tree = load(name)
    again = jf.load_urdf(jf.to_urdf(tree))
    assert set(again.names) == set(tree.names)
    assert again.joint_names == tree.joint_names
    for frame in tree.names[1:]:
        assert again.joint_of(frame) == tree.joint_of(frame)
        assert again.parent(frame) == tree.parent(frame)
        mine, other = tree.edge(frame), again.edge(frame)
        assert type(mine) is type(other)
        for a, b in zip(jax.tree.leaves(mine), jax.tree.leaves(other), strict=True):
            if dtype == np.float64:
                np.testing.assert_array_equal(a, b)
            else:
                np.testing.assert_allclose(a, b, rtol=2e-7, atol=1e-7)
        assert again.properties[frame] == tree.properties[frame]


@pytest.mark.parametrize("name", ROBOTS)
def test_json_include_and_rebuild_keep_a_robot(name):
    tree = load(name)
    assert jf.from_json(jf.to_json(tree)).topology == tree.topology
    assert jf.TreeBuilder.from_tree(tree).build().topology == tree.topology
    b = jf.TreeBuilder(root="site")
    b.include(tree, parent="site", prefix="left/")
    b.include(tree, parent="site", prefix="right/")
    both = b.build()
    assert both.joint_names == tuple(f"{side}/{joint}" for side in ("left", "right") for joint in tree.joint_names)
    assert both.nq == 2 * tree.nq


def test_links_and_joints_are_two_name_spaces_and_keep_their_names():
    tree = load("so100")
    shared = set(tree.names) & set(tree.joint_names)
    assert shared
    for joint in shared:
        assert tree.joint_of(tree.frame_of(joint)) == joint
    tree = load("anymal")
    assert len(tree.names) == 23  # ten joints are fixed, none is fused away
    assert tree.nq == 12
    assert all(tree.joint_of(frame) is not None for frame in tree.names[1:])


def test_joints_are_in_the_order_of_the_file():
    tree = load("so101")
    text = (FOLDER / "so101.urdf").read_text()
    places = [text.index(f'joint name="{joint}"') for joint in tree.joint_names]
    assert places == sorted(places)
    assert list(tree.topology.joint_frames) != sorted(tree.topology.joint_frames)


def test_a_mimic_joint_takes_no_coordinates_and_follows():
    tree = load("panda")
    assert tree.joint_names[-1] == "panda_finger_joint1"
    state = tree.state(q={"panda_finger_joint1": 0.03})
    np.testing.assert_allclose(tree.get_q(state, "panda_finger_joint2"), [0.03], rtol=1e-6)
    with pytest.raises(jf.FrameError, match="follows 'panda_finger_joint1'"):
        tree.set_q(state, {"panda_finger_joint2": 0.01})
    free = jf.load_urdf(FOLDER / "panda.urdf", mimic=False)
    assert free.joint_names[-1] == "panda_finger_joint2"


def test_limits_are_kept():
    edge = load("panda").edge("panda_link1")
    np.testing.assert_allclose(edge.limits, [-2.8973, 2.8973], rtol=1e-6)
    np.testing.assert_allclose(edge.velocity_limits, [2.1750], rtol=1e-6)
    np.testing.assert_allclose(edge.effort_limits, [87.0], rtol=1e-6)


def test_unknown_elements_are_counted_and_inertials_kept():
    tree = load("ur5_robot")
    assert tree.properties[tree.root]["ignored"]["transmission"] == 6
    assert tree.properties[tree.root]["robot"] == "ur5"
    assert tree.properties["upper_arm_link"]["inertial"]["mass"]["value"] == 8.393


def test_loading_twice_compiles_once(dtype):
    chex.clear_trace_counter()

    @jax.jit
    @chex.assert_max_traces(n=1)
    def tip(tree, q):
        return tree.transform(tree.state(q=q), of="link4", relative_to="link1").translation

    first, second = load("puma560_robot"), load("puma560_robot")
    longer = second.with_edge("link3", second.edge("link3").replace(placement=jf.Transform.from_translation((0.0, 0.0, 0.5))))
    assert first.topology == second.topology
    q = jnp.asarray(np.linspace(0.1, 0.6, first.nq), dtype)
    np.testing.assert_array_equal(tip(first, q), tip(second, q))
    assert np.abs(tip(longer, q) - tip(first, q)).max() > 0.1


def test_copies_of_one_robot_share_one_compilation(dtype):
    robot = load("double_pendulum_continuous")
    b = jf.TreeBuilder(root="hall")
    for i in range(3):
        stand = jf.edges.Fixed(jf.Transform.from_translation((1.0 * i, 0.0, 0.0)))
        b.add(f"stand{i}", parent="hall", edge=stand)
        b.include(robot, parent=f"stand{i}", prefix=f"{i}/")
    hall = b.build()
    chex.clear_trace_counter()

    @jax.jit
    @chex.assert_max_traces(n=1)
    def poses(tree, state):
        return tree.world_transforms(state)

    state = hall.state(q=np.arange(6.0).astype(dtype) / 7)
    for i in range(3):
        part, values = hall.extract(f"{i}/{robot.root}", prefix=f"{i}/"), hall.extract_state(state, f"{i}/{robot.root}")
        assert part.topology == robot.topology
        alone = poses(part, values)
        with jax.disable_jit():
            inside = hall.relative_transforms(state, relative_to=f"{i}/{robot.root}")
        for k, name in enumerate(robot.names):
            np.testing.assert_allclose(alone.translation[k], inside.translation[hall.names.index(f"{i}/{name}")], atol=1e-6)


def test_example_robots_need_a_package_or_a_good_name():
    try:
        importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        if not jf.example_robots():
            with pytest.raises(jf.FrameError, match="pip install"):
                jf.example_robot("panda")
        return
    assert jf.load_urdf(jf.example_robot("panda")).joint_names[0] == "panda_joint1"
    with pytest.raises(jf.FrameError, match="'panda'"):
        jf.example_robot("pandda")
    with pytest.raises(jf.FrameError, match="anymal_b_simple/anymal"):
        jf.example_robot("anymal")
