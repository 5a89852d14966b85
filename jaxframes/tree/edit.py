"""Trees made of trees on the host: a part as a tree of its own, and the same frames with one of them hanging elsewhere."""

from dataclasses import replace
from typing import TypeVar

import jax
import numpy as np

from jaxframes.edges.attachable import Attachable
from jaxframes.edges.base import Edge
from jaxframes.edges.fixed import Fixed
from jaxframes.errors import EdgeError, FrameError, TopologyError
from jaxframes.kinematics import queries
from jaxframes.model.compile import Declared, compile_frames
from jaxframes.model.parameters import Parameters
from jaxframes.model.state import State
from jaxframes.spatial import Transform

Tree = TypeVar("Tree", bound=Parameters)


def extract(tree: Tree, root: str, prefix: str) -> Tree:
    """Return the tree of a frame and all that hangs on it, with a prefix taken off every name that starts with it."""
    return _compiled(tree, Declared.of(tree).part(tree.subtree(root)).renamed(lambda name: name.removeprefix(prefix)))


def _compiled(tree: Tree, declared: Declared) -> Tree:
    edges, topology = compile_frames(declared)
    return replace(tree, frame_edges=edges, topology=topology)


def extract_state(tree: Parameters, state: State, root: str) -> State:
    """Return the part of a state that belongs to a frame's subtree."""
    topology = tree.topology
    inside = topology.subtree(topology.index(root))[1:]
    if any(frame in topology.attachables for frame in inside):
        raise EdgeError(f"the part below {root!r} holds attachable frames, which may hang on frames outside of it")
    joints = [topology.coordinates[frame] for frame in topology.joint_frames if frame in set(inside)]
    q = np.array([first + i for first, count, _, _ in joints for i in range(count)], np.int32)
    v = np.array([first + i for _, _, first, count in joints for i in range(count)], np.int32)
    rows = np.array([topology.prescribed[frame] for frame in inside if topology.prescribed[frame] >= 0], np.int32)
    return replace(
        state,
        q=state.q[..., q],
        qd=state.qd[..., v],
        qdd=state.qdd[..., v],
        prescribed=jax.tree.map(lambda leaf: leaf[..., rows, :], state.prescribed),
        attachments=None,
    )


def reattached(tree: Tree, state: State, frame: str, to: str, keep: str) -> Tree:
    """Return a new static tree in which a frame, with all that hangs on it, hangs on another frame.

    Args:
        tree: The tree as it is.
        state: Where everything is now.
        frame: The frame to move.
        to: Its new parent.
        keep: ``"relative"`` or ``"world"``, as ``FrameTree.reattached`` says.

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
        edge = Fixed(_pose(tree, state, frame, tree.parent_name(frame, state)))
    changed = Declared.of(tree)
    changed.parents[frame], changed.edges[frame] = to, edge
    return _compiled(tree, changed.part([*(name for name in tree.names if name not in below), *below]))


def _moved(tree: Parameters, edge: Edge, frame: str, to: str, state: State) -> Edge:
    """Return the edge that gives a frame the same pose in the world when it hangs on another one."""
    if isinstance(edge, (Fixed, Attachable)):
        return Fixed(_pose(tree, state, frame, to))
    moved = edge.preceded_by(_pose(tree, state, tree.parent(frame), to))
    if moved is None:
        raise EdgeError(f"frame {frame!r} hangs on {edge.describe()}, which cannot keep its pose elsewhere; use keep='relative'")
    return moved


def _pose(tree: Parameters, state: State, of: str, relative_to: str) -> Transform:
    return queries.between(tree, state, of, relative_to, order=0).transform
