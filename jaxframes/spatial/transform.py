"""Transform: the pose of one frame relative to another, an element of SE(3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.errors import ShapeError
from jaxframes.numerics.batch import tag
from jaxframes.spatial import averages, transform_ops
from jaxframes.spatial.refusals import matrix_of
from jaxframes.spatial.rotation import Rotation
from jaxframes.spatial.twist import Twist, Wrench
from jaxframes.spatial.value import Value
from jaxframes.spatial.velocity import SpatialVelocity
from jaxframes.staging.arrays import as_float


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False)
class Transform(Value):
    """``a_T_b``: the pose of a frame b in a frame a; maps b-coordinates of points to a-coordinates, ``a_p = a_T_b @ b_p``.

    ``rotation`` is ``a_R_b``; ``translation`` [..., 3] in metres is b's origin in a. ``a_T_b @ b_T_c == a_T_c``.
    """

    rotation: Rotation
    translation: jax.Array
    kind: str = tag("Transform")

    # ------------------------------------------------------------------ constructors
    @classmethod
    def identity(cls, batch: Sequence[int] = (), dtype: Any = None) -> "Transform":
        """Return the identity for a batch shape."""
        return cls(Rotation.identity(batch, dtype), jnp.zeros((*batch, 3), float if dtype is None else dtype))

    @classmethod
    def from_matrix(cls, matrix: Any) -> "Transform":
        """Return the pose of homogeneous matrices [..., 4, 4] (or their upper three rows); the last row is not read."""
        matrix = as_float(matrix)
        if matrix.ndim < 2 or matrix.shape[-2:] not in ((4, 4), (3, 4)):
            raise ShapeError(f"a homogeneous matrix has shape [..., 4, 4] or [..., 3, 4]; found {matrix.shape}")
        return cls(Rotation.from_matrix(matrix[..., :3, :3]), matrix[..., :3, 3])

    @classmethod
    def from_rotation(cls, rotation: Rotation) -> "Transform":
        """Return the pose that turns and does not move."""
        wxyz = as_float(rotation.wxyz)
        return cls(rotation, jnp.zeros((*wxyz.shape[:-1], 3), wxyz.dtype))

    @classmethod
    def from_translation(cls, translation: Any) -> "Transform":
        """Return the pose that moves by [..., 3] metres and does not turn."""
        translation = as_float(translation)
        return cls(Rotation.identity(translation.shape[:-1], translation.dtype), translation)

    @classmethod
    def from_geodetic(cls, latitude: Any, longitude: Any, height: Any) -> "Transform":
        """Return the pose of a place on the WGS-84 ellipsoid in the Earth-fixed frame: axes x east, y north, z up.

        Args:
            latitude: Geodetic latitude [...] in radians, north positive.
            longitude: Longitude [...] in radians, east positive.
            height: Height [...] above the ellipsoid in metres.
        """
        q, p = transform_ops.from_geodetic(latitude, longitude, height)
        return cls(Rotation(q), p)

    @classmethod
    def from_dh(cls, a: Any, alpha: Any, d: Any, theta: Any) -> "Transform":
        """Return Rz(theta) Tz(d) Tx(a) Rx(alpha): a link by the parameters of Denavit and Hartenberg (1955), each [...]."""
        q, p = transform_ops.from_dh(a, alpha, d, theta)
        return cls(Rotation(q), p)

    @classmethod
    def from_dh_craig1989(cls, a: Any, alpha: Any, d: Any, theta: Any) -> "Transform":
        """Return Rx(alpha) Tx(a) Rz(theta) Tz(d): a link by the modified parameters of Craig (1989), each [...]."""
        q, p = transform_ops.from_dh_craig1989(a, alpha, d, theta)
        return cls(Rotation(q), p)

    @classmethod
    def exp(cls, twist: Twist) -> "Transform":
        """Return the pose reached from the identity by one unit of time of a constant twist: the exponential of SE(3)."""
        q, p = transform_ops.exp(twist.angular, twist.linear)
        return cls(Rotation(q), p)

    @classmethod
    def random(cls, key: jax.Array, batch: Sequence[int] = (), dtype: Any = None, scale: float = 1.0) -> "Transform":
        """Return poses with uniform rotations and normal translations of standard deviation ``scale`` metres."""
        turn, move = jax.random.split(key)
        translation = scale * jax.random.normal(move, (*batch, 3), float if dtype is None else dtype)
        return cls(Rotation.random(turn, batch, dtype), translation)

    # ------------------------------------------------------------------ the group
    def __matmul__(self, other: Any) -> Any:
        """Return ``a_T_b @ b_T_c``; points [..., 3] mapped to a; a ``Twist`` or ``Wrench`` with base and reference point moved to a."""
        if isinstance(other, Transform):
            q, p = transform_ops.compose(self.rotation.wxyz, self.translation, other.rotation.wxyz, other.translation)
            return Transform(Rotation(q), p)
        if isinstance(other, (Twist, Wrench)):
            return other.transform(self)
        if isinstance(other, Value):
            return NotImplemented
        return self.apply(other)

    def __mul__(self, other: Any) -> Any:
        raise TypeError(f"a Transform is not multiplied by *, found {type(other).__name__}: compose and apply by @, as in T @ p")

    def __pow__(self, exponent: Any) -> "Transform":
        """Return the pose at ``exponent`` [...] times the screw motion from the identity, turned by at most pi: ``exp(exponent * log)``."""
        return Transform.exp(self.log() * exponent)

    def apply(self, points: Any) -> jax.Array:
        """Return points [..., 3] given in b, in a."""
        return transform_ops.apply(self.rotation.wxyz, self.translation, points)

    def apply_vector(self, vectors: Any) -> jax.Array:
        """Return free vectors [..., 3] (directions, forces, velocities) given along b's axes, along a's axes: turned, not moved."""
        return self.rotation @ vectors

    def inverse(self) -> "Transform":
        """Return ``b_T_a``."""
        q, p = transform_ops.inverse(self.rotation.wxyz, self.translation)
        return Transform(Rotation(q), p)

    def inverse_apply(self, points: Any) -> jax.Array:
        """Return points [..., 3] given in a, in b."""
        return transform_ops.inverse_apply(self.rotation.wxyz, self.translation, points)

    def relative_to(self, observer: "Transform") -> "Transform":
        """Return ``observer.inverse() @ self``: from ``c_T_p`` and ``c_T_o``, ``o_T_p``; differences are taken before turning."""
        q, p = transform_ops.relative(observer.rotation.wxyz, observer.translation, self.rotation.wxyz, self.translation)
        return Transform(Rotation(q), p)

    def normalize(self) -> "Transform":
        """Return the same pose with a unit quaternion: after ``Rotation(wxyz)`` of other numbers."""
        return self.replace(rotation=self.rotation.normalize())

    # ------------------------------------------------------------------ extractors
    def to_matrix(self) -> jax.Array:
        """Return the homogeneous matrix [..., 4, 4]."""
        return matrix_of(transform_ops.to_matrix(self.rotation.wxyz, self.translation), 4)

    def log(self) -> Twist:
        """Return the twist, in b's axes at b's origin, whose exponential this is: the logarithm of SE(3), angle at most pi."""
        angular, linear = transform_ops.log(self.rotation.wxyz, self.translation)
        return Twist(linear=linear, angular=angular)

    def adjoint(self) -> jax.Array:
        """Return [[R, 0], [[l]x R, R]] [..., 6, 6], for [angular, linear] order.

        It takes a twist in b's axes at b's origin to a's axes at a's origin.
        """
        return matrix_of(transform_ops.adjoint(self.rotation.wxyz, self.translation), 6)

    # ------------------------------------------------------------------ means, Jacobians
    def mean(self, weights: Any = None, axis: int | Sequence[int] = 0) -> "Transform":
        """Return the mean pose over batch axes: ``Rotation.mean`` of the rotations, the weighted mean of the origins.

        It depends on the origin of the frame of the poses, b's, but not on that in which they are seen, a's.

        Args:
            weights: Not negative; they broadcast to the batch shape (default: equal).
            axis: One batch axis or several.

        Raises:
            ShapeError: As for ``Rotation.mean``.
        """
        full = self.broadcast_to(self.shape)
        rotation = full.rotation.mean(weights, axis)
        return Transform(rotation, averages.translation_mean(full.translation, weights, axis))

    @staticmethod
    def left_jacobian(twist: Twist) -> jax.Array:
        """Return J_l [..., 6, 6] in [angular, linear] order: exp(twist + d) = exp(J_l d) exp(twist) to first order."""
        return matrix_of(transform_ops.left_jacobian(twist.angular, twist.linear), 6)

    @staticmethod
    def right_jacobian(twist: Twist) -> jax.Array:
        """Return J_r [..., 6, 6] in [angular, linear] order: exp(twist + d) = exp(twist) exp(J_r d) to first order."""
        return Transform.left_jacobian(-twist)

    @staticmethod
    def left_jacobian_inv(twist: Twist) -> jax.Array:
        """Return the inverse of J_l [..., 6, 6]; regular at angles of 0 and pi, pole at 2 pi."""
        return matrix_of(transform_ops.left_jacobian_inv(twist.angular, twist.linear), 6)

    @staticmethod
    def right_jacobian_inv(twist: Twist) -> jax.Array:
        """Return the inverse of J_r [..., 6, 6]; regular at angles of 0 and pi, pole at 2 pi."""
        return Transform.left_jacobian_inv(-twist)

    # ------------------------------------------------------------------ moving along
    def retract(self, twist: Twist) -> "Transform":
        """Return ``self @ exp(twist)``: exact motion by a constant twist in b's axes at b's origin (rate times duration)."""
        return self @ Transform.exp(twist)

    def interpolate_screw(self, other: "Transform", fraction: Any) -> "Transform":
        """Return the pose at a fraction [...] of the screw motion to another; beyond [0, 1] it extrapolates."""
        return self.retract(other.relative_to(self).log() * fraction)

    def interpolate_separate(self, other: "Transform", fraction: Any) -> "Transform":
        """Return the pose at a fraction [...]: the origin on the straight line, the rotation by ``slerp``."""
        translation = transform_ops.lerp(self.translation, other.translation, fraction)
        return Transform(self.rotation.slerp(other.rotation, fraction), translation)

    def reverse_velocity(self, velocity: SpatialVelocity) -> SpatialVelocity:
        """Return the velocity of a relative to b from that of b relative to a (axes of a): [-R'w; -R'(v - w x l)] in b's axes."""
        return SpatialVelocity(*transform_ops.reverse_velocity(self.rotation.wxyz, self.translation, velocity.angular, velocity.linear))
