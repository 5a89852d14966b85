"""States as batches: shape, indexing, joining, loops over batches, shardings, donation; many motions set at once; one rule for dtypes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.sharding import NamedSharding
from jax.sharding import PartitionSpec as P

import jaxframes as jf


def tree_of(prescribed=2):
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=jf.edges.Revolute())
    for i in range(prescribed):
        b.add(f"c{i}", parent="a", edge=jf.edges.Prescribed())
    b.add("load", parent="a", edge=jf.edges.Attachable(jf.Transform.from_translation((0.1, 0.0, 0.0))))
    return b.build()


TREE = tree_of()


def place(state):
    return TREE.transform(state, of="load", relative_to="world").translation


def batch():
    return TREE.state(q=np.linspace(0.0, 1.0, 6)[:, None], time=np.arange(6.0))


def test_a_state_is_a_batch():
    states = batch()
    assert states.shape == (6,)
    assert len(states) == 6
    assert states[2].shape == ()
    assert states[2].q[0] == states.q[2, 0]
    assert states[1:3].attachments.parents.shape == (2, 1)
    assert states.reshape(2, 3).shape == (2, 3)
    assert jf.stack([states, states]).shape == (2, 6)
    joined = jf.concatenate([states, states])
    assert joined.shape == (12,)
    assert joined.attachments.parents.dtype == jnp.int32
    assert [float(s.q[0]) for s in states] == [float(x) for x in states.q[:, 0]]
    assert "shape=(6,)" in repr(states)
    assert len(repr(TREE.state())) < 120


def test_loops_over_batches_of_states(tol):
    states = batch()
    whole = states.broadcast_to(states.shape)
    wanted = place(states)
    for found in (
        jax.lax.map(place, whole, batch_size=4),
        jax.vmap(place)(whole),
        jax.vmap(place, in_axes=(states.prefix("q", "time"),))(states),
        jax.lax.scan(lambda c, s: (c, place(s)), 0.0, whole)[1],
    ):
        np.testing.assert_allclose(found, wanted, atol=tol)
    with pytest.raises(jf.FrameError, match="no field 'tme'"):
        states.prefix("tme")


def test_states_are_sharded_and_donated():
    states, mesh = batch(), jax.make_mesh((1,), ("b",))
    spread, same = NamedSharding(mesh, P("b")), NamedSharding(mesh, P())
    assert jax.device_put(states.broadcast_to((6,)), spread).qd.sharding.spec == P("b")
    held = jax.device_put(states, states.prefix("q", "time", chosen=spread, other=same))
    assert held.q.sharding.spec == P("b")
    assert held.qd.sharding.spec == P()
    step = jax.jit(lambda s: s.replace(q=s.q + 1), donate_argnums=0)
    for state in (TREE.state(), TREE.state(q=[0.1], time=jf.Epoch.from_tdb("2026-01-01")), batch().broadcast_to((6,))):
        leaves = [leaf for leaf in jax.tree.leaves(state) if leaf.size]
        assert len({leaf.unsafe_buffer_pointer() for leaf in leaves}) == len(leaves)
        assert step(state).q.shape == state.q.shape
    leaves = [leaf for leaf in jax.tree.leaves(TREE) if leaf.size]
    assert len({leaf.unsafe_buffer_pointer() for leaf in leaves}) == len(leaves)


def test_joint_values_of_another_shape_are_refused():
    for wrong in (0, [0.1, 0.2], np.zeros((3, 2))):
        with pytest.raises(jf.FrameError, match=r"q has shape .* holds \[\.\.\., 1\]"):
            TREE.state().replace(q=wrong)
    assert TREE.state().replace(q=np.zeros((4, 1))).shape == (4,)


def test_many_motions_at_once(rng, tol):
    many = tree_of(40)
    poses = {f"c{i}": jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3)) for i in range(40)}
    moving = jf.Motion(poses["c7"], jf.SpatialVelocity(jnp.ones(3), jnp.zeros(3)), None)
    found = many.set_motions(many.state(), {**poses, "c7": moving, "load": poses["c3"]})
    one_by_one = many.state()
    for name, pose in poses.items():
        one_by_one = many.set_motion(one_by_one, name, pose, moving.velocity if name == "c7" else None)
    one_by_one = many.set_motion(one_by_one, "load", poses["c3"])
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=tol), found, one_by_one)
    pose = jf.Transform.from_translation(jnp.zeros((5, 3)))
    program = jax.jit(lambda pose: many.set_motions(many.state(), dict.fromkeys(poses, pose)))
    assert program.lower(pose).as_text().count('"stablehlo.scatter"(') == 2  # of quaternions and translations: not one a frame
    with pytest.raises(jf.FrameError, match="'a' is not prescribed"):
        TREE.set_motions(TREE.state(), {"a": jf.Transform.identity()})
    with pytest.raises(jf.FrameError, match=r"expected a jf\.Motion"):
        TREE.set_motions(TREE.state(), {"c0": 3.0})


@pytest.mark.float64
def test_one_rule_for_dtypes():
    """Plain numbers take the tree's dtype, arrays of floats keep theirs, in either form; queries compute in the widest."""
    tree = TREE.astype("float32")
    wide = np.array([0.3])
    for q, dtype in (
        ([0.3], "float32"),
        ({"a": 0.3}, "float32"),
        (wide, "float64"),
        ({"a": wide[0]}, "float64"),
        (np.float32([0.3]), "float32"),
    ):
        state = tree.state(q=q)
        assert state.q.dtype == dtype
        assert tree.transform(state, of="load", relative_to="world").translation.dtype == dtype


@pytest.mark.float64
def test_single_precision_tables_under_strict_promotion():
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("arm", parent="earth", edge=jf.edges.Revolute())
    tree = b.build().astype("float32")
    for time in (jf.Epoch.from_tdb("2026-02-01"), 8.25e8):
        state = tree.state(q=[0.3], time=time)
        assert jax.config.jax_numpy_dtype_promotion == "strict"
        for program in (lambda s: tree.motion(s, of="arm", relative_to="emb"), tree.world_motions):
            assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(jax.jit(program)(state)))
