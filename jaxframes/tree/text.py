"""A tree as text: one line a frame, and the edges of a path."""

from dataclasses import dataclass

import numpy as np

from jaxframes.errors import TopologyError
from jaxframes.kinematics import queries
from jaxframes.kinematics.plan import along_path
from jaxframes.model.state import State
from jaxframes.tree.check import check
from jaxframes.tree.states import States


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


def format_tree(tree: States, options: DumpOptions, state: State | None) -> str:
    """Return the tree as text."""
    topology = tree.topology
    wrong = check(tree, state) if options.health and state is not None else ()
    place = {name: i for i, name in enumerate(topology.names)}
    lines, ahead = [], [(0, "", "")]
    while ahead:
        frame, lead, indent = ahead.pop()
        lines.append(lead + _line(tree, frame, options, state, wrong))
        children = [place[name] for name in tree.children(topology.names[frame], state)]
        for position, child in reversed(list(enumerate(children))):
            last = position == len(children) - 1
            ahead.append((child, indent + ("└── " if last else "├── "), indent + ("    " if last else "│   ")))
    return "\n".join(lines)


def _line(tree: States, frame: int, options: DumpOptions, state: State | None, wrong: tuple[str, ...]) -> str:
    topology = tree.topology
    name = topology.names[frame]
    text = f"{frame}: {name}" if options.id else name
    facts = []
    if frame:
        edge = tree.edge_of(frame)
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


def _joint_name(tree: States, frame: int) -> str | None:
    return tree.topology.edge_names[frame]


def _joint_text(tree: States, frame: int) -> str:
    joint = _joint_name(tree, frame)
    return "" if joint in (None, tree.topology.names[frame]) else f", joint {joint!r}"


def _pose_text(tree: States, state: State, name: str) -> str:
    pose = queries.between(tree, state, name, tree.parent_name(name, state), order=0).transform
    if pose.translation.ndim != 1:
        return f"batch {pose.translation.shape[:-1]}"
    w, x, y, z = np.asarray(pose.rotation.wxyz)
    px, py, pz = np.asarray(pose.translation)
    return f"at ({px:.6g}, {py:.6g}, {pz:.6g}) m, wxyz ({w:.4f}, {x:.4f}, {y:.4f}, {z:.4f})"


def path_in_state(tree: States, state: State | None, of: str, relative_to: str) -> tuple[tuple[str, int], ...]:
    """Return the path between two frames as attachable frames hang in a state: (edge, +1 down or -1 up) from ``relative_to``."""

    def line(name: str) -> list[str]:
        names = [name]
        while names[-1] != tree.root:
            names.append(tree.parent_name(names[-1], state))
            if len(names) > len(tree.names):
                raise TopologyError(
                    f"frame {name!r} hangs on a cycle in this state: {' -> '.join(names[:6])} ...; tree.check(state) says where"
                )
        return names

    up, down = line(relative_to), line(of)
    while up and down and up[-1] == down[-1]:
        up.pop()
        down.pop()
    return (*((name, -1) for name in up), *((name, 1) for name in reversed(down)))


def explain(tree: States, of: str, relative_to: str, state: State | None) -> str:
    """Return text about the path of a query."""
    topology = tree.topology
    crossing = topology.static_components[topology.index(of)] != topology.static_components[topology.index(relative_to)]
    if crossing and state is None:
        attachable = [tree.names[i] for i in dict.fromkeys(topology.static_components[topology.index(n)] for n in (relative_to, of)) if i]
        where = "; ".join(f"{name!r} [{tree.edge(name).describe()}], declared on {tree.parent(name)!r}" for name in attachable)
        return f"{relative_to} -> {of}: the path is data in the state (links composed by pointer doubling): {where}"
    path = path_in_state(tree, state, of, relative_to)
    up = [name for name, direction in path if direction < 0]
    meet = tree.parent_name(up[-1], state) if up else relative_to
    down = [topology.index(name) for name, direction in path if direction > 0]
    way = (
        "static parts one after another, links by pointer doubling"
        if crossing
        else along_path(tree, [*map(topology.index, up[::-1])], down)
    )
    head = f"{relative_to} -> {of}: {len(path)} edges through their common ancestor {meet!r}, {way}"
    rows = []
    for name, direction in path:
        edge = tree.edge(name)
        needs = (
            [f"q[{edge.nq}]"] * bool(edge.nq)
            + [f"q of {edge.follows}"] * bool(edge.follows)
            + ["time"] * edge.needs_time
            + ["prescribed motion"] * edge.is_prescribed
        )
        above = tree.parent_name(name, state)
        arrow = f"{above} -> {name}" if direction > 0 else f"{name} -> {above}"
        without = "" if edge.supports_accelerations else "; no accelerations"
        rows.append(f"  {direction:+d}  {arrow}  [{edge.describe()}; needs {', '.join(needs) or 'nothing'}{without}]")
    return "\n".join([head, *rows])
