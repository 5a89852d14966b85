"""Beside other libraries: orbax keeps trees by name, equinox edits them, optax, optimistix and diffrax work through them."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import optimistix
import orbax.checkpoint as ocp
import pytest

import jaxframes as jf
from tests.pipeline.trees import turned

CAMERA = "camera.transform.translation"


@pytest.fixture(autouse=True)
def promotions():
    """Those libraries mix dtypes and ranks; the other tests of this project forbid it."""
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        yield


def arm(order=("shoulder", "elbow", "camera"), seed=0, limits=(-2.0, 2.0)):
    """An arm whose frames are declared in some order, its numbers drawn frame by frame."""
    rng = np.random.default_rng(seed)
    edges = {
        "shoulder": jf.edges.Revolute(axis=(0.0, 0.0, 1.0), placement=turned(rng), limits=limits),
        "elbow": jf.edges.Revolute(axis=(0.0, 1.0, 0.0), placement=turned(rng)),
        "camera": jf.edges.Fixed(turned(rng)),
        "lamp": jf.edges.Fixed(turned(rng)),
    }
    parents = {"shoulder": "world", "elbow": "shoulder", "camera": "elbow", "lamp": "world"}
    b = jf.TreeBuilder()
    for name in order:
        b.add(name, parent=parents[name], edge=edges[name])
    return b.build()


def place(tree, q):
    return tree.transform(tree.state(q=q), of="camera", relative_to="world").translation


def samples(dtype, count=6):
    return jnp.asarray(np.random.default_rng(5).normal(size=(count, 2)), dtype)


@pytest.mark.filterwarnings("ignore")  # orbax warns of itself
def test_orbax_gives_each_frame_its_own_numbers_in_whatever_order(tmp_path):
    saved, other = arm(("shoulder", "lamp", "elbow", "camera")), arm(("lamp", "shoulder", "elbow", "camera"), seed=1)
    with ocp.StandardCheckpointer() as checkpointer:
        checkpointer.save(tmp_path / "tree", saved)
        checkpointer.wait_until_finished()
        restored = checkpointer.restore(tmp_path / "tree", jax.tree.map(ocp.utils.to_shape_dtype_struct, other))
        for name in ("shoulder", "elbow", "camera", "lamp"):
            for mine, theirs in zip(jax.tree.leaves(restored.edge(name)), jax.tree.leaves(saved.edge(name)), strict=True):
                np.testing.assert_array_equal(mine, theirs)
        np.testing.assert_array_equal(place(restored, jnp.ones(2)), place(saved, jnp.ones(2)))
        with pytest.raises(ValueError, match="lamp"):  # a frame that the file has and the tree has not is named
            checkpointer.restore(tmp_path / "tree", jax.tree.map(ocp.utils.to_shape_dtype_struct, arm()))


def test_equinox_edits_filters_and_saves(tmp_path, dtype):
    class Model(eqx.Module):
        tree: jf.FrameTree
        gain: jax.Array

    model, q = Model(arm(), jnp.ones(())), samples(dtype)[0]
    moved = eqx.tree_at(lambda m: m.tree.edge("camera").transform.translation, model, jnp.asarray([1.0, 2.0, 3.0]))
    expected = model.tree.with_values({CAMERA: jnp.asarray([1.0, 2.0, 3.0])})
    np.testing.assert_array_equal(eqx.filter_jit(lambda m, q: place(m.tree, q))(moved, q), place(expected, q))

    own, rest = eqx.partition(model.tree, model.tree.mask(CAMERA))
    assert [leaf.shape for leaf in jax.tree.leaves(own)] == [(3,)]
    gradient = eqx.filter_grad(lambda own: jnp.sum(place(eqx.combine(own, rest), q)))(own)
    full = jax.grad(lambda tree: jnp.sum(place(tree, q)))(model.tree)
    np.testing.assert_allclose(jax.tree.leaves(gradient)[0], full.get(CAMERA), rtol=1e-5)

    eqx.tree_serialise_leaves(tmp_path / "model.eqx", moved)
    again = eqx.tree_deserialise_leaves(tmp_path / "model.eqx", model)
    np.testing.assert_array_equal(place(again.tree, q), place(moved.tree, q))


def test_optax_trains_what_a_mask_names_and_nothing_else(dtype):
    true, q = arm(), samples(dtype)
    start = true.with_values({CAMERA: true.get(CAMERA) + 0.1})
    mask = start.mask(CAMERA)
    frozen = jax.tree.map(lambda chosen: not chosen, mask)
    optimiser = optax.chain(optax.masked(optax.adam(0.02), mask), optax.masked(optax.set_to_zero(), frozen))
    seen = place(true, q)

    @jax.jit
    def step(tree, held):
        gradient = jax.grad(lambda tree: jnp.sum((place(tree, q) - seen) ** 2))(tree)
        update, held = optimiser.update(gradient, held, tree)
        return optax.apply_updates(tree, update), held

    tree, held = start, optimiser.init(start)
    for _ in range(200):
        tree, held = step(tree, held)
    np.testing.assert_allclose(tree.get(CAMERA), true.get(CAMERA), atol=2e-3)
    for name in ("shoulder", "elbow"):
        assert all(map(np.array_equal, jax.tree.leaves(tree.edge(name)), jax.tree.leaves(true.edge(name))))


def test_limits_reach_no_optimiser(dtype):
    tree, q = arm(limits=(-np.inf, np.inf)), samples(dtype)
    assert np.isfinite(optax.tree.norm(tree))
    optimiser = optax.adamw(1e-3)
    update, _ = optimiser.update(jax.grad(lambda tree: jnp.sum(place(tree, q)))(tree), optimiser.init(tree), tree)
    assert np.isfinite(place(optax.apply_updates(tree, update), q)).all()


@pytest.mark.float64
def test_optimistix_calibrates_a_mount_and_solves_for_joints():
    true, q = arm(), samples(np.float64)
    seen = place(true, q)
    start = {CAMERA: true.get(CAMERA) + 0.3, "elbow.placement.translation": true.get("elbow.placement.translation") - 0.2}
    solver = optimistix.LevenbergMarquardt(rtol=1e-10, atol=1e-10)
    found = optimistix.least_squares(lambda values, _: place(true.with_values(values), q) - seen, solver, start)
    np.testing.assert_allclose(place(true.with_values(found.value), q), seen, atol=1e-8)

    goal = place(true, jnp.asarray([0.4, -0.3]))
    joints = optimistix.least_squares(lambda q, tree: place(tree, q) - goal, solver, jnp.asarray([0.2, -0.1]), args=true)
    np.testing.assert_allclose(joints.value, [0.4, -0.3], atol=1e-8)


@pytest.mark.float64
def test_diffrax_integrates_states_and_differentiates_through_trees():
    tree = arm()

    def end(tree):
        """Where the camera's path has led, its velocity integrated along joints that move uniformly."""

        def velocity(t, at, tree):
            state = tree.state(q=jnp.stack([t, 0.5 * t]), qd=jnp.asarray([1.0, 0.5]))
            return tree.motion(state, of="camera", relative_to="world").velocity.linear

        start = place(tree, jnp.zeros(2))
        steps = diffrax.PIDController(rtol=1e-10, atol=1e-10)
        solved = diffrax.diffeqsolve(diffrax.ODETerm(velocity), diffrax.Tsit5(), 0.0, 1.0, 0.1, start, args=tree, stepsize_controller=steps)
        return solved.ys[0]

    np.testing.assert_allclose(end(tree), place(tree, jnp.asarray([1.0, 0.5])), atol=1e-9)
    gradient = jax.grad(lambda tree: jnp.sum(end(tree)))(tree).get("elbow.placement.translation")
    exact = jax.grad(lambda tree: jnp.sum(place(tree, jnp.asarray([1.0, 0.5]))))(tree).get("elbow.placement.translation")
    np.testing.assert_allclose(gradient, exact, atol=1e-8)

    field = lambda t, state, args: jax.tree.map(jnp.zeros_like, state).replace(q=state.qd, qd=-state.q)  # oscillators
    whole = tree.state(q=[1.0, 0.5], qd=[0.0, 0.0])
    solved = diffrax.diffeqsolve(
        diffrax.ODETerm(field), diffrax.Dopri8(), 0.0, np.pi, 0.1, whole, stepsize_controller=diffrax.PIDController(1e-9, 1e-9)
    )
    np.testing.assert_allclose(solved.ys.q[0], [-1.0, -0.5], atol=1e-7)
