"""What is no rotation, said on the host; and matrices as rows of nine numbers."""

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from jaxframes.errors import FrameError, ShapeError
from jaxframes.staging.arrays import as_float, is_concrete

ZERO = "a quaternion is zero, which is no rotation; the identity is (1, 0, 0, 0)"
NOWHERE = "a vector is zero, so it has no direction to turn from or to"
MIRRORED = "a matrix has no positive determinant, so it is a reflection or flat and no rotation: check the order and signs of its axes"
AMBIGUOUS = "several rotations fit equally well: directions must span at least a plane, and a matrix must not be nearest to a reflection"


def rotations(wxyz: jax.Array, given: Sequence[Any], otherwise: str) -> jax.Array:
    """Return quaternions that were made of finite numbers, refusing those that are none (FrameError); what is traced passes."""
    if all(map(is_concrete, (wxyz, *given))) and np.isnan(found := np.asarray(wxyz)).any():
        finite = all(np.isfinite(np.asarray(one, float)).all() for one in given)
        at = [int(i) for i in np.argwhere(np.isnan(found).any(-1))[0]]
        if finite:
            raise FrameError(otherwise + (f" (at batch index {', '.join(map(str, at))})" if at else ""))
    return wxyz


def nine(matrix: Any) -> jax.Array:
    """Return matrices [..., 3, 3] as rows of nine [..., 9]."""
    matrix = as_float(matrix)
    if matrix.shape[-2:] != (3, 3):
        raise ShapeError(f"a rotation matrix has shape [..., 3, 3]; found {matrix.shape}")
    return matrix.reshape(*matrix.shape[:-2], 9)


def matrix_of(entries: jax.Array, size: int = 3) -> jax.Array:
    """Return rows of k*k entries [..., k*k] as matrices [..., k, k]."""
    return entries.reshape(*entries.shape[:-1], size, size)
