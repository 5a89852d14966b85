"""Every real robot of the installed packages, against Pinocchio and yourdfpy. Opt-in: ``pytest -m robots`` (extra ``robots``)."""

import zlib
from xml.etree import ElementTree

import jax
import numpy as np
import pytest

import jaxframes as jf
from tests.io.robot_checks import assert_motions
from tests.random_trees import parts

pytestmark = [pytest.mark.robots, pytest.mark.float64]

NAMES = jf.example_robots()
NOT_URDF = {"ur3"}  # an empty stub
BROKEN_MIMIC = {"alex_psyonic_hands"}  # its mimic joints name joints that do not exist; Pinocchio refuses it too


LATE_MIMIC = {"romeo", "talos_full_v2", "talos_full_v2_box"}  # joints that Pinocchio reads before the ones that they mimic: it refuses


def spread_of(path, joints):
    """All moving joints of a file, and (matrix, offset) that give their values from those of the joints that mimic none."""
    own = {name: i for i, name in enumerate(joints)}
    found = {}
    for joint in ElementTree.parse(path).getroot().findall("joint"):
        mimic, name = joint.find("mimic"), joint.get("name")
        if name in own:
            found[name] = (own[name], 1.0, 0.0)
        elif mimic is not None and joint.get("type") != "fixed":
            found[name] = (own[mimic.get("joint")], float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0)))
    matrix = np.zeros((len(found), len(joints)))
    for row, (column, factor, _) in enumerate(found.values()):
        matrix[row, column] = factor
    return list(found), matrix, np.array([offset for _, _, offset in found.values()])


@pytest.fixture(scope="module")
def oracle():
    return pytest.importorskip("tests.pinocchio_oracle")


def test_the_packages_are_there():
    assert len(NAMES) > 70


@pytest.mark.parametrize("name", [n for n in NAMES if n not in NOT_URDF])
def test_against_pinocchio(name, oracle):
    path, mimic = jf.example_robot(name), name not in BROKEN_MIMIC
    tree, robot = jf.load_urdf(path, mimic=mimic), oracle.Robot(path, mimic=mimic and name not in LATE_MIMIC)
    spread = spread_of(path, tree.joint_names) if name in LATE_MIMIC else None
    rng = np.random.default_rng(zlib.crc32(name.encode()))
    q, (qd, qdd) = np.asarray(tree.random(jax.random.key(len(name)))), rng.normal(size=(2, tree.nv))
    named = [dict(zip(tree.joint_names, map(float, row), strict=True)) for row in (q, qd, qdd)]
    state = tree.state(q=q, qd=qd, qdd=qdd)
    if spread is not None:
        names, matrix, offset = spread
        rows = (matrix @ q + offset, matrix @ qd, matrix @ qdd)
        named = [dict(zip(names, map(float, row), strict=True)) for row in rows]
    assert_motions(tree, state, robot.motions(tree.names, *named), int(rng.integers(len(tree.names))), 1e-11)
    for link in {tree.names[-1], tree.names[int(rng.integers(len(tree.names)))]}:
        with jax.disable_jit():
            mine = tree.jacobian(state, of=link, relative_to=tree.root)
        theirs = robot.jacobian(link, list(named[0]), *named)
        theirs = theirs if spread is None else theirs @ spread[1]
        np.testing.assert_allclose(mine, theirs, atol=1e-11)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in NOT_URDF | BROKEN_MIMIC])
def test_poses_against_yourdfpy(name):
    yourdfpy = pytest.importorskip("yourdfpy")
    path = jf.example_robot(name)
    tree = jf.load_urdf(path)
    try:
        robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
        robot.update_cfg(dict.fromkeys(robot.actuated_joint_names, 0.0))
    except Exception as error:
        pytest.skip(f"yourdfpy cannot read it: {type(error).__name__}: {error}")
    q = np.asarray(tree.random(jax.random.key(1)))
    robot.update_cfg(dict(zip(tree.joint_names, map(float, q), strict=True)))
    with jax.disable_jit():
        poses = tree.world_transforms(tree.state(q=q)).to_matrix()
    for frame, mine in zip(tree.names, np.asarray(poses), strict=True):
        np.testing.assert_allclose(mine, robot.get_transform(frame, tree.root), atol=1e-6, err_msg=frame)


@pytest.mark.parametrize("name", [n for n in NAMES if n not in NOT_URDF | BROKEN_MIMIC])
def test_round_trip(name):
    tree = jf.load_urdf(jf.example_robot(name))
    again = jf.load_urdf(jf.to_urdf(tree))
    assert again.joint_names == tree.joint_names
    for frame in tree.names[1:]:
        for a, b in zip(jax.tree.leaves(tree.edge(frame)), jax.tree.leaves(again.edge(frame)), strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_free_base_has_pinocchios_rates(oracle):
    path = jf.example_robot("panda")
    b = jf.TreeBuilder(root="world")
    b.add("base", parent="world", edge=jf.edges.Free())
    b.include(jf.load_urdf(path), parent="base")
    tree, rng = b.build(), np.random.default_rng(4)
    robot = oracle.Robot(path, mimic=True, root="free")
    q, (qd, qdd) = np.asarray(tree.random(jax.random.key(3))), rng.normal(size=(2, tree.nv))
    joints = tree.joint_names[1:]
    named = [dict(zip(joints, map(float, row), strict=True)) for row in (q[7:], qd[6:], qdd[6:])]
    swap = [3, 4, 5, 0, 1, 2]  # Pinocchio: position, then xyzw; linear, then angular
    robot.base = q[[4, 5, 6, 1, 2, 3, 0]], qd[:6][swap], qdd[:6][swap]
    links = tree.names[2:]
    theirs = robot.motions(links, *named)
    with jax.disable_jit():
        mine = tree.world_motions(tree.state(q=q, qd=qd, qdd=qdd))
    for found, other in zip(parts(mine), theirs, strict=True):
        np.testing.assert_allclose(found[2:], other, atol=1e-11 * max(1.0, np.abs(other).max()))


def test_planar_and_floating_joints_of_urdf_agree_with_pinocchio_in_place(oracle, tmp_path):
    # Pinocchio 4.1 takes every planar joint for one across z, whatever its axis says: others are tested against matrices only.
    text = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
      <joint name="p" type="planar"><parent link="a"/><child link="b"/><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/></joint>
      <joint name="f" type="floating"><parent link="b"/><child link="c"/><origin xyz="0 0 1" rpy="0.3 0 0"/></joint></robot>"""
    path = tmp_path / "r.urdf"
    path.write_text(text)
    tree, robot = jf.load_urdf(path), oracle.Robot(path)
    q = np.asarray(tree.random(jax.random.key(8)))
    x, y, angle = q[:3]
    theirs = robot.poses(tree.names, np.array([x, y, np.cos(angle), np.sin(angle), *q[[7, 8, 9, 4, 5, 6, 3]]]))
    with jax.disable_jit():
        mine = tree.world_transforms(tree.state(q=q)).to_matrix()
    np.testing.assert_allclose(mine, theirs, atol=1e-12)


def test_files_that_are_no_urdf_are_refused():
    for name in NOT_URDF:
        with pytest.raises(jf.FrameError, match="link"):
            jf.load_urdf(jf.example_robot(name))
