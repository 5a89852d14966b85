"""Trees as graph text: DOT for Graphviz, and Mermaid for pages and notebooks."""

from collections.abc import Mapping

from jaxframes.tree import FrameTree

_COLOURS = ("#cfe2f3", "#d9ead3", "#fce5cd", "#ead1dc", "#fff2cc", "#d0e0e3", "#f4cccc", "#d9d2e9")


def _labels(tree: FrameTree, label_map: Mapping[str, str] | None) -> list[str]:
    return [(label_map or {}).get(name, name) for name in tree.names]


def _kinds(tree: FrameTree) -> dict[str, str]:
    """Return a colour for each family of edges, in order of first appearance."""
    kinds: dict[str, str] = {}
    for edge in tree.edges.values():
        kinds.setdefault(type(edge).__name__, _COLOURS[len(kinds) % len(_COLOURS)])
    return kinds


def to_dot(tree: FrameTree, *, title: str = "frames", label_map: Mapping[str, str] | None = None) -> str:
    """Return a tree as a DOT digraph: a node a frame, coloured by its edge's family, an arrow from parent to child.

    Args:
        tree: The tree.
        title: Name of the graph.
        label_map: Labels to show in place of frame names.
    """
    labels, kinds = _labels(tree, label_map), _kinds(tree)
    lines = [f"digraph {_dot_text(title)} {{", '  node [shape=box, style="rounded,filled", fillcolor=white, fontname="sans-serif"];']
    for i, (name, label) in enumerate(zip(tree.names, labels, strict=True)):
        colour = "" if i == 0 else f', fillcolor="{kinds[type(tree.edge(name)).__name__]}"'
        lines.append(f"  n{i} [label={_dot_text(label)}{colour}];")
    for i, parent in enumerate(tree.topology.parents):
        if parent >= 0:
            lines.append(f"  n{parent} -> n{i} [label={_dot_text(tree.edge(tree.names[i]).describe())}, fontsize=9];")
    return "\n".join([*lines, "}"]) + "\n"


def _dot_text(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def to_mermaid(tree: FrameTree, *, label_map: Mapping[str, str] | None = None) -> str:
    """Return a tree as a Mermaid flowchart, coloured by the families of the edges (arguments as for ``to_dot``)."""
    labels, kinds = _labels(tree, label_map), _kinds(tree)
    lines = ["flowchart TD"]
    for i, label in enumerate(labels):
        lines.append(f"  n{i}[{_mermaid_text(label)}]")
    for i, parent in enumerate(tree.topology.parents):
        if parent >= 0:
            lines.append(f"  n{parent} -->|{_mermaid_text(tree.edge(tree.names[i]).describe())}| n{i}")
    for kind, colour in kinds.items():
        members = [f"n{i}" for i, name in enumerate(tree.names) if i and type(tree.edge(name)).__name__ == kind]
        lines += [f"  classDef {kind} fill:{colour}", f"  class {','.join(members)} {kind}"]
    return "\n".join(lines) + "\n"


def _mermaid_text(text: str) -> str:
    escaped = text.replace("#", "#35;").replace('"', "#quot;").replace("<", "#lt;").replace(">", "#gt;").replace("\n", "<br/>")
    return f'"{escaped}"'
