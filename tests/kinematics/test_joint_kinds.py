"""Every joint kind: motions against matrices at 50 digits, RobWork's joints, exact derivatives at the places that break others."""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

import jaxframes as jf
from tests import oracle
from tests.random_trees import parts

E = jf.edges
GOLDEN = json.loads((Path(__file__).parent.parent / "data" / "robwork.json").read_text())["cases"]
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
PLACE = ([0.5, -0.1, 0.7, 0.5], [0.3, -0.2, 0.4])
TIP = ([0.7, 0.1, -0.3, 0.2], [0.25, 0.15, -0.35])


def pose_of(place):
    return jf.Transform(jf.Rotation.from_quaternion_wxyz(place[0]), np.array(place[1]))


def turn(axis, angle):
    return oracle.pose(oracle.rotation_matrix([mp.mpf(float(a)) * angle for a in axis]), [0, 0, 0])


def slide(axis, length):
    return oracle.pose(mp.eye(3), [mp.mpf(float(a)) * length for a in axis])


X, Y, Z = np.eye(3)
PITCH = 0.37


def plane(q):
    """Motion in the plane across AXIS, with u and v by the shortest rotation from z to AXIS."""
    half = [mp.mpf(1) + AXIS[2], -AXIS[1], AXIS[0], 0]
    basis = oracle.quaternion_matrix(half)
    u, v = ([basis[i, k] for i in range(3)] for k in range(2))
    return slide_exact(u, q[0]) * slide_exact(v, q[1]) * turn(AXIS, q[2])


def slide_exact(axis, length):
    return oracle.pose(mp.eye(3), [a * length for a in axis])


FLAT = {
    "revolute": (lambda p: E.Revolute(AXIS, p), 1, lambda q: turn(AXIS, q[0])),
    "continuous": (lambda p: E.Continuous(AXIS, p), 1, lambda q: turn(AXIS, q[0])),
    "prismatic": (lambda p: E.Prismatic(AXIS, p), 1, lambda q: slide(AXIS, q[0])),
    "screw": (lambda p: E.Screw(AXIS, PITCH, p), 1, lambda q: turn(AXIS, q[0]) * slide(AXIS, mp.mpf(PITCH) * q[0] / (2 * mp.pi))),
    "cylindrical": (lambda p: E.Cylindrical(AXIS, p), 2, lambda q: turn(AXIS, q[0]) * slide(AXIS, q[1])),
    "universal": (lambda p: E.Universal(p), 2, lambda q: turn(X, q[0]) * turn(Y, q[1])),
    "universal, other axes": (lambda p: E.Universal(p, axes=(2 * AXIS, Z)), 2, lambda q: turn(AXIS, q[0]) * turn(Z, q[1])),
    "spherical": (lambda p: E.Spherical(p), 3, lambda q: turn(X, q[0]) * turn(Y, q[1]) * turn(Z, q[2])),
    "prismatic-spherical": (
        lambda p: E.PrismaticSpherical(p),
        4,
        lambda q: turn(X, q[0]) * turn(Y, q[1]) * turn(Z, q[2]) * slide(Z, q[3]),
    ),
    "prismatic-universal": (lambda p: E.PrismaticUniversal(p), 3, lambda q: turn(X, q[0]) * turn(Y, q[1]) * slide(Z, q[2])),
    "planar": (lambda p: E.Planar(AXIS, p), 3, plane),
    "virtual": (lambda p: E.Virtual(2, p), 2, lambda q: mp.eye(4)),
}


def screw_exp(twist):
    """The exponential of a body twist (angular, linear) as a matrix."""
    w, v = twist[:3], twist[3:]
    return mp.expm(mp.matrix([[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]]))


def quaternion_matrix(q):
    """Matrix of a quaternion of any length, to all digits: R v = q v q* / |q|^2 (Hamilton products)."""
    w, u = q[0], mp.matrix(q[1:4])
    k = mp.matrix([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return mp.eye(3) + 2 * (w * k + k * k) / (w * w + (u.T * u)[0])


def ball_at(q):
    return oracle.pose(quaternion_matrix(q), [0, 0, 0])


def free_at(q):
    return oracle.pose(quaternion_matrix(q[:4]), q[4:])


CURVED = {
    "ball": (lambda p: E.Ball(p), 4, 3, ball_at, lambda twist: screw_exp([*twist, 0, 0, 0])),
    "free": (lambda p: E.Free(p), 7, 6, free_at, screw_exp),
}


def tree_of(make):
    b = jf.TreeBuilder(root="base")
    b.add("child", parent="base", edge=make(pose_of(PLACE)))
    b.add("tip", parent="child", edge=E.Fixed(pose_of(TIP)))
    return b.build()


def links_of(move):
    """The oracle's base -> child -> tip, where ``move(t)`` is the joint's own matrix."""
    before, after = oracle.fixed(*PLACE), oracle.fixed(*TIP)
    return [oracle.Link(-1, None), oracle.Link(0, lambda t: before(t) * move(t)), oracle.Link(1, after)]


def along(q, qd, qdd):
    return lambda t: [mp.mpf(float(a)) + mp.mpf(float(b)) * t + mp.mpf(float(c)) * t * t / 2 for a, b, c in zip(q, qd, qdd, strict=True)]


def assert_same(tree, state, links, dtype):
    ask = jax.jit(lambda s: (tree.motion(s, of="tip", relative_to="base"), tree.motion(s, of="base", relative_to="tip")))
    for motion, (of, by) in zip(ask(state), ((2, 0), (0, 2)), strict=True):
        for mine, theirs in zip(parts(motion), oracle.motion(links, of, by), strict=True):
            bound = (2e-12 if dtype == np.float64 else 3e-5) * max(1.0, np.abs(theirs).max())
            assert np.abs(mine - theirs).max() <= bound


@pytest.mark.parametrize("kind", FLAT)
def test_flat_joints_move_as_their_matrices(kind, rng, dtype):
    make, count, matrix = FLAT[kind]
    tree = tree_of(make)
    assert (tree.nq, tree.nv) == (count, count)
    q, qd, qdd = rng.normal(size=(3, count)).astype(dtype)
    state, curve = tree.state(q=q, qd=qd, qdd=qdd), along(q, qd, qdd)
    assert_same(tree, state, links_of(lambda t: matrix(curve(t))), dtype)
    assert_rates(tree, state, dtype)


@pytest.mark.parametrize("kind", CURVED)
@pytest.mark.parametrize("scale", [1.0, 2.7])
def test_quaternion_joints_move_as_their_matrices(kind, scale, rng, dtype):
    make, nq, nv, matrix, exp = CURVED[kind]
    tree = tree_of(make)
    assert (tree.nq, tree.nv) == (nq, nv)
    q = rng.normal(size=nq)
    q[:4] *= scale / np.linalg.norm(q[:4])
    q, qd, qdd = (a.astype(dtype) for a in (q, *rng.normal(size=(2, nv))))
    start, curve = matrix([mp.mpf(float(x)) for x in q]), along(np.zeros(nv), qd, qdd)
    state = tree.state(q=q, qd=qd, qdd=qdd)
    assert_same(tree, state, links_of(lambda t: start * exp(curve(t))), dtype)
    assert_rates(tree, state, dtype)


def assert_rates(tree, state, dtype):
    """Jacobians, and the pose moved along ``tree.rate``, give the velocity; the velocity moved along it the acceleration."""
    bound = 1e-12 if dtype == np.float64 else 2e-5

    @jax.jit
    def ask(state):
        names = {"of": "tip", "relative_to": "base"}
        motion = tree.motion(state, **names)
        moved = jax.jvp(lambda s: tree.transform(s, **names).translation, (state,), (tree.rate(state),))[1]
        faster = jax.jvp(lambda s: tree.velocity(s, **names).as_vector(), (state,), (tree.rate(state),))[1]
        return motion, tree.jacobian(state, **names) @ state.qd, moved, faster

    motion, by_jacobian, moved, faster = ask(state)
    scale = max(1.0, float(np.abs(motion.acceleration.as_vector()).max()))
    np.testing.assert_allclose(by_jacobian, motion.velocity.as_vector(), atol=bound * scale)
    np.testing.assert_allclose(moved, motion.velocity.linear, atol=bound * scale)
    np.testing.assert_allclose(faster, motion.acceleration.as_vector(), atol=bound * scale)


ROBWORK = {
    "RevoluteJoint": lambda p, n: E.Revolute((0, 0, 1), p),
    "PrismaticJoint": lambda p, n: E.Prismatic((0, 0, 1), p),
    "UniversalJoint": lambda p, n: E.Universal(p),
    "SphericalJoint": lambda p, n: E.Spherical(p),
    "PrismaticSphericalJoint": lambda p, n: E.PrismaticSpherical(p),
    "PrismaticUniversalJoint": lambda p, n: E.PrismaticUniversal(p),
    "VirtualJoint": lambda p, n: E.Virtual(n, p),
    "DependentRevoluteJoint": lambda p, n: E.Revolute((0, 0, 1), p),
    "DependentPrismaticJoint": lambda p, n: E.Prismatic((0, 0, 1), p),
}


def golden_transform(entry):
    return jf.Transform(jf.Rotation.from_matrix(np.array(entry["R"])), np.array(entry["P"]))


def assert_golden(pose, theirs):
    np.testing.assert_allclose(pose.rotation.to_matrix(), theirs["R"], atol=1e-13)
    np.testing.assert_allclose(pose.translation, theirs["P"], atol=1e-13)


@pytest.mark.float64
@pytest.mark.parametrize("case", [c for c in GOLDEN if c["fn"] in ROBWORK], ids=lambda c: c["id"])
def test_robwork_joints(case):
    given, theirs = case["in"], case["out"]
    b = jf.TreeBuilder(root="world")
    if "Dependent" in case["fn"]:
        scale, offset = given["scale_offset"]
        b.add("owner", parent="world", edge=E.Revolute())
        edge = E.Dependent("owner", ROBWORK[case["fn"]](golden_transform(given["base"]), 1), multiplier=scale, offset=offset)
        b.add("joint", parent="world", edge=edge)
        tree = b.build()
        state = tree.state(q=given["owner_q"])
    else:
        b.add("parent", parent="world", edge=E.Fixed(golden_transform(given["parent"])))
        b.add("joint", parent="parent", edge=ROBWORK[case["fn"]](golden_transform(given["base"]), len(given["q"])))
        tree = b.build()
        state = tree.state(q=given["q"])
        assert_golden(tree.transform(state, of="joint", relative_to="world"), theirs["multiplyTransform"])
    assert tree.edge("joint").state_size == theirs["dof"]
    assert_golden(tree.transform(state, of="joint", relative_to=tree.parent("joint")), theirs["getTransform"])


# --- derivatives at the places that break others ---------------------------------------------------------------------------


def tip_of(tree):
    def tip(q):
        pose = tree.transform(tree.state(q=q), of="tip", relative_to="base")
        return jnp.concatenate([pose.translation, pose.rotation.to_matrix().reshape(9)])

    return tip


def expected_derivative(matrix, q):
    """d(translation, rotation matrix)/dq by central differences at 50 digits."""
    h, columns = mp.mpf(10) ** -16, []
    for i in range(len(q)):
        ends = []
        for s in (1, -1):
            moved = [mp.mpf(float(x)) + (s * h if i == k else 0) for k, x in enumerate(q)]
            ends.append(oracle.world(links_of(lambda t, moved=moved: matrix(moved)), 2, 0))
        slope = (ends[0] - ends[1]) / (2 * h)
        columns.append([float(slope[j, 3]) for j in range(3)] + [float(slope[j, k]) for j in range(3) for k in range(3)])
    return np.array(columns).T


def assert_derivatives(tree, matrix, places, dtype):
    tip = tip_of(tree)
    both = jax.jit(lambda q: (jax.jacfwd(tip)(q), jax.jacrev(tip)(q)))
    for place in places:
        q = np.asarray(place, dtype)
        expected = expected_derivative(matrix, q)
        for found in both(jnp.asarray(q)):
            np.testing.assert_allclose(found, expected, atol=1e-12 if dtype == np.float64 else 1e-5)


@pytest.mark.parametrize("kind", [k for k in FLAT if k != "virtual"])
def test_derivatives_at_zero_at_pi_and_at_limits(kind, dtype):
    make, count, matrix = FLAT[kind]
    tree = tree_of(lambda p: make(p).replace(limits=jnp.asarray([-0.5] * count + [np.pi / 2] * count)))
    assert_derivatives(tree, matrix, [[value] * count for value in (0.0, np.pi, -0.5, np.pi / 2)], dtype)


@pytest.mark.parametrize("kind", CURVED)
def test_derivatives_at_the_identity_and_at_unnormalised_quaternions(kind, dtype):
    make, nq, _, matrix, _ = CURVED[kind]
    tree = tree_of(make)
    rest = [0.3, -0.2, 0.5][: nq - 4]
    quaternions = [1, 0, 0, 0], [0, 0, 1, 0], [2.5, 0, 0, 0], [0.3, -0.4, 0.1, 1.2]
    assert_derivatives(tree, matrix, [[*wxyz, *rest] for wxyz in quaternions], dtype)


@pytest.mark.slow
@pytest.mark.float64
def test_by_level_every_kind_moves_as_unrolled(rng, dtype, monkeypatch):
    b = jf.TreeBuilder(root="base")
    kinds = {**{name: make for name, (make, *_) in FLAT.items()}, **{name: make for name, (make, *_) in CURVED.items()}}
    for side in ("l", "r"):
        parent = "base"
        for name, make in kinds.items():
            b.add(f"{side} {name}", parent=parent, edge=make(pose_of(TIP)))
            parent = f"{side} {name}"
        for follower, source in (("copy", "revolute"), ("copy of copy", "copy")):
            b.add(f"{side} {follower}", parent=parent, edge=E.Mimic(f"{side} {source}", E.Screw(AXIS, 0.2, pose_of(PLACE)), 0.5, 0.1))
        b.add(f"{side} movable", parent=parent, edge=E.Movable(pose_of(PLACE)))
    tree = b.build()
    rows = rng.normal(size=(2, tree.nv)).astype(dtype)
    state = tree.state(q=tree.random(jax.random.key(7)), qd=rows[0], qdd=rows[1])
    with jax.disable_jit():
        unrolled = tree.world_motions(state)
        monkeypatch.setattr("jaxframes.kinematics.plan.MAX_UNROLLED", 0)
        by_level = tree.world_motions(state)
    for mine, other in zip(jax.tree.leaves(by_level), jax.tree.leaves(unrolled), strict=True):
        np.testing.assert_allclose(mine, other, atol=(1e-12 if dtype == np.float64 else 2e-4) * max(1.0, float(np.abs(other).max())))


def test_a_zero_quaternion_is_nan_in_value_and_gradient_and_check_says_so(dtype):
    tree = tree_of(lambda p: E.Ball(p))
    state = tree.state(q=jnp.zeros(4, dtype))
    value, gradient = jax.jit(jax.value_and_grad(lambda q: tip_of(tree)(q)[0]))(state.q)
    assert np.isnan(value)
    assert np.isnan(gradient).all()
    assert "quaternion is zero" in tree.check(state)[0]
