"""Trees with many frames go by depth level: the same values as single queries, with batches, vmap, gradients and tables."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.tree import ways
from tests.random_trees import parts, random_tree


def bushy_tree(rng, dtype):
    """More than ``ways.FEWEST`` frames of every kind, hanging at most a few deep, below a table."""
    tree, state, _ = random_tree(rng, 9, dtype)
    b = jf.TreeBuilder(root="ssb")
    b.add("earth", parent="ssb", edge=jf.spice.example_tables()["earth"])
    copies = ways.FEWEST // 9 + 1
    for i in range(copies):
        b.include(tree, parent="earth", prefix=f"{i}/")
    whole = b.build()
    held = jax.tree.map(lambda x: jnp.concatenate([x] * copies), state.prescribed)
    q, qd, qdd = (jnp.tile(x, copies) for x in (state.q, state.qd, state.qdd))
    state = whole.state(q=q + jnp.arange(q.size, dtype=dtype) * 0.01, qd=qd, qdd=qdd, time=jf.Epoch.from_tdb("2026-05-01"))
    return whole, state.replace(prescribed=held)


def test_levels_agree_with_single_queries(rng, dtype):
    tree, state = bushy_tree(rng, dtype)
    assert len(tree.names) >= ways.FEWEST
    motions = jax.jit(lambda t, s: t.world_motions(s))(tree, state)
    poses = jax.jit(lambda s: tree.world_transforms(s))(state)
    chosen = ("3/f9", "6/f5", "earth", "ssb", "7/f0")
    ask = jax.jit(lambda s: [tree.motion(s, of=name, relative_to="ssb") for name in chosen])
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
    jacobian = tree.jacobian(state, of=name, relative_to="ssb")[3:]
    np.testing.assert_allclose(jax.jit(jax.jacrev(place))(state.q), jacobian, atol=1e-9)
