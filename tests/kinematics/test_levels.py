"""Trees with many frames go by depth level: the same values as single queries, with batches, vmap, gradients and tables."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.kinematics import plan
from jaxframes.kinematics.level_blocks import BLOCK
from tests.random_trees import parts, random_tree


def bushy_tree(rng, dtype):
    """More than ``plan.MAX_UNROLLED`` frames of every kind, hanging at most a few deep, below a table."""
    tree, state, _ = random_tree(rng, 9, dtype)
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=jf.spice.example_tables()["earth"])
    copies = 8
    for i in range(copies):
        b.include(tree, parent="earth", prefix=f"{i}/")
    whole = b.build()
    held = jax.tree.map(lambda x: jnp.concatenate([x] * copies), state.prescribed)
    q, qd, qdd = (jnp.tile(x, copies) for x in (state.q, state.qd, state.qdd))
    state = whole.state(q=q + jnp.arange(q.size, dtype=dtype) * 0.01, qd=qd, qdd=qdd, time=jf.Epoch.from_tdb("2026-05-01"))
    return whole, state.replace(prescribed=held)


def test_levels_agree_with_single_queries(rng, dtype):
    tree, state = bushy_tree(rng, dtype)
    assert len(tree.names) > plan.MAX_UNROLLED
    motions = jax.jit(lambda t, s: t.world_motions(s))(tree, state)
    poses = jax.jit(lambda s: tree.world_transforms(s))(state)
    chosen = ("3/f9", "6/f5", "earth", "emb", "7/f0")
    ask = jax.jit(lambda s: [tree.motion(s, of=name, relative_to="emb") for name in chosen])
    bound = 1e-11 if dtype == np.float64 else 1e-4
    for name, one in zip(chosen, ask(state), strict=True):
        i = tree.topology.index(name)
        for mine, theirs in zip(parts(motions[i]), parts(one), strict=True):
            assert np.abs(mine - theirs).max() <= bound * max(1.0, np.abs(theirs).max()), name
        np.testing.assert_allclose(poses.translation[i], one.transform.translation, rtol=bound, atol=bound)


@pytest.mark.parametrize("batch", [(2, 3)])
def test_levels_batch_and_vmap_agree(batch, rng, dtype, tol):
    tree, state = bushy_tree(rng, dtype)
    q = jnp.asarray(rng.normal(size=(*batch, tree.nq)), dtype)
    ask = lambda q: tree.world_transforms(state.replace(q=q)).translation
    native, mapped = jax.jit(ask)(q), ask
    for _ in batch:
        mapped = jax.vmap(mapped)
    scale = float(np.abs(native).max())
    assert native.shape == (*batch, len(tree.names), 3)
    np.testing.assert_allclose(jax.jit(mapped)(q), native, atol=10 * tol * scale)
    np.testing.assert_allclose(jax.jit(ask)(q[(0,) * len(batch)]), native[(0,) * len(batch)], atol=10 * tol * scale)


@pytest.mark.float64
def test_gradients_by_level_agree_with_the_jacobian(rng, dtype):
    tree, state = bushy_tree(rng, dtype)
    name = "5/f9"
    place = lambda q: tree.world_transforms(state.replace(q=q)).translation[tree.topology.index(name)]
    jacobian = tree.jacobian(state, of=name, relative_to="emb")[3:]
    np.testing.assert_allclose(jax.jit(jax.jacrev(place))(state.q), jacobian, atol=1e-9)


@pytest.mark.parametrize("count", [BLOCK, BLOCK + 1, 2 * BLOCK + 3])
def test_blocks_of_a_batch_are_as_its_samples(count, rng, dtype, tol):
    """Large batches go in blocks: with batch axes of every shape, fields that have none, under vmap, and with derivatives."""
    tree, state = bushy_tree(rng, dtype)
    scale = jnp.linspace(0.0, 1.0, count, dtype=dtype)
    many = state.replace(q=state.q[None] * scale[:, None], time=state.time + scale * 1e5)
    whole = jax.jit(tree.world_motions)(many)
    picked = np.array([0, BLOCK // 2, BLOCK - 1, count - 2, count - 1])
    ask = jax.jit(tree.world_motions)
    for i in picked:
        one = ask(state.replace(q=state.q * scale[i], time=state.time + scale[i] * 1e5))
        for mine, other in zip(jax.tree.leaves(whole), jax.tree.leaves(one), strict=True):
            np.testing.assert_allclose(mine[i], other, rtol=0, atol=tol * max(1.0, float(np.abs(other).max())))
    over = jax.jit(jax.vmap(tree.world_motions, in_axes=(many.prefix("q", "time"),)))(many)
    for mine, other in zip(jax.tree.leaves(over), jax.tree.leaves(whole), strict=True):
        np.testing.assert_allclose(mine, other, rtol=0, atol=tol * max(1.0, float(np.abs(other).max())))
    if count == BLOCK + 1:
        folded = jax.tree.map(lambda a: a.reshape(3, -1, *a.shape[1:]), (many.q, many.time))
        shaped = jax.jit(tree.world_motions)(state.replace(q=folded[0], time=folded[1]))
        np.testing.assert_allclose(
            shaped.transform.translation.reshape(whole.transform.translation.shape), whole.transform.translation, rtol=1e-6
        )


@pytest.mark.float64
def test_gradients_of_blocked_batches_by_level(rng):
    tree, state = bushy_tree(rng, np.float64)
    scale = jnp.linspace(0.0, 1.0, BLOCK + 7)
    loss = lambda q: jnp.sum(tree.world_transforms(state.replace(q=q)).translation[..., 5:, :] ** 2)
    many = state.q[None] * scale[:, None]
    gradient = jax.jit(jax.grad(loss))(many)
    for i in (0, BLOCK - 1, BLOCK + 6):
        exact = jax.jit(jax.grad(loss))(many[i])
        np.testing.assert_allclose(gradient[i], exact, atol=1e-11 * float(np.abs(exact).max()))
