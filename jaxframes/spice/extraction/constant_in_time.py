"""Orientations that are constant in time: frames at fixed offsets, inertial frames; and the facts of edges without an end."""

from jaxframes.numerics import host_quaternions
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
    pose = rotation_only(host_quaternions.from_matrices(base.matrix.T @ between @ of.matrix))
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
