"""Unit quaternions wxyz on the host: NumPy arrays [..., 4], double precision."""

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
    """Return the quaternions of rotation matrices [n, 3, 3], by the largest of the four components (Shepperd 1978)."""
    trace = m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2]
    scores = np.stack([trace, m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], 1)
    best = np.argmax(scores, 1)
    x, y, z = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    rows = np.stack(
        [
            np.stack([1 + trace, x, y, z], 1),
            np.stack([x, 1 - trace + 2 * m[:, 0, 0], xy, xz], 1),
            np.stack([y, xy, 1 - trace + 2 * m[:, 1, 1], yz], 1),
            np.stack([z, xz, yz, 1 - trace + 2 * m[:, 2, 2]], 1),
        ],
        1,
    )
    picked = rows[np.arange(len(m)), best]
    return picked / np.linalg.norm(picked, axis=1, keepdims=True)
