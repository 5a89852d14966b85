"""Best fits and means against SciPy and singular values: Wahba's problem, the nearest rotation, means over axes and of poses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Reference

from jaxframes import FrameError, Rotation, Transform
from jaxframes.errors import ShapeError

LIMIT = 100  # roundings: eigenvectors of well separated eigenvalues


@pytest.fixture(scope="module")
def measured():
    """Seven directions of some length in b, the same with noise in a, and weights; for five attitudes."""
    rng = np.random.default_rng(3)
    dtype = jnp.zeros(()).dtype
    in_b = rng.normal(size=(5, 7, 3))
    truth = Reference.random(5, rng=3)
    in_a = np.einsum("nij,nkj->nki", truth.as_matrix(), in_b) + 0.1 * rng.normal(size=in_b.shape)
    return tuple(x.astype(dtype) for x in (in_a, in_b, rng.uniform(0.5, 2.0, (5, 7))))


def reference(in_a, in_b, weights):
    return np.array(
        [Reference.align_vectors(*(x.astype(float) for x in one))[0].as_matrix() for one in zip(in_a, in_b, weights, strict=True)]
    )


def test_align_vectors(measured, dtype):
    limit = LIMIT * np.finfo(dtype).eps
    want = reference(*measured)
    np.testing.assert_allclose(Rotation.align_vectors(*measured).to_matrix(), want, atol=limit)
    in_a, in_b, weights = measured
    np.testing.assert_allclose(
        Rotation.align_vectors(in_a[0], in_b[0]).to_matrix(), reference(in_a[:1], in_b[:1], np.ones((1, 7)))[0], atol=limit
    )
    exact = Rotation.random(jax.random.key(1), (5,))
    found = jax.jit(Rotation.align_vectors)(jax.vmap(lambda r, v: r @ v)(exact, in_b), in_b, weights[0])
    assert np.max(found.distance(exact)) < limit
    two = Rotation.align_vectors(exact[0] @ np.eye(3, dtype=dtype)[:2], np.eye(3, dtype=dtype)[:2])
    assert two.distance(exact[0]) < limit


def test_align_vectors_has_the_derivatives_of_the_minimum(measured):
    """Against the minimum condition itself: the residual torque sum of w a x (R b) stays zero along any change of all three."""
    arguments = tuple(jnp.asarray(x[0]) for x in measured)

    def torque(in_a, in_b, weights):
        rotation = Rotation.align_vectors(in_a, in_b, weights)
        return jnp.sum(weights[:, None] * jnp.cross(in_a, rotation @ in_b), 0)

    rng = np.random.default_rng(4)
    changes = tuple(jnp.asarray(rng.normal(size=x.shape).astype(x.dtype)) for x in arguments)
    value, change = jax.jvp(torque, arguments, changes)
    size = np.sum(np.linalg.norm(arguments[0], axis=1) * np.linalg.norm(arguments[1], axis=1) * arguments[2])
    eps = size * jnp.finfo(value.dtype).eps
    assert np.max(np.abs(value)) < 20 * eps
    assert np.max(np.abs(change)) < 50 * eps
    (back,) = jax.vjp(torque, *arguments)[1](jnp.ones_like(value))[:1]
    assert np.max(np.abs(back)) < 50 * eps


def test_nearest(dtype):
    """Against U diag(1, 1, det) V^T; a rotation with noise, any matrix, and a rotation itself."""
    rng = np.random.default_rng(5)
    matrices = rng.normal(size=(40, 3, 3))
    matrices[:10] = Reference.random(10, rng=1).as_matrix()
    u, s, vt = np.linalg.svd(matrices)
    sign = np.sign(np.linalg.det(u @ vt))
    matrices, sign, u, s, vt = (x[(s[:, 1] + sign * s[:, 2]) > 0.1] for x in (matrices, sign, u, s, vt))
    u[:, :, 2] *= sign[:, None]
    found = Rotation.nearest(matrices.astype(dtype))
    np.testing.assert_allclose(found.to_matrix(), u @ vt, atol=300 * np.finfo(dtype).eps)
    assert np.min(found.wxyz[:, 0]) >= 0


@pytest.mark.parametrize("rank", ["one", "none", "mirrored"])
def test_what_is_ambiguous_is_refused(rank, dtype):
    matrix = {"one": np.outer([1, 2, 3], [0, 1, 1]), "none": np.zeros((3, 3)), "mirrored": -np.eye(3)}[rank].astype(dtype)
    with pytest.raises(FrameError, match="several rotations fit equally well"):
        Rotation.nearest(matrix)
    value, gradient = jax.jit(jax.value_and_grad(lambda m: jnp.sum(Rotation.nearest(m).wxyz)))(matrix)
    assert np.isnan(value)
    assert np.isnan(gradient).all()
    line = np.array([[1, 2, 3], [-2, -4, -6]], dtype)
    with pytest.raises(FrameError, match="several rotations fit equally well"):
        Rotation.align_vectors(line, line)


def test_means_over_several_axes(dtype):
    rng = np.random.default_rng(6)
    rotations = Rotation.exp(0.5 * rng.normal(size=(2, 3, 4, 3)).astype(dtype))
    weights = rng.uniform(0.5, 2, (2, 1, 4)).astype(dtype)
    found = rotations.mean(weights, axis=(0, -1))
    assert found.shape == (3,)
    for i in range(3):
        flat = Reference.from_matrix(np.asarray(rotations[:, i].to_matrix(), float).reshape(-1, 3, 3))
        want = flat.mean(np.broadcast_to(weights[:, 0], (2, 4)).ravel())
        np.testing.assert_allclose(found[i].to_matrix(), want.as_matrix(), atol=LIMIT * np.finfo(dtype).eps)
    poses = Transform(rotations, rng.normal(size=(2, 3, 4, 3)).astype(dtype))
    moved = Transform.random(jax.random.key(2), dtype=dtype)
    both, after = (p.mean(weights, axis=(0, 2)) for p in (poses, moved @ poses))
    np.testing.assert_allclose(after.to_matrix(), (moved @ both).to_matrix(), atol=LIMIT * np.finfo(dtype).eps)
    full = np.broadcast_to(weights, (2, 3, 4))
    np.testing.assert_allclose(
        both.translation,
        [np.average(np.asarray(poses.translation)[:, i].reshape(-1, 3), 0, full[:, i].ravel()) for i in range(3)],
        rtol=1e-4 if dtype == np.float32 else 1e-13,
    )
    np.testing.assert_allclose(poses.mean(axis=1).translation, np.mean(np.asarray(poses.translation), 1), atol=LIMIT * np.finfo(dtype).eps)


@pytest.mark.parametrize(
    ("case", "words"),
    {
        "no batch": (lambda: Rotation.identity().mean(), r"shape \(\) has no axis 0; a mean needs a batch axis"),
        "empty": (lambda: Rotation.identity((0,)).mean(), r"nothing stands along axis 0 of a batch of shape \(0,\)"),
        "no such axis": (lambda: Rotation.identity((3,)).mean(axis=(0, 1)), r"shape \(3,\) has no axis 1"),
        "twice": (lambda: Rotation.identity((3, 2)).mean(axis=(0, -2)), "names one axis twice"),
        "weights": (lambda: Transform.identity((3,)).mean(np.ones(2)), r"weights of shape \(2,\) do not broadcast to the shape \(3,\)"),
        "composed": (lambda: Rotation.identity((3,)) @ Rotation.identity((2,)), r"batch shapes \(3,\) and \(2,\) do not broadcast"),
        "applied": (lambda: Transform.identity((3,)).apply(np.ones((2, 3))), r"apply: batch shapes \(3,\) and \(2,\)"),
        "relative": (lambda: Transform.identity((3,)).relative_to(Transform.identity((2,))), r"batch shapes \(2,\) and \(3,\)"),
        "vectors": (lambda: Rotation.align_vectors(np.ones((2, 3)), np.ones((3, 3))), r"one by one; found \(2, 3\) and \(3, 3\)"),
        "pairs": (lambda: Rotation.align_vectors(np.ones(3), np.ones(3)), r"\[..., n, 3\] are needed; found \(3,\)"),
    }.values(),
)
def test_shapes_that_do_not_fit(case, words):
    with pytest.raises(ShapeError, match=words):
        case()
