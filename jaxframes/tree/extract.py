"""A part of a tree as a tree of its own: the inverse of including one."""

from dataclasses import replace
from typing import Any

import jax
import numpy as np

from jaxframes.errors import EdgeError
from jaxframes.model.state import State
from jaxframes.tree.builder import TreeBuilder


def extract(tree: Any, root: str, prefix: str) -> Any:
    """Return the tree of a frame and all that hangs on it, with a prefix taken off every name that starts with it."""
    topology, short = tree.topology, lambda name: name.removeprefix(prefix)
    names = tree.subtree(root)
    builder = TreeBuilder(root=short(root))
    builder.set_properties(short(root), tree.properties[root])
    for name in names[1:]:
        joint = tree.joint_of(name)
        edge = tree.edge(name).renamed(short)
        builder.add(
            short(name),
            parent=short(tree.parent(name)),
            edge=edge,
            joint=None if joint is None else short(joint),
            properties=tree.properties[name],
        )
    inside = set(topology.subtree(topology.index(root))[1:])
    builder.order_joints([short(joint) for joint, frame in zip(tree.joint_names, topology.joint_frames, strict=True) if frame in inside])
    return builder.build()


def extract_state(tree: Any, state: State, root: str) -> State:
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
