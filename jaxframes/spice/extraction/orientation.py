"""Orientation edges by the class of a SPICE frame: which of the ways of making one serves, and the way for binary PCK files."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.errors import NoPathError
from jaxframes.spice import accuracy
from jaxframes.spice.extraction import ck_attitude, joining
from jaxframes.spice.extraction.constant_in_time import timeless_info
from jaxframes.spice.extraction.text_pck import has_text_pck, model_axes, no_data, text_pck
from jaxframes.spice.fitting import orientation as fit_turns
from jaxframes.spice.options import Tolerance, checked_bridge, checked_layout, checked_tolerance
from jaxframes.spice.reading.frame_chain import CK, CLASSES, DYNAMIC, PCK, SWITCH, TK, anchored
from jaxframes.spice.reading.segment_paths import orientation_pieces
from jaxframes.staging.arrays import default_float
from jaxframes.tables.fixed import FixedFrame, rotation_only
from jaxframes.tables.instants import Instant, reference_day
from jaxframes.tables.orientation import OrientationTable

if TYPE_CHECKING:
    from jaxframes.spice.kernels import Kernels


@dataclass(frozen=True)
class Request:
    """What an orientation edge is asked for.

    Attributes:
        of: The frame that is oriented, as ``Kernels._axes`` says: name, id, center, class, class_id.
        base: The frame that the parent has the axes of, likewise.
        start: Start of the coverage, None for as early as the kernels have data.
        stop: End of the coverage, likewise.
        ck: How C-kernels are read between their knots: ``"smooth"`` or ``"spice"``.
        tolerance: Fit to within these errors instead of what the class of the frame would be read by.
        layout: Records of such a fit.
        bridge: For C-kernels of type 1: longest time in seconds to interpolate over.
    """

    of: dict[str, Any]
    base: dict[str, Any]
    start: Instant | None
    stop: Instant | None
    ck: str = "smooth"
    tolerance: Tolerance | None = None
    layout: str = "uniform"
    bridge: float | None = None


Maker = Callable[["Kernels", Request], Edge]


def orientation(kernels: "Kernels", request: Request) -> Any:
    """Return the edge that orients a frame, which knows the body that the frame belongs to; errors as those of its maker."""
    edge = _made(kernels, request)
    return edge.replace(info=replace(edge.info, center=request.of["center"]))


def _made(kernels: "Kernels", request: Request) -> Any:
    """Return the edge that orients a frame: a fixed one where nothing turns, else made in the way that the frame's class asks for.

    Raises:
        NoPathError: If there is no way for this class, or ``relative_to`` turns against it.
        ToleranceError: If the tolerance is none, or a layout is asked for without one.
        SpiceError: If ``bridge`` is no time.
    """
    of, base = request.of, request.base
    checked_bridge(request.bridge)
    checked_layout(request.layout, checked_tolerance(request.tolerance) is not None)
    of_anchor, base_anchor = anchored(kernels, of), anchored(kernels, base)
    if of_anchor.axes["id"] == base_anchor.axes["id"] or (of_anchor.inertial and base_anchor.inertial):
        middle = kernels._process.call(
            "rotation", of_anchor.axes["name"], base_anchor.axes["name"], doing=f"rotating {of['name']} to {base['name']}"
        )
        pose = rotation_only(quaternion(base_anchor.matrix.T @ np.array(middle) @ of_anchor.matrix))
        return FixedFrame(pose, timeless_info(kernels, request, "fixed", "constant rotation"))
    if request.tolerance is not None:
        return fit_turns.orientation(kernels, request)
    if of["class"] in (DYNAMIC, SWITCH):
        raise NoPathError(
            f"{of['name']} is a {CLASSES[of['class']]} frame: give tolerance=jf.spice.Tolerance(angle=..., rate=...) to have a "
            "table fitted to what CSPICE computes."
        )
    if of["class"] == CK:
        return ck_attitude.attitude(kernels, of, base, request.start, request.stop, request.ck, request.bridge)
    if not base_anchor.inertial:
        raise NoPathError(
            f"relative_to = {base['name']!r} is a {CLASSES.get(base['class'], '?')} frame, which turns; tables have inertial axes. "
            f"kernels.tree(frames=[{of['name']!r}, {base['name']!r}]) relates frames that both turn."
        )
    if of["class"] == TK:
        name = of_anchor.axes["name"]
        raise NoPathError(
            f"{of['name']} is fixed to {name}, which turns against {base['name']}: that makes two edges, "
            f"kernels.orientation(frame={name!r}, relative_to={base['name']!r}) and "
            f"kernels.orientation(frame={of['name']!r}, relative_to={name!r}). kernels.tree(frames=[{of['name']!r}]) makes both."
        )
    maker = MAKERS.get(of["class"])
    if maker is None:
        kind = CLASSES.get(of["class"], "?")
        raise NoPathError(f"{of['name']} is a frame of class {of['class']} ({kind}): no table can be made of it yet.")
    return maker(kernels, request)


def pck(kernels: "Kernels", request: Request) -> Any:
    """Return the orientation of a PCK frame: by binary segments if there are any for it, as in SPICE, else by a text PCK."""
    class_id = request.of["class_id"]
    if any(s.kind == "PCK" and s.body == class_id for s in kernels._segments):
        return binary_pck(kernels, request)
    if not has_text_pck(kernels, class_id):
        raise no_data(kernels, request)
    axes = model_axes(kernels, class_id)
    placement = np.array(kernels._process.call("rotation", axes, request.base["name"], doing=f"rotating {axes}"))
    return text_pck(kernels, request, quaternion(placement))


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
    records, _ = kernels._join([(piece, None) for piece in pieces], 1, bounds[0])
    names = (of["name"], of["id"], base["name"], base["id"], base["name"])
    placement, records = quaternion(np.eye(3) if rotation is None else rotation), joining.unwound(records)
    facts = {"measured": accuracy.angles(kernels, of["name"], base["name"], records, placement, reference_day(bounds[0]), bounds)}
    placed = jnp.asarray(placement, default_float())
    return kernels._table(OrientationTable, "orientation", names, bounds, [records], pieces, facts, placement=placed)


MAKERS: dict[int, Maker] = {PCK: pck}
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
