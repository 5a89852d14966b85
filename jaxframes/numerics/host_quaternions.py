"""Unit quaternions wxyz on the host: NumPy arrays [..., 4], double precision."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the product a b."""
    w, v, x, u = a[..., :1], a[..., 1:], b[..., :1], b[..., 1:]
    return np.concatenate([w * x - (v * u).sum(-1, keepdims=True), w * u + x * v + np.cross(v, u)], -1)


def conjugate(a: np.ndarray) -> np.ndarray:
    """Return the conjugate."""
    return a * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(a: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return vectors [..., 3] turned."""
    t = 2 * np.cross(a[..., 1:], v)
    return v + a[..., :1] * t + np.cross(a[..., 1:], t)


def from_rotation_vector(vector: np.ndarray) -> np.ndarray:
    """Return the quaternions of rotation vectors [..., 3], radians."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), vector * (np.sinc(angle / (2 * np.pi)) / 2)], -1)


def vector_of(a: np.ndarray) -> np.ndarray:
    """Return the rotation vectors [..., 3] of quaternions, of angles up to pi: the shorter way."""
    a = np.where(a[..., :1] < 0, -a, a)
    size = np.linalg.norm(a[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, a[..., :1])
    return a[..., 1:] * np.where(size > 0, angle / np.where(size > 0, size, 1.0), 2.0)


def from_matrices(m: np.ndarray) -> np.ndarray:
    """Return the quaternions [..., 4] of rotation matrices [..., 3, 3], by the largest of the four components (Shepperd 1978).

    That component is positive. Rows of the symmetric matrix 4 q q' are made of sums of entries; the one with the largest diagonal is the
    quaternion times its largest component.
    """
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    best = np.argmax(np.stack([trace, m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], -1), -1)
    x, y, z = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = [
        [1 + trace, x, y, z],
        [x, 1 - trace + 2 * m[..., 0, 0], xy, xz],
        [y, xy, 1 - trace + 2 * m[..., 1, 1], yz],
        [z, xz, yz, 1 - trace + 2 * m[..., 2, 2]],
    ]
    table = np.stack([np.stack(row, -1) for row in rows], -2)
    largest = np.take_along_axis(table, best[..., None, None], -2)[..., 0, :]
    return largest / np.linalg.norm(largest, axis=-1, keepdims=True)


def from_rpy(rpy: Sequence[float]) -> np.ndarray:
    """Return the quaternion wxyz [4] of Rz(yaw) Ry(pitch) Rx(roll)."""
    (a, b, c), (r, s, t) = ([f(angle / 2) for angle in rpy] for f in (math.cos, math.sin))
    wxyz = np.array([a * b * c + r * s * t, r * b * c - a * s * t, a * s * c + r * b * t, a * b * t - r * s * c])
    return wxyz / np.linalg.norm(wxyz)


def to_rpy(wxyz: Any) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a unit quaternion, accurate at a pitch of a quarter turn too.

    Half angles by Bernardes and Viollet, "Quaternion to Euler angles conversion", PLOS ONE 17 (2022), for the order z-y-x.
    """
    w, x, y, z = (float(v) for v in wxyz)
    a, b, c, d = w - y, x + z, y + w, z - x
    pitch = 2.0 * math.atan2(math.hypot(c, d), math.hypot(a, b)) - math.pi / 2
    half_sum, half_difference = math.atan2(b, a), math.atan2(d, c)
    if math.hypot(a, b) < 1e-12:
        return 0.0, pitch, 2.0 * half_difference
    if math.hypot(c, d) < 1e-12:
        return 0.0, pitch, 2.0 * half_sum
    wrap = lambda angle: math.remainder(angle, 2.0 * math.pi)  # noqa: E731
    return wrap(half_sum - half_difference), pitch, wrap(half_sum + half_difference)
