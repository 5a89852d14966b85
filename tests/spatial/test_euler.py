"""Euler angles about any three axes against SciPy, at gimbal lock too; modified Rodrigues parameters; what is no sequence."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation as Reference

from jaxframes import FrameError, Rotation
from jaxframes.errors import ShapeError

LOWER = ["".join(s) for s in itertools.product("xyz", repeat=3) if s[0] != s[1] != s[2]]
SEQUENCES = LOWER + [s.upper() for s in LOWER]


@pytest.fixture(scope="module")
def angles():
    """Angles of all sequences [n, 3]: anywhere, and with the middle one at zero, a right angle and half a turn."""
    rng = np.random.default_rng(8)
    found = rng.uniform(-np.pi, np.pi, (40, 3))
    found[20:, 1] = np.repeat([0.0, np.pi / 2, -np.pi / 2, np.pi], 5)
    return found.astype(jnp.zeros(()).dtype)


@pytest.fixture(scope="module")
def round_trip():
    """Per sequence: quaternions, the angles that are read from them, the quaternions of these; one program for all sequences."""

    @jax.jit
    def of_all(given):
        found = {}
        for sequence in SEQUENCES:
            rotation = Rotation.from_euler(sequence, given)
            read = rotation.to_euler(sequence)
            found[sequence] = rotation.to_matrix(), read, Rotation.from_euler(sequence, read).to_matrix()
        return found

    return of_all


def test_against_scipy(angles, round_trip, dtype):
    eps = np.finfo(dtype).eps
    found = jax.device_get(round_trip(angles))
    assert len(found) == 24
    for sequence, (matrix, read, again) in found.items():
        want = Reference.from_euler(sequence, angles.astype(float))
        np.testing.assert_allclose(matrix, want.as_matrix(), atol=8 * eps, err_msg=sequence)
        np.testing.assert_allclose(again, want.as_matrix(), atol=20 * eps, err_msg=sequence)
        free = Reference.from_matrix(matrix[:20]).as_euler(sequence)
        off = np.abs((read[:20] - free + np.pi) % (2 * np.pi) - np.pi)
        lock = np.abs(np.cos(free[:, 1]) if len(set(sequence)) == 3 else np.sin(free[:, 1]))
        assert np.max(off * lock[:, None]) < 40 * eps, sequence
        middle = (0, np.pi) if len(set(sequence)) == 2 else (-np.pi / 2, np.pi / 2)
        assert middle[0] <= read[:, 1].min()
        assert read[:, 1].max() <= np.nextafter(dtype.type(middle[1]), dtype.type(4))


def test_at_lock_one_angle_is_zero():
    """The last of axes that move, the first of axes that stay, with the whole turn in the other."""
    np.testing.assert_allclose(Rotation.from_euler("ZXZ", np.array([0.3, 0.0, 0.4])).to_euler("ZXZ"), [0.7, 0, 0], atol=1e-6)
    np.testing.assert_allclose(Rotation.from_euler("xyz", np.array([0.3, np.pi / 2, 0.4])).to_euler("xyz"), [0, np.pi / 2, 0.1], atol=1e-3)
    gradient = jax.jacfwd(lambda a: Rotation.from_euler("ZXZ", a).to_euler("ZXZ"))(jnp.array([0.3, 0.0, 0.4]))
    np.testing.assert_allclose(gradient, [[1, 0, 1], [0, 0, 0], [0, 0, 0]], atol=1e-6)


def test_fewer_letters(dtype):
    angles = np.array([[0.2, -0.7], [1.0, 3.0]], dtype)
    np.testing.assert_allclose(
        Rotation.from_euler("XZ", angles).to_matrix(), Reference.from_euler("XZ", angles.astype(float)).as_matrix(), atol=1e-6
    )
    one = Rotation.from_euler("y", angles)  # [...] angles of one turn
    assert one.shape == (2, 2)
    np.testing.assert_array_equal(one.wxyz, Rotation.rot_y(angles).wxyz)
    np.testing.assert_array_equal(Rotation.from_euler("y", angles[..., None]).wxyz, one.wxyz)


@pytest.mark.parametrize("sequence", ["", "ZZX", "xyX", "ZXW", "XYZX"])
def test_no_sequence(sequence):
    with pytest.raises(FrameError, match="is no sequence of Euler angles: one to three of the letters XYZ"):
        Rotation.from_euler(sequence, np.zeros(3))
    with pytest.raises(FrameError, match=r"is no sequence|three letters is needed"):
        Rotation.identity().to_euler(sequence or "ZX")


def test_angles_that_do_not_fit():
    with pytest.raises(ShapeError, match=r"'ZXZ' takes angles \[..., 3\]; found \(2,\)"):
        Rotation.from_euler("ZXZ", np.zeros(2))


def test_modified_rodrigues_parameters(dtype):
    eps = np.finfo(dtype).eps
    rotation = Rotation.random(jax.random.key(4), (50,))
    want = Reference.from_quat(np.asarray(rotation.to_quaternion_xyzw(), float))
    np.testing.assert_allclose(rotation.to_mrp(), want.as_mrp(), atol=4 * eps)
    np.testing.assert_allclose(
        Rotation.from_mrp(3 * want.as_mrp()).to_matrix(), Reference.from_mrp(3 * want.as_mrp()).as_matrix(), atol=8 * eps
    )
    np.testing.assert_array_equal(Rotation.from_mrp(np.zeros(3)).wxyz, [1, 0, 0, 0])
    np.testing.assert_allclose(jax.jacfwd(lambda v: Rotation.exp(v).to_mrp())(jnp.zeros(3)), np.eye(3) / 4, atol=eps)
    np.testing.assert_allclose(Rotation.rot_z(np.pi).to_mrp(), [0, 0, 1], atol=4 * eps)
