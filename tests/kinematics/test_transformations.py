"""jit, vmap, batch axes, retraces, dtypes and gradients of tree queries."""

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests.random_trees import random_tree


def arm(length=0.3):
    b = jf.TreeBuilder(root="base")
    b.add("one", parent="base", edge=jf.edges.Revolute(axis=(0, 0, 1), placement=jf.Transform.from_translation((0, 0, length))))
    b.add("two", parent="one", edge=jf.edges.Revolute(axis=(0, 1, 0), placement=jf.Transform.from_translation((0.5, 0, 0))))
    b.add("tip", parent="two", edge=jf.edges.Fixed(jf.Transform.from_translation((0.2, 0.1, 0))))
    return b.build()


def motion_leaves(tree, state):
    return jax.tree.leaves(tree.motion(state, of="tip", relative_to="one"))


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 2)])
def test_jit_vmap_batch_and_loop_agree(batch, rng, dtype, tol):
    tree = arm()
    q, qd, qdd = (jnp.asarray(rng.normal(size=(*batch, 2)), dtype) for _ in range(3))
    ask = lambda q, qd, qdd: motion_leaves(tree, tree.state(q=q, qd=qd, qdd=qdd))
    native = jax.jit(ask)(q, qd, qdd)
    mapped = ask
    for _ in batch:
        mapped = jax.vmap(mapped)
    for a, b, c in zip(native, jax.jit(mapped)(q, qd, qdd), ask(q, qd, qdd), strict=True):
        assert a.shape[: len(batch)] == batch
        np.testing.assert_allclose(b, a, atol=tol)
        np.testing.assert_allclose(c, a, atol=tol)
    one = jax.jit(ask)
    for index in np.ndindex(*batch):
        for whole, single in zip(native, one(q[index], qd[index], qdd[index]), strict=True):
            np.testing.assert_allclose(whole[index], single, atol=tol)


def test_batch_axes_of_fields_broadcast_against_each_other(rng, dtype, tol):
    b = jf.TreeBuilder(root="base")
    b.add("craft", parent="base", edge=jf.edges.Prescribed())
    b.add("arm", parent="craft", edge=jf.edges.Revolute(axis=(1, 2, 3)))
    tree = b.build()
    positions, q = rng.normal(size=(5, 1, 3)).astype(dtype), rng.normal(size=(4, 1)).astype(dtype)
    transform = jf.Transform(jf.Rotation.identity((5, 1)), jnp.asarray(positions))
    pose = tree.transform(tree.set_motion(tree.state(q=q), "craft", transform), of="arm", relative_to="base")
    assert pose.translation.shape == (5, 4, 3)
    np.testing.assert_allclose(pose.translation, np.broadcast_to(positions, (5, 4, 3)), atol=tol)


def test_a_batch_of_trees_is_one_more_axis(rng, dtype, tol):
    trees = [arm(length) for length in (0.1, 0.2, 0.3)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)
    q = jnp.asarray(rng.normal(size=2), dtype)
    many = jax.vmap(lambda tree: tree.transform(tree.state(q=q), of="tip", relative_to="base").translation)(stacked)
    native = stacked.transform(stacked.state(q=q), of="tip", relative_to="base").translation
    for i, tree in enumerate(trees):
        one = tree.transform(tree.state(q=q), of="tip", relative_to="base").translation
        np.testing.assert_allclose(many[i], one, atol=tol)
        np.testing.assert_allclose(native[i], one, atol=tol)


def test_numbers_never_retrace_and_equal_trees_share_a_program(dtype):
    chex.clear_trace_counter()

    @jax.jit
    @chex.assert_max_traces(n=1)
    def tip(tree, state):
        return tree.transform(state, of="tip", relative_to="base").translation

    first, second = arm(0.3), arm(0.9)
    assert first.topology == second.topology
    assert hash(first.topology) == hash(second.topology)
    tip(first, first.state(q=[0.1, 0.2]))
    tip(second, second.state(q=np.array([3.0, 4.0]), qd=np.ones(2)))
    tip(first, first.state(q={"two": 1}))
    tip(first.with_edge("tip", jf.edges.Fixed()), second.state())


def test_times_never_retrace(dtype):
    chex.clear_trace_counter()
    tree = arm()

    @jax.jit
    @chex.assert_max_traces(n=1)
    def ask(state):
        return tree.transform(state, of="tip", relative_to="base").translation * state.time.et

    state = tree.state(time=0.0)
    for t in (1, 2.5, np.float64(7.25e8), jnp.asarray(3.0, dtype), jf.Epoch.from_tdb("2026-03-01"), jf.Epoch.from_et(5) + 0.5):
        ask(state.replace(time=t))


def test_topologies_differ_by_name_structure_and_property():
    def build(name="a", parent="root", properties=None):
        b = jf.TreeBuilder(root="root")
        b.add("x", parent="root", edge=jf.edges.Fixed())
        b.add(name, parent=parent, edge=jf.edges.Fixed(), properties=properties)
        return b.build().topology

    assert build() == build()
    for other in (build(name="b"), build(parent="x"), build(properties={"colour": "red"})):
        assert build() != other


@pytest.mark.float64
@pytest.mark.parametrize("seed", [5, 6])
def test_gradients_of_random_trees_agree_with_central_differences(seed):
    tree, state, _ = random_tree(np.random.default_rng(seed), 7)

    def loss(state):
        motion = tree.motion(state, of="f7", relative_to="f2")
        return sum(jnp.sum(jnp.sin(x) * np.arange(1.0, x.shape[-1] + 1)) for x in jax.tree.leaves(motion))

    compiled = jax.jit(loss)
    gradient = jax.jit(jax.grad(loss))(state)
    for name in ("q", "qd", "qdd"):
        values = getattr(state, name)
        for i in range(values.shape[0]):
            h = 1e-6
            ends = [compiled(state.replace(**{name: values.at[i].add(s * h)})) for s in (1, -1)]
            np.testing.assert_allclose(getattr(gradient, name)[i], (ends[0] - ends[1]) / (2 * h), atol=2e-7)


def test_gradients_with_respect_to_the_geometry(dtype, tol):
    tree = arm()
    state = tree.state(q=[0.0, 0.0])
    tip = lambda tree: tree.transform(state, of="tip", relative_to="base").translation
    jacobian = jax.jacrev(tip)(tree).edge("two").placement.translation
    np.testing.assert_allclose(jacobian, np.eye(3), atol=tol)


def test_derivatives_at_zero_joint_angles_are_right(dtype, tol):
    tree = arm()
    tip = lambda q: tree.transform(tree.state(q=q), of="tip", relative_to="base").translation
    expected = np.array([[-0.1, 0.0], [0.7, 0.0], [0.0, -0.2]])  # z x r and y x r with r = (0.7, 0.1) and (0.2, 0.1)
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(derivative(tip)(jnp.zeros(2, dtype)), expected, atol=tol)


def test_one_bad_row_spoils_no_other(dtype):
    tree = arm()
    q = jnp.asarray([[0.1, 0.2], [np.nan, 0.3], [0.4, 1e30]], dtype)
    tip = jax.jit(lambda q: tree.transform(tree.state(q=q), of="tip", relative_to="base").translation)
    got = np.asarray(tip(q))
    np.testing.assert_allclose(got[0], tip(q[0]), atol=4 * np.finfo(dtype).eps)
    assert np.isnan(got[1]).all()
    assert np.isnan(got[2]).all()  # an angle that no number resolves has no sine


def test_float32_numbers_stay_float32(dtype):
    tree = arm().astype(np.float32)
    state = tree.state(q=jnp.zeros(2, np.float32))
    assert tree.transform(state, of="tip", relative_to="base").translation.dtype == np.float32
    assert jax.jit(lambda s: tree.motion(s, of="tip", relative_to="base"))(state).acceleration.linear.dtype == np.float32
