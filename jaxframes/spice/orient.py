"""Orientation edges by the class of a SPICE frame: which of the ways of making one serves, and the way for binary PCK files."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import NoPathError
from jaxframes.numerics.boundary import default_float
from jaxframes.spice import build
from jaxframes.spice.paths import orientation_pieces
from jaxframes.spice.tables import OrientationTable
from jaxframes.spice.times import Instant
from jaxframes.tree.edges.base import Edge

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels

INERTIAL, PCK, CK, TK, DYNAMIC, SWITCH = 1, 2, 3, 4, 5, 6
CLASSES = {INERTIAL: "inertial", PCK: "PCK", CK: "CK", TK: "fixed offset (TK)", DYNAMIC: "dynamic", SWITCH: "switch"}


@dataclass(frozen=True)
class Request:
    """What an orientation edge is asked for.

    Attributes:
        of: The frame that is oriented, as ``Kernels._axes`` says: name, id, center, class, class_id.
        base: The frame that the parent has the axes of, likewise.
        start: Start of the coverage, None for as early as the kernels have data.
        stop: End of the coverage, likewise.
    """

    of: dict[str, Any]
    base: dict[str, Any]
    start: Instant | None
    stop: Instant | None


Maker = Callable[["Kernels", Request], Edge]


def orientation(kernels: "Kernels", request: Request) -> Any:
    """Return the edge that orients a frame, made in the way that its class asks for.

    Raises:
        NoPathError: If there is no way for this class.
    """
    maker = MAKERS.get(request.of["class"])
    if maker is None:
        kind = CLASSES.get(request.of["class"], "?")
        remedy = (
            "use jf.edges.Fixed with a constant rotation" if request.of["class"] in (INERTIAL, TK) else "no table can be made of it yet"
        )
        raise NoPathError(
            f"{request.of['name']} is a frame of class {request.of['class']} ({kind}), not one oriented by a binary PCK: {remedy}."
        )
    return maker(kernels, request)


def binary_pck(kernels: "Kernels", request: Request) -> OrientationTable:
    """Return the orientation of a frame from binary PCK segments, by extraction of their records: exact."""
    of, base = request.of, request.base
    bounds = kernels._span(request.start, request.stop, "PCK", (of["class_id"],))
    pieces = orientation_pieces(of["class_id"], of["name"], kernels._segments, *bounds)
    bases = {piece.segment.frame for piece in pieces}
    if len(bases) > 1:
        raise NoPathError(
            f"The segments of {of['name']} are relative to different frames {sorted(bases)} over this span: make one table for each."
        )
    rotation = kernels._rotation(pieces[0].segment, base["name"])
    leg, _ = kernels._join([(piece, None) for piece in pieces], 1, bounds[0])
    names = (of["name"], of["id"], base["name"], base["id"], base["name"])
    placement = jnp.asarray(quaternion(np.eye(3) if rotation is None else rotation), default_float())
    return kernels._table(OrientationTable, "orientation", names, bounds, [build.unwound(leg)], pieces, placement=placement)


MAKERS: dict[int, Maker] = {PCK: binary_pck}
"""Class of a frame -> the function that makes its edge."""


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
