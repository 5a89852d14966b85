"""Conversions to and from other libraries against what those libraries compute themselves; none is imported before it is used."""

import subprocess
import sys
import types

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation as ScipyRotation

from jaxframes import spatial as s
from jaxframes.errors import MissingExtraError, ShapeError
from jaxframes.io import interop
from jaxframes.spatial import Rotation, SpatialVelocity, Transform, Twist, Wrench

SHAPES = [(), (3,)]


@pytest.fixture(params=SHAPES, ids=str)
def pose(request):
    return Transform.random(jax.random.key(7), request.param)


def test_numpy(pose, tol):
    q = interop.rotation_to_numpy_wxyz(pose.rotation)
    assert type(q) is np.ndarray
    assert np.array_equal(interop.rotation_to_numpy_xyzw(pose.rotation), np.roll(q, -1, -1))
    assert s.allclose(interop.rotation_from_numpy_wxyz(q), pose.rotation, atol=tol)
    assert s.allclose(interop.rotation_from_numpy_xyzw(np.roll(q, -1, -1)), pose.rotation, atol=tol)
    matrix = interop.transform_to_numpy_matrix(pose)
    assert type(matrix) is np.ndarray
    assert s.allclose(interop.transform_from_numpy_matrix(matrix), pose, rtol=tol, atol=tol)


def test_scipy(pose, tol):
    theirs = interop.rotation_to_scipy_xyzw(pose.rotation)
    assert np.abs(theirs.as_matrix() - pose.rotation.to_matrix()).max() < tol
    assert np.abs(theirs.apply([1.0, 2.0, 3.0]) - np.asarray(pose.rotation @ np.array([1.0, 2.0, 3.0]))).max() < 10 * tol
    assert s.allclose(interop.rotation_from_scipy_xyzw(theirs), pose.rotation, atol=tol)
    rigid = interop.transform_to_scipy_xyzw(pose)
    assert np.abs(rigid.as_matrix() - pose.to_matrix()).max() < tol
    assert s.allclose(interop.transform_from_scipy_xyzw(rigid), pose, rtol=tol, atol=tol)
    twist = pose.log()
    assert np.abs(rigid.as_exp_coords() - twist.as_vector()).max() < 100 * tol


def test_jaxlie(pose, tol):
    theirs = interop.rotation_to_jaxlie_wxyz(pose.rotation)
    assert np.abs(theirs.as_matrix() - pose.rotation.to_matrix()).max() < tol
    assert s.allclose(interop.rotation_from_jaxlie_wxyz(theirs), pose.rotation, atol=tol)
    rigid = interop.transform_to_jaxlie_wxyz_xyz(pose)
    assert np.abs(rigid.as_matrix() - pose.to_matrix()).max() < tol
    assert s.allclose(interop.transform_from_jaxlie_wxyz_xyz(rigid), pose, rtol=tol, atol=tol)
    moved = jax.jit(lambda p: interop.transform_from_jaxlie_wxyz_xyz(interop.transform_to_jaxlie_wxyz_xyz(p)))(pose)
    assert s.allclose(moved, pose, rtol=tol, atol=tol)


def test_ros_messages(tol):
    pose = Transform(Rotation.rot_z(np.pi / 2), np.array([1.0, 2.0, 3.0]))
    message = interop.transform_to_tf2_xyzw(pose)
    assert message["translation"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    half = float(np.sqrt(0.5))
    assert message["rotation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": half, "w": half}, abs=tol)
    assert s.allclose(interop.transform_from_tf2_xyzw(message), pose, rtol=tol, atol=tol)

    class Fields:
        def __init__(self, **named):
            self.__dict__.update(named)

    as_object = Fields(translation=Fields(**message["translation"]), rotation=Fields(**message["rotation"]))
    assert s.allclose(interop.transform_from_tf2_xyzw(as_object), pose, rtol=tol, atol=tol)
    twist, wrench = (
        Twist(linear=np.array([1.0, 2, 3]), angular=np.array([4.0, 5, 6])),
        Wrench(force=np.array([1.0, 2, 3]), torque=np.array([4.0, 5, 6])),
    )
    assert interop.twist_to_tf2(twist) == {"linear": {"x": 1, "y": 2, "z": 3}, "angular": {"x": 4, "y": 5, "z": 6}}
    assert interop.wrench_to_tf2(wrench) == {"force": {"x": 1, "y": 2, "z": 3}, "torque": {"x": 4, "y": 5, "z": 6}}
    assert s.allclose(interop.twist_from_tf2(interop.twist_to_tf2(twist)), twist)
    assert s.allclose(interop.wrench_from_tf2(interop.wrench_to_tf2(wrench)), wrench)
    with pytest.raises(ShapeError, match="one value"):
        interop.transform_to_tf2_xyzw(Transform.identity((2,)))


def test_mujoco(pose, tol):
    pos, quat = interop.transform_to_mujoco_wxyz(pose)
    assert pos.shape == (*pose.shape, 3)
    assert np.array_equal(quat, pose.rotation.wxyz)
    assert s.allclose(interop.transform_from_mujoco_wxyz(pos, quat), pose, rtol=tol, atol=tol)
    qpos = interop.transform_to_mujoco_free_joint_wxyz(pose)
    assert qpos.shape == (*pose.shape, 7)
    assert s.allclose(interop.transform_from_mujoco_free_joint_wxyz(qpos), pose, rtol=tol, atol=tol)


def test_spice(tol):
    """Against rav2xf, xf2rav and the text of pxform: matrices map a-coordinates to b-coordinates, rates are along a's axes."""
    spiceypy = pytest.importorskip("spiceypy")
    a_R_b, w = Rotation.from_rpy(0.4, -0.3, 2.0), np.array([0.1, -0.2, 0.3])
    velocity = SpatialVelocity(np.asarray(w, a_R_b.dtype), np.zeros(3, a_R_b.dtype))
    matrix, rate = interop.rotation_and_velocity_to_spice_rav(a_R_b, velocity)
    theirs = spiceypy.rav2xf(np.array(matrix, float), np.array(rate, float))
    ours = interop.rotation_and_velocity_to_spice_sxform(a_R_b, velocity)
    assert np.abs(ours - theirs).max() < tol
    for back, speed in (
        interop.rotation_and_velocity_from_spice_sxform(theirs),
        interop.rotation_and_velocity_from_spice_rav(*spiceypy.xf2rav(theirs)),
    ):
        assert s.allclose(back, a_R_b, atol=tol)
        assert np.abs(speed.angular - w).max() < tol
    axes = spiceypy.pxform("J2000", "ECLIPJ2000", 0.0)  # built in: no kernel
    to_R_from = interop.rotation_from_spice_pxform(axes)
    assert np.abs(to_R_from @ np.array([1.0, 2.0, 3.0]) - spiceypy.mxv(axes, [1.0, 2.0, 3.0])).max() < 10 * tol
    assert np.abs(interop.rotation_to_spice_pxform(to_R_from) - axes).max() < tol
    batch = interop.rotation_and_velocity_from_spice_sxform(np.stack([theirs, np.eye(6)]))
    assert batch[0].shape == (2,)


def test_dual_quaternions(pose, tol):
    """Their products compose poses; points go through q (p + eps x) q*; any norm is read."""
    dual = np.asarray(interop.transform_to_dual_quaternion_wxyz(pose), float)
    assert dual.shape == (*pose.shape, 8)

    def product(a, b):
        (w, x, y, z), (s, t, u, v) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
        parts = (w * s - x * t - y * u - z * v, w * t + x * s + y * v - z * u, w * u - x * v + y * s + z * t, w * v + x * u - y * t + z * s)
        return np.stack(parts, -1)

    def both(a, b):
        real = product(a[..., :4], b[..., :4])
        return np.concatenate([real, product(a[..., :4], b[..., 4:]) + product(a[..., 4:], b[..., :4])], -1)

    other = Transform.random(jax.random.key(8), pose.shape)
    composed = both(dual, np.asarray(interop.transform_to_dual_quaternion_wxyz(other), float))
    assert s.allclose(interop.transform_from_dual_quaternion_wxyz(-3 * composed), pose @ other, rtol=10 * tol, atol=10 * tol)
    assert s.allclose(interop.transform_from_dual_quaternion_wxyz(dual), pose, rtol=10 * tol, atol=10 * tol)
    with pytest.raises(ShapeError, match=r"a dual quaternion has shape \[..., 8\]; found \(7,\)"):
        interop.transform_from_dual_quaternion_wxyz(np.ones(7))


def test_nothing_is_imported_before_use():
    code = "import sys, jaxframes.io.interop; sys.exit(any(m in sys.modules for m in ('scipy.spatial', 'jaxlie', 'mujoco')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


class KdlRotation:
    """What the tests need of ``PyKDL.Rotation``: quaternions scalar last, entries by row and column (its golden values)."""

    def __init__(self, matrix):
        self.matrix = matrix

    @classmethod
    def Quaternion(cls, x, y, z, w):
        return cls(ScipyRotation.from_quat([x, y, z, w]).as_matrix())

    def GetQuaternion(self):
        return tuple(ScipyRotation.from_matrix(self.matrix).as_quat())

    def __getitem__(self, at):
        return self.matrix[at]


def stand_in():
    """A module with PyKDL's classes, for where it is not installed."""
    kdl = types.ModuleType("PyKDL")
    kdl.Rotation, kdl.Vector = KdlRotation, lambda x, y, z: [x, y, z]
    kdl.Frame = lambda M, p: types.SimpleNamespace(M=M, p=p)
    kdl.Twist = lambda vel, rot: types.SimpleNamespace(vel=vel, rot=rot)
    kdl.Wrench = lambda force, torque: types.SimpleNamespace(force=force, torque=torque)
    return kdl


@pytest.fixture(params=["stand-in", "PyKDL"])
def kdl(request, monkeypatch):
    if request.param == "PyKDL":
        return pytest.importorskip("PyKDL")
    monkeypatch.setitem(sys.modules, "PyKDL", stand_in())
    return sys.modules["PyKDL"]


def test_pykdl(kdl, tol):
    pose = Transform.random(jax.random.key(3))
    frame = interop.transform_to_pykdl_xyzw(pose)
    matrix = np.array([[frame.M[i, j] for j in range(3)] for i in range(3)])
    np.testing.assert_allclose(matrix, pose.rotation.to_matrix(), atol=tol)
    np.testing.assert_allclose([frame.p[i] for i in range(3)], pose.translation, atol=tol)
    assert s.allclose(interop.transform_from_pykdl_xyzw(frame), pose, atol=tol)
    quarter = interop.rotation_from_pykdl_xyzw(kdl.Rotation.Quaternion(0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)))
    np.testing.assert_allclose(quarter.to_matrix(), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=tol)
    x, z = kdl.Vector(1.0, 2.0, 3.0), kdl.Vector(4.0, 5.0, 6.0)
    twist, wrench = interop.twist_from_pykdl(kdl.Twist(x, z)), interop.wrench_from_pykdl(kdl.Wrench(x, z))
    np.testing.assert_array_equal((twist.linear, twist.angular), [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal((wrench.force, wrench.torque), [[1, 2, 3], [4, 5, 6]])
    for value, back, names in (
        (interop.twist_to_pykdl(twist), twist, {"vel": "linear", "rot": "angular"}),
        (interop.wrench_to_pykdl(wrench), wrench, {"force": "force", "torque": "torque"}),
    ):
        for theirs, ours in names.items():
            np.testing.assert_array_equal([getattr(value, theirs)[i] for i in range(3)], getattr(back, ours))
    with pytest.raises(ShapeError, match="one by one"):
        interop.transform_to_pykdl_xyzw(Transform.random(jax.random.key(3), (2,)))


def test_without_pykdl_its_name_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "PyKDL", None)
    with pytest.raises(MissingExtraError, match="'PyKDL'"):
        interop.twist_to_pykdl(Twist.zero())
