"""Large batches of all frames, worked block after block on a CPU: as a loop over samples, whatever has batch axes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.kinematics.unrolled import BLOCK

COUNTS = (1, BLOCK, BLOCK + 1, 2 * BLOCK + 77)  # none, none, a last block that overlaps the first, a ragged end


def robot(rng):
    """A tree with joints of every family that holds samples apart, a mount, and a prescribed frame."""
    pose = lambda: jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))
    b = jf.TreeBuilder(root="base")
    b.add("turn", parent="base", edge=jf.edges.Revolute(axis=(1, 2, 3), placement=pose()))
    b.add("slide", parent="turn", edge=jf.edges.Prismatic(axis=(0, 1, 1), placement=pose()))
    b.add("mount", parent="slide", edge=jf.edges.Fixed(pose()))
    b.add("held", parent="base", edge=jf.edges.Prescribed())
    b.add("wheel", parent="held", edge=jf.edges.Revolute(axis=(0, 0, 1), placement=pose()))
    return b.build()


def loops(function, *arguments):
    return jax.jit(function).lower(*arguments).as_text().count("stablehlo.while")


def leaves(motions):
    return [
        motions.transform.rotation.to_matrix(),
        motions.transform.translation,
        *jax.tree.leaves((motions.velocity, motions.acceleration)),
    ]


@pytest.fixture
def blocked():
    """Blocks are for a CPU that is one device."""
    if jax.local_device_count("cpu") != 1:
        pytest.skip("several CPU devices")


@pytest.mark.parametrize("count", COUNTS)
def test_blocks_are_as_a_loop_over_samples(count, rng, dtype, tol, blocked):
    tree = robot(rng)
    state = [jnp.asarray(rng.normal(size=(count, tree.nv)), dtype) for _ in range(3)]
    ask = lambda q, qd, qdd: leaves(tree.world_motions(tree.state(q=q, qd=qd, qdd=qdd)))
    assert loops(ask, *state) == (1 if count > BLOCK else 0)
    made = jax.jit(ask)(*state)
    one = jax.jit(jax.vmap(ask))
    for some in (slice(0, 3), slice(max(count - 3, 0), count), slice(max(BLOCK - 2, 0), BLOCK + 2)):
        for whole, part in zip(made, one(*(x[some] for x in state)), strict=True):
            np.testing.assert_allclose(whole[some], part, atol=30 * tol * max(1.0, float(np.abs(whole).max())))


def test_batch_axes_of_every_shape(rng, dtype, tol, blocked):
    tree = robot(rng)
    q = jnp.asarray(rng.normal(size=(3, BLOCK, tree.nq)), dtype)
    held = jf.Transform.from_translation(jnp.asarray(rng.normal(size=(3, 1, 3)), dtype))

    def ask(q, held):
        state = tree.set_motion(tree.state(q=q), "held", held)
        return tree.world_transforms(state).translation

    made = jax.jit(ask)(q, held)
    assert loops(ask, q, held) == 1
    mapped = jax.jit(jax.vmap(ask))(q, held)
    assert loops(jax.vmap(ask), q, held) == 1
    np.testing.assert_allclose(mapped, made, atol=tol * 10)
    for row in range(3):
        np.testing.assert_allclose(made[row, :5], ask(q[row, :5], held[row]), atol=10 * tol)
    inner = jax.jit(jax.vmap(lambda q: ask(q, held[0]), in_axes=1, out_axes=1))(q)
    np.testing.assert_allclose(inner, jnp.stack([ask(q[i], held[0]) for i in range(3)]), atol=10 * tol)


def test_trees_with_batch_axes_are_worked_at_once(rng, dtype, tol, blocked):
    tree = robot(rng)
    q = jnp.asarray(rng.normal(size=(BLOCK + 3, tree.nq)), dtype)
    shifts = jnp.asarray(rng.normal(size=(BLOCK + 3, 3)), dtype)

    def ask(shift, q):
        edge = tree.edge("slide").replace(placement=jf.Transform.from_translation(shift))
        moved = tree.with_edge("slide", edge)
        return moved.world_transforms(moved.state(q=q)).translation

    made = jax.jit(jax.vmap(ask))(shifts, q)
    assert loops(jax.vmap(ask), shifts, q) == 0
    for i in (0, 7, BLOCK + 2):
        np.testing.assert_allclose(made[i], ask(shifts[i], q[i]), atol=10 * tol)


@pytest.mark.float64
def test_gradients_of_blocked_batches(rng, blocked):
    tree = robot(rng)
    q = jnp.asarray(rng.normal(size=(BLOCK + 9, tree.nq)))
    loss = lambda q: jnp.sum(jnp.sin(tree.world_motions(tree.state(q=q, qd=2 * q)).velocity.linear))
    gradient = jax.jit(jax.grad(loss))(q)
    each = jax.jit(jax.vmap(jax.grad(loss)))(q[-20:])
    np.testing.assert_allclose(gradient[-20:], each, atol=1e-11 * float(np.abs(each).max()))
    step = jnp.asarray(rng.normal(size=q.shape))
    ends = [loss(q + s * 1e-6 * step) for s in (1, -1)]
    assert np.isclose(jnp.sum(gradient * step), (ends[0] - ends[1]) / 2e-6, rtol=1e-6)


def test_rows_that_are_bad_spoil_no_other(rng, dtype, blocked):
    tree = robot(rng)
    q = jnp.asarray(rng.normal(size=(BLOCK + 5, tree.nq)), dtype).at[BLOCK + 1, 0].set(jnp.nan)
    made = jax.jit(lambda q: tree.world_transforms(tree.state(q=q)).translation)(q)
    bad = np.isnan(np.asarray(made)).any((1, 2))
    assert np.flatnonzero(bad).tolist() == [BLOCK + 1]
