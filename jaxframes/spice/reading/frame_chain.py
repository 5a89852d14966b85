"""Chains of frames at fixed offsets (TK): the frame that one is fixed to in the end."""

from dataclasses import dataclass

import numpy as np

from jaxframes.errors import NoPathError
from jaxframes.spice.reading.naming import INERTIAL, TK, FrameFacts
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.process import CspiceError


@dataclass(frozen=True)
class Anchor:
    """The frame that a chain of fixed offsets ends at, and the matrix that takes coordinates of the chain's start to it."""

    frame: FrameFacts
    matrix: np.ndarray

    @property
    def inertial(self) -> bool:
        """Whether the chain ends at an inertial frame."""
        return self.frame.frame_class == INERTIAL


def anchored(pool: KernelPool, frame: FrameFacts) -> Anchor:
    """Return what a frame is fixed to: itself, unless it is given by fixed offsets (TK) from others.

    Raises:
        NoPathError: If an offset is not defined, or the offsets run in a circle.
    """
    matrix, seen = np.eye(3), [frame.name]
    while frame.frame_class == TK:
        try:
            offset, base = pool.fixed_offset(frame)
        except CspiceError as error:
            raise NoPathError(f"The fixed offset (TK) of {frame.name} is not fully defined by the kernels loaded: {error}") from error
        matrix, frame = offset @ matrix, pool.frame(base)
        if frame.name in seen:
            raise NoPathError(f"Fixed offsets run in a circle: {' -> '.join([*seen, frame.name])}.")
        seen.append(frame.name)
    return Anchor(frame, matrix)
