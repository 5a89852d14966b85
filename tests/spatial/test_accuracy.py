"""Errors counted in units in the last place against 60 digits, over all angles, in the dtype of the run; long products."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxframes.spatial import Rotation, Transform
from tests.spatial import exact

LIMIT = 4.0


@pytest.fixture(scope="module")
def vectors():
    """Rotation vectors of 600 angles: even, tiny to one, and crowding towards pi."""
    dtype = np.dtype(jnp.zeros(()).dtype)
    rng = np.random.default_rng(0)
    tiny, close = (-18, -15) if dtype == np.float64 else (-12, -6)
    angles = [
        np.linspace(0, np.pi, 200),
        10 ** rng.uniform(tiny, 0, 200),
        np.pi - 10 ** rng.uniform(close, 0, 100),
        rng.uniform(0, np.pi, 100),
    ]
    axes = rng.normal(size=(600, 3))
    axes[:4] = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0]]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return (axes * rng.permutation(np.concatenate(angles))[:, None]).astype(dtype)


@pytest.fixture(scope="module")
def quaternions(vectors):
    """Correctly rounded quaternions of the vectors."""
    return np.array([[float(c) for c in exact.exp_quaternion(exact.numbers(v))] for v in vectors]).astype(vectors.dtype)


def ulps(got, want, sizes):
    """Return the largest error of each row in units in the last place of the row's size (of numbers just below 1 for size 1)."""
    got = np.asarray(got)
    size = np.array([float(s) for s in sizes]) * (1 - 1e-12)
    unit = np.exp2(np.floor(np.log2(np.maximum(size, 1e-300)))) * float(np.finfo(got.dtype).eps)
    error = np.array([[abs(float(exact.mp.mpf(float(g)) - w)) for g, w in zip(a, b, strict=True)] for a, b in zip(got, want, strict=True)])
    return error.max(1) / unit


def test_exponential(vectors):
    want = [exact.exp_quaternion(exact.numbers(v)) for v in vectors]
    q = Rotation.exp(vectors).wxyz
    assert ulps(q[:, 1:], [r[1:] for r in want], [exact.norm(r[1:]) for r in want]).max() <= LIMIT
    assert ulps(q[:, :1], [r[:1] for r in want], [1] * len(want)).max() <= LIMIT


def test_logarithm(quaternions):
    got = np.asarray(Rotation(quaternions).log())
    signs = np.where(np.sum(got * quaternions[:, 1:], 1) < 0, -1, 1)
    assert np.all(np.abs(quaternions[signs < 0, 0]) <= 4 * np.finfo(got.dtype).eps)  # only half turns may be turned round
    want = [exact.log_quaternion(exact.numbers(q * s)) for q, s in zip(quaternions, signs, strict=True)]
    sizes = [exact.norm(v) for v in want]
    assert ulps(got, want, sizes).max() <= LIMIT
    angle, axis = Rotation(quaternions).to_axis_angle()
    assert ulps(np.asarray(angle)[:, None], [[min(s, 2 * exact.mp.pi - s)] for s in sizes], sizes).max() <= LIMIT
    turning = np.linalg.norm(quaternions[:, 1:].astype(float), axis=1) > 0
    unit = [[c / s for c in v] for v, s, t in zip(want, sizes, turning, strict=True) if t]
    assert ulps(np.asarray(axis)[turning], unit, [1] * len(unit)).max() <= LIMIT


def test_matrix_of_quaternion(quaternions):
    """Against 1, the length of a row; the quaternion's own rounding, which the exact matrix divides out, is in the error."""
    want = [exact.matrix(exact.numbers(q)) for q in quaternions]
    assert ulps(Rotation(quaternions).to_matrix().reshape(-1, 9), want, [1.001] * len(want)).max() <= LIMIT


def test_quaternion_of_matrix(quaternions):
    """From correctly rounded matrices: against 1, and for the vector part also against its own length."""
    nine = np.array([[float(c) for c in exact.matrix(exact.numbers(q))] for q in quaternions]).astype(quaternions.dtype)
    got = np.asarray(Rotation.from_matrix(nine.reshape(-1, 3, 3)).wxyz)
    got = got * np.where(np.sum(got * quaternions, 1, keepdims=True) < 0, -1, 1).astype(got.dtype)
    rows = [exact.numbers(q) for q in quaternions]
    want = [[c / exact.norm(r) for c in r] for r in rows]
    assert ulps(got, want, [1] * len(want)).max() <= LIMIT
    assert ulps(got[:, 1:], [r[1:] for r in want], [exact.norm(r[1:]) for r in want]).max() <= LIMIT


def test_normalisation(dtype):
    rng = np.random.default_rng(1)
    huge = np.finfo(dtype).maxexp * 0.28
    q = (rng.normal(size=(200, 4)) * 10 ** rng.uniform(-huge, huge, (200, 1))).astype(dtype)
    rows = [exact.numbers(r) for r in q]
    want = [[c / exact.norm(r) for c in r] for r in rows]
    assert ulps(Rotation.from_quaternion_wxyz(q).wxyz, want, [1] * 200).max() <= LIMIT


def test_ten_thousand_products(dtype):
    """Unit norm after 10 000 products, with and without ``normalize`` at each."""
    factors = Rotation.random(jax.random.key(0), (10_000,))

    @jax.jit
    def compose(factors):
        def step(pair, factor):
            plain, kept = pair
            return (plain @ factor, (kept @ factor).normalize()), None

        return lax.scan(step, (Rotation.identity(), Rotation.identity()), factors)[0]

    plain, kept = compose(factors)
    eps = float(np.finfo(dtype).eps)

    def drift(rotation):
        return abs(float(exact.norm(exact.numbers(rotation.wxyz))) - 1)

    assert drift(kept) < 2 * eps
    assert drift(plain) < 2 * eps
    total = exact.numbers([1, 0, 0, 0])
    exact.mp.mp.dps, digits = 25, exact.mp.mp.dps
    try:
        for row in np.asarray(factors.wxyz, float):
            total = exact.product(total, [exact.mp.mpf(c) for c in row])
        want = np.array([float(c / exact.norm(total)) for c in total])
    finally:
        exact.mp.mp.dps = digits
    for rotation in (kept, plain.normalize()):
        assert np.abs(np.asarray(rotation.wxyz) - want).max() < 450 * eps


@pytest.mark.parametrize("angle", [0.3, 3.0])
def test_products_stay_unit_however_many(angle, dtype):
    """Squared sixty times, where each squaring would double the error of the norm; and their derivatives are those of rotations."""
    small = Rotation.rot_z(np.asarray(angle, dtype)).inverse()

    @jax.jit
    def squared(rotation, pose):
        return lax.fori_loop(0, 60, lambda _, both: (both[0] @ both[0], both[1] @ both[1]), (rotation, pose))

    rotation, pose = squared(small, Transform(small, np.array([0.1, 0.0, 0.0], dtype)))
    for q in (rotation.wxyz, pose.rotation.wxyz):
        assert abs(np.linalg.norm(np.asarray(q, float)) - 1) < 2 * np.finfo(dtype).eps
    along = jax.jacfwd(lambda a: jnp.linalg.norm((Rotation.rot_x(a) @ Rotation.rot_y(a)).wxyz))(jnp.asarray(angle, dtype))
    assert abs(along) < 4 * np.finfo(dtype).eps


def test_distance_has_no_direction_where_both_are_equal(dtype):
    """Of a thousand rotations to themselves, under either sign of the quaternion: 0 with derivative 0; small angles are exact."""
    q = Rotation.random(jax.random.key(0), (1000,)).wxyz
    for sign in (1, -1):
        value, gradient = jax.vmap(jax.value_and_grad(lambda a, b: Rotation(a).distance(Rotation(b))))(q, sign * q)
        assert not np.any(value)
        assert not np.any(gradient)
    tiny = np.asarray(1e-9 if dtype == np.float64 else 1e-5, dtype)
    near = Rotation(q) @ Rotation.rot_y(tiny)
    np.testing.assert_allclose(near.distance(Rotation(q)), tiny, rtol=1e-5 if dtype == np.float64 else 2e-2)
    scaled = Rotation(q * 3).distance(Rotation(-q[::-1] / 2))  # the norms of the quaternions do not matter
    np.testing.assert_allclose(scaled, Rotation(q).distance(Rotation(q[::-1])), atol=20 * np.finfo(dtype).eps)
