"""Derived quantities of a motion against derivatives of a moving frame, taken by differentiation in time."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes import spatial as s
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform


def trajectory(seed):
    """Return a frame as a smooth function of time, nothing aligned and nothing constant."""
    a = np.random.default_rng(seed).normal(size=(6, 3)).astype(jnp.zeros(()).dtype)

    def pose(t):
        turn = Rotation.exp(a[0] + t * a[1] + t * t * a[2]) @ Rotation.exp(t * a[3])
        return Transform(turn, a[4] + t * a[5] + jnp.sin(t) * a[2])

    return pose


def rate(function, t):
    return jax.jvp(function, (t,), (jnp.ones_like(t),))[1]


def angular(pose, t):
    """The angular velocity, from dR/dt R' = [w]x."""
    spin = rate(lambda x: pose(x).rotation.to_matrix(), t) @ pose(t).rotation.to_matrix().T
    return jnp.stack([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / 2


def motion_of(pose, t):
    velocity = lambda x: rate(lambda y: pose(y).translation, x)
    return Motion(
        pose(t),
        SpatialVelocity(angular(pose, t), velocity(t)),
        SpatialAcceleration(rate(lambda x: angular(pose, x), t), rate(velocity, t)),
    )


A, B = trajectory(1), trajectory(2)
NOW = 0.3


@pytest.fixture(scope="module")
def known():
    """Everything the tests compare, compiled as one program."""

    @jax.jit
    def compute(t):
        first, second = motion_of(A, t), motion_of(B, t)
        back = lambda x: A(x).rotation.inverse()
        spin, slip = lambda x: back(x) @ angular(A, x), lambda x: back(x) @ rate(lambda y: A(y).translation, x)
        own = lambda x: back(x) @ A(x).translation
        x = lambda y: jnp.stack([jnp.sin(y), y * y, jnp.cos(2 * y)])
        return {
            "first": first,
            "second": second,
            "product": motion_of(lambda y: A(y) @ B(y), t),
            "inverse": motion_of(lambda y: A(y).inverse(), t),
            "relative": motion_of(lambda y: A(y).inverse() @ B(y), t),
            "spin": spin(t),
            "slip": slip(t),
            "spin_dot": rate(spin, t),
            "slip_dot": rate(slip, t),
            "own_dot": rate(own, t),
            "own_dot_dot": rate(lambda y: rate(own, y), t),
            "x": x(t),
            "x_dot": rate(x, t),
            "moved_dot": rate(lambda y: A(y).rotation @ x(y), t),
            "vector_dot": rate(lambda y: A(y).rotation.log(), t),
        }

    return compute(jnp.asarray(NOW))


def near(a, b, tol):
    return s.allclose(a, b, rtol=20 * tol, atol=20 * tol)


@pytest.mark.float64
def test_composition(known, tol):
    first, second = known["first"], known["second"]
    assert near(first @ second, known["product"], tol)
    assert near(first.inverse(), known["inverse"], tol)
    assert near(second.relative_to(first), known["relative"], tol)
    assert not near((first @ second).acceleration, known["first"].acceleration, tol)


def test_pframe_observed(known, tol):
    motion = known["first"]
    velocity, half = motion.pframe_observed_velocity(), motion.pframe_observed_acceleration()
    full = motion.pframe_observed_acceleration_full()
    assert near(velocity.linear, known["own_dot"], tol)
    assert near(velocity, -known["inverse"].velocity, tol)
    # kdFlex's acceleration of this name is no derivative of its velocity: it is the derivative of the body twist
    assert near(half.linear, known["slip_dot"], tol)
    assert not near(half.linear, known["own_dot_dot"], tol)
    assert near(full.linear, known["own_dot_dot"], tol)
    assert near(full, -known["inverse"].acceleration, tol)
    for acceleration in (half, full):
        assert near(acceleration.angular, known["spin_dot"], tol)
    w, v, l = motion.velocity.angular, motion.velocity.linear, motion.transform.translation
    gap = motion.transform.rotation.inverse() @ (
        -s.kdl.cross(motion.acceleration.angular, l) - s.kdl.cross(w, v) + s.kdl.cross(w, s.kdl.cross(w, l))
    )
    assert near(full.linear - half.linear, gap, tol)


def test_body_twist(known, tol):
    twist, change = known["first"].body_twist(), known["first"].body_twist_dot()
    assert near((twist.angular, twist.linear), (known["spin"], known["slip"]), tol)
    assert near((change.angular, change.linear), (known["spin_dot"], known["slip_dot"]), tol)


def test_featherstone(known, tol):
    """Referred to o's origin: the derivative of [w; v - l' terms] of the body's point there, in axes that stand still."""
    motion = known["first"]

    def at_origin(t):
        """The velocity of the point of the body now at o's origin: w x (0 - l) + v."""
        pose = A(t)
        return rate(lambda y: A(y).translation, t) - s.kdl.cross(angular(A, t), pose.translation)

    expected = jax.jit(lambda t: rate(at_origin, t))(jnp.asarray(NOW))
    at_o, at_p = (motion.spatial_acceleration_featherstone(at=where) for where in ("relative_to", "of"))
    assert near(at_o.linear, expected, tol)
    assert near(at_o.angular, motion.acceleration.angular, tol)
    assert near(at_p.linear, motion.acceleration.linear - s.kdl.cross(motion.velocity.angular, motion.velocity.linear), tol)
    # both are one spatial vector: moving the point is the same linear map as for velocities
    moved = SpatialVelocity(at_o.angular, at_o.linear).at_point(motion.transform.translation)
    assert near(moved.linear, at_p.linear, tol)


def test_reverse(known, tol):
    motion = known["first"]
    assert near(motion.reverse_velocity(), known["inverse"].velocity, tol)
    assert near(motion.transform.reverse_velocity(motion.velocity), known["inverse"].velocity, tol)
    assert near(motion.reverse_acceleration(), known["inverse"].acceleration, tol)
    other = known["second"]
    swapped = motion.replace(acceleration=other.acceleration)
    assert near(motion.reverse_acceleration(other.acceleration), swapped.inverse().acceleration, tol)
    assert near(motion.reverse_velocity(other.velocity), motion.replace(velocity=other.velocity).inverse().velocity, tol)


def test_to_oframe_observed(known, tol):
    motion = known["first"]
    seen = motion.to_oframe_observed(known["x"], known["x_dot"])
    assert near(seen, known["moved_dot"], tol)
    own = motion.to_oframe_observed(known["x"], known["x_dot"], expressed_in="of")
    assert near(motion.transform.rotation @ own, seen, tol)


def test_rotation_vector_rates(known, tol):
    rates = known["first"].rotvec_rates()
    assert near(rates[:3], known["vector_dot"], tol)
    assert near(rates[3:], known["first"].velocity.linear, tol)
    for angle in (0.0, np.pi):  # regular at both
        motion = Motion(Transform.from_rotation(Rotation.rot_x(angle)), known["first"].velocity, known["first"].acceleration)
        theta = jnp.array([angle, 0.0, 0.0])
        assert near(Rotation.left_jacobian(theta) @ motion.rotvec_rates()[:3], motion.velocity.angular, tol)


def test_change_of_axes_keeps_observer_and_point(known, tol):
    motion, turn = known["first"], Rotation.from_rpy(0.3, 0.2, -0.9)
    for value in (motion.velocity, motion.acceleration):
        turned = turn @ value
        assert type(turned) is type(value)
        assert near((turned.angular, turned.linear), (turn @ value.angular, turn @ value.linear), tol)


def test_another_point_of_the_body(known, tol):
    """A point fixed in p, d away from its origin: the motion of the frame there, by composition."""
    motion, own = known["first"], np.array([0.3, -1.2, 0.7])
    there = motion @ Motion.from_point(own)
    d = motion.transform.rotation @ own
    assert near(motion.velocity.at_point(d), there.velocity, tol)
    assert near(motion.acceleration.at_point(d, motion.velocity.angular), there.acceleration, tol)


def test_cross_products(known, tol):
    """Against the 6x6 matrices: v x m as the commutator of 4x4 generators, v x* f as minus its transpose."""
    v, m = known["first"].velocity, known["second"].velocity

    def generator(x):
        w, u = np.asarray(x.angular), np.asarray(x.linear)
        return np.array([[0, -w[2], w[1], u[0]], [w[2], 0, -w[0], u[1]], [-w[1], w[0], 0, u[2]], [0, 0, 0, 0]])

    commutator = generator(v) @ generator(m) - generator(m) @ generator(v)
    assert near(generator(v.cross_motion(m)), commutator, tol)
    wrench = s.Wrench(force=np.asarray(m.linear) + 0.7, torque=m.angular)
    turning, moving = generator(v)[:3, :3], generator(SpatialVelocity(v.linear, v.angular))[:3, :3]
    of_motions = np.block([[turning, np.zeros((3, 3))], [moving, turning]])
    assert near(of_motions @ m.as_vector(), v.cross_motion(m).as_vector(), tol)
    assert np.linalg.norm(moving @ wrench.force) > 0.1  # every term counts
    assert near(v.cross_force(wrench).as_vector(), -of_motions.T @ wrench.as_vector(), tol)
