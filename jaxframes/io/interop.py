"""Rotations and poses to and from other libraries, by value; the order of a quaternion is part of every name.

SciPy, jaxlie and PyKDL are imported by the functions that make their objects, nothing else is. NumPy arrays are what
``numpy.asarray`` makes of any field; ROS messages, MuJoCo arrays and SPICE matrices need no library at all.
"""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import MissingExtraError, ShapeError
from jaxframes.numerics.components import V3, Quat, quat_conj, quat_from, quat_mul, quat_norm2, rotate_inverse
from jaxframes.numerics.lift import lift
from jaxframes.spatial.rotation import Rotation
from jaxframes.spatial.transform import Transform
from jaxframes.spatial.twist import Twist, Wrench
from jaxframes.spatial.velocity import SpatialVelocity
from jaxframes.staging.arrays import as_float

if TYPE_CHECKING:
    import jaxlie
    import scipy.spatial.transform as scipy_transform


def _imported(name: str) -> Any:
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise MissingExtraError(f"this conversion needs the package {name.split('.')[0]!r}, which is not installed") from error


# ---------------------------------------------------------------------- NumPy
def rotation_to_numpy_wxyz(rotation: Rotation) -> np.ndarray:
    """Return the quaternions [..., 4], scalar first, as a NumPy array."""
    return np.asarray(rotation.wxyz)


def rotation_to_numpy_xyzw(rotation: Rotation) -> np.ndarray:
    """Return the quaternions [..., 4], scalar last, as a NumPy array."""
    return np.asarray(rotation.to_quaternion_xyzw())


def rotation_from_numpy_wxyz(wxyz: Any) -> Rotation:
    """Return the rotations of quaternions [..., 4], scalar first; normalised."""
    return Rotation.from_quaternion_wxyz(wxyz)


def rotation_from_numpy_xyzw(xyzw: Any) -> Rotation:
    """Return the rotations of quaternions [..., 4], scalar last; normalised."""
    return Rotation.from_quaternion_xyzw(xyzw)


def transform_to_numpy_matrix(transform: Transform) -> np.ndarray:
    """Return homogeneous matrices [..., 4, 4] as a NumPy array."""
    return np.asarray(transform.to_matrix())


def transform_from_numpy_matrix(matrix: Any) -> Transform:
    """Return the poses of homogeneous matrices [..., 4, 4]."""
    return Transform.from_matrix(matrix)


# ---------------------------------------------------------------------- dual quaternions
def transform_to_dual_quaternion_wxyz(transform: Transform) -> jax.Array:
    """Return unit dual quaternions [..., 8]: the rotation q, scalar first, then half of (0, translation) q, as in pytransform3d."""
    return _dual(transform.rotation.wxyz, transform.translation)


def transform_from_dual_quaternion_wxyz(dual_quaternion: Any) -> Transform:
    """Return the poses of dual quaternions [..., 8], both parts scalar first.

    They may have any norm; of the dual part what is not perpendicular to the real one has no meaning for a pose and is left out.
    """
    array = as_float(dual_quaternion)
    if array.ndim == 0 or array.shape[-1] != 8:
        raise ShapeError(f"a dual quaternion has shape [..., 8]; found {array.shape}")
    rotation = Rotation.from_quaternion_wxyz(array[..., :4])
    return Transform(rotation, _translation(array[..., :4], array[..., 4:]))


@lift(Quat, V3, out=tuple)
def _dual(q: Quat, p: V3) -> tuple[Any, ...]:
    return (*q, *(0.5 * part for part in quat_mul(quat_from(0.0, p), q)))


@lift(Quat, Quat, out=V3)
def _translation(real: Quat, dual: Quat) -> V3:
    return quat_mul(dual, quat_conj(real)).vector * (2.0 / quat_norm2(real))


# ---------------------------------------------------------------------- SciPy
def rotation_to_scipy_xyzw(rotation: Rotation) -> "scipy_transform.Rotation":
    """Return a ``scipy.spatial.transform.Rotation``, made from quaternions scalar last; SciPy computes in 64 bits."""
    xyzw = rotation_to_numpy_xyzw(rotation).astype(np.float64)
    return _imported("scipy.spatial.transform").Rotation.from_quat(xyzw)


def rotation_from_scipy_xyzw(rotation: "scipy_transform.Rotation") -> Rotation:
    """Return the rotation of a ``scipy.spatial.transform.Rotation``, read as quaternions scalar last."""
    return Rotation.from_quaternion_xyzw(rotation.as_quat())


def transform_to_scipy_xyzw(transform: Transform) -> "scipy_transform.RigidTransform":
    """Return a ``scipy.spatial.transform.RigidTransform`` (SciPy 1.16 or newer)."""
    module = _imported("scipy.spatial.transform")
    if not hasattr(module, "RigidTransform"):
        raise MissingExtraError("RigidTransform needs SciPy 1.16 or newer; rotation_to_scipy_xyzw works with any")
    full = transform.broadcast_to(transform.shape)
    translation = np.asarray(full.translation, np.float64)
    return module.RigidTransform.from_components(translation, rotation_to_scipy_xyzw(full.rotation))


def transform_from_scipy_xyzw(transform: "scipy_transform.RigidTransform") -> Transform:
    """Return the pose of a ``scipy.spatial.transform.RigidTransform``."""
    return Transform(rotation_from_scipy_xyzw(transform.rotation), as_float(transform.translation))


# ---------------------------------------------------------------------- jaxlie
def rotation_to_jaxlie_wxyz(rotation: Rotation) -> "jaxlie.SO3":
    """Return a ``jaxlie.SO3``, which also holds quaternions scalar first."""
    return _imported("jaxlie").SO3(wxyz=as_float(rotation.wxyz))


def rotation_from_jaxlie_wxyz(rotation: "jaxlie.SO3") -> Rotation:
    """Return the rotation of a ``jaxlie.SO3``; the numbers are taken as they are."""
    return Rotation(as_float(rotation.wxyz))


def transform_to_jaxlie_wxyz_xyz(transform: Transform) -> "jaxlie.SE3":
    """Return a ``jaxlie.SE3``: quaternions scalar first, then the translation."""
    full = transform.broadcast_to(transform.shape)
    return _imported("jaxlie").SE3.from_rotation_and_translation(rotation_to_jaxlie_wxyz(full.rotation), full.translation)


def transform_from_jaxlie_wxyz_xyz(transform: "jaxlie.SE3") -> Transform:
    """Return the pose of a ``jaxlie.SE3``; the numbers are taken as they are."""
    return Transform(rotation_from_jaxlie_wxyz(transform.rotation()), as_float(transform.translation()))


# ---------------------------------------------------------------------- ROS (tf2, geometry_msgs) as dictionaries
def transform_to_tf2_xyzw(transform: Transform) -> dict[str, dict[str, float]]:
    """Return one pose as the fields of ``geometry_msgs/Transform``: translation x, y, z and rotation x, y, z, w."""
    x, y, z, w = _one(rotation_to_numpy_xyzw(transform.rotation))
    return {"translation": _fields(transform.translation), "rotation": {"x": x, "y": y, "z": z, "w": w}}


def transform_from_tf2_xyzw(message: Any) -> Transform:
    """Return the pose of the fields of ``geometry_msgs/Transform``: nested dictionaries, or objects with such attributes."""
    rotation = Rotation.from_quaternion_xyzw(_read(_get(message, "rotation"), "xyzw"))
    return Transform(rotation, _read(_get(message, "translation"), "xyz"))


def twist_to_tf2(twist: Twist) -> dict[str, dict[str, float]]:
    """Return one twist as the fields of ``geometry_msgs/Twist``: linear, angular."""
    return {"linear": _fields(twist.linear), "angular": _fields(twist.angular)}


def twist_from_tf2(message: Any) -> Twist:
    """Return the twist of the fields of ``geometry_msgs/Twist``."""
    return Twist(linear=_read(_get(message, "linear"), "xyz"), angular=_read(_get(message, "angular"), "xyz"))


def wrench_to_tf2(wrench: Wrench) -> dict[str, dict[str, float]]:
    """Return one wrench as the fields of ``geometry_msgs/Wrench``: force, torque."""
    return {"force": _fields(wrench.force), "torque": _fields(wrench.torque)}


def wrench_from_tf2(message: Any) -> Wrench:
    """Return the wrench of the fields of ``geometry_msgs/Wrench``."""
    return Wrench(force=_read(_get(message, "force"), "xyz"), torque=_read(_get(message, "torque"), "xyz"))


def _one(array: Any) -> list[float]:
    array = np.asarray(array)
    if array.ndim != 1:
        raise ShapeError(f"a message or object holds one value; found a batch of shape {array.shape[:-1]}: convert its items one by one")
    return [float(v) for v in array]


def _fields(vector: Any) -> dict[str, float]:
    return dict(zip("xyz", _one(vector), strict=True))


def _get(message: Any, name: str) -> Any:
    return message[name] if isinstance(message, dict) else getattr(message, name)


def _read(message: Any, names: str) -> jax.Array:
    return as_float(np.array([float(_get(message, name)) for name in names]))


# ---------------------------------------------------------------------- PyKDL: one value each, by value
def rotation_to_pykdl_xyzw(rotation: Rotation) -> Any:
    """Return one rotation as a ``PyKDL.Rotation``, made by ``Rotation.Quaternion(x, y, z, w)``."""
    return _imported("PyKDL").Rotation.Quaternion(*_one(rotation_to_numpy_xyzw(rotation)))


def rotation_from_pykdl_xyzw(rotation: Any) -> Rotation:
    """Return the rotation of a ``PyKDL.Rotation``, read by ``GetQuaternion()`` as (x, y, z, w); normalised."""
    return Rotation.from_quaternion_xyzw(np.array(rotation.GetQuaternion()))


def transform_to_pykdl_xyzw(transform: Transform) -> Any:
    """Return one pose as a ``PyKDL.Frame``."""
    return _imported("PyKDL").Frame(rotation_to_pykdl_xyzw(transform.rotation), _to_pykdl(transform.translation))


def transform_from_pykdl_xyzw(frame: Any) -> Transform:
    """Return the pose of a ``PyKDL.Frame``: its rotation ``M`` and origin ``p``."""
    return Transform(rotation_from_pykdl_xyzw(frame.M), _from_pykdl(frame.p))


def twist_to_pykdl(twist: Twist) -> Any:
    """Return one twist as a ``PyKDL.Twist(vel, rot)``: linear first, as KDL has it."""
    return _imported("PyKDL").Twist(_to_pykdl(twist.linear), _to_pykdl(twist.angular))


def twist_from_pykdl(twist: Any) -> Twist:
    """Return the twist of a ``PyKDL.Twist``: ``vel`` and ``rot``."""
    return Twist(linear=_from_pykdl(twist.vel), angular=_from_pykdl(twist.rot))


def wrench_to_pykdl(wrench: Wrench) -> Any:
    """Return one wrench as a ``PyKDL.Wrench(force, torque)``."""
    return _imported("PyKDL").Wrench(_to_pykdl(wrench.force), _to_pykdl(wrench.torque))


def wrench_from_pykdl(wrench: Any) -> Wrench:
    """Return the wrench of a ``PyKDL.Wrench``."""
    return Wrench(force=_from_pykdl(wrench.force), torque=_from_pykdl(wrench.torque))


def _to_pykdl(vector: Any) -> Any:
    return _imported("PyKDL").Vector(*_one(vector))


def _from_pykdl(vector: Any) -> jax.Array:
    return as_float(np.array([float(vector[i]) for i in range(3)]))


# ---------------------------------------------------------------------- MuJoCo
def transform_to_mujoco_wxyz(transform: Transform) -> tuple[np.ndarray, np.ndarray]:
    """Return (pos [..., 3], quat [..., 4] scalar first), as in ``xpos``/``xquat``, ``mocap_pos``/``mocap_quat`` or a body's fields."""
    full = transform.broadcast_to(transform.shape)
    return np.asarray(full.translation), np.asarray(full.rotation.wxyz)


def transform_from_mujoco_wxyz(pos: Any, quat: Any) -> Transform:
    """Return the pose of (pos [..., 3], quat [..., 4] scalar first); normalised."""
    return Transform(Rotation.from_quaternion_wxyz(quat), as_float(pos))


def transform_to_mujoco_free_joint_wxyz(transform: Transform) -> np.ndarray:
    """Return the seven ``qpos`` numbers [..., 7] of a free joint: position, then quaternion scalar first."""
    return np.concatenate(transform_to_mujoco_wxyz(transform), -1)


def transform_from_mujoco_free_joint_wxyz(qpos: Any) -> Transform:
    """Return the pose of the seven ``qpos`` numbers [..., 7] of a free joint."""
    qpos = as_float(qpos)
    return transform_from_mujoco_wxyz(qpos[..., :3], qpos[..., 3:7])


# ---------------------------------------------------------------------- SPICE
def rotation_from_spice_pxform(matrix: Any) -> Rotation:
    """Return ``to_R_from`` of the matrices [..., 3, 3] of ``pxform(from, to, et)``, which map from-coordinates to to-coordinates."""
    return Rotation.from_matrix(matrix)


def rotation_to_spice_pxform(rotation: Rotation) -> jax.Array:
    """Return the matrices [..., 3, 3] that ``pxform(b, a, et)`` gives for the rotation ``a_R_b``."""
    return rotation.to_matrix()


def rotation_and_velocity_from_spice_sxform(matrix: Any) -> tuple[Rotation, SpatialVelocity]:
    """Return (``a_R_b``, velocity of b relative to a along a's axes) of the 6x6 matrices [..., 6, 6] of ``sxform(a, b, et)``.

    The matrix is [[M, 0], [dM/dt, M]] with M = ``b_R_a``; the angular velocity is that of ``xf2rav``. The linear part is zero.
    """
    matrix = as_float(matrix)
    if matrix.shape[-2:] != (6, 6):
        raise ShapeError(f"a state transformation has shape [..., 6, 6]; found {matrix.shape}")
    a_R_b = Rotation.from_matrix(matrix[..., :3, :3]).inverse()
    flat = matrix.reshape(*matrix.shape[:-2], 36)
    angular = _rate_of(flat)
    return a_R_b, SpatialVelocity(angular, jnp.zeros_like(angular))


def rotation_and_velocity_from_spice_rav(matrix: Any, angular: Any) -> tuple[Rotation, SpatialVelocity]:
    """Return (``a_R_b``, velocity of b relative to a along a's axes) of what ``xf2rav(sxform(a, b, et))`` returns."""
    angular = as_float(angular)
    return Rotation.from_matrix(matrix).inverse(), SpatialVelocity(angular, jnp.zeros_like(angular))


def rotation_and_velocity_to_spice_rav(a_R_b: Rotation, velocity: SpatialVelocity) -> tuple[jax.Array, jax.Array]:
    """Return the pair that ``rav2xf`` takes: (``b_R_a`` [..., 3, 3], angular velocity of b relative to a along a's axes [..., 3])."""
    return a_R_b.inverse().to_matrix(), as_float(velocity.angular)


def rotation_and_velocity_to_spice_sxform(a_R_b: Rotation, velocity: SpatialVelocity) -> jax.Array:
    """Return the 6x6 matrices [..., 6, 6] that ``sxform(a, b, et)`` gives, from ``a_R_b`` and b's angular velocity along a's axes."""
    flat = _state_matrix(a_R_b.wxyz, velocity.angular)
    return flat.reshape(*flat.shape[:-1], 6, 6)


@lift(tuple, out=V3)
def _rate_of(m: tuple[jax.Array, ...]) -> V3:
    """Return w from [w]x = -M^T dM/dt, the mean of its two triangles."""
    rows, rates = ([m[6 * (i + start) : 6 * (i + start) + 3] for i in range(3)] for start in (0, 3))

    def entry(i: int, j: int) -> jax.Array:
        return -(rows[0][i] * rates[0][j] + rows[1][i] * rates[1][j] + rows[2][i] * rates[2][j])

    return V3(0.5 * (entry(2, 1) - entry(1, 2)), 0.5 * (entry(0, 2) - entry(2, 0)), 0.5 * (entry(1, 0) - entry(0, 1)))


@lift(Quat, V3, out=tuple)
def _state_matrix(q: Quat, w: V3) -> tuple[Any, ...]:
    """Return the entries of [[M, 0], [dM/dt, M]] with M = R' and dM/dt = -M [w]x."""
    one, zero = jnp.ones_like(q.w), jnp.zeros_like(q.w)
    units = (V3(one, zero, zero), V3(zero, one, zero), V3(zero, zero, one))
    columns = [tuple(rotate_inverse(q, unit)) for unit in units]
    # column j of -M [w]x is -M (w x e_j)
    moving = (V3(zero, -w.z, w.y), V3(w.z, zero, -w.x), V3(-w.y, w.x, zero))
    rates = [tuple(rotate_inverse(q, v)) for v in moving]
    upper = [entry for i in range(3) for entry in (*(c[i] for c in columns), 0.0, 0.0, 0.0)]
    lower = [entry for i in range(3) for entry in (*(c[i] for c in rates), *(c[i] for c in columns))]
    return (*upper, *lower)
