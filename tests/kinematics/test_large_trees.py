"""Trees of up to 60 frames with every kind of edge, tables and attachable frames included: against matrices, and through time."""

import functools

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests import oracle
from tests.random_trees import parts, random_tree, unit


@pytest.mark.float64
@pytest.mark.parametrize(
    ("seed", "count"), [(0, 2), (1, 17), pytest.param(2, 33, marks=pytest.mark.slow), pytest.param(3, 60, marks=pytest.mark.slow)]
)
def test_random_pairs_and_triples_against_matrices(seed, count):
    rng = np.random.default_rng(100 + seed)
    tree, state, links = random_tree(rng, count)
    o, c = (int(i) for i in rng.integers(0, count + 1, 2))
    triples = [(int(rng.integers(0, count + 1)), o, c) for _ in range(2)]

    def ask(tree, state):
        motions = [tree.motion(state, of=f"f{p}", relative_to=f"f{o}") for p, o, _ in triples]
        turned = [tree.acceleration(state, of=f"f{p}", relative_to=f"f{o}", expressed_in=f"f{c}") for p, o, c in triples]
        return motions, turned

    batch = jax.tree.map(lambda x: jnp.stack([x, x]), state)
    results = {"jit": jax.jit(ask)(tree, state)}
    if count < 20:
        results["vmap"] = jax.tree.map(lambda x: x[1], jax.jit(jax.vmap(ask, in_axes=(None, 0)))(tree, batch))
        results["batch"] = jax.tree.map(lambda x: x[1], jax.jit(ask)(tree, batch))
    for i, (p, o, c) in enumerate(triples):
        expected = oracle.motion(links, p, o)
        axes = oracle.relative(links, o, c)
        turn = np.array([[float(axes[r, k]) for k in range(3)] for r in range(3)])
        for how, (motions, turned) in results.items():
            for mine, theirs in zip(parts(motions[i]), expected, strict=True):
                assert np.abs(mine - theirs).max() <= 1e-11 * max(1.0, np.abs(theirs).max()), (how, p, o)
            linear = turn @ expected[5]
            assert np.abs(np.asarray(turned[i].linear) - linear).max() <= 1e-11 * max(1.0, np.abs(linear).max()), (how, p, o, c)


def mixed_scene(rng):
    """A tree with every kind of edge on the way: tables, joints, prescribed and attachable frames, attachables on attachables."""
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("itrf93", parent="earth", edge=tables["itrf93"])
    pose = lambda: jf.Transform(jf.Rotation.from_quaternion_wxyz(unit(rng, 4)), rng.normal(size=3))
    b.add("mount", parent="itrf93", edge=jf.edges.Fixed(pose()))
    b.add("craft", parent="mount", edge=jf.edges.Prescribed())
    b.add("slide", parent="craft", edge=jf.edges.Prismatic(axis=(1, 2, 3), placement=pose()))
    b.add("turn", parent="slide", edge=jf.edges.Revolute(axis=(3, -1, 2), placement=pose()))
    b.add("load", parent="turn", edge=jf.edges.Attachable(pose()))
    b.add("wheel", parent="load", edge=jf.edges.Revolute(axis=(0, 1, 1), placement=pose()))
    b.add("tag", parent="wheel", edge=jf.edges.Attachable(pose()))
    return b.build()


def moved(motion, t):
    """A motion's pose a short time later: rotation exp(w t + alpha t2 / 2) R, translation l + v t + a t2 / 2."""
    turn = jf.Rotation.from_rotation_vector(motion.velocity.angular * t + motion.acceleration.angular * (t * t / 2))
    place = motion.transform.translation + motion.velocity.linear * t + motion.acceleration.linear * (t * t / 2)
    return motion.replace(transform=jf.Transform(turn @ motion.transform.rotation, place))


@pytest.mark.float64
@pytest.mark.parametrize(("of", "relative_to"), [("tag", "emb"), pytest.param("mount", "wheel", marks=pytest.mark.slow)])
def test_motions_are_derivatives_of_poses_through_time(of, relative_to):
    rng = np.random.default_rng(7)
    tree = mixed_scene(rng)
    q, qd, qdd = rng.normal(size=(3, 3))
    start = jf.Epoch.from_tdb("2026-05-01T06:00:00")

    def speed():
        return jf.SpatialVelocity(*rng.normal(size=(2, 3))), jf.SpatialAcceleration(*rng.normal(size=(2, 3)))

    first = tree.state(q=q, qd=qd, qdd=qdd, time=start)
    first = tree.set_motion(first, "craft", jf.Transform(jf.Rotation.from_quaternion_wxyz(unit(rng, 4)), rng.normal(size=3)), *speed())
    first = tree.set_motion(tree.set_motion(first, "load", None, *speed()), "tag", None, *speed())
    attach = functools.partial(jf.Attachments, first.attachments.parents)

    def at(t):
        held = first.replace(q=q + qd * t + qdd * (t * t / 2), time=start + t, prescribed=moved(first.prescribed, t))
        return held.replace(attachments=attach(moved(first.attachments.motion, t)))

    def ends(t):
        pose = tree.transform(at(t), of=of, relative_to=relative_to)
        return pose.rotation.to_matrix(), pose.translation

    once = lambda t: jax.jvp(ends, (t,), (1.0,))
    ((matrix, place), (matrix1, place1)), (_, (matrix2, place2)) = jax.jit(lambda t: jax.jvp(once, (t,), (1.0,)))(0.0)
    vee = lambda m: np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2
    motion = jax.jit(lambda s: tree.motion(s, of=of, relative_to=relative_to))(first)
    spin = np.asarray(matrix1) @ np.asarray(matrix).T
    bend = np.asarray(matrix2) @ np.asarray(matrix).T - spin @ spin
    for mine, theirs in (
        (motion.transform.translation, place),
        (motion.velocity.angular, vee(spin)),
        (motion.velocity.linear, place1),
        (motion.acceleration.angular, vee(bend)),
        (motion.acceleration.linear, place2),
    ):
        assert np.abs(np.asarray(mine) - np.asarray(theirs)).max() <= 1e-11 * max(1.0, np.abs(np.asarray(theirs)).max())


def test_new_prescribed_values_and_attachments_never_retrace(dtype):
    chex.clear_trace_counter()
    b = jf.TreeBuilder()
    b.add("craft", parent="world", edge=jf.edges.Prescribed())
    b.add("load", parent="craft", edge=jf.edges.Attachable())
    tree = b.build()

    @jax.jit
    @chex.assert_max_traces(n=1)
    def ask(state):
        return tree.transform(state, of="load", relative_to="world").translation

    state = tree.state()
    ask(state)
    state = tree.set_motion(state, "craft", jf.Transform.from_translation((1, 2, 3)))
    np.testing.assert_array_equal(ask(state), [1, 2, 3])
    state = tree.set_motion(tree.detach(state, "load"), "load", jf.Transform.from_translation(np.array([4.0, 5.0, 6.0])))
    np.testing.assert_array_equal(ask(state), [4, 5, 6])


@pytest.mark.float64
def test_a_few_robots_among_many_satellites(rng):
    """Wide and deep parts, tables, joints and prescribed frames in one tree that goes by level: as one query for each frame."""
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=jf.spice.example_tables()["earth"])
    panel = jf.edges.Revolute(axis=(0, 1, 0), placement=jf.Transform.from_translation((0.0, 1.0, 0.0)))
    for i in range(150):
        b.add(f"sat{i}", parent="earth", edge=jf.edges.Prescribed())
        b.add(f"panel{i}", parent=f"sat{i}", edge=panel)
    for k in range(2):
        for j in range(5):
            kind = jf.edges.Prismatic if j == 2 else jf.edges.Revolute
            edge = kind(axis=rng.normal(size=3), placement=jf.Transform.from_translation(rng.normal(size=3)))
            b.add(f"arm{k}/{j}", parent=f"arm{k}/{j - 1}" if j else f"sat{k}", edge=edge)
    tree = b.build()
    assert "by level, all frames of a level at a time" in tree.explain()
    q, qd, qdd = rng.normal(size=(3, tree.nq))
    state = tree.state(q=q, qd=qd, qdd=qdd, time=jf.Epoch.from_tdb("2026-05-01T06:00:00"))
    count = len([name for name in tree.names if name.startswith("sat")])
    wxyz = rng.normal(size=(count, 4))
    poses = jf.Transform(jf.Rotation.from_quaternion_wxyz(wxyz / np.linalg.norm(wxyz, axis=1)[:, None]), 7e6 * rng.normal(size=(count, 3)))
    speeds = jf.SpatialVelocity(*rng.normal(size=(2, count, 3))), jf.SpatialAcceleration(*rng.normal(size=(2, count, 3)))
    state = state.replace(prescribed=jf.Motion(poses, *speeds))
    whole = jax.jit(tree.world_motions)(state)
    seen = jax.jit(lambda s: tree.relative_transforms(s, relative_to="arm1/4"))(state)
    ask = jax.jit(lambda s: [tree.motion(s, of=name, relative_to="emb") for name in ("arm0/4", "arm1/2", "panel0", "panel149", "sat77")])
    for name, one in zip(("arm0/4", "arm1/2", "panel0", "panel149", "sat77"), ask(state), strict=True):
        for mine, theirs in zip(parts(whole[tree.names.index(name)]), parts(one), strict=True):
            assert np.abs(mine - theirs).max() <= 1e-12 * max(1.0, np.abs(theirs).max()), name
    pair = jax.jit(lambda s: tree.transform(s, of="arm1/0", relative_to="arm1/4").translation)(state)
    assert np.abs(seen.translation[tree.names.index("arm1/0")] - pair).max() <= 1e-8  # of the way by the root, 1e7 m off


def one_of_many(rng, count, batch, deep):
    """A tree of joints, and the same with a batch of mounts for one of them."""
    b = jf.TreeBuilder(root="world")
    for i in range(count):
        mount = jf.Transform.from_translation(rng.normal(size=3))
        b.add(f"f{i}", parent="world" if i == 0 else f"f{i - 1 if deep else (i - 1) // 2}", edge=jf.edges.Revolute((0, 1, 0), mount))
    tree = b.build()
    mounts = jf.Transform.from_translation(rng.normal(size=(batch, 3)))
    return tree, tree.with_edge("f1", tree.edge("f1").replace(placement=mounts))


def test_a_batch_of_numbers_for_one_edge_is_not_stored_for_all_of_its_family(rng):
    tree, many = one_of_many(rng, 200, 10_000, deep=False)
    state, last = tree.state(), "f199"
    place = lambda tree: tree.transform(state, of=last, relative_to="world").translation
    place(tree)
    before = sum(array.nbytes for array in jax.live_arrays())
    found = place(many)
    assert found.shape == (10_000, 3)
    held = sum(array.nbytes for array in jax.live_arrays()) - before - found.nbytes
    assert held <= 2 * sum(leaf.nbytes for leaf in jax.tree.leaves(many))  # 112 MB of float64 where all had the batch, now 0.6


@pytest.mark.parametrize("deep", [False, True])
def test_edges_with_a_batch_of_numbers_among_many_without(deep, rng, dtype, tol):
    tree, many = one_of_many(rng, 90, 3, deep)
    state = tree.state(q=rng.normal(size=tree.nq).astype(dtype), qd=rng.normal(size=tree.nv).astype(dtype))
    last = "f89"

    def asked(tree, state):
        return tree.motion(state, of=last, relative_to="world"), tree.world_transforms(state)

    def alone(i):
        return jax.tree.map(lambda leaf: leaf[i] if leaf.ndim > 1 else leaf, many)

    outside, inside, argument = asked(many, state), jax.jit(lambda s: asked(many, s))(state), jax.jit(asked)(many, state)
    for i in (0, 2):
        for got in (outside, inside, argument):
            for a, b in zip(jax.tree.leaves(got), jax.tree.leaves(asked(alone(i), state)), strict=True):
                np.testing.assert_allclose(a[i], b, atol=100 * tol * max(1.0, float(np.abs(b).max())))

    def height(tree):
        return jnp.sum(tree.transform(state, of=last, relative_to="world").translation[..., 2])

    gradient = jax.grad(height)(many)
    for name in ("f0.placement.translation", "f1.placement.translation"):
        each = np.stack([jax.grad(height)(alone(i)).get(name) for i in range(3)])
        np.testing.assert_allclose(gradient.get(name), each if name.startswith("f1") else each.sum(0), atol=100 * tol)
