"""What a graph page is told: the tree as plain data, what is wrong with it, its numbers, and instants for the slider."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxframes.errors import FrameError, ShapeError
from jaxframes.model.state import State
from jaxframes.spatial import Epoch
from jaxframes.tree import FrameTree
from jaxframes.view.local_motions import local_motions
from jaxframes.view.looks import Chains, LabelMap, chains_of, checked_coloring, kinds_of, labels_of, parents_of

States = State | Callable[[Any], State]


@dataclass(frozen=True)
class Looks:
    """How a page shows a tree.

    Attributes:
        label_map: Labels by a frame's name or number.
        title: Title of the page.
        coloring: ``"type"`` or ``"valency"``.
        chains: What dashed arcs connect, as ``chains_of`` takes it.
    """

    label_map: LabelMap | None = None
    title: str = "Frame layer"
    coloring: str = "type"
    chains: Chains = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "chains", self.chains if isinstance(self.chains, bool) else tuple(self.chains))

    def of_tree(self, tree: FrameTree, buttons: Sequence[str] = ()) -> dict[str, Any]:
        """Return what a page is told of a tree whatever its state: names, labels, kinds and edges."""
        kinds, kind_names = kinds_of(tree)
        return {
            "title": str(self.title),
            "names": list(tree.names),
            "labels": labels_of(tree, self.label_map),
            "kinds": kinds,
            "kindNames": kind_names,
            "edges": ["root", *(tree.edge_of(i).describe() for i in range(1, len(tree.names)))],
            "coloring": checked_coloring(self.coloring),
            "buttons": list(buttons),
            "health": {},
            "notes": [],
            "times": None,
        }

    def in_state(self, tree: FrameTree, state: State) -> dict[str, Any]:
        """Return what depends on the state: what hangs on what, and the chains drawn."""
        return {"parents": parents_of(tree, state)[0], "chains": [list(pair) for pair in chains_of(tree, self.chains, state)]}


def numbers_of(tree: FrameTree, state: State) -> np.ndarray:
    """Return the numbers of a page at one instant [n_frames, 19]; NaN where a frame hangs on nothing."""
    numbers = local_motions(tree, state)
    if numbers.ndim != 2:
        raise ShapeError(f"the tree holds a batch of numbers, shape {tree.batch_shape}, and a page shows one; take one by jax.tree.map")
    severed = parents_of(tree, state)[1]
    numbers[severed] = np.nan
    return numbers


def health_of(tree: FrameTree, state: State) -> tuple[dict[str, list[str]], list[str]]:
    """Return what ``tree.check`` finds: sentences by the number of the frame that they are about, and those about no one frame."""
    by_start = {f"frame {name!r}": i for i, name in enumerate(tree.names)}
    by_start |= {f"joint {joint!r}": i for i, joint in enumerate(tree.topology.edge_names) if joint is not None}
    found: dict[str, list[str]] = {}
    notes = []
    for sentence in tree.check(state):
        ends = (at for at, letter in enumerate(sentence) if letter == ":" and sentence[:at] in by_start)
        end = next(ends, None)
        if end is None:
            notes.append(sentence)
        else:
            found.setdefault(str(by_start[sentence[:end]]), []).append(sentence)
    return found, notes


@dataclass(frozen=True)
class Instants:
    """The instants of a slider.

    Attributes:
        states: A function of one instant, or a batch of states with one axis.
        times: The instants, or None where the states stand for themselves.
        labels: A text for each.
    """

    states: States
    times: Any
    labels: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.labels)

    def state(self, index: int) -> State:
        """Return the state of one of the instants (FrameError for one that there is not, or where the function returns no state)."""
        if not 0 <= index < len(self):
            raise FrameError(f"instant {index} is asked for, and there are {len(self)}")
        if isinstance(self.states, State):
            return self.states.broadcast_to(self.states.shape)[index]
        state = self.states(self.times[index])
        if not isinstance(state, State) or state.shape:
            found = f"a batch of shape {state.shape}" if isinstance(state, State) else type(state).__name__
            raise FrameError(f"states(time) returns the state of one instant, what tree.state(...) makes; found {found}")
        return state


def instants_of(states: States | None, times: Any) -> Instants | None:
    """Return the instants of a slider, or None where there are none.

    Raises:
        FrameError: Times without states, a function without times, or states that are neither.
        ShapeError: Not one axis of states, or another number of times.
    """
    if states is None:
        if times is not None:
            raise FrameError("times need states: a function of one instant that returns its state, or a batch of states")
        return None
    if isinstance(states, State):
        if len(states.shape) != 1 or not states.shape[0]:
            raise ShapeError(f"states is a batch with one axis, found shape {states.shape}; state= takes a single one")
        count = states.shape[0]
        shown = states.broadcast_to(states.shape).time if times is None else times
    elif callable(states):
        if times is None:
            raise FrameError("states is a function of one instant, so it needs the instants: times=epochs, or a list of seconds")
        shown, count = times, len(times) if not isinstance(times, Epoch) else _count(times)
    else:
        raise FrameError(f"states takes a function of one instant or a batch of states, found {type(states).__name__}")
    labels = tuple(f"step {i}" for i in range(count)) if shown is None else labels_of_times(shown)
    if len(labels) != count or not labels:
        raise ShapeError(f"there are {count} states and {len(labels)} times; each state needs one")
    return Instants(states, times, labels)


def _count(epochs: Epoch) -> int:
    if len(epochs.shape) != 1:
        raise ShapeError(f"times are epochs along one axis, found shape {epochs.shape}")
    return epochs.shape[0]


def labels_of_times(times: Any) -> tuple[str, ...]:
    """Return a text for each instant: calendar text of an epoch, numbers as seconds, anything else as it prints."""
    if isinstance(times, Epoch):
        return tuple(f"{times[i].to_tdb()} TDB" for i in range(_count(times)))
    return tuple(_label(time) for time in times)


def _label(time: Any) -> str:
    if isinstance(time, Epoch):
        return f"{time.to_tdb()} TDB"
    if isinstance(time, str):
        return time
    number = np.asarray(time)
    return f"{float(number):.9g} s" if number.ndim == 0 and np.issubdtype(number.dtype, np.number) else str(time)
