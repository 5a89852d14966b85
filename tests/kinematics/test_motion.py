"""Poses, velocities and accelerations between frames, against matrices at 50 digits and against KDL's second-order frames."""

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests import oracle
from tests.random_trees import parts, random_tree

GOLDEN = json.loads((Path(__file__).parent.parent / "data" / "kdl_frameacc.json").read_text())["cases"]


@pytest.mark.parametrize("seed", range(8))
def test_random_pairs_agree_with_the_oracle(seed, dtype):
    rng = np.random.default_rng(seed)
    tree, state, links = random_tree(rng, int(rng.integers(2, 14)), dtype)
    pairs = [rng.integers(len(links), size=2) for _ in range(3)]

    @jax.jit
    def ask(tree, state):
        return [tree.motion(state, of=f"f{p}", relative_to=f"f{o}") for p, o in pairs]

    for (p, o), got in zip(pairs, ask(tree, state), strict=True):
        for name, mine, theirs in zip(["R", "l", "w", "v", "alpha", "a"], parts(got), oracle.motion(links, int(p), int(o)), strict=True):
            scale = max(1.0, np.abs(theirs).max())
            bound = 2e-12 if dtype == np.float64 else 3e-4
            assert np.abs(mine - theirs).max() <= bound * scale, (name, p, o)


@pytest.mark.parametrize("seed", [11, 12])
def test_expressed_in_turns_the_axes_and_nothing_else(seed, dtype, tol):
    tree, state, links = random_tree(np.random.default_rng(seed), 9, dtype)
    p, o, c = 9, 4, 6
    _, _, w, v, alpha, a = oracle.motion(links, p, o)
    axes = oracle.relative(links, o, c)
    turn = np.array([[float(axes[i, j]) for j in range(3)] for i in range(3)])

    @jax.jit
    def ask(tree, state):
        names = {"of": f"f{p}", "relative_to": f"f{o}", "expressed_in": f"f{c}"}
        return tree.velocity(state, **names), tree.acceleration(state, **names)

    velocity, acceleration = ask(tree, state)
    for mine, theirs in ((velocity.angular, w), (velocity.linear, v), (acceleration.angular, alpha), (acceleration.linear, a)):
        np.testing.assert_allclose(mine, turn @ theirs, atol=40 * tol * max(1.0, np.abs(theirs).max()))


def test_world_queries_agree_with_pairwise_ones(dtype, tol):
    tree, state, _ = random_tree(np.random.default_rng(3), 8, dtype)
    motions = jax.jit(lambda t, s: t.world_motions(s))(tree, state)
    poses, velocities = jax.jit(lambda t, s: (t.world_transforms(s), t.world_velocities(s)))(tree, state)
    assert motions.transform.rotation.wxyz.shape == (9, 4)
    for i in (0, 3, 8):
        one = jax.jit(lambda t, s, i=i: t.motion(s, of=f"f{i}", relative_to="f0"))(tree, state)
        for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(motions), strict=True):
            np.testing.assert_allclose(b[i], a, atol=20 * tol * max(1.0, np.abs(a).max()))
    np.testing.assert_allclose(poses.translation, motions.transform.translation, rtol=tol, atol=tol)
    np.testing.assert_allclose(velocities.linear, motions.velocity.linear, rtol=tol, atol=tol)


def golden_tree():
    b = jf.TreeBuilder(root="c")
    b.add("B", parent="c", edge=jf.edges.Prescribed())
    b.add("A", parent="B", edge=jf.edges.Prescribed())
    b.add("C", parent="c", edge=jf.edges.Prescribed())
    b.add("D", parent="C", edge=jf.edges.Prescribed())
    return b.build()


def set_golden(tree, state, name, case):
    from_matrix = jf.Rotation.from_matrix(np.array(case["R"]))
    l, w, v, alpha, a = (np.array(case[k]) for k in ("l", "w", "v", "alpha", "a"))
    return tree.set_motion(state, name, jf.Transform(from_matrix, l), jf.SpatialVelocity(w, v), jf.SpatialAcceleration(alpha, a))


ROUTES = {
    "FrameAcc.mul": ({"A": "B", "B": "A"}, "A", "c"),
    "FrameAcc.Inverse": ({"A": "B"}, "c", "B"),
    "FrameAcc.chain_invA_invB_C_D": ({"A": "B", "B": "A", "C": "C", "D": "D"}, "D", "A"),  # the file's chain is (A B)^-1 C D
}


@pytest.mark.float64
@pytest.mark.parametrize("function", ROUTES)
def test_kdl_second_order_frames(function):
    places, of, relative_to = ROUTES[function]
    tree = golden_tree()
    cases = [c for c in GOLDEN if c["fn"] == function]
    assert len(cases) >= 10
    ask = jax.jit(lambda s: tree.motion(s, of=of, relative_to=relative_to))
    for case in cases:
        state = tree.state()
        for given, frame in places.items():
            state = set_golden(tree, state, frame, case["in"][given])
        for key, mine in zip(("R", "l", "w", "v", "alpha", "a"), parts(ask(state)), strict=True):
            theirs = np.array(case["out"][key])
            assert np.abs(mine - theirs).max() <= 1e-12 * max(1.0, np.abs(theirs).max()), (case["id"], key)


def test_velocity_and_acceleration_are_derivatives_of_the_pose_through_time(dtype):
    b = jf.TreeBuilder(root="base")
    b.add(
        "shoulder", parent="base", edge=jf.edges.Revolute(axis=(0.3, -0.5, 0.8), placement=jf.Transform.from_translation((0.1, 0.2, 0.3)))
    )
    b.add("slide", parent="shoulder", edge=jf.edges.Prismatic(axis=(1, 0, 0)))
    b.add("wrist", parent="slide", edge=jf.edges.Revolute(axis=(0, 1, 0), placement=jf.Transform.from_translation((0.4, 0.0, -0.1))))
    b.add("tip", parent="wrist", edge=jf.edges.Fixed(jf.Transform.from_translation((0.0, 0.5, 0.2))))
    tree = b.build()
    q, qd, qdd = (jnp.asarray(x, dtype) for x in ([0.4, -0.7, 1.9], [0.5, 0.3, -0.8], [-0.2, 0.9, 0.6]))

    def position(t):
        return tree.transform(tree.state(q=q + qd * t + qdd * (t * t / 2)), of="tip", relative_to="base").translation

    zero = jnp.zeros((), dtype)
    motion = tree.motion(tree.state(q=q, qd=qd, qdd=qdd), of="tip", relative_to="base")
    eps = 1e-13 if dtype == np.float64 else 2e-6
    np.testing.assert_allclose(jax.jit(jax.jacfwd(position))(zero), motion.velocity.linear, atol=eps)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(jax.jacfwd(position)))(zero), motion.acceleration.linear, atol=eps)


def test_frames_behind_a_distant_root_keep_their_distance(dtype):
    b = jf.TreeBuilder(root="sun")
    b.add("earth", parent="sun", edge=jf.edges.Prescribed())
    b.add("one", parent="earth", edge=jf.edges.Prescribed())
    b.add("two", parent="one", edge=jf.edges.Prismatic(axis=(1, 0, 0)))
    b.add("three", parent="one", edge=jf.edges.Prismatic(axis=(1, 0, 0)))
    tree = b.build()
    state = tree.set_motion(tree.state(), "earth", jf.Transform.from_translation((1.495978707e11, 2e10, -3e9)))
    state = tree.set_motion(state, "one", jf.Transform.from_translation((6.9e6, 1e6, 2e6)))

    def distance(q):
        return tree.transform(state.replace(q=q), of="two", relative_to="three").translation[0]

    value, gradient = jax.value_and_grad(distance)(jnp.asarray([4.0, 1.0], dtype))
    assert float(value) == 3.0
    np.testing.assert_array_equal(gradient, np.array([1.0, -1.0]))


def test_frames_that_are_all_fixed_are_computed_too(tol):
    b = jf.TreeBuilder(root="world")
    place = jf.Transform(jf.Rotation.rot_z(np.pi / 2), np.array([1.0, 0.0, 0.0]))
    b.add("a", parent="world", edge=jf.edges.Fixed(place))
    b.add("b", parent="a", edge=jf.edges.Fixed(place))
    tree = b.build()
    motions = tree.world_motions(tree.state())
    np.testing.assert_allclose(motions.transform.translation, [[0, 0, 0], [1, 0, 0], [1, 1, 0]], atol=tol)
    np.testing.assert_array_equal(motions.acceleration.linear, np.zeros((3, 3)))
    batched = tree.with_values({"a.transform.translation": np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])})
    np.testing.assert_allclose(batched.world_transforms(tree.state()).translation[:, 2], [[1, 1, 0], [2, 1, 0]], atol=tol)
