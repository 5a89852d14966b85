"""A tree of the bodies and frames that are asked of kernels, rooted where their data meet."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from jaxframes.errors import NoPathError, SpiceError
from jaxframes.spice.edge_source import KernelSource
from jaxframes.spice.reading.pool import KernelPool
from jaxframes.tables.naif_ids import J2000
from jaxframes.tables.placing import place
from jaxframes.tree.builder import TreeBuilder
from jaxframes.tree.frame_tree import FrameTree


def bundle(pool: KernelPool, source: KernelSource, bodies: Sequence[Any], frames: Sequence[Any], root: str | int | None) -> FrameTree:
    """Return the tree; ``Kernels.tree`` says what it looks like.

    Args:
        pool: The kernels.
        source: Makes the edges.
        bodies: Bodies by name or id.
        frames: Frames by name or id, or pairs (body, frame).
        root: The body to take as the root; None for the one that the data meet at.

    Raises:
        SpiceError: If a frame is given by something else.
        NoPathError: If the kernels do not connect them.
    """
    ids = [pool.body(body, "body") for body in bodies]
    top = _meeting_body(pool, source, ids, frames) if root is None else pool.body(root, "root")
    name = pool.body_name(top)
    builder = TreeBuilder(root=name)
    builder.set_properties(name, {"spice_body": top, "spice_frame": J2000, "spice_body_name": name, "spice_frame_name": "J2000"})
    for body in ids:
        own = source.own_axes(body)
        place(builder, source, body, J2000 if own is None else own[0])
    for frame in frames:
        if isinstance(frame, (tuple, list)):
            place(builder, source, *_pair(frame))
        else:
            _place_at_center(pool, builder, source, frame)
    return builder.build()


def _meeting_body(pool: KernelPool, source: KernelSource, bodies: Sequence[int], frames: Sequence[Any]) -> int:
    """Return the last body that the positions of all bodies asked for are relative to; the SSB where there is none, or they differ."""
    at = [pool.body(_pair(f)[0], "frames") if isinstance(f, (tuple, list)) else pool.frame(f).center for f in frames]
    tops = {source.chain(body, ())[-1] for body in (*bodies, *at)}
    return tops.pop() if len(tops) == 1 else 0


def _place_at_center(pool: KernelPool, builder: TreeBuilder, source: KernelSource, frame: str | int) -> None:
    center = pool.frame(frame).center
    try:
        place(builder, source, center, frame)
    except NoPathError as error:
        held = {s.body for s in pool.segments if s.kind == "SPK"}
        barycentre = center // 100
        if center in held or not 100 < center < 1000 or barycentre not in held:
            raise
        raise NoPathError(
            f"{error}\nTo have the frame at the barycentre, which is held, name the pair: "
            f"frames=[({pool.body_name(barycentre)!r}, {frame!r})]."
        ) from None


def several(given: Any, role: str) -> list[Any]:
    """Return names, ids or pairs as a list, of which a user may give one alone."""
    if isinstance(given, (str, int, np.integer)):
        return [given]
    if not isinstance(given, Iterable) or isinstance(given, bytes):
        raise SpiceError(f"{role} = {given!r}: give a name or an id, or a list of them.")
    return list(given)


def _pair(given: Sequence[Any]) -> Sequence[Any]:
    if len(given) != 2:
        raise SpiceError(f"frames = [..., {given!r}, ...]: give names or ids of frames, or pairs (body, frame).")
    return given
