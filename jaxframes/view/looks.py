"""What every picture of a tree shares: labels, chains, colouring, and what hangs on what in a state."""

import re
from collections.abc import Iterable, Mapping, Sequence

import jax
import numpy as np

from jaxframes.errors import FrameError, ShapeError, UnknownFrameError, suggest
from jaxframes.model.state import State
from jaxframes.staging.arrays import is_concrete
from jaxframes.tree import FrameTree
from jaxframes.tree.chain import Chain

LabelMap = Mapping[str | int, str]
Chains = bool | Iterable[tuple[str, str] | Chain]
COLORINGS = ("type", "valency")
LIGHT = ("#cfe2f3", "#d9ead3", "#fce5cd", "#ead1dc", "#fff2cc", "#d0e0e3", "#f4cccc", "#d9d2e9")
"""Grounds of nodes, one a kind of edge, light enough for black text."""

RAMP = ("#e3eefb", "#c9e4f2", "#c8ecd9", "#e5efbf", "#fbe3b5", "#f8c9bd")
"""Grounds of nodes by valency, from 1 to 6 or more."""


def labels_of(tree: FrameTree, label_map: LabelMap | None) -> list[str]:
    """Return what is written on each frame: its name, unless the map says otherwise.

    Args:
        tree: The tree.
        label_map: Labels by a frame's name or by its number in ``tree.names``.

    Raises:
        UnknownFrameError: A key is no frame of the tree.
    """
    labels = list(tree.names)
    for key, label in (label_map or {}).items():
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            if not 0 <= key < len(labels):
                raise UnknownFrameError(f"label_map has the key {key}, but frames are numbered 0 to {len(labels) - 1}")
            labels[key] = str(label)
        elif key in tree.topology.index_of:
            labels[tree.topology.index(str(key))] = str(label)
        else:
            raise UnknownFrameError(f"label_map has the key {key!r}, which is no frame.{suggest(str(key), tree.names)}")
    return labels


def numbered_labels(tree: FrameTree, label_map: LabelMap | None = None) -> dict[int, str]:
    """Return a label map in which frames without a label are called by their number, as kdFlex's ``showFramesGraph`` calls them.

    Args:
        tree: The tree.
        label_map: Labels by a frame's name or by its number in ``tree.names``.

    Returns:
        A label for each frame by its number: what ``label_map=`` of every picture and page takes. Without it these keep the names.

    Raises:
        UnknownFrameError: A key is no frame of the tree.

    Example:
        >>> import jaxframes as jf
        >>> b = jf.TreeBuilder()
        >>> b.add("arm", parent="world", edge=jf.edges.Fixed())
        >>> jf.numbered_labels(b.build(), {"arm": "Arm"})
        {0: '0', 1: 'Arm'}
    """
    given = labels_of(tree, label_map)
    keys = {key if isinstance(key, str) else tree.names[key] for key in label_map or {}}
    return {i: label if name in keys else str(i) for i, (name, label) in enumerate(zip(tree.names, given, strict=True))}


def checked_coloring(coloring: str) -> str:
    """Return a colouring (FrameError for one that there is not)."""
    if coloring not in COLORINGS:
        raise FrameError(f"coloring={coloring!r}: it is 'type' (by the edge's kind) or 'valency' (by how many edges meet)")
    return coloring


def chains_of(tree: FrameTree, chains: Chains, state: State | None) -> list[tuple[int, int]]:
    """Return pairs of frames that a dashed line connects.

    Args:
        tree: The tree.
        chains: Pairs (of, relative_to) of names, or ``Chain`` objects; or True for what the tree itself connects beside its edges: each
            joint that follows another with that one, and each attachable frame that has moved with the parent it was declared on.
        state: Where attachable frames hang.

    Raises:
        UnknownFrameError: A name is no frame of the tree.
        FrameError: Something is no pair.
    """
    if isinstance(chains, bool):
        return _own_chains(tree, state) if chains else []
    found = []
    for chain in chains:
        ends = (chain.of, chain.relative_to) if isinstance(chain, Chain) else chain
        if isinstance(ends, str) or not isinstance(ends, Sequence) or len(ends) != 2:
            raise FrameError(f"chains takes True, False or pairs (of, relative_to) of frame names; found {chain!r}")
        found.append((tree.topology.index(ends[0]), tree.topology.index(ends[1])))
    return found


def _own_chains(tree: FrameTree, state: State | None) -> list[tuple[int, int]]:
    topology = tree.topology
    found = [(frame, source) for frame, source in enumerate(topology.sources) if source >= 0]
    now = parents_of(tree, state)[0]
    return found + [(frame, topology.parents[frame]) for frame in topology.attachables if now[frame] != topology.parents[frame]]


def parents_of(tree: FrameTree, state: State | None) -> tuple[list[int], list[int]]:
    """Return each frame's parent in a state, and the frames that hang on nothing there: on themselves, or on a number that is no frame.

    Those are shown below the root; ``tree.check`` says what is wrong with them, and they have no numbers.
    """
    parents, severed = list(tree.topology.parents), []
    if state is None or state.attachments is None:
        return parents, severed
    held = np.asarray(tree.attachments_in(state).parents)
    if held.ndim != 1:
        raise ShapeError(f"attachments differ over a batch of shape {held.shape[:-1]}, and a picture shows one instant: state[0]")
    for frame, parent in zip(tree.topology.attachables, held.tolist(), strict=True):
        parents[frame] = parent if 0 <= parent < len(parents) else 0
        severed += [] if 0 <= parent < len(parents) else [frame]
    components, sound = tree.topology.static_components, {0}
    for frame in tree.topology.attachables:
        line: dict[int, None] = {}
        while frame not in sound and frame not in line:
            line[frame] = None
            frame = components[parents[frame]]
        if frame not in sound:  # it closes a ring of attachable frames: the first of them in the tree's order is cut
            ring = {*list(line)[list(line).index(frame) :]}
            parents[min(ring)] = 0
            severed.append(min(ring))
        sound.update(line)
    return parents, severed


def kinds_of(tree: FrameTree) -> tuple[list[int], list[str]]:
    """Return the kind of each frame's edge, -1 for the root, and the names of the kinds in order of first appearance."""
    place: dict[str, int] = {}
    kinds = [-1, *(place.setdefault(type(tree.edge_of(i)).__name__, len(place)) for i in range(1, len(tree.names)))]
    return kinds, list(place)


def valencies(parents: Sequence[int]) -> list[int]:
    """Return how many edges meet at each frame."""
    count = [0] * len(parents)
    for frame, parent in enumerate(parents):
        if parent >= 0:
            count[frame] += 1
            count[parent] += 1
    return count


def one_instant(tree: FrameTree, state: State | None, remedy: str = "pass one of them, state[0]") -> State:
    """Return a state of one instant: the one given, or the neutral one.

    Raises:
        ShapeError: It is a batch, or its numbers are not known.
        FrameError: It is no state.
    """
    if state is None:
        return tree.state()
    if not isinstance(state, State):
        raise FrameError(f"state takes what tree.state(...) returns, found {type(state).__name__}: {state!r}")
    if not tree.is_known or not all(map(is_concrete, jax.tree.leaves(state))):
        raise ShapeError("a picture needs known numbers; call it outside of jit, grad and vmap")
    if state.shape:
        raise ShapeError(f"the state is a batch of shape {state.shape}, and a picture shows one instant; {remedy}")
    return state


UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")
"""Characters that show nothing, end lines, or turn the text after them round."""


def printable(text: str) -> str:
    """Return a text with a dot for each character that nobody sees: it cannot hide, break a line or turn round what follows."""
    return UNSEEN.sub("\u00b7", text)


def colours(tree: FrameTree, coloring: str, state: State | None) -> tuple[list[str], list[tuple[str, str]]]:
    """Return a light ground for each frame, and a legend: what each colour means, in order."""
    if checked_coloring(coloring) == "valency":
        counts = [min(count, len(RAMP)) for count in valencies(parents_of(tree, state)[0])]
        words = [f"{n} edge{'s' if n > 1 else ''}" for n in range(1, len(RAMP))] + [f"{len(RAMP)} edges or more"]
        return [RAMP[max(count, 1) - 1] for count in counts], list(zip(words, RAMP, strict=True))
    kinds, names = kinds_of(tree)
    grounds = [LIGHT[kind % len(LIGHT)] if kind >= 0 else "#ffffff" for kind in kinds]
    return grounds, [(name, LIGHT[i % len(LIGHT)]) for i, name in enumerate(names)]
