"""The graph page as one file: the tree and its numbers inside, no server, no network."""

from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from jaxframes.errors import FrameError
from jaxframes.model.state import State
from jaxframes.tree import FrameTree
from jaxframes.view.graph_data import Instants, Looks, States, health_of, instants_of, numbers_of
from jaxframes.view.looks import Chains, LabelMap, one_instant, parents_of
from jaxframes.view.page_text import GraphHtml, encoded, static_page


def to_html(
    tree: FrameTree,
    path: str | PathLike[str] | None = None,
    *,
    state: State | None = None,
    states: States | None = None,
    times: Any = None,
    label_map: LabelMap | None = None,
    title: str = "Frame layer",
    coloring: str = "type",
    chains: Chains = False,
) -> GraphHtml:
    """Return the graph page of a tree as one self-contained HTML text: to mail, to keep, to show in a notebook.

    Everything of the live page works in it but buttons and updates: search, paths, motions of any pair of frames, the slider over time.

    Args:
        tree: The tree.
        path: A file to write the text to as well.
        state: What the numbers are of. Default: the neutral state, ``tree.state()``.
        states: For a slider: a function of one instant that returns its state, or a batch of states with one axis.
        times: The instants: an ``Epoch`` batch, seconds, or any texts, one for each state. Default: the times of the batch of states.
        label_map: What to write on frames, by their names or numbers. Default: their names.
        title: Title of the page.
        coloring: ``"type"`` colours by the kind of the edge, ``"valency"`` by how many edges meet.
        chains: What dashed arcs connect: pairs (of, relative_to) of frame names or ``Chain`` objects; True for what follows what, and where
            attachable frames came from.

    Returns:
        The text; a notebook shows it as a page in a frame of its own.

    Raises:
        UnknownFrameError: A label or a chain names no frame.
        FrameError: An option has a value that it does not take, or both state and states are given.

    Example:
        >>> import jaxframes as jf
        >>> b = jf.TreeBuilder(root="world")
        >>> b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
        >>> "</html>" in jf.to_html(b.build())
        True
    """
    looks = Looks(label_map, title, coloring, chains)
    instants = instants_of(states, times)
    state = first_state(tree, state, instants)
    data = looks.of_tree(tree) | looks.in_state(tree, state)
    data["health"], data["notes"] = health_of(tree, state)
    numbers, series = numbers_of(tree, state), None
    if instants is not None:
        data["times"] = {"labels": list(instants.labels), "at": 0}
        series = _series(tree, instants)
    text = static_page({"tree": data, "numbers": encoded(numbers), "series": series})
    if path is not None:
        Path(fspath(path)).write_text(text, encoding="utf-8")
    return text


def first_state(tree: FrameTree, state: State | None, instants: Instants | None) -> State:
    """Return the state that a page opens with: the one given, the first instant's, or the neutral one."""
    if instants is None:
        return one_instant(tree, state, "pass one of them, state[0], or all of them as states= for a slider")
    if state is not None:
        raise FrameError("give state, one instant, or states, the instants of a slider; not both")
    return instants.state(0)


def _series(tree: FrameTree, instants: Instants) -> dict[str, Any]:
    """Return the numbers of all instants, of those frames only that move, and what attachable frames hang on."""
    found, parents = [], []
    for index in range(len(instants)):
        state = instants.state(index)
        found.append(numbers_of(tree, state))
        hanging = parents_of(tree, state)[0]
        parents.append([hanging[frame] for frame in tree.topology.attachables])
    all_numbers = np.stack(found)
    same = (all_numbers == all_numbers[0]) | (np.isnan(all_numbers) & np.isnan(all_numbers[0]))
    rows = np.flatnonzero(~same.all((0, 2)))
    return {
        "rows": rows.tolist(),
        "values": encoded(all_numbers[:, rows]),
        "attachable": list(tree.topology.attachables),
        "parents": parents,
    }
