"""What laws do not fix: conventions, end points, geodesy, link parameters, means, and sampling."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

from jaxframes import spatial as s
from jaxframes.errors import FrameError
from jaxframes.spatial import Rotation, SpatialVelocity, Transform, Twist, Wrench


def test_rotations_are_right_handed_and_map_b_to_a(tol):
    x, y, z = np.eye(3)
    for turn, start, end in ((Rotation.rot_x, y, z), (Rotation.rot_y, z, x), (Rotation.rot_z, x, y)):
        assert np.abs(turn(np.pi / 2) @ start - end).max() < tol
    rotation = Rotation.from_rpy(0.1, 0.2, 0.3)
    assert np.abs(rotation @ x - rotation.unit_x()).max() < tol
    matrix = np.asarray(rotation.to_matrix())
    assert np.abs(matrix - np.stack([rotation.unit_x(), rotation.unit_y(), rotation.unit_z()], -1)).max() < tol
    assert s.allclose(rotation, Rotation.rot_z(0.3) @ Rotation.rot_y(0.2) @ Rotation.rot_x(0.1), atol=tol)


def test_half_turns_have_documented_axes(tol):
    """The axis of a half turn has its largest component positive, the last of equal ones; KDL's table."""
    table = {(1, 0, 0): 1, (-1, 0, 0): -1, (0, 0, -1): -1, (1, -1, 0): -1, (-1, 1, 0): 1, (1, 0, -1): -1, (-1, -1, -1): -1, (1, 1, 1): 1}
    axes = np.array(list(table), float)
    unit = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    rotations = Rotation.from_matrix(2 * unit[:, :, None] * unit[:, None] - np.eye(3))
    want = unit * np.array(list(table.values()))[:, None]
    assert np.abs(rotations.log() - np.pi * want).max() < 10 * tol
    angle, axis = rotations.to_axis_angle()
    assert np.abs(angle - np.pi).max() < tol
    assert np.abs(axis - want).max() < 10 * tol


def test_geodetic_axes_and_place(tol):
    pose = Transform.from_geodetic(0.0, 0.0, 100.0)
    assert np.abs(pose.translation / 6378237.0 - jnp.array([1.0, 0, 0], float)).max() < tol
    assert np.abs(pose.rotation.to_matrix() - jnp.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]], float)).max() < tol  # east, north, up
    pole = Transform.from_geodetic(np.pi / 2, 0.3, 0.0)
    assert abs(pole.translation[2] - 6356752.314245) < max(1e-6, 2 * np.spacing(np.float32(6e6)) * (tol > 1e-9))
    lat, lon, h = 0.6, -1.9, 250.0
    moved = jax.jacfwd(lambda x: Transform.from_geodetic(x[0], x[1], x[2]).translation)(jnp.array([lat, lon, h]))
    axes = Transform.from_geodetic(lat, lon, h).rotation
    assert np.abs(moved[:, 2] - axes.unit_z()).max() < tol  # up is the direction of height
    for column, axis in ((0, axes.unit_y()), (1, axes.unit_x())):
        assert np.abs(moved[:, column] / np.linalg.norm(moved[:, column]) - axis).max() < 10 * tol


def test_link_parameters(tol):
    pose = Transform.from_dh(0.0, np.pi / 2, 0.36, 0.0)
    assert np.abs(pose.translation - jnp.array([0, 0, 0.36], float)).max() < tol
    assert np.abs(Transform.from_dh_craig1989(0.0, np.pi / 2, 0.36, 0.0).translation - jnp.array([0, -0.36, 0], float)).max() < tol
    a, alpha, d, theta = 0.3, -0.7, 0.2, 1.1
    move, turn = Transform.from_translation, Transform.from_rotation
    classic = turn(Rotation.rot_z(theta)) @ move([0, 0, d]) @ move([a, 0, 0]) @ turn(Rotation.rot_x(alpha))
    craig = turn(Rotation.rot_x(alpha)) @ move([a, 0, 0]) @ turn(Rotation.rot_z(theta)) @ move([0, 0, d])
    assert s.allclose(Transform.from_dh(a, alpha, d, theta), classic, rtol=tol, atol=tol)
    assert s.allclose(Transform.from_dh_craig1989(a, alpha, d, theta), craig, rtol=tol, atol=tol)


def test_screw_and_separate_interpolation(tol):
    """Half a turn about z through (1, 0, 0): the screw runs on the circle, the separate one on the chord."""
    end = Transform(Rotation.rot_z(np.pi - 1e-3), jnp.array([2.0, 0.0, 0.0]))
    middle = Transform.identity().interpolate_screw(end, 0.5)
    assert abs(middle.translation[1]) > 0.9
    assert abs(Transform.identity().interpolate_separate(end, 0.5).translation[1]) < tol
    for half in (middle, Transform.identity().interpolate_separate(end, 0.5)):
        assert abs(float(half.rotation.angle()) - (np.pi - 1e-3) / 2) < tol
    quarter = Transform.identity().interpolate_screw(end, jnp.array([0.25, 0.5, 0.75]))
    steps = [quarter[i].inverse() @ quarter[i + 1] for i in range(2)]
    assert s.allclose(steps[0], steps[1], rtol=10 * tol, atol=10 * tol)  # constant rate
    assert np.abs(s.kdl.cross(quarter.translation[0], quarter.translation[1])).max() > 0.1


def test_first_order_integration_converges_to_the_exact_motion():
    twist, start = (
        Twist(linear=jnp.array([1.0, 2.0, -0.5]), angular=jnp.array([0.3, -0.4, 0.9])),
        Transform.from_translation([1.0, 0.0, 0.0]),
    )
    exact = start.retract(twist * 0.1)
    once = s.kdl.integrate_body_first_order(start, twist, 0.1)
    half = s.kdl.integrate_body_first_order(s.kdl.integrate_body_first_order(start, twist, 0.05), twist, 0.05)
    errors = [float(jnp.linalg.norm(pose.translation - exact.translation)) for pose in (once, half)]
    assert errors[0] == pytest.approx(2 * errors[1], rel=0.1)  # second order a step, first order in all
    assert errors[0] > 1e-3
    assert s.allclose(once.rotation, exact.rotation)


def test_mean_of_rotations(tol):
    two = s.stack([Rotation.rot_z(0.2), Rotation.rot_z(1.0)])
    assert s.allclose(two.mean(), Rotation.rot_z(0.6), atol=4 * tol)
    assert s.allclose(Rotation(two.wxyz * np.array([[1], [-1]], two.dtype)).mean(), Rotation.rot_z(0.6), atol=4 * tol)
    assert s.allclose(two.mean(np.array([1.0, 0.0])), Rotation.rot_z(0.2), atol=4 * tol)
    many = Rotation.exp(0.3 * jax.random.normal(jax.random.key(0), (4, 50, 3)))
    turned = Rotation.from_rpy(0.5, 1.0, -2.0)
    assert many.mean(axis=1).shape == (4,)
    assert s.allclose((turned @ many).mean(axis=-1), turned @ many.mean(axis=1), atol=10 * tol)
    mean = many.mean(axis=1)

    def spread(d, i):
        return jnp.sum((many[i].to_matrix() - (mean[i] @ Rotation.exp(d)).to_matrix()[None]) ** 2)

    gradient = jax.jit(jax.vmap(jax.grad(spread), (None, 0)))(jnp.zeros(3), jnp.arange(4))
    assert np.abs(gradient).max() < 500 * tol  # stationary: the sum of squares has no slope


def test_random_rotations_are_uniform():
    rotations = Rotation.random(jax.random.key(3), (20_000,))
    assert np.abs(jnp.mean(rotations.to_matrix(), 0)).max() < 0.02
    angles = np.sort(np.asarray(rotations.angle(), float))
    expected = (angles - np.sin(angles)) / np.pi  # distribution of the angle under the Haar measure
    assert np.abs(expected - np.arange(20_000) / 20_000).max() < 0.015
    poses = Transform.random(jax.random.key(4), (20_000,), scale=3.0)
    assert np.std(poses.translation) == pytest.approx(3.0, rel=0.02)


def test_opposite_directions(dtype):
    starts = np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 1], [1, -2, 0.5]]]).astype(dtype)
    rotations = Rotation.from_two_vectors(starts, -3 * starts)
    assert np.abs(rotations @ starts + starts).max() < 16 * np.finfo(dtype).eps
    assert np.abs(rotations.angle() - np.pi).max() < 16 * np.finfo(dtype).eps
    with pytest.raises(FrameError, match="a vector is zero, so it has no direction"):
        Rotation.from_two_vectors(np.zeros(3), np.ones(3))
    assert np.isnan(jax.jit(Rotation.from_two_vectors)(np.zeros(3), np.ones(3)).wxyz).all()


def test_twists_and_velocities_name_their_point(tol):
    pose = Transform.random(jax.random.key(5))
    velocity = SpatialVelocity(jnp.array([0.1, -0.5, 0.7]), jnp.array([1.0, 2.0, 3.0]))
    at_origin_of_o = Twist.from_spatial_velocity(velocity, -pose.translation)
    body = s.Motion(pose, velocity, s.SpatialAcceleration.zero()).body_twist()
    assert s.allclose(body.transform(pose), at_origin_of_o, rtol=tol, atol=10 * tol)
    back = at_origin_of_o.to_spatial_velocity(pose.translation)
    assert s.allclose(back, velocity, rtol=tol, atol=10 * tol)
    assert at_origin_of_o.as_vector()[:3].tolist() == velocity.angular.tolist()  # angular first
    assert Wrench(force=jnp.ones(3), torque=jnp.zeros(3)).as_vector().tolist() == [0, 0, 0, 1, 1, 1]


def test_norms_of_extreme_vectors(dtype):
    huge = float(np.finfo(dtype).max) / 4
    for size in (huge, 1.0, float(np.finfo(dtype).tiny) * 8):
        unit, length = s.kdl.normalize(np.array([0.6, 0.0, -0.8]) * size)
        assert float(length) == pytest.approx(size, rel=1e-6)
        assert np.abs(unit - np.array([0.6, 0, -0.8], dtype)).max() < 4 * np.finfo(dtype).eps


def test_jacobians_of_the_pose_exponential(dtype):
    """Against phi(ad), phi(x) = (e^x - 1) / x, a block of SciPy's expm: at zero, tiny, ordinary, and beyond pi."""
    rng = np.random.default_rng(9)
    twists = rng.normal(size=(8, 6)) * np.array([0, 1e-9, 1e-5, 1e-2, 0.3, 1, 2, 2])[:, None]
    twists = twists.astype(dtype)

    def skew(v):
        return np.cross(np.eye(3), v).T @ -np.eye(3)

    want = []
    for angular, linear in twists.astype(float).reshape(-1, 2, 3):
        ad = np.block([[skew(angular), np.zeros((3, 3))], [skew(linear), skew(angular)]])
        assert np.allclose(skew(angular) @ linear, np.cross(angular, linear))
        want.append(expm(np.block([[ad, np.eye(6)], [np.zeros((6, 12))]]))[:6, 6:])
    twist, eps = Twist.from_vector(twists), np.finfo(dtype).eps
    np.testing.assert_allclose(Transform.left_jacobian(twist), want, atol=20 * eps)
    np.testing.assert_allclose(Transform.left_jacobian_inv(twist), np.linalg.inv(want), atol=100 * eps)
    np.testing.assert_allclose(Transform.right_jacobian(-twist), want, atol=20 * eps)
    np.testing.assert_allclose(Transform.right_jacobian_inv(-twist), np.linalg.inv(want), atol=100 * eps)
