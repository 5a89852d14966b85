"""Which way a query goes through a tree: along a path, frame by frame, by level, or by level in segments. Chosen by shape alone."""

from jaxframes.tree.topology import Topology

FEWEST = 256
"""Trees of at least so many frames go by level; smaller ones are unrolled, which runs faster on large batches."""
SPAN = 10
"""Levels in a segment of a deep tree."""


def is_deep(levels: int) -> bool:
    """Return whether so many levels are cut into segments."""
    return levels > SPAN + SPAN // 2


def along_path(edges: int) -> str:
    """Return text on how a path of so many edges is worked out."""
    return f"composed one after another (unrolled{'' if edges <= 10 else ', cut into pieces where many edges move'})"


def over_all_frames(topology: Topology) -> str:
    """Return text on how a query about all frames is worked out, and why."""
    count, levels = len(topology.names), max(topology.depths) + 1
    kinds = len({group for group, _ in topology.locations if group >= 0})
    head = f"all {count} frames, {levels} levels, {kinds} kinds of edges: "
    if topology.attachables:
        links = len(topology.attachables)
        return head + f"static parts unrolled, the links of {links} attachable frames composed by pointer doubling (their parents are data)"
    if count < FEWEST:
        return head + f"unrolled outward from the observer, each frame a stage of its own (fewer than {FEWEST} frames)"
    if is_deep(levels):
        return head + f"by level in segments of {SPAN} levels, whose starts are again a tree ({FEWEST} frames or more, and deep)"
    return head + f"by level, all frames of a level at a time ({FEWEST} frames or more, and shallow)"
