"""Joint coordinates as a manifold: integrate, difference, neutral, random, clamp; names; sizes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors

E = jf.edges
NAMES = ("ball", "free", "hinge", "wheel", "virtual")


def mixed():
    b = jf.TreeBuilder(root="world")
    b.add("ball", parent="world", edge=E.Ball())
    b.add("free", parent="ball", edge=E.Free(placement=jf.Transform.from_translation((0.1, 0.2, 0.3))))
    b.add("hinge", parent="free", edge=E.Revolute(limits=(-0.5, 1.0)))
    b.add("twin", parent="free", edge=E.Mimic("hinge", E.Revolute(), multiplier=-2.0, offset=0.25))
    b.add("wheel", parent="hinge", edge=E.Continuous())
    b.add("cart", parent="wheel", edge=E.Movable(jf.Transform.from_translation((1.0, 2.0, 3.0))))
    b.add("virtual", parent="cart", edge=E.Virtual(2, limits=((0.0, -np.inf), (np.inf, 3.0))))
    return b.build()


def places(tree, rng, dtype, batch=()):
    return jnp.asarray(tree.random(jax.random.key(int(rng.integers(1000))), batch), dtype), jnp.asarray(
        rng.normal(size=(*batch, tree.nv)), dtype
    )


@pytest.mark.parametrize("batch", [(), pytest.param((3, 1), marks=pytest.mark.slow)])
def test_integrating_a_difference_arrives_and_the_other_way_round(batch, rng, dtype):
    tree = mixed()
    (q, v), (other, _) = places(tree, rng, dtype, batch), places(tree, rng, dtype, batch)
    moved = jax.jit(tree.integrate)(q, v, 0.5)
    assert moved.shape == q.shape
    bound = 1e-13 if dtype == np.float64 else 3e-6
    np.testing.assert_allclose(tree.difference(q, moved), v * 0.5, atol=bound)
    arrived = tree.integrate(q, tree.difference(q, other))
    with jax.disable_jit():
        here, there = (tree.world_transforms(tree.state(q=x)).to_matrix() for x in (arrived, other))
    np.testing.assert_allclose(here, there, atol=10 * bound)
    np.testing.assert_allclose(tree.difference(q, q), 0.0, atol=bound)


def test_integrate_follows_the_motion_that_velocities_say(rng, dtype):
    tree = mixed()
    q, v = places(tree, rng, dtype)
    state = tree.state(q=q, qd=v)
    pose = lambda t: tree.transform(state.replace(q=tree.integrate(q, v, t)), of="virtual", relative_to="world").translation
    rate = jax.jit(jax.jacfwd(pose))(jnp.zeros((), dtype))
    np.testing.assert_allclose(
        rate, tree.velocity(state, of="virtual", relative_to="world").linear, atol=1e-12 if dtype == np.float64 else 3e-5
    )


def test_derivatives_at_rest_are_right_and_at_the_identity(dtype):
    tree = mixed()
    q = tree.neutral().astype(dtype)
    zero = jnp.zeros(tree.nv, dtype)
    step = jax.jit(jax.jacfwd(lambda v: tree.difference(q, tree.integrate(q, v))))(zero)
    np.testing.assert_allclose(step, np.eye(tree.nv), atol=1e-12 if dtype == np.float64 else 1e-6)
    back = jax.jit(jax.jacrev(lambda v: tree.difference(q, tree.integrate(q, v))))(zero)
    np.testing.assert_allclose(back, np.eye(tree.nv), atol=1e-12 if dtype == np.float64 else 1e-6)


def test_continuous_joints_take_the_shorter_way(dtype):
    tree = mixed()
    q0, q1 = (tree.set_q(tree.state(), {"wheel": value}).q for value in (3.0, -3.0))
    at = tree.topology.coordinates[tree.topology.index("wheel")][2]
    np.testing.assert_allclose(tree.difference(q0, q1)[at], 2 * np.pi - 6.0, atol=1e-6)
    gradient = jax.grad(lambda q: tree.difference(q0, q)[at])(q1)
    np.testing.assert_array_equal(gradient, np.eye(tree.nq)[at + 2])


def test_neutral_is_where_states_start(dtype):
    tree = mixed()
    np.testing.assert_array_equal(tree.neutral(), tree.state().q)
    np.testing.assert_array_equal(tree.get_q(tree.state(), "ball"), [1, 0, 0, 0])
    np.testing.assert_array_equal(tree.get_q(tree.state(), "free"), [1, 0, 0, 0, 0, 0, 0])


def test_random_places_respect_limits_and_quaternions_are_unit(dtype):
    tree = mixed()
    q = tree.random(jax.random.key(3), (2000,))
    assert q.shape == (2000, tree.nq)
    state = tree.state(q=q)
    hinge, virtual = tree.get_q(state, "hinge"), np.asarray(tree.get_q(state, "virtual"))
    assert -0.5 <= hinge.min() < -0.45
    assert 0.95 < hinge.max() <= 1.0
    assert (virtual[:, 0] >= 0).all()
    assert (virtual[:, 1] <= 3).all()
    assert np.abs(tree.get_q(state, "wheel")).max() <= np.pi
    np.testing.assert_allclose(np.linalg.norm(tree.get_q(state, "ball"), axis=-1), 1.0, atol=1e-6)
    assert np.abs(np.mean(tree.get_q(state, "ball"), 0)).max() < 0.05
    assert tree.check(state) == ()
    assert not np.array_equal(tree.get_q(state, "ball"), tree.get_q(state, "free")[:, :4])


def test_clamp_and_its_derivatives_exactly_at_the_limits(dtype):
    tree = mixed()
    clamp = jax.jit(lambda x: tree.get_q(tree.state(q=tree.clamp(tree.set_q(tree.state(), {"hinge": x}).q)), "hinge")[0])
    for x, value, slope in ((-2.0, -0.5, 0.0), (-0.5, -0.5, 1.0), (0.3, 0.3, 1.0), (1.0, 1.0, 1.0), (5.0, 1.0, 0.0)):
        found, gradient = jax.value_and_grad(clamp)(jnp.asarray(x, dtype))
        np.testing.assert_allclose((found, gradient), (value, slope), rtol=1e-6)
    assert np.isnan(clamp(jnp.asarray(np.nan, dtype)))
    q = tree.clamp(tree.set_q(tree.state(), {"ball": [0.0, 0.0, 2.0, 0.0], "virtual": [-1.0, 7.0]}).q)
    np.testing.assert_array_equal(tree.get_q(tree.state(q=q), "ball"), [0, 0, 1, 0])
    np.testing.assert_array_equal(tree.get_q(tree.state(q=q), "virtual"), [0, 3])


def test_trees_without_joints_have_empty_coordinates(dtype):
    tree = jf.TreeBuilder().build()
    assert tree.neutral().shape == tree.random(jax.random.key(0)).shape == (0,)
    assert tree.integrate(tree.neutral(), jnp.zeros(0, dtype)).shape == (0,)
    assert tree.clamp(tree.neutral()).shape == (0,)


def test_sizes_and_mobility_are_kept_apart():
    tree = mixed()
    sizes = {name: (tree.edge(name).dof, tree.edge(name).state_size) for name in (*NAMES, "twin", "cart")}
    assert sizes == {"ball": (3, 4), "free": (6, 7), "hinge": (1, 1), "wheel": (1, 1), "virtual": (0, 2), "twin": (0, 0), "cart": (6, 7)}
    assert (tree.nq, tree.nv) == (15, 13)
    assert tree.joint_names == NAMES
    assert E.Revolute(active=False).active is False


def test_movable_frames_start_at_their_pose_and_move_to_others(tol):
    tree = mixed()
    state = tree.state()
    np.testing.assert_array_equal(tree.transform(state, of="cart", relative_to="wheel").translation, [1, 2, 3])
    goal = jf.Transform(jf.Rotation.rot_x(0.3), np.array([0.5, 0.0, -1.0]))
    state = tree.state(q=tree.random(jax.random.key(5)))
    moved = tree.move_to(state, "cart", goal, relative_to="ball")
    found = tree.transform(moved, of="cart", relative_to="ball")
    np.testing.assert_allclose(found.to_matrix(), goal.to_matrix(), atol=20 * tol)
    np.testing.assert_array_equal(moved.q, state.q)
    with pytest.raises(errors.TopologyError, match="'virtual'"):
        tree.move_to(state, "cart", goal, relative_to="virtual")
    with pytest.raises(errors.EdgeError, match="'wheel'"):
        tree.move_to(state, "wheel", goal)


def test_wrong_shapes_are_refused():
    tree = mixed()
    for ask in (lambda: tree.integrate(np.zeros(3), np.zeros(13)), lambda: tree.integrate(np.zeros(15), np.zeros(15))):
        with pytest.raises(errors.ShapeError, match="need"):
            ask()
    with pytest.raises(errors.ShapeError):
        tree.difference(np.zeros(15), np.zeros(13))


def test_check_names_the_coordinate_that_is_outside():
    tree = mixed()
    (line,) = tree.check(tree.set_q(tree.state(), {"virtual": [0.0, 4.0]}))
    assert line == "joint 'virtual': q[1] = 4 is outside its limits [-inf, 3]"
