"""A tree as text: one line a frame, and the edges of a path."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxframes.tree.state import State


@dataclass(frozen=True)
class DumpOptions:
    """What each line of a tree's text says beside the frame's name.

    Attributes:
        type: The class of the edge above the frame.
        edge_type: What the edge says of itself, with the joint's name where it differs from the frame's.
        health: ``ok``, or the first thing that ``tree.check`` finds wrong with the frame (needs a state).
        id: The frame's index, its place in ``tree.names``.
        depth: The number of edges to the root.
    """

    type: bool = False
    edge_type: bool = True
    health: bool = False
    id: bool = False
    depth: bool = False


def format_tree(tree: Any, options: DumpOptions, state: State | None) -> str:
    """Return the tree as text."""
    topology = tree.topology
    wrong = tree.check(state) if options.health and state is not None else ()
    lines, ahead = [], [(0, "", "")]
    while ahead:
        frame, lead, indent = ahead.pop()
        lines.append(lead + _line(tree, frame, options, state, wrong))
        children = topology.children[frame]
        for position, child in reversed(list(enumerate(children))):
            last = position == len(children) - 1
            ahead.append((child, indent + ("└── " if last else "├── "), indent + ("    " if last else "│   ")))
    return "\n".join(lines)


def _line(tree: Any, frame: int, options: DumpOptions, state: State | None, wrong: tuple[str, ...]) -> str:
    topology = tree.topology
    name = topology.names[frame]
    text = f"{frame}: {name}" if options.id else name
    facts = []
    if frame:
        edge = tree._edge(frame)
        if options.type:
            facts.append(type(edge).__name__)
        if options.edge_type:
            facts.append(edge.describe() + _joint_text(tree, frame))
    if options.depth:
        facts.append(f"depth {topology.depths[frame]}")
    if options.health and state is not None:
        mine = [line for line in wrong if line.startswith((f"frame {name!r}", f"joint {_joint_name(tree, frame)!r}"))]
        facts.append(mine[0].split(": ", 1)[1] if mine else "ok")
    if state is not None and frame:
        facts.append(_pose_text(tree, state, name))
    return f"{text}  [{'; '.join(facts)}]" if facts else text


def _joint_name(tree: Any, frame: int) -> str | None:
    frames = tree.topology.joint_frames
    return tree.topology.joint_names[frames.index(frame)] if frame in frames else None


def _joint_text(tree: Any, frame: int) -> str:
    joint = _joint_name(tree, frame)
    return "" if joint in (None, tree.topology.names[frame]) else f", joint {joint!r}"


def _pose_text(tree: Any, state: State, name: str) -> str:
    pose = tree.transform(state, of=name, relative_to=tree.parent(name))
    if pose.translation.ndim != 1:
        return f"batch {pose.translation.shape[:-1]}"
    w, x, y, z = np.asarray(pose.rotation.wxyz)
    px, py, pz = np.asarray(pose.translation)
    return f"at ({px:.6g}, {py:.6g}, {pz:.6g}) m, wxyz ({w:.4f}, {x:.4f}, {y:.4f}, {z:.4f})"


def explain(tree: Any, of: str, relative_to: str) -> str:
    """Return text about the path of a query."""
    path = tree.path(of=of, relative_to=relative_to)
    meet = tree.common_ancestor(of, relative_to)
    head = f"{relative_to} -> {of}: {len(path)} edges through their common ancestor {meet!r}, composed one after another (unrolled)"
    rows = []
    for name, direction in path:
        edge = tree.edge(name)
        needs = [f"q[{edge.nq}]"] * bool(edge.nq) + ["time"] * edge.needs_time + ["prescribed motion"] * edge.is_prescribed
        arrow = f"{tree.parent(name)} -> {name}" if direction > 0 else f"{name} -> {tree.parent(name)}"
        without = "" if edge.supports_accelerations else "; no accelerations"
        rows.append(f"  {direction:+d}  {arrow}  [{edge.describe()}; needs {', '.join(needs) or 'nothing'}{without}]")
    return "\n".join([head, *rows])
