"""SPICE's classes of frames, and what frames of fixed offsets are fixed to."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxframes.errors import NoPathError
from jaxframes.spice.reading.process import CspiceError

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

INERTIAL, PCK, CK, TK, DYNAMIC, SWITCH = 1, 2, 3, 4, 5, 6
CLASSES = {INERTIAL: "inertial", PCK: "PCK", CK: "CK", TK: "fixed offset (TK)", DYNAMIC: "dynamic", SWITCH: "switch"}


@dataclass(frozen=True)
class Anchor:
    """The frame that a chain of fixed offsets ends at, and the matrix that takes coordinates of the chain's start to it."""

    axes: dict[str, Any]
    matrix: np.ndarray

    @property
    def inertial(self) -> bool:
        """Whether the chain ends at an inertial frame."""
        return self.axes["class"] == INERTIAL


def anchored(kernels: "Kernels", axes: dict[str, Any]) -> Anchor:
    """Return what a frame is fixed to: itself, unless it is given by fixed offsets (TK) from others.

    Raises:
        NoPathError: If an offset is not defined, or the offsets run in a circle.
    """
    matrix, seen = np.eye(3), [axes["name"]]
    while axes["class"] == TK:
        try:
            offset, base = kernels._process.call("fixed_offset", axes["id"], doing=f"looking up the offset of {axes['name']}")
        except CspiceError as error:
            raise NoPathError(f"The fixed offset (TK) of {axes['name']} is not fully defined by the kernels loaded: {error}") from error
        matrix, axes = np.array(offset) @ matrix, kernels._axes(str(base))
        if axes["name"] in seen:
            raise NoPathError(f"Fixed offsets run in a circle: {' -> '.join([*seen, axes['name']])}.")
        seen.append(axes["name"])
    return Anchor(axes, matrix)
