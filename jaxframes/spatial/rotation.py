"""Rotation: an element of SO(3), stored as a unit quaternion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.numerics.batch import tag
from jaxframes.spatial import averages, rotation_ops
from jaxframes.spatial.refusals import AMBIGUOUS, MIRRORED, NOWHERE, ZERO, matrix_of, nine, rotations
from jaxframes.spatial.value import Based, Value
from jaxframes.staging.arrays import as_float


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False)
class Rotation(Value):
    """The rotation of a frame b relative to a frame a: maps b-coordinates of vectors to a-coordinates, ``a_v = a_R_b @ b_v``.

    Columns of its matrix are the axes of b in a. ``wxyz`` [..., 4] is a unit quaternion, scalar first; q and -q are the same
    rotation. Products stay unit to rounding, however many there are: each is brought back by one Newton step. ``Rotation(wxyz)``
    itself takes the numbers as they are (``.normalize()`` helps), the constructors below normalise.

    Gradients: smooth wherever the operation is; the exceptions are said at each method.
    """

    wxyz: jax.Array
    kind: str = tag("Rotation")

    # ------------------------------------------------------------------ constructors
    @classmethod
    def identity(cls, batch: Sequence[int] = (), dtype: Any = None) -> "Rotation":
        """Return the identity for a batch shape."""
        one = jnp.zeros((4,), float if dtype is None else dtype).at[0].set(1)
        return cls(jnp.broadcast_to(one, (*batch, 4)))

    @classmethod
    def from_quaternion_wxyz(cls, wxyz: Any) -> "Rotation":
        """Return the rotation of quaternions [..., 4], scalar first, normalised (FrameError for zero; under jit NaN)."""
        return cls(rotations(rotation_ops.normalized(wxyz), (wxyz,), ZERO))

    @classmethod
    def from_quaternion_xyzw(cls, xyzw: Any) -> "Rotation":
        """Return the rotation of quaternions [..., 4], scalar last (ROS, KDL, SciPy), normalised (FrameError for zero; under jit NaN)."""
        return cls(rotations(rotation_ops.normalized_xyzw(xyzw), (xyzw,), ZERO))

    @classmethod
    def from_matrix(cls, matrix: Any) -> "Rotation":
        """Return the rotation of matrices [..., 3, 3].

        Every rotation is met with full accuracy. An almost orthonormal matrix gives a unit quaternion all the same; one farther from a
        rotation, a scale or a shear, gives one that means little: see ``nearest``.

        Raises:
            FrameError: A matrix is a reflection or flat: its determinant is not positive. Under jit value and gradient are NaN.
            ShapeError: It is no array [..., 3, 3].
        """
        return cls(rotations(rotation_ops.from_matrix(nine(matrix)), (matrix,), MIRRORED))

    @classmethod
    def from_rows(cls, x: Any, y: Any, z: Any) -> "Rotation":
        """Return the rotation whose matrix has the rows x, y, z [..., 3]: the axes of a in b (errors as ``from_matrix``)."""
        return cls(rotations(rotation_ops.from_rows(x, y, z), (x, y, z), MIRRORED))

    @classmethod
    def from_columns(cls, x: Any, y: Any, z: Any) -> "Rotation":
        """Return the rotation whose matrix has the columns x, y, z [..., 3]: the axes of b in a (errors as ``from_matrix``)."""
        return cls(rotations(rotation_ops.from_columns(x, y, z), (x, y, z), MIRRORED))

    @classmethod
    def from_axis_angle(cls, axis: Any, angle: Any) -> "Rotation":
        """Return the rotation about an axis [..., 3] of any length by an angle [...] (rad); a zero axis gives the identity."""
        return cls(rotation_ops.from_axis_angle(axis, angle))

    @classmethod
    def from_unit_axis_angle(cls, axis: Any, angle: Any) -> "Rotation":
        """Return the rotation about an axis [..., 3] that is a unit vector already (not checked) by an angle [...] (rad)."""
        return cls(rotation_ops.from_unit_axis_angle(axis, angle))

    @classmethod
    def from_rotation_vector(cls, vector: Any) -> "Rotation":
        """Return the rotation of rotation vectors [..., 3]: axis times angle (rad), of any length. The exponential."""
        return cls(rotation_ops.exp(vector))

    exp = from_rotation_vector

    @classmethod
    def rot_x(cls, angle: Any) -> "Rotation":
        """Return the right-handed rotation about x by an angle [...] (rad)."""
        return cls(rotation_ops.about_x(angle))

    @classmethod
    def rot_y(cls, angle: Any) -> "Rotation":
        """Return the right-handed rotation about y by an angle [...] (rad)."""
        return cls(rotation_ops.about_y(angle))

    @classmethod
    def rot_z(cls, angle: Any) -> "Rotation":
        """Return the right-handed rotation about z by an angle [...] (rad)."""
        return cls(rotation_ops.about_z(angle))

    @classmethod
    def from_rpy(cls, roll: Any, pitch: Any, yaw: Any) -> "Rotation":
        """Return Rz(yaw) Ry(pitch) Rx(roll), each angle [...] in rad: turns about fixed x, then y, then z."""
        return cls(rotation_ops.from_rpy(roll, pitch, yaw))

    @classmethod
    def from_euler_zyx(cls, z: Any, y: Any, x: Any) -> "Rotation":
        """Return Rz(z) Ry(y) Rx(x), each angle [...] in rad: turns about z, the new y, the newest x."""
        return cls(rotation_ops.from_rpy(x, y, z))

    @classmethod
    def from_euler_zyz(cls, z1: Any, y: Any, z2: Any) -> "Rotation":
        """Return Rz(z1) Ry(y) Rz(z2), each angle [...] in rad."""
        return cls(rotation_ops.from_zyz(z1, y, z2))

    @classmethod
    def from_euler(cls, sequence: str, angles: Any) -> "Rotation":
        """Return the product of turns about coordinate axes.

        Args:
            sequence: One to three letters, neighbours different. Upper case, ``"ZXZ"``: each turn is about an axis that the turns before
                have moved (intrinsic). Lower case, ``"xyz"``: about axes that stay (extrinsic). As in SciPy.
            angles: [..., n] in rad, in the order of the letters; [...] for one letter.

        Raises:
            FrameError: The sequence is none.
            ShapeError: The angles are not as many as the letters.
        """
        return cls(rotation_ops.from_euler(sequence, angles))

    @classmethod
    def from_mrp(cls, parameters: Any) -> "Rotation":
        """Return the rotation of modified Rodrigues parameters [..., 3]: axis times tan(angle / 4) (Schaub and Junkins 1996)."""
        return cls(rotation_ops.from_mrp(parameters))

    @classmethod
    def nearest(cls, matrix: Any) -> "Rotation":
        """Return the rotation nearest to any matrices [..., 3, 3], in the Frobenius norm: what a noisy matrix meant.

        Errors and derivatives grow as one over the sum of the two smallest singular values, the last negative for a reflection; where
        it is zero several rotations are equally near: a FrameError, under jit NaN.
        """
        return cls(rotations(averages.nearest(nine(matrix)), (matrix,), AMBIGUOUS))

    @classmethod
    def align_vectors(cls, in_a: Any, in_b: Any, weights: Any = None) -> "Rotation":
        """Return ``a_R_b`` that best takes vectors known in b to the same ones measured in a: Wahba's problem (1965).

        It makes the sum of ``weights * |in_a - R @ in_b|^2`` least, by the largest eigenvector of Davenport's matrix (Keat 1977), and has
        the derivatives of that.

        Args:
            in_a: Vectors [..., n, 3] along a's axes, of any lengths.
            in_b: The same vectors [..., n, 3] along b's axes.
            weights: [..., n], 1 / variance of each; default: equal.

        Raises:
            FrameError: Several rotations fit equally well: fewer than two directions that differ. Under jit value and gradient are NaN.
            ShapeError: The vectors or weights are not equally many.
        """
        return cls(rotations(averages.align_vectors(in_a, in_b, weights), (in_a, in_b), AMBIGUOUS))

    @classmethod
    def from_two_vectors(cls, start: Any, end: Any) -> "Rotation":
        """Return the smallest rotation that takes the direction ``start`` [..., 3] to the direction ``end`` [..., 3].

        Opposite directions turn by pi about an axis perpendicular to ``start`` and to the coordinate axis farthest from it;
        a zero vector is a FrameError, under jit NaN.
        """
        return cls(rotations(rotation_ops.between(start, end), (start, end), NOWHERE))

    @classmethod
    def random(cls, key: jax.Array, batch: Sequence[int] = (), dtype: Any = None) -> "Rotation":
        """Return rotations drawn uniformly (Haar measure) for a batch shape."""
        normal = jax.random.normal(key, (*batch, 4), float if dtype is None else dtype)
        return cls(rotation_ops.normalized(normal))

    # ------------------------------------------------------------------ extractors
    def to_quaternion_wxyz(self) -> jax.Array:
        """Return the quaternion [..., 4], scalar first, as stored: w may be negative."""
        return as_float(self.wxyz)

    def to_quaternion_xyzw(self) -> jax.Array:
        """Return the quaternion [..., 4], scalar last, as stored: w may be negative."""
        return rotation_ops.to_xyzw(self.wxyz)

    def to_matrix(self) -> jax.Array:
        """Return the matrix [..., 3, 3]."""
        return matrix_of(rotation_ops.to_matrix(self.wxyz))

    def to_rotation_vector(self) -> jax.Array:
        """Return the rotation vector [..., 3], of length at most pi. The logarithm.

        Smooth through the identity, with no dead zone. Where the angle is pi to rounding (|w| at most 4 rounding errors) the
        axis has its largest component positive, the last of equal ones, as in KDL; the vector jumps there, and derivatives are
        those of the branch returned.
        """
        return rotation_ops.log(self.wxyz)

    log = to_rotation_vector

    def to_axis_angle(self) -> tuple[jax.Array, jax.Array]:
        """Return (angle [...] in [0, pi], unit axis [..., 3]); the axis of the identity is z, with derivatives 0."""
        return rotation_ops.to_axis_angle(self.wxyz)

    def angle(self) -> jax.Array:
        """Return the angle of rotation [...] in [0, pi]; its derivative at the identity is set to 0."""
        return rotation_ops.angle(self.wxyz)

    def to_rpy(self) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Return (roll, pitch, yaw), each [...]: pitch in [-pi/2, pi/2], the others in (-pi, pi].

        At gimbal lock, pitch = +-pi/2 within rounding, roll is 0 and yaw holds the whole turn; derivatives are finite
        there: those of pitch are 0, those of yaw are of the turn with roll held at 0.
        """
        return rotation_ops.to_rpy(self.wxyz)

    def to_euler_zyx(self) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Return (z, y, x), each [...]: ``to_rpy`` in reverse order."""
        roll, pitch, yaw = self.to_rpy()
        return yaw, pitch, roll

    def to_euler_zyz(self) -> tuple[jax.Array, jax.Array, jax.Array]:
        """Return (z1, y, z2), each [...]: y in [0, pi], the others in (-pi, pi].

        Where y is 0 or pi within rounding z2 is 0, z1 holds the whole turn and the derivatives of y are 0.
        """
        return rotation_ops.to_zyz(self.wxyz)

    def to_euler(self, sequence: str) -> jax.Array:
        """Return the angles [..., 3] (rad) whose ``from_euler`` this is.

        Args:
            sequence: Three letters, as for ``from_euler``.

        The middle angle is in [0, pi] where first and last axis are one ("ZXZ"), else in [-pi/2, pi/2]; the others are in (-pi, pi].
        Where it is at an end within rounding, the last angle of upper-case letters, the first of lower-case ones is 0, with derivatives
        as for ``to_rpy``.
        """
        return rotation_ops.to_euler(sequence, self.wxyz)

    def to_mrp(self) -> jax.Array:
        """Return the modified Rodrigues parameters [..., 3] of length at most 1: axis times tan(angle / 4), angle at most pi."""
        return rotation_ops.to_mrp(self.wxyz)

    def canonical(self) -> "Rotation":
        """Return the same rotation with w >= 0; where w is 0 to rounding, with the largest of x, y, z positive, the last of equal ones."""
        return Rotation(rotation_ops.canonical(self.wxyz))

    def unit_x(self) -> jax.Array:
        """Return the x axis of b in a [..., 3]: the first column of the matrix."""
        return rotation_ops.unit_x(self.wxyz)

    def unit_y(self) -> jax.Array:
        """Return the y axis of b in a [..., 3]: the second column of the matrix."""
        return rotation_ops.unit_y(self.wxyz)

    def unit_z(self) -> jax.Array:
        """Return the z axis of b in a [..., 3]: the third column of the matrix."""
        return rotation_ops.unit_z(self.wxyz)

    def with_unit_x(self, vector: Any) -> "Rotation":
        """Return the rotation turned the shortest way so that its x axis has the direction of a vector [..., 3]."""
        return Rotation.from_two_vectors(self.unit_x(), vector) @ self

    def with_unit_y(self, vector: Any) -> "Rotation":
        """Return the rotation turned the shortest way so that its y axis has the direction of a vector [..., 3]."""
        return Rotation.from_two_vectors(self.unit_y(), vector) @ self

    def with_unit_z(self, vector: Any) -> "Rotation":
        """Return the rotation turned the shortest way so that its z axis has the direction of a vector [..., 3]."""
        return Rotation.from_two_vectors(self.unit_z(), vector) @ self

    # ------------------------------------------------------------------ the group
    def __matmul__(self, other: Any) -> Any:
        """Return ``a_R_b @ b_R_c``, or vectors [..., 3], twists, wrenches, velocities, accelerations turned from b axes to a axes."""
        if isinstance(other, Rotation):
            return Rotation(rotation_ops.compose(self.wxyz, other.wxyz))
        if isinstance(other, Based):
            return other.change_base(self)
        if isinstance(other, Value):
            return NotImplemented
        return rotation_ops.rotate(self.wxyz, other)

    def __mul__(self, other: Any) -> Any:
        raise TypeError(f"a Rotation is not multiplied by *, found {type(other).__name__}: compose and apply by @, as in R @ v")

    def __pow__(self, exponent: Any) -> "Rotation":
        """Return the rotation about the same axis by ``exponent`` [...] times the angle, which is at most pi: ``exp(exponent * log)``."""
        return Rotation(rotation_ops.power(self.wxyz, exponent))

    def inverse(self) -> "Rotation":
        """Return ``b_R_a``."""
        return Rotation(rotation_ops.conjugate(self.wxyz))

    def normalize(self) -> "Rotation":
        """Return the same rotation with a unit quaternion: after ``Rotation(wxyz)`` of other numbers."""
        return Rotation(rotation_ops.normalized(self.wxyz))

    def rotate_local_x(self, angle: Any) -> "Rotation":
        """Return ``self @ rot_x(angle)``: turned about the own x axis by an angle [...] (rad)."""
        return self @ Rotation.rot_x(angle)

    def rotate_local_y(self, angle: Any) -> "Rotation":
        """Return ``self @ rot_y(angle)``: turned about the own y axis by an angle [...] (rad)."""
        return self @ Rotation.rot_y(angle)

    def rotate_local_z(self, angle: Any) -> "Rotation":
        """Return ``self @ rot_z(angle)``: turned about the own z axis by an angle [...] (rad)."""
        return self @ Rotation.rot_z(angle)

    # ------------------------------------------------------------------ distances, means, Jacobians
    def distance(self, other: "Rotation") -> jax.Array:
        """Return the angle [...] in [0, pi] of the rotation between two; its derivative where they are equal is set to 0."""
        return rotation_ops.distance(self.wxyz, other.wxyz)

    def slerp(self, other: "Rotation", fraction: Any, *, long_way: bool = False) -> "Rotation":
        """Return the rotation at a fraction [...] of the way to another, at constant rate; beyond [0, 1] it extrapolates.

        Args:
            other: Where the way ends.
            fraction: 0 is here, 1 there.
            long_way: Turn the other way round, by 2 pi less the angle between the two; a full turn about z where they are equal.
        """
        return Rotation((rotation_ops.slerp_long if long_way else rotation_ops.slerp)(self.wxyz, other.wxyz, fraction))

    def mean(self, weights: Any = None, axis: int | Sequence[int] = 0) -> "Rotation":
        """Return the mean over one batch axis or several, with weights that broadcast to the batch shape (default: equal).

        The chordal L2 mean: it minimises the weighted sum of |R - R_i|^2 (Frobenius), and is the eigenvector of the largest
        eigenvalue of the sum of w_i q_i q_i^T (Markley et al. 2007), so signs of quaternions do not matter. Unique when that
        eigenvalue is simple: always when all lie within pi/2 of one rotation. Where it is not unique (two rotations by pi apart)
        one minimiser is returned and derivatives are not finite.

        Raises:
            ShapeError: There is no such batch axis, nothing along it, or the weights do not broadcast.
        """
        return Rotation(averages.mean(self.broadcast_to(self.shape).wxyz, weights, axis))

    left_jacobian = staticmethod(rotation_ops.left_jacobian)
    right_jacobian = staticmethod(rotation_ops.right_jacobian)
    left_jacobian_inv = staticmethod(rotation_ops.left_jacobian_inv)
    right_jacobian_inv = staticmethod(rotation_ops.right_jacobian_inv)
