"""First and second derivatives, forward and reverse, against 60-digit references, at and next to every delicate point."""

import functools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

from jaxframes import spatial as s
from jaxframes.spatial import Rotation, Transform, Twist
from tests.spatial import exact

AXES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1], [1, 1, 1], [0.48, -0.6, 0.64]], float)
AXES = AXES / np.linalg.norm(AXES, axis=1, keepdims=True)
ANGLES = [1e-9, 1e-4, 0.4, 0.51, 1.0, 2.5, np.pi - 1e-4, np.pi - 1e-9, np.pi, np.pi + 1e-4]
VECTORS = np.concatenate([np.zeros((1, 3)), *(AXES * angle for angle in ANGLES)])


def rounded(points):
    """Return points as the run's dtype holds them, so that the reference starts from the very same numbers."""
    return np.asarray(points, np.dtype(jnp.zeros(()).dtype))


def derivatives(function, points, second=True):
    """Return (value, jacobian forward, jacobian reverse, second derivatives) of a function at each row of points."""

    def whole(x):
        first = function(x), jax.jacfwd(function)(x), jax.jacrev(function)(x)
        return (*first, jax.jacfwd(jax.jacrev(function))(x)) if second else first

    return [np.asarray(part, float) for part in jax.jit(jax.vmap(whole))(rounded(points))]


def references(function, points):
    """Return (value, jacobian, second derivatives) in 60 digits."""
    rows = [exact.numbers(x) for x in rounded(points)]
    values = np.array([[float(c) for c in function(x)] for x in rows])
    return values, np.array([exact.derivative(function, x) for x in rows]), np.array([exact.derivative(function, x, 2) for x in rows])


def compare(ours, reference, tol, points):
    """Assert that value, both Jacobians and the second derivatives agree, relative to 1 + the largest entry of each row."""
    value, forward, reverse, second = ours
    names, wanted = ("value", "forward", "reverse", "second"), (*reference[:2], *reference[1:])
    for name, got, want in zip(names, (value, forward, reverse, second), wanted, strict=True):
        axes = tuple(range(1, want.ndim))
        error = np.abs(got - want).max(axes) / (1 + np.abs(want).max(axes))
        assert error.max() < tol, (name, error.max(), points[int(np.nanargmax(error))])


def test_exponential(tol):
    ours = derivatives(lambda v: Rotation.exp(v).wxyz, VECTORS)
    compare(ours, references(exact.exp_quaternion, VECTORS), tol, VECTORS)


def quaternions():
    """Quaternions of all the vectors, with w = 0 exactly for half turns; the branch of the logarithm is then theirs."""
    q = np.array([[float(c) for c in exact.exp_quaternion(exact.numbers(v))] for v in VECTORS])
    half = np.abs(q[:, 0]) < 1e-12
    q[half, 0] = 0.0
    largest = q[:, 1:][np.arange(len(q)), 3 - 1 - np.argmax(np.abs(np.round(q[:, :0:-1], 6)), 1)]
    return q * np.where(half, np.sign(largest), np.sign(q[:, 0]))[:, None]


def test_logarithm(tol):
    q = quaternions()
    # where rounding to 32 bits makes half turns of what is near one, the axis is chosen as for exact half turns
    near = np.abs(q[:, 0]) <= 4 * np.finfo(rounded(q).dtype).eps
    assert near.sum() >= len(AXES)
    kept = ~near | (q[:, 0] == 0)
    compare(derivatives(lambda x: Rotation(x).log(), q[kept]), references(exact.log_quaternion, q[kept]), tol, q[kept])


def test_logarithm_takes_the_other_sign_of_a_quaternion(tol):
    q = -quaternions()
    reference = references(lambda x: exact.log_quaternion([-c for c in x]), q)
    kept = np.abs(q[:, 0]) > 1e-3
    compare(derivatives(lambda x: Rotation(x).log(), q[kept]), [part[kept] for part in reference], tol, q[kept])


def test_log_of_exp_is_the_identity_map(tol):
    v = np.concatenate([AXES * size for size in (0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-4)])
    value, forward, reverse, second = derivatives(lambda x: Rotation.exp(x).log(), v)
    assert np.abs(value - rounded(v)).max() < 4 * tol
    for jacobian in (forward, reverse):
        assert np.abs(jacobian - np.eye(3)).max() < 4 * tol
    assert np.abs(second).max() < 20 * tol


def along_rotation(function, exact_function, tol, q, scale=None):
    """Compare derivatives of a function of rotations along the group at given quaternions."""
    q = rounded(q)

    ours = everything_at_zero(lambda d, q: function(Rotation(q) @ Rotation.exp(d)), q)
    reference = [[], [], []]
    for row in q:
        start = exact.numbers(row)
        size = exact.norm(start)
        start = [c / size for c in start]
        inner = functools.partial(lambda d, start: exact_function(exact.product(start, exact.exp_quaternion(d))), start=start)
        zero = [mp.mpf(0)] * 3
        reference[0].append([float(c) for c in inner(zero)])
        reference[1].append(exact.derivative(inner, zero))
        reference[2].append(exact.derivative(inner, zero, 2))
    compare(ours, [np.array(part) for part in reference], tol, q)


def test_matrix(tol):
    along_rotation(lambda r: r.to_matrix().reshape(9), exact.matrix, tol, quaternions()[::3])


def test_quaternion_of_matrix(tol):
    """Through the matrix and back: each case of the formula, at and on both sides of its borders."""
    corners = np.array([[0, 1, 1, 0], [0, 0, 1, 1], [1, 1, 1, 1], [1, 1, -1, 1], [1, 1, 0, 0], [0.5, 0.5, 0.6, -0.4]], float)
    q = np.concatenate([quaternions()[1::3], corners / np.linalg.norm(corners, axis=1, keepdims=True)])
    reference_sign = np.asarray(jax.vmap(lambda x: Rotation.from_matrix(Rotation(x).to_matrix()).wxyz)(rounded(q)))
    q = q * np.sign(np.sum(q * reference_sign, 1))[:, None]
    along_rotation(lambda r: Rotation.from_matrix(r.to_matrix()).wxyz, list, 4 * tol, q)


def exact_rpy(q):
    m = exact.matrix(q)
    return [mp.atan2(m[7], m[8]), mp.atan2(-m[6], mp.sqrt(m[0] ** 2 + m[3] ** 2)), mp.atan2(m[3], m[0])]


def exact_zyz(q):
    m = exact.matrix(q)
    return [mp.atan2(m[5], m[2]), mp.atan2(mp.sqrt(m[2] ** 2 + m[5] ** 2), m[8]), mp.atan2(m[7], -m[6])]


RPY = [[0, 0, 0], [0.3, -0.7, 1.1], [-2.0, 1.2, 3.0], [0.2, np.pi / 2 - 1e-2, 0.5], [0.2, 1e-2 - np.pi / 2, 0.5], [3.0, 0.1, -3.0]]


def test_roll_pitch_yaw(tol):
    q = np.asarray(Rotation.from_rpy(*np.array(RPY).T).wxyz)
    along_rotation(lambda r: jnp.stack(r.to_rpy()), exact_rpy, 50 * tol, q)


def test_euler_zyz(tol):
    angles = np.array([[0.3, 0.7, 1.1], [-2.0, 1.2, 3.0], [0.2, 1e-2, 0.5], [0.2, np.pi - 1e-2, 0.5], [3.0, 2.1, -3.0]])
    q = np.asarray(Rotation.from_euler_zyz(*angles.T).wxyz)
    along_rotation(lambda r: jnp.stack(r.to_euler_zyz()), exact_zyz, 50 * tol, q)


@pytest.mark.float64
@pytest.mark.parametrize("distance", [1e-4, 1e-9])
@pytest.mark.parametrize("side", [-1, 1])
def test_next_to_gimbal_lock(distance, side):
    """Derivatives grow as 1/distance and are right to what rounding of the quaternion leaves: eps/distance, relatively."""
    q = rounded(Rotation.from_rpy(0.4, side * (np.pi / 2 - distance), 0.7).wxyz)
    ours = jax.jacfwd(lambda d: jnp.stack((Rotation(q) @ Rotation.exp(d)).to_rpy()))(jnp.zeros(3))
    start = exact.numbers(q)
    want = exact.derivative(lambda d: exact_rpy(exact.product(start, exact.exp_quaternion(d))), [mp.mpf(0)] * 3, step="1e-15")
    assert np.abs(want).max() > 0.1 / distance
    assert np.abs(ours - want).max() < 4e-16 / distance * np.abs(want).max()


def test_at_gimbal_lock(tol):
    """As documented: roll 0 with derivatives 0, pitch with derivatives 0, yaw with those of the turn about the vertical."""
    start = rounded(Rotation.from_rpy(0.0, np.array([1.0, -1.0]) * np.pi / 2, 0.7).wxyz)

    def angles(d, q):
        return jnp.stack((Rotation.exp(d) @ Rotation(q)).to_rpy())

    value, forward, reverse, second = everything_at_zero(angles, start)
    assert np.abs(value - rounded([[0, np.pi / 2, 0.7], [0, -np.pi / 2, 0.7]])).max() < tol
    for jacobian in (forward, reverse):
        assert np.abs(jacobian[:, :2]).max() < tol
        assert np.abs(jacobian[:, 2, 2] - 1).max() < tol
    assert np.isfinite(second).all()


def test_at_upright_zyz(tol):
    upright = Rotation.rot_z(0.7) @ Rotation.rot_x(np.array([0.0, np.pi]))

    def angles(d, q):
        return jnp.stack((Rotation.exp(d) @ Rotation(q)).to_euler_zyz())

    value, forward, reverse, second = everything_at_zero(angles, rounded(upright.wxyz))
    assert np.abs(value[:, 1] - rounded([0, np.pi])).max() < 4 * tol
    assert np.all(value[:, 2] == 0)
    assert np.max(Rotation.from_euler_zyz(*value.T).distance(upright)) < 10 * tol
    for jacobian in (forward, reverse):
        assert np.isfinite(jacobian).all()
        assert np.abs(jacobian[:, 0, 2] - 1).max() < 10 * tol  # a turn about the vertical is a turn of the first angle
        assert np.abs(jacobian[:, 1]).max() == 0
    assert np.isfinite(second).all()


def everything_at_zero(function, q):
    """Return (value, both Jacobians, second derivatives) with respect to d at d = 0 for each row of quaternions."""

    def whole(q):
        d = jnp.zeros(3)
        return function(d, q), jax.jacfwd(function)(d, q), jax.jacrev(function)(d, q), jax.jacfwd(jax.jacrev(function))(d, q)

    return [np.asarray(part) for part in jax.jit(jax.vmap(whole))(q)]


def exact_left_jacobian(v):
    """J_l from its definition, d exp(v) exp(v)^-1, column by column."""
    q = exact.exp_quaternion(v)
    step = mp.mpf("1e-18")
    columns = []
    for i in range(3):
        ahead, behind = list(v), list(v)
        ahead[i] += step
        behind[i] -= step
        rate = [(a - b) / (2 * step) for a, b in zip(exact.exp_quaternion(ahead), exact.exp_quaternion(behind), strict=True)]
        columns.append([2 * c for c in exact.product(rate, exact.conjugate(q))[1:]])
    return [columns[j][i] for i in range(3) for j in range(3)]


def inverted(nine):
    inverse = mp.matrix([nine[0:3], nine[3:6], nine[6:9]]) ** -1
    return [inverse[i, j] for i in range(3) for j in range(3)]


@pytest.mark.parametrize("inverse", [False, True])
def test_left_jacobian(inverse, tol):
    name = "left_jacobian_inv" if inverse else "left_jacobian"
    reference = (lambda v: inverted(exact_left_jacobian(v))) if inverse else exact_left_jacobian
    points = VECTORS[[0, 1, 8, 9, 16, 17, 24, 32, 40, 48, 56, 64]]
    compare(derivatives(lambda v: getattr(Rotation, name)(v).reshape(9), points), references(reference, points), 4 * tol, points)


def exact_pose(x):
    """The exponential of SE(3) by the matrix exponential: twelve numbers."""
    w, v = x[:3], x[3:]
    generator = mp.matrix([[0, -w[2], w[1], v[0]], [w[2], 0, -w[0], v[1]], [-w[1], w[0], 0, v[2]], [0, 0, 0, 0]])
    result = mp.expm(generator)
    return [result[i, j] for i in range(3) for j in range(4)]


POSES = np.array(
    [[0, 0, 0, 0, 0, 0], [0, 0, 0, 1, -2, 3], [1e-9, 0, 0, 1, 2, 3], [0, 1e-4, 1e-4, 1, 2, 3], [1, 2, -1, 0.3, 0.2, 1], [0, 0, 3, 1, 2, 3]]
)


def test_pose_exponential(tol):
    value, forward, reverse = derivatives(lambda x: Transform.exp(Twist.from_vector(x)).to_matrix()[:3].reshape(12), POSES, second=False)
    rows = [exact.numbers(x) for x in rounded(POSES)]
    assert np.abs(value - np.array([[float(c) for c in exact_pose(x)] for x in rows])).max() < 4 * tol
    for jacobian in (forward, reverse):
        assert np.abs(jacobian - np.array([exact.derivative(exact_pose, x) for x in rows])).max() < 4 * tol


@pytest.mark.slow
def test_pose_logarithm_undoes_the_exponential(tol):
    value, forward, reverse, second = derivatives(lambda x: Transform.exp(Twist.from_vector(x)).log().as_vector(), POSES)
    assert np.abs(value - POSES).max() < 20 * tol
    assert np.abs(forward - np.eye(6)).max() < 20 * tol
    assert np.abs(reverse - np.eye(6)).max() < 20 * tol
    assert np.abs(second).max() < 200 * tol


SIZES = [[0.3, -0.4, 1.2], [1e-9, 0, 0], [0, 1e-4, 1e-4], [3.0, 0, 0], [1e-9, -1e-9, 1e-9]]


def test_norm(tol):
    value, forward, reverse, second = derivatives(s.kdl.norm, np.array(SIZES))
    want = references(lambda v: [exact.norm(v)], np.array(SIZES[:1] + SIZES[3:4]))
    assert np.abs(forward - np.array(SIZES) / value[:, None]).max() < tol
    assert np.abs(reverse - forward).max() < tol
    assert np.abs(second[[0, 3]] - want[2][:, 0]).max() < 4 * tol
    projected = (np.eye(3) - forward[:, :, None] * forward[:, None, :]) / value[:, None, None]
    assert (np.abs(second - projected) * value[:, None, None]).max() < 4 * tol


def test_zero_vector():
    """The documented values at zero: norm and its derivatives 0, the unit vector x with derivatives 0."""

    def everything(v):
        unit, length = s.kdl.normalize(v)
        return jnp.stack([s.kdl.norm(v), length, *unit])

    for derivative in (jax.jacrev, jax.jacfwd, jax.hessian):
        assert np.all(jax.jit(derivative(everything))(jnp.zeros(3)) == 0)
    unit, length = s.kdl.normalize(jnp.zeros(3))
    assert unit.tolist() == [1, 0, 0]
    assert length == 0


def test_zero_axis_turns_nothing():
    function = lambda axis, angle: Rotation.from_axis_angle(axis, angle).wxyz
    assert function(jnp.zeros(3), 1.0).tolist() == [1, 0, 0, 0]
    for derivative in (jax.jacfwd, jax.jacrev):
        assert all(np.all(part == 0) for part in jax.jit(derivative(function, (0, 1)))(jnp.zeros(3), 1.0))


def test_axis_and_angle(tol):
    v = VECTORS[[1, 8, 9, 16, 17, 24, 33, 40, 48]]

    def ours(x):
        angle, axis = Rotation.exp(x).to_axis_angle()
        return jnp.concatenate([angle[None], axis])

    points = rounded(v)
    value, forward, reverse, _ = derivatives(ours, points)
    size = np.linalg.norm(points, axis=1)
    unit = points / size[:, None]
    want = np.concatenate([unit[:, None], (np.eye(3) - unit[:, :, None] * unit[:, None]) / size[:, None, None]], 1)
    for jacobian in (forward, reverse):
        assert (np.abs(jacobian - want) / np.maximum(1, 1 / size)[:, None, None]).max() < 20 * tol
    assert np.abs(value[:, 1:] - unit).max() < 4 * tol


def test_distance_of_equal_rotations_has_zero_derivative():
    rotation = Rotation.from_rpy(0.1, 0.2, 0.3)
    function = lambda d: (rotation @ Rotation.exp(d)).distance(rotation)
    assert np.linalg.norm(jax.jit(jax.grad(function))(jnp.zeros(3))) < 1.001  # equal to rounding: no direction of change is steeper
    same = lambda x: Rotation.identity().distance(Rotation.exp(x))
    for derivative in (jax.grad, jax.jacfwd):
        assert np.all(jax.jit(derivative(same))(jnp.zeros(3)) == 0)


def test_slerp_from_a_rotation_to_itself(tol):
    """The rate of slerp with respect to either end, where both are one rotation: shares of the movement."""
    rotation = Rotation.from_rpy(0.1, 0.2, 0.3)

    def ours(d):
        return (rotation.inverse() @ (rotation @ Rotation.exp(d[:3])).slerp(rotation @ Rotation.exp(d[3:]), 0.25)).log()

    for derivative in (jax.jacfwd, jax.jacrev):
        jacobian = jax.jit(derivative(ours))(jnp.zeros(6))
        assert np.abs(jacobian - np.concatenate([0.75 * np.eye(3), 0.25 * np.eye(3)], 1)).max() < 4 * tol


def test_mean(tol):
    """Where all are equal the mean moves by the mean of the movements; elsewhere as central differences of the mean say."""
    rotation = Rotation.from_rpy(0.1, 0.2, 0.3)

    def equal(d):
        return (rotation.inverse() @ (rotation @ Rotation.exp(d)).mean()).log()

    first, second = jax.jit(lambda d: (jax.jacrev(equal)(d), jax.jacfwd(jax.jacrev(equal))(d)))(jnp.zeros((3, 3)))
    assert np.abs(first - np.eye(3)[:, None] / 3).max() < 4 * tol
    assert np.isfinite(second).all()
    spread = rounded([[0.5, 0, 0.1], [0, -0.7, 0.3], [0.2, 0.9, 1.1]])
    weights = rounded([1.0, 2.0, 0.5])
    ours, reverse = (jax.jit(derivative(lambda d: Rotation.exp(d).mean(weights).wxyz))(spread) for derivative in (jax.jacfwd, jax.jacrev))
    assert np.abs(ours - reverse).max() < 4 * tol
    reference = exact.derivative(lambda d: exact_mean(d, weights), exact.numbers(spread.ravel())).reshape(4, 3, 3)
    sign = np.sign(np.sum(reference * ours))
    assert np.abs(ours - sign * reference).max() < 10 * tol


def exact_mean(d, weights):
    moment = mp.zeros(4)
    for i, weight in enumerate(weights):
        q = mp.matrix(exact.exp_quaternion(d[3 * i : 3 * i + 3]))
        moment += mp.mpf(float(weight)) * q * q.T
    _, vectors = mp.eigsy(moment)
    vector = [vectors[i, 3] for i in range(4)]
    return [c if vector[0] > 0 else -c for c in vector]


def test_between_two_vectors(tol):
    """Derivatives at equal, right-angled, oblique and almost opposite directions."""
    start = np.array([1.0, 0.0, 0.0])
    ends = np.array([[1, 0, 0], [1, 1e-4, 0], [0.3, 1, -0.2], [0, 1, 0], [-0.3, 1, -0.2], [-1, 0.02, 0]], float)

    def reference(x):
        a, b = (([c / exact.norm(v) for c in v]) for v in (exact.numbers(start), x))
        d = sum(p * q for p, q in zip(a, b, strict=True))
        q = [1 + d, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        return [c / exact.norm(q) for c in q]

    compare(derivatives(lambda x: Rotation.from_two_vectors(rounded(start), x).wxyz, ends), references(reference, ends), 50 * tol, ends)


def test_opposite_vectors_are_finite():
    start = jnp.array([0.0, 0.0, 1.0])

    def function(x):
        return Rotation.from_two_vectors(x, -start).wxyz

    assert np.abs(Rotation(function(start)) @ start + start).max() < 1e-6
    for derivative in (jax.jacfwd, jax.jacrev):
        assert np.isfinite(jax.jit(derivative(function))(start)).all()


@pytest.mark.parametrize(
    ("function", "bad"),
    [
        (lambda x: Rotation.from_quaternion_wxyz(x).log(), [0.0, 0.0, 0.0, 0.0]),
        (lambda x: jnp.stack(Rotation(x).to_rpy(), -1), [np.nan, 0.0, 0.0, 0.0]),
        (lambda x: Rotation.from_two_vectors(x[..., :3], np.ones(3)).wxyz, [0.0, 0.0, 0.0, 0.0]),
        (lambda x: s.kdl.normalize(x[..., :3])[0], [np.inf, 0.0, 0.0, 0.0]),
    ],
)
def test_a_bad_row_spoils_no_other(function, bad):
    good = rounded([[0.5, 0.5, -0.5, 0.5], [1.0, 0.0, 0.0, 0.0], [0.8, 0.0, 0.6, 0.0]])
    batch = np.insert(good, 1, bad, axis=0)
    gradient = jax.jit(jax.grad(lambda x: function(x)[..., 0].sum()))
    alone, together = gradient(good), np.delete(gradient(batch), 1, axis=0)
    assert np.isfinite(alone).all()
    assert np.array_equal(alone, together)
