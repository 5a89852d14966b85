"""Tables in another dtype and through JSON: times are kept in two parts, so little is lost."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.numerics.two_part import recast_pair


def tree_of_tables():
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("itrf93", parent="earth", edge=tables["itrf93"])
    return b.build()


@pytest.mark.float64
def test_converted_to_float32_an_orientation_keeps_a_microradian(rng):
    tree = tree_of_tables()
    times = jf.Epoch.from_tdb("2026-01-02") + rng.uniform(0, 3e7, 400)
    wide = tree.transform(tree.state(time=times), of="itrf93", relative_to="earth").rotation.to_matrix()
    small = tree.astype(np.float32)
    state = small.state(q=jnp.zeros(0, np.float32), time=jf.Epoch(*recast_pair(times.hi, times.lo, np.float32)))
    narrow = small.transform(state, of="itrf93", relative_to="earth").rotation
    assert narrow.wxyz.dtype == np.float32
    assert np.abs(np.asarray(narrow.to_matrix(), np.float64) - np.asarray(wide)).max() < 2e-6


def test_tables_go_through_json_exactly(dtype):
    tree = tree_of_tables()
    again = jf.from_json(jf.to_json(tree, indent=None))
    assert again.topology == tree.topology
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(tree), strict=True):
        np.testing.assert_array_equal(a, b)


def test_attachables_and_candidates_go_through_json(dtype):
    b = jf.TreeBuilder()
    b.add("hand", parent="world", edge=jf.edges.Revolute())
    pose = jf.Transform(jf.Rotation.from_rpy(0.1, 0.2, 0.3), jnp.asarray([1.0, 2.0, 3.0], dtype))
    b.add("box", parent="world", edge=jf.edges.Attachable(pose, candidates=("world", "hand")))
    tree = b.build()
    again = jf.from_json(jf.to_json(tree))
    assert again.topology == tree.topology
    np.testing.assert_array_equal(again.edge("box").pose.rotation.wxyz, tree.edge("box").pose.rotation.wxyz)
