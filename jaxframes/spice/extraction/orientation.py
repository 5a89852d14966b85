"""Extraction of orientations, by the class of the frame: C-kernels, binary PCK files, text PCK files."""

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import CoverageError, NoPathError
from jaxframes.numerics import host_quaternions
from jaxframes.spice import accuracy
from jaxframes.spice.assembly import assembled
from jaxframes.spice.extraction import ck_attitude, joining
from jaxframes.spice.extraction.text_pck import has_text_pck, model_axes, no_data, text_pck
from jaxframes.spice.options import OrientationRequest
from jaxframes.spice.reading.frame_chain import anchored
from jaxframes.spice.reading.naming import CK, DYNAMIC, PCK, SWITCH, TK
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.spice.reading.segment_paths import orientation_pieces
from jaxframes.staging.arrays import default_float
from jaxframes.tables.attitude import AttitudeTable
from jaxframes.tables.iau_model import IauOrientation
from jaxframes.tables.instants import reference_day
from jaxframes.tables.orientation import OrientationTable


def orientation(pool: KernelPool, request: OrientationRequest) -> AttitudeTable | OrientationTable | IauOrientation:
    """Return the edge that orients a frame that turns, in the way that its class asks for.

    Raises:
        NoPathError: If there is no way for this class, or ``relative_to`` turns against it.
    """
    of, base = request.of, request.base
    if of.frame_class in (DYNAMIC, SWITCH):
        raise NoPathError(
            f"{of.name} is a {of.class_name} frame: give tolerance=jf.spice.Tolerance(angle=..., rate=...) to have a "
            "table fitted to what CSPICE computes."
        )
    if of.frame_class == CK:
        return ck_attitude.attitude(pool, request)
    if not anchored(pool, base).inertial:
        raise NoPathError(
            f"relative_to = {base.name!r} is a {base.class_name} frame, which turns; tables have inertial axes. "
            f"kernels.tree(frames=[{of.name!r}, {base.name!r}]) relates frames that both turn."
        )
    if of.frame_class == TK:
        name = anchored(pool, of).frame.name
        raise NoPathError(
            f"{of.name} is fixed to {name}, which turns against {base.name}: that makes two edges, "
            f"kernels.orientation(frame={name!r}, relative_to={base.name!r}) and "
            f"kernels.orientation(frame={of.name!r}, relative_to={name!r}). kernels.tree(frames=[{of.name!r}]) makes both."
        )
    if of.frame_class != PCK:
        raise NoPathError(f"{of.name} is a frame of class {of.frame_class} ({of.class_name}): no table can be made of it yet.")
    return pck(pool, request)


def pck(pool: KernelPool, request: OrientationRequest) -> OrientationTable | IauOrientation:
    """Return the orientation of a PCK frame: by binary segments if there are any for it, as in SPICE, else by a text PCK."""
    class_id = request.of.class_id
    if pool.pck_segments(class_id):
        return binary_pck(pool, request)
    if not has_text_pck(pool, class_id):
        raise no_data(pool, request)
    placement = pool.rotation(model_axes(pool, class_id), request.base.name)
    return text_pck(pool, request, host_quaternions.from_matrices(placement))


def binary_pck(pool: KernelPool, request: OrientationRequest) -> OrientationTable:
    """Return the orientation of a frame from binary PCK segments, by extraction of their records: exact."""
    of, base = request.of, request.base
    bounds = pool.span(request.start, request.stop, "PCK", (of.class_id,))
    try:
        pieces = orientation_pieces(of.class_id, of.name, pool.segments, *bounds)
    except CoverageError as error:
        if not has_text_pck(pool, of.class_id):
            raise
        raise CoverageError(
            f"{error}\nA text PCK loaded orients {of.name} too, at every instant, and SPICE falls back to it outside of the binary PCK. "
            "For that model open the kernels without the binary PCK."
        ) from None
    bases = {piece.segment.frame for piece in pieces}
    if len(bases) > 1:
        raise NoPathError(
            f"The segments of {of.name} are relative to different frames {sorted(bases)} over this span: make one table for each."
        )
    rotation = joining.segment_rotation(pool, pieces[0].segment, base.name)
    records, _ = joining.join_pieces(pool, [(piece, None) for piece in pieces], 1, bounds[0])
    placement, records = host_quaternions.from_matrices(np.eye(3) if rotation is None else rotation), joining.unwrapped(records)
    facts = {"measured": accuracy.angles(pool, of.name, base.name, records, placement, reference_day(bounds[0]), bounds)}
    placed = jnp.asarray(placement, default_float())
    return assembled(pool, OrientationTable, "orientation", request.names, bounds, [records], pieces, facts, placement=placed)
