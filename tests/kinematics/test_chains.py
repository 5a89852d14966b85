"""Chains: solving for a part, the identities of observed velocities, several frames at once, two times, Jacobians."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import TopologyError
from tests.random_trees import random_tree


def close(a, b, bound):
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_allclose(x, y, atol=bound * max(1.0, float(np.abs(y).max())))


def same_rotation(a, b, bound):
    np.testing.assert_allclose(a.to_matrix(), b.to_matrix(), atol=bound)


def line(rng, count=5):
    b = jf.TreeBuilder(root="f0")
    for i in range(1, count):
        b.add(f"f{i}", parent=f"f{i - 1}", edge=jf.edges.Prescribed())
    tree = b.build()
    state = tree.state()
    for i in range(1, count):
        w = rng.normal(size=4)
        wxyz = w / np.linalg.norm(w)
        l, *rest = rng.normal(size=(5, 3))
        velocity, acceleration = jf.SpatialVelocity(*map(np.array, rest[:2])), jf.SpatialAcceleration(*map(np.array, rest[2:]))
        state = tree.set_motion(state, f"f{i}", jf.Transform(jf.Rotation.from_quaternion_wxyz(wxyz), l), velocity, acceleration)
    return tree, state


@pytest.mark.parametrize("ends", [("f0", "f2"), ("f2", "f4")])
def test_solving_for_a_part_reaches_any_target_exactly(ends, rng, dtype, tol):
    tree, state = line(rng)
    chain, sub = tree.chain(of="f4", relative_to="f0"), tree.chain(of=ends[1], relative_to=ends[0])
    wanted = tree.motion(state, of="f3", relative_to="f1")
    transform = chain.solve_transform(sub, wanted.transform, state)
    velocity = chain.solve_velocity(sub, wanted.velocity, state, sub_transform=transform)
    acceleration = chain.solve_acceleration(sub, wanted.acceleration, state, sub_transform=transform, sub_velocity=velocity)
    solved = jf.Motion(transform, velocity, acceleration)
    rest = tree.chain(of="f4", relative_to="f2") if ends[0] == "f0" else tree.chain(of="f2", relative_to="f0")
    whole = solved @ rest.motion(state) if ends[0] == "f0" else rest.motion(state) @ solved
    same_rotation(whole.transform.rotation, wanted.transform.rotation, 20 * tol)
    close((whole.transform.translation, whole.velocity, whole.acceleration),
          (wanted.transform.translation, wanted.velocity, wanted.acceleration), 50 * tol)  # fmt: skip


@pytest.mark.parametrize(("of", "relative_to"), [("f1", "f2"), ("f3", "f1"), ("f0", "f2")])
def test_solving_refuses_other_parts(of, relative_to, rng):
    tree, state = line(rng)
    chain, sub = tree.chain(of="f4", relative_to="f0"), tree.chain(of=of, relative_to=relative_to)
    with pytest.raises(TopologyError, match=f"{relative_to!r} -> {of!r}"):
        chain.solve_transform(sub, jf.Transform.identity(), state)


def test_observed_velocities_and_the_reverse_chain(rng, dtype, tol):
    tree, state = line(rng)
    there, back = (tree.motion(state, of=a, relative_to=b) for a, b in (("f4", "f1"), ("f1", "f4")))
    bound = 100 * tol
    close(there.pframe_observed_velocity(), -back.velocity, bound)
    close(there.transform.reverse_velocity(there.velocity), back.velocity, bound)
    close(there.reverse_acceleration(there.acceleration), back.acceleration, bound)
    close(there.pframe_observed_acceleration_full(), -back.acceleration, bound)
    gap = there.pframe_observed_acceleration().linear - there.pframe_observed_acceleration_full().linear
    assert np.abs(gap).max() > 0.1  # they are not the same: semantics 1.1
    observed, twist_dot = there.pframe_observed_acceleration(), there.body_twist_dot()
    close((observed.angular, observed.linear), (twist_dot.angular, twist_dot.linear), bound)


def test_relative_transforms_and_pairs_agree_with_single_queries(dtype, tol):
    tree, state, _ = random_tree(np.random.default_rng(8), 9, dtype)
    rel = jax.jit(lambda s: tree.relative_transforms(s, relative_to="f6"))(state)
    pairs = jax.jit(lambda s: tree.transforms_between(s, of=["f1", "f9", "f6"], relative_to=["f3", "f6"]))(state)
    assert pairs.translation.shape == (2, 3, 3)
    for i in range(10):
        one = tree.transform(state, of=f"f{i}", relative_to="f6")
        same_rotation(rel[i].rotation, one.rotation, 20 * tol)
        np.testing.assert_allclose(rel.translation[i], one.translation, atol=20 * tol)
    for r, o in enumerate(("f3", "f6")):
        for c, p in enumerate(("f1", "f9", "f6")):
            np.testing.assert_allclose(pairs.translation[r, c], tree.transform(state, of=p, relative_to=o).translation, atol=20 * tol)


def test_two_times_through_a_fixed_frame(dtype, tol):
    tree, then, _ = random_tree(np.random.default_rng(2), 8, dtype)
    now = then.replace(q=then.q + 0.4)
    got = tree.transform_across(of="f8", of_state=then, relative_to="f5", relative_to_state=now, fixed="f0")
    expected = tree.transform(now, of="f5", relative_to="f0").inverse() @ tree.transform(then, of="f8", relative_to="f0")
    np.testing.assert_allclose(got.translation, expected.translation, atol=20 * tol)
    unmoved = tree.transform_across(of="f8", of_state=then, relative_to="f5", relative_to_state=then, fixed="f2")
    np.testing.assert_allclose(unmoved.translation, tree.transform(then, of="f8", relative_to="f5").translation, atol=20 * tol)


def test_express_and_transport(rng, dtype, tol):
    tree, state = line(rng)
    vector = jnp.asarray(rng.normal(size=3), dtype)
    turn = tree.transform(state, of="f3", relative_to="f1")
    np.testing.assert_allclose(tree.express(state, vector, of="f3", relative_to="f1"), turn.rotation.to_matrix() @ vector, atol=10 * tol)
    twist = jf.Twist(linear=vector, angular=2 * vector + 1)
    wrench = jf.Wrench(force=vector - 1, torque=vector * vector)
    moved_twist, moved_wrench = (tree.transport(state, x, of="f3", relative_to="f1") for x in (twist, wrench))
    np.testing.assert_allclose(moved_twist.dot(moved_wrench), twist.dot(wrench), rtol=20 * tol)
    np.testing.assert_allclose(moved_twist.angular, turn.rotation.to_matrix() @ twist.angular, atol=20 * tol)


@pytest.mark.parametrize("seed", range(3))
def test_jacobian_times_rates_is_the_velocity(seed, dtype, tol):
    tree, state, _ = random_tree(np.random.default_rng(seed + 40), 9, dtype, kinds=("fixed", "revolute", "prismatic"))
    names = {"of": "f9", "relative_to": "f4"}
    for axes in (None, "f2"):
        jacobian = jax.jit(lambda s, axes=axes: tree.jacobian(s, **names, expressed_in=axes))(state)
        assert jacobian.shape == (6, tree.nv)
        velocity = tree.velocity(state, **names, expressed_in=axes).as_vector()
        np.testing.assert_allclose(jacobian @ state.qd, velocity, atol=30 * tol * max(1.0, float(np.abs(velocity).max())))
    dot = jax.jit(lambda s: tree.jacobian_dot(s, **names))(state)
    acceleration = tree.acceleration(state, **names).as_vector()
    made = tree.jacobian(state, **names) @ state.qdd + dot @ state.qd
    np.testing.assert_allclose(made, acceleration, atol=100 * tol * max(1.0, float(np.abs(acceleration).max())))


def test_jacobian_of_batches_and_its_derivative_along_prescribed_motion(dtype, tol):
    tree, state, _ = random_tree(np.random.default_rng(77), 8, dtype)
    names = {"of": "f8", "relative_to": "f3"}
    batch = state.replace(q=jnp.stack([state.q, state.q + 0.1]))
    both = tree.jacobian(batch, **names)
    assert both.shape == (2, 6, tree.nv)
    np.testing.assert_allclose(both[0], tree.jacobian(state, **names), atol=20 * tol)
    if dtype == np.float64:
        h, rate = 1e-6, tree.rate(state)
        ends = [tree.jacobian(jax.tree.map(lambda x, dx, h=s * h: x + h * dx, state, rate), **names) for s in (1, -1)]
        np.testing.assert_allclose(tree.jacobian_dot(state, **names), (ends[0] - ends[1]) / (2 * h), atol=1e-7)
