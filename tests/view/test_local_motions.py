"""Motions of edges relative to their parents, on the host: against ``tree.motion``, edge by edge."""

import time

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.view.local_motions import WIDTH, local_motions
from tests.random_trees import placement, unit
from tests.view.trees import every_kind, fleet, large, row


def worst(tree, state, found):
    """Largest difference of any row from ``tree.motion``, relative to the size of the row's numbers; quaternions up to sign."""
    largest = 0.0
    for i, name in enumerate(tree.names[1:], 1):
        expected, own = row(tree.motion(state, of=name, relative_to=tree.parent(name, state))), found[i].copy()
        own[:4] *= np.sign(own[:4] @ expected[:4])
        largest = max(largest, np.abs(own - expected).max() / max(1.0, np.abs(expected).max()))
    return largest


def test_every_kind_of_edge_moves_as_a_query_says(rng, tol):
    tree, state = every_kind(rng)
    found = local_motions(tree, state)
    assert found.shape == (len(tree.names), WIDTH)
    assert np.array_equal(found[0], [1.0] + [0.0] * 18)
    assert worst(tree, state, found) < tol


def test_an_attached_frame_moves_relative_to_its_present_parent(rng, tol):
    tree, state = every_kind(rng)
    moved = tree.attach(state, "box", "revolute", keep="motion")
    found = local_motions(tree, moved)
    assert tree.parent("box", moved) == "revolute"
    assert worst(tree, moved, found) < 30 * tol
    assert not np.allclose(found, local_motions(tree, state))


def test_a_batch_of_states_is_the_states_one_by_one(rng, tol):
    tree, state = every_kind(rng)
    states = jf.stack([state, tree.set_q(state, {"revolute": 0.7}), state.replace(qd=state.qd * 2)])
    found = local_motions(tree, states)
    for i in range(3):
        np.testing.assert_allclose(found[i], local_motions(tree, states[i]), rtol=tol, atol=tol)


def test_a_batch_of_trees_broadcasts(rng, tol):
    b = jf.TreeBuilder(root="world")
    mounts = jf.Transform.from_translation(np.arange(6.0).reshape(2, 3) + 0)
    b.add("arm", parent="world", edge=jf.edges.Revolute(placement=mounts))
    found = local_motions(b.build(), b.build().state(q=[0.25]))
    np.testing.assert_allclose(found[:, 1, 4:7], [[0, 1, 2], [3, 4, 5]])
    np.testing.assert_allclose(found[:, 1, :4], [[np.cos(0.125), 0, 0, np.sin(0.125)]] * 2, rtol=tol)


def test_tables_and_instants(tol):
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    for name, parent in (("emb", "ssb"), ("earth", "emb"), ("moon", "earth"), ("itrf93", "earth")):
        b.add(name, parent=parent, edge=tables[name])
    tree = b.build()
    start = jf.Epoch.from_tdb("2026-03-01T00:00:00")
    states = tree.state(time=start + np.linspace(0.0, 86400.0, 4))
    found = local_motions(tree, states)
    for i in range(4):
        assert worst(tree, states[i], found[i]) < tol
    nowhen = local_motions(tree, tree.state())
    assert np.isnan(nowhen[1:]).all()
    assert not np.isnan(nowhen[0]).any()
    late = local_motions(tree, tree.state(time=jf.Epoch.from_tdb("2050-01-01T00:00:00")))
    assert np.isnan(late[1, 4:7]).all()


def test_edges_without_accelerations_say_so_and_no_more(rng, dtype):
    b = jf.TreeBuilder(root="world")
    b.add("craft", parent="world", edge=jf.edges.Prescribed(supports_accelerations=False))
    b.add("wing", parent="craft", edge=jf.edges.Fixed(placement(rng, dtype)[0]))
    tree = b.build()
    velocity = jf.SpatialVelocity(np.ones(3, dtype), np.full(3, 2, dtype))
    state = tree.set_motion(tree.state(), "craft", jf.Transform(jf.Rotation(unit(rng, 4).astype(dtype)), np.ones(3, dtype)), velocity)
    found = local_motions(tree, state)
    assert np.isnan(found[1, 13:]).all()
    assert np.array_equal(found[1, 7:13], [1, 1, 1, 2, 2, 2])
    assert np.isfinite(found[2]).all()


def test_followers_of_followers_and_of_one_coordinate_among_several(tol):
    b = jf.TreeBuilder(root="world")
    b.add("knee", parent="world", edge=jf.edges.Universal())
    b.add("a", parent="world", edge=jf.edges.Mimic("knee", jf.edges.Revolute(), multiplier=-2.0, offset=0.1, coordinate=1))
    b.add("b", parent="a", edge=jf.edges.Mimic("a", jf.edges.Revolute(), multiplier=0.5))
    b.add("c", parent="b", edge=jf.edges.Mimic("b", jf.edges.Prismatic(), multiplier=3.0, offset=-1.0))
    b.add("d", parent="c", edge=jf.edges.Mimic("slide", jf.edges.Prismatic(), multiplier=3.0))
    b.add("slide", parent="world", edge=jf.edges.Prismatic())
    tree = b.build()
    state = tree.state(q=[0.3, 0.4, 0.5], qd=[1.0, 2.0, 3.0], qdd=[0.1, 0.2, 0.3])
    found = local_motions(tree, state)
    assert worst(tree, state, found) < tol
    np.testing.assert_allclose(found[tree.topology.index("c"), 6], 3 * 0.5 * (-2 * 0.4 + 0.1) - 1, rtol=1e-6)


def test_a_users_family_and_one_that_stands_alone(rng, tol):
    @jf.edges.family()
    class Swinging(jf.edges.Edge):
        nq = nv = 1
        length: jax.Array

        def steps(self, inputs, order):
            return jf.edges.Prismatic(axis=(0, 0, 1)).steps(inputs, order)

    b = jf.TreeBuilder(root="world")
    for i in range(3):
        b.add(f"s{i}", parent="world", edge=Swinging(jax.numpy.full((1,), float(i))))
    tree = b.build()
    state = tree.state(q=rng.normal(size=3), qd=rng.normal(size=3))
    assert worst(tree, state, local_motions(tree, state)) < tol


@pytest.mark.float64
@pytest.mark.parametrize("make", [large, fleet], ids=["5000 frames with 250 attachable ones", "312 robots of 14 links"])
def test_large_trees(make, rng):
    tree, state = make(rng)
    begun = time.perf_counter()
    found = local_motions(tree, state)
    print(f"{len(tree.names)} frames: first numbers after {time.perf_counter() - begun:.2f} s")  # asked: 2 s; no test asserts on a clock
    assert np.isfinite(found).all()
    for name in rng.choice(tree.names[1:], 12, replace=False):
        parent, part, i = tree.parent(name, state), tree.edge(name), tree.topology.index(name)
        if tree.is_attachable(name) or part.follows or part.is_prescribed:
            continue  # a query in a tree with so many attachable frames compiles for minutes: the edge is asked in a tree of its own
        alone = jf.TreeBuilder(root=parent)
        alone.add(name, parent=parent, edge=part)
        own = alone.build()
        first_q, nq, first_v, nv = tree.topology.coordinates[i]
        values = own.state(q=state.q[first_q : first_q + nq], qd=state.qd[first_v : first_v + nv], qdd=state.qdd[first_v : first_v + nv])
        expected = row(own.motion(values, of=name, relative_to=parent))
        mine = found[i] * np.where(np.arange(WIDTH) < 4, np.sign(found[i, :4] @ expected[:4]), 1.0)
        np.testing.assert_allclose(mine, expected, rtol=1e-12, atol=1e-12)
