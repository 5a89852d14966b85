"""Orientations that are constant in time: frames at fixed offsets, inertial frames; and the facts of edges without an end."""

import numpy as np

from jaxframes.spice.options import OrientationRequest
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.kernel_files import sha256
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.tables.fixed import FixedFrame, rotation_only
from jaxframes.tables.info import Info, Source


def fixed_frame(pool: KernelPool, request: OrientationRequest) -> FixedFrame | None:
    """Return the edge of a frame that does not turn against the other, None where it does.

    Raises:
        NoPathError: If a fixed offset is not defined.
    """
    of, base = anchored(pool, request.of), anchored(pool, request.base)
    if of.frame.id != base.frame.id and not (of.inertial and base.inertial):
        return None
    between = pool.rotation(of.frame.name, base.frame.name)
    pose = rotation_only(quaternion(base.matrix.T @ between @ of.matrix))
    return FixedFrame(pose, constant_info(pool, request, "fixed", "constant rotation"))


def constant_info(pool: KernelPool, request: OrientationRequest, kind: str, method: str) -> Info:
    """Return the facts of an orientation that text kernels, or SPICE itself, define at every instant."""
    return Info(
        kind,
        *request.names,
        *("", "", ""),
        sources=tuple(Source(file.name, sha256(file)) for file in pool.text),
        segments=(),
        toolkit=pool.version(),
        method=method,
        center=request.of.center,
    )


def quaternion(matrix: np.ndarray) -> np.ndarray:
    """Return the unit quaternion wxyz of a rotation matrix: the eigenvector of Bar-Itzhack's 4x4 form (2000)."""
    m = matrix
    form = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    vector = np.linalg.eigh(form)[1][:, -1]
    return vector if vector[np.argmax(np.abs(vector))] > 0 else -vector
