"""Trees as graph text: DOT for Graphviz, and Mermaid for pages and notebooks. Whatever a frame is called, it stays a label."""

from collections.abc import Sequence

from jaxframes.model.state import State
from jaxframes.tree import FrameTree
from jaxframes.view.looks import Chains, LabelMap, chains_of, colours, kinds_of, labels_of, parents_of, printable

PLAIN = frozenset(" _-./(),=+*")
"""Signs that mean nothing to Mermaid inside a quoted text."""


def to_dot(
    tree: FrameTree,
    *,
    title: str = "frames",
    label_map: LabelMap | None = None,
    coloring: str = "type",
    chains: Chains = False,
    state: State | None = None,
) -> str:
    """Return a tree as a DOT digraph: a node a frame, an arrow from parent to child.

    Args:
        tree: The tree.
        title: Name of the graph.
        label_map: Labels to show in place of frame names, by a frame's name or number.
        coloring: ``"type"`` colours a frame by the kind of its edge, ``"valency"`` by how many edges meet there.
        chains: What dashed lines connect: pairs (of, relative_to) of frame names or ``Chain`` objects; True for what follows what, and
            where attachable frames came from.
        state: Where attachable frames hang. Default: where they were declared.

    Raises:
        UnknownFrameError: A label or a chain names no frame.
        FrameError: There is no such colouring.
    """
    labels, (grounds, _) = labels_of(tree, label_map), colours(tree, coloring, state)
    lines = [f"digraph {_dot_text(title)} {{", '  node [shape=box, style="rounded,filled", fillcolor=white, fontname="sans-serif"];']
    for i, (label, ground) in enumerate(zip(labels, grounds, strict=True)):
        colour = "" if ground == "#ffffff" else f', fillcolor="{ground}"'
        lines.append(f"  n{i} [label={_dot_text(label)}{colour}];")
    for i, parent in enumerate(parents_of(tree, state)[0]):
        if parent >= 0:
            lines.append(f"  n{parent} -> n{i} [label={_dot_text(tree.edge_of(i).describe())}, fontsize=9];")
    lines += [f"  n{b} -> n{a} [style=dashed, dir=none, constraint=false];" for a, b in chains_of(tree, chains, state)]
    return "\n".join([*lines, "}"]) + "\n"


def _dot_text(text: str) -> str:
    """Return a text as a quoted string whose backslashes and entities mean nothing to Graphviz."""
    lines = (printable(line).replace("\\", "\\\\").replace('"', '\\"').replace("&", "&amp;") for line in text.split("\n"))
    return '"' + "\\n".join(lines) + '"'


def to_mermaid(
    tree: FrameTree,
    *,
    label_map: LabelMap | None = None,
    coloring: str = "type",
    chains: Chains = False,
    state: State | None = None,
) -> str:
    """Return a tree as a Mermaid flowchart (arguments and errors as for ``to_dot``)."""
    labels, (grounds, legend) = labels_of(tree, label_map), colours(tree, coloring, state)
    lines = ["flowchart TD"]
    lines += [f"  n{i}[{_mermaid_text(label)}]" for i, label in enumerate(labels)]
    for i, parent in enumerate(parents_of(tree, state)[0]):
        if parent >= 0:
            lines.append(f"  n{parent} -->|{_mermaid_text(tree.edge_of(i).describe())}| n{i}")
    lines += [f"  n{b} -.- n{a}" for a, b in chains_of(tree, chains, state)]
    for place, (_, ground) in enumerate(legend):
        members = _members(tree, coloring, grounds, place, ground)
        if members:
            lines += [f"  classDef k{place} fill:{ground}", f"  class {','.join(members)} k{place}"]
    return "\n".join(lines) + "\n"


def _members(tree: FrameTree, coloring: str, grounds: Sequence[str], place: int, ground: str) -> list[str]:
    """Return the nodes that an entry of the legend is about."""
    if coloring == "valency":
        return [f"n{i}" for i, own in enumerate(grounds) if own == ground]
    return [f"n{i}" for i, kind in enumerate(kinds_of(tree)[0]) if kind == place]


def _mermaid_text(text: str) -> str:
    """Return a text in quotes, every sign in it that could mean something as the number of its character."""
    if not text:
        return '" "'
    lines = ("".join(map(_mermaid_letter, printable(line))) for line in text.split("\n"))
    return '"' + "<br/>".join(lines) + '"'


def _mermaid_letter(letter: str) -> str:
    if letter.isalnum() or letter in PLAIN or letter == "\u00b7":
        return letter
    return "#quot;" if letter == '"' else f"#{ord(letter)};"
