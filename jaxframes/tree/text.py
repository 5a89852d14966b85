"""A tree as text: one line a frame, and the edges of a path."""

from dataclasses import dataclass

import numpy as np

from jaxframes.errors import MissingInputError
from jaxframes.kinematics import queries
from jaxframes.kinematics.plan import along_path
from jaxframes.model.state import State
from jaxframes.tree.check import check
from jaxframes.tree.states import States


@dataclass(frozen=True)
class DumpOptions:
    """What each line of a tree's text says beside the frame's name.

    Attributes:
        type_string: The class of the edge above the frame (kdFlex's ``type_string``).
        edge_type: What the edge says of itself, with the joint's name where it differs from the frame's (kdFlex's ``edge_type``).
        health: ``ok``, or the first thing that ``tree.check`` finds wrong with the frame; needs a state (kdFlex's ``healthy_status``).
        index: The frame's index, its place in ``tree.names`` (kdFlex's ``id``).
        depth: The number of edges to the root.

    kdFlex's ``ref_count`` and ``edge_ref_count`` count references of C++, which have no counterpart here.
    """

    type_string: bool = False
    edge_type: bool = True
    health: bool = False
    index: bool = False
    depth: bool = False


def format_tree(tree: States, options: DumpOptions, state: State | None, frame: str | None = None, prefix: str = "") -> str:
    """Return the tree as text; arguments as for ``FrameTree.format``."""
    topology = tree.topology
    if options.health and state is None:
        raise MissingInputError("DumpOptions(health=True) says what is wrong in a state: pass one, tree.format(options, state=...)")
    wrong = check(tree, state) if options.health and state is not None else ()
    place = {name: i for i, name in enumerate(topology.names)}
    lines, ahead = [], [(0 if frame is None else topology.index(frame), prefix, prefix)]
    while ahead:
        at, lead, indent = ahead.pop()
        lines.append(lead + _line(tree, at, options, state, wrong))
        children = [place[name] for name in tree.children(topology.names[at], state)]
        for position, child in reversed(list(enumerate(children))):
            last = position == len(children) - 1
            ahead.append((child, indent + ("└── " if last else "├── "), indent + ("    " if last else "│   ")))
    return "\n".join(lines)


def _line(tree: States, frame: int, options: DumpOptions, state: State | None, wrong: tuple[str, ...]) -> str:
    topology = tree.topology
    name = topology.names[frame]
    text = f"{frame}: {name}" if options.index else name
    facts = []
    if frame:
        edge = tree.edge_of(frame)
        if options.type_string:
            facts.append(type(edge).__name__)
        if options.edge_type:
            facts.append(edge.describe() + _joint_text(tree, frame))
    if options.depth:
        facts.append(f"depth {tree.depth(name, state)}")
    if options.health:
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


def explain(tree: States, of: str, relative_to: str, state: State | None) -> str:
    """Return text about the path of a query."""
    topology = tree.topology
    crossing = topology.static_components[topology.index(of)] != topology.static_components[topology.index(relative_to)]
    if crossing and state is None:
        attachable = [tree.names[i] for i in dict.fromkeys(topology.static_components[topology.index(n)] for n in (relative_to, of)) if i]
        where = "; ".join(f"{name!r} [{tree.edge(name).describe()}], declared on {tree.parent(name)!r}" for name in attachable)
        return f"{relative_to} -> {of}: the path is data in the state (links composed by pointer doubling): {where}"
    path = tree.path(of=of, relative_to=relative_to, state=state)
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
            + [f"motions of {', '.join(dict.fromkeys(read.of for read in edge.reads))}"] * bool(edge.reads)
        )
        above = tree.parent_name(name, state)
        arrow = f"{above} -> {name}" if direction > 0 else f"{name} -> {above}"
        without = "" if edge.supports_accelerations else "; no accelerations"
        rows.append(f"  {direction:+d}  {arrow}  [{edge.describe()}; needs {', '.join(needs) or 'nothing'}{without}]")
    return "\n".join([head, *rows])
