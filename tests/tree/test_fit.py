"""Fitting a joint to a motion: exact where the joint can move so, scipy's least squares elsewhere, derivatives, batches, refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import jaxframes as jf
from jaxframes import errors
from tests.compilations import compilations

E = jf.edges
PLACE = jf.Transform(jf.Rotation.from_rpy(0.1, -0.2, 0.3), np.array([0.1, 0.2, 0.3]))
KINDS = {
    "revolute": E.Revolute((1, 2, 3), PLACE),
    "screw": E.Screw((0, 0, 1), 0.3, PLACE),
    "universal": E.Universal(PLACE),
}
SLOWER = {
    "free": E.Free(PLACE),
    "ball": E.Ball(PLACE),
    "planar": E.Planar((0, 1, 1), PLACE),
    "prismatic": E.Prismatic((1, 0, 2), PLACE),
    "cylindrical": E.Cylindrical((0, 1, 1), PLACE),
    "spherical": E.Spherical(PLACE),
    "continuous": E.Continuous((0, 1, 0)),
}
ASK = {"of": "tool", "relative_to": "base"}


def arm(edge):
    """A joint below another one, with a tool below it, so that its own place in the arrays is not the first."""
    b = jf.TreeBuilder(root="world")
    b.add("base", parent="world", edge=E.Revolute())
    b.add("tool", parent="base", edge=edge, joint="wrist")
    b.add("tip", parent="tool", edge=E.Fixed(PLACE))
    return b.build()


@pytest.mark.parametrize(
    "edge", [*KINDS.values(), *(pytest.param(edge, marks=pytest.mark.slow) for edge in SLOWER.values())], ids=[*KINDS, *SLOWER]
)
def test_what_a_joint_can_do_is_found_exactly(edge, rng, dtype):
    tree = arm(edge)
    q = tree.random(jax.random.key(1), (20,))
    q = q.at[:, 1:].multiply(3.0) if isinstance(edge, E.Screw) else q  # a screw says how many turns it has made
    qd, qdd = rng.normal(size=(2, 20, tree.nv)).astype(dtype)
    state = tree.state(q=q, qd=qd, qdd=qdd)
    with jax.disable_jit():
        wanted = tree.motion(state, **ASK)
    start = tree.state(q=jnp.broadcast_to(tree.neutral(), q.shape), qd=qd * 0)
    fit = tree.fit_joint(start, "wrist", transform=wanted.transform, velocity=wanted.velocity, acceleration=wanted.acceleration)
    bound = 1e-13 if dtype == np.float64 else 5e-5
    for residual in (fit.residual, fit.velocity_residual, fit.acceleration_residual):
        assert np.abs(residual).max() < bound
    with jax.disable_jit():
        found = tree.motion(fit.state, **ASK)
    for mine, theirs in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(np.abs(mine), np.abs(theirs), atol=20 * bound)  # quaternions of either sign
    np.testing.assert_array_equal(fit.state.q[:, 0], start.q[:, 0])
    if not isinstance(edge, E.Spherical):  # three angles have two places for a rotation
        np.testing.assert_allclose(tree.difference(q, fit.state.q)[:, 1:], 0.0, atol=20 * bound)
        np.testing.assert_allclose(fit.state.qd[:, 1:], qd[:, 1:], atol=50 * bound)


UNIVERSAL = arm(KINDS["universal"])
GOAL = np.array([0.4, -0.3, 0.9, 0.5, -0.1, 0.7])
WEIGHT = 0.5


def fitted(goal, weight=WEIGHT, tree=UNIVERSAL):
    """The fit to a pose given as rotation vector and translation."""
    goal = jnp.asarray(goal)
    transform = jf.Transform(jf.Rotation.from_rotation_vector(goal[..., :3]), goal[..., 3:])
    return tree.fit_joint(tree.state(), "wrist", transform=transform, weight=weight)


def in_scipy(goal):
    place = Rotation.from_quat(np.asarray(PLACE.rotation.to_quaternion_xyzw(), float))

    def residual(q):
        turned = place * Rotation.from_euler("XY", q)
        angle = (Rotation.from_rotvec(goal[:3]) * turned.inv()).as_rotvec()
        return np.concatenate([angle, WEIGHT * (goal[3:] - np.asarray(PLACE.translation, float))])

    return least_squares(residual, np.zeros(2), jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


def test_out_of_reach_the_closest_is_scipys(dtype):
    fit = fitted(np.asarray(GOAL, dtype))
    np.testing.assert_allclose(fit.q, in_scipy(GOAL), atol=1e-8 if dtype == np.float64 else 1e-5)
    assert np.linalg.norm(fit.residual[:3]) > 0.1
    np.testing.assert_allclose(fit.residual[3:], GOAL[3:] - PLACE.translation, atol=1e-6)
    assert fit.velocity_residual is None
    single = UNIVERSAL.astype(np.float32)
    pose = jf.Transform(jf.Rotation.identity(), np.zeros(3)).astype(np.float32)
    q = jax.eval_shape(lambda state: single.fit_joint(state, "wrist", transform=pose, weight=2.0).q, single.state())
    assert q.dtype == np.float32  # plain numbers make nothing wider
    np.testing.assert_array_equal(fit.qd, np.zeros(2))


@pytest.mark.float64
def test_derivatives_are_those_of_the_closest_place():
    slopes = jax.jit(jax.jacrev(lambda goal: fitted(goal).q))(GOAL)
    forward = jax.jit(jax.jacfwd(lambda goal: fitted(goal).q))(GOAL)
    h = 1e-3
    by_difference = [(in_scipy(GOAL + h * unit) - in_scipy(GOAL - h * unit)) / (2 * h) for unit in np.eye(6)]
    np.testing.assert_allclose(slopes, np.transpose(by_difference), atol=3e-6)
    np.testing.assert_allclose(forward, slopes, atol=1e-12)


def test_batches_are_the_loop(dtype):
    tree = arm(KINDS["revolute"])
    goals = np.asarray(GOAL * np.array([[1.0], [0.5], [-0.7]]), dtype)
    whole, mapped = fitted(goals, tree=tree).q, jax.vmap(lambda goal: fitted(goal, tree=tree).q)(goals)
    bound = 1e-13 if dtype == np.float64 else 1e-5
    np.testing.assert_allclose(mapped, whole, atol=bound)
    np.testing.assert_allclose([fitted(goal, tree=tree).q for goal in goals], whole, atol=bound)
    weighted = fitted(goals, weight=np.array([[WEIGHT], [2.0]], dtype), tree=tree)
    assert weighted.state.q.shape == (2, 3, tree.nq)
    np.testing.assert_allclose(weighted.q[0], whole, atol=bound)


def test_what_a_chain_needs_of_a_part_goes_into_its_joint(dtype, tol):
    tree = arm(KINDS["revolute"])
    goal = tree.state(q=[0.3, -1.2], qd=[0.1, 0.7])
    names = {"of": "tip", "relative_to": "world"}
    start = tree.set_qd(tree.state(q=[0.3, 0.0]), {"base": 0.1})
    chain, sub = tree.chain(**names), tree.chain(of="tip", relative_to="base")
    part, fixed = tree.chain(**ASK), tree.chain(of="tip", relative_to="tool")
    needed = sub.solve_transform(part, chain.solve_transform(sub, tree.transform(goal, **names), start), start)
    fit = tree.fit_joint(start, "wrist", transform=needed)
    np.testing.assert_allclose(fit.state.q, goal.q, atol=20 * tol)
    np.testing.assert_allclose(tree.transform(fit.state, **names).to_matrix(), tree.transform(goal, **names).to_matrix(), atol=20 * tol)
    assert fixed.oriented


def test_joints_of_a_family_share_a_program():
    b = jf.TreeBuilder()
    for i in range(2):
        b.add(f"f{i}", parent="world", edge=E.Revolute((0, 0, 1 + i), limits=(-1 - i, 2)), joint=f"j{i}")
    tree = b.build()
    goal = jf.Transform(jf.Rotation.rot_z(0.5), np.zeros(3))
    fit = lambda joint: tree.fit_joint(tree.state(), joint, transform=goal).q
    np.testing.assert_allclose(fit("j0"), 0.5, rtol=1e-6)
    assert compilations(fit, "j1") <= 2  # what puts the number into its column of q


def test_what_cannot_be_fitted_is_said():
    tree = arm(KINDS["revolute"])
    pose = jf.Transform.identity()
    with pytest.raises(errors.UnknownJointError, match="'tool'"):
        tree.fit_joint(tree.state(), "tool", transform=pose)
    with pytest.raises(errors.ShapeError, match=r"'wrist'\) takes a jf.Transform, found ndarray"):
        tree.fit_joint(tree.state(), "wrist", transform=np.eye(4))
    with pytest.raises(errors.ShapeError, match=r"takes a jf\.SpatialVelocity, found SpatialAcceleration"):
        tree.fit_joint(tree.state(), "wrist", transform=pose, velocity=jf.SpatialAcceleration.zero())


def test_several_jacobians_are_those_of_each(rng, dtype, tol):
    tree = arm(KINDS["universal"])
    state = tree.state(q=rng.normal(size=(2, 3)).astype(dtype))
    together = tree.jacobians(state, of=["tip", "base", "tool"], relative_to="world", expressed_in="tool")
    assert together.shape == (2, 3, 6, 3)
    for i, name in enumerate(("tip", "base", "tool")):
        np.testing.assert_allclose(together[:, i], tree.jacobian(state, of=name, relative_to="world", expressed_in="tool"), atol=tol)
    with pytest.raises(errors.ShapeError, match="list of frame names"):
        tree.jacobians(state, of="tip", relative_to="world")
