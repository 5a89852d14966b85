"""Changing the static structure on the host: the same frames, one of them hanging elsewhere."""

from typing import Any

from jaxframes.edges.attachable import Attachable
from jaxframes.edges.base import Edge
from jaxframes.edges.fixed import Fixed
from jaxframes.errors import EdgeError, FrameError, TopologyError
from jaxframes.model.state import State
from jaxframes.spatial import Transform
from jaxframes.tree.builder import TreeBuilder


def reattached(tree: Any, frame: str, to: str, state: State, keep: str) -> Any:
    """Return a new static tree in which a frame, with all that hangs on it, hangs on another frame.

    Raises:
        UnknownFrameError: A name is not in the tree.
        TopologyError: The frame is the root, or ``to`` hangs on it.
        EdgeError: ``keep="world"`` and the edge has no placement that could take up the difference.
    """
    if keep not in ("relative", "world"):
        raise FrameError(f"reattached(keep=...) takes 'relative' or 'world', not {keep!r}")
    below = tree.subtree(frame)
    tree.topology.index(to)
    if frame == tree.root:
        raise TopologyError(f"{frame!r} is the root and cannot hang on {to!r}; build the tree from another root")
    if to in below:
        raise TopologyError(f"{frame!r} cannot hang on {to!r}, which hangs on it: that would be a cycle")
    edge = tree.edge(frame)
    if keep == "world":
        edge = _moved(tree, edge, frame, to, state)
    elif isinstance(edge, Attachable):
        edge = Fixed(_held(tree, frame, state))
    old = TreeBuilder.from_tree(tree)
    kept = [name for name in tree.names if name not in below]
    return old.reordered([*kept, *below], {frame: to}, {frame: edge}).build()


def _held(tree: Any, frame: str, state: State) -> Transform:
    return tree.transform(state, of=frame, relative_to=tree.parent(frame, state))


def _moved(tree: Any, edge: Edge, frame: str, to: str, state: State) -> Edge:
    """Return the edge that gives a frame the same pose in the world when it hangs on another one."""
    if isinstance(edge, (Fixed, Attachable)):
        return Fixed(tree.transform(state, of=frame, relative_to=to))
    placement = getattr(edge, "placement", None)
    if not isinstance(placement, Transform):
        raise EdgeError(f"frame {frame!r} hangs on {edge.describe()}, which cannot keep its pose elsewhere; use keep='relative'")
    return edge.replace(placement=tree.transform(state, of=tree.parent(frame), relative_to=to) @ placement)
