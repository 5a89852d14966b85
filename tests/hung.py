"""Edges hung side by side below one frame, and how they move there."""

import jaxframes as jf


def tree_of(*edges):
    """Return a tree with each edge below the root, to frames c0, c1, ..."""
    b = jf.TreeBuilder()
    for i, edge in enumerate(edges):
        b.add(f"c{i}", parent="world", edge=edge)
    return b.build()


def motion(tree, time, name="c0"):
    """Return how one of the frames moves."""
    return tree.motion(tree.state(time=time), of=name, relative_to="world")
