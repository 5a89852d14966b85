"""Plans on the host: in which stages the frames of a large tree are worked out. NumPy only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jaxframes.tree.ways import SPAN, is_deep


@dataclass(frozen=True)
class Level:
    """Frames that are worked at one time.

    Attributes:
        frames: The frames.
        above: Row, in the level before, of the frame that each hangs on; None where they start segments.
        start: Row, among the starts with the observer before them, of the frame that each one's segment hangs on.
    """

    frames: np.ndarray
    above: np.ndarray | None
    start: np.ndarray


@dataclass(frozen=True)
class Stages:
    """How frames are worked out.

    Attributes:
        levels: The same levels of all segments.
        starts: Rows, in the last level, of the frames that segments hang on; empty where one segment is all.
        parents: Row, among the starts, of the start that each hangs on; -1 for those in the first segment.
    """

    levels: tuple[Level, ...]
    starts: np.ndarray
    parents: np.ndarray


def rerooted(parents: Sequence[int], observer: int) -> tuple[np.ndarray, tuple[int, ...]]:
    """Return each frame's parent as seen from an observer, and the frames whose edges are turned round.

    From the observer up to the root every frame hangs on its child; everything else stays. The observer has the parent -1.
    """
    found = np.array(parents)
    turned = []
    frame = observer
    while parents[frame] >= 0:
        turned.append(frame)
        found[parents[frame]] = frame
        frame = parents[frame]
    found[observer] = -1
    return found, tuple(turned)


def depths_of(parents: np.ndarray) -> np.ndarray:
    """Return the number of steps from each frame to one without a parent, by doubling: parents may come in any order."""
    count = len(parents)
    at, steps = np.append(np.where(parents < 0, count, parents), count), np.append(np.where(parents < 0, 0, 1), 0)
    while not np.all(at == count):
        steps, at = steps + steps[at], at[at]
    return steps[:count]


def staged(parents: np.ndarray) -> Stages:
    """Return the stages of frames with the parents given (-1: hangs on the observer, or is the observer)."""
    depths = depths_of(parents)
    deep = is_deep(int(depths.max()) + 1)
    digits = depths % SPAN if deep else depths
    by_digit = np.argsort(digits, kind="stable")
    groups = np.split(by_digit, np.searchsorted(digits[by_digit], np.arange(1, int(digits.max()) + 1)))
    place, start = np.empty(len(parents), int), np.where(digits == 0, parents, -1)
    for i, group in enumerate(groups):
        place[group] = np.arange(len(group))
        if i:
            start[group] = start[parents[group]]
    starts = np.unique(start[start >= 0])
    row = np.full(len(parents) + 1, -1)  # the last is what a start of -1 reads
    row[starts] = np.arange(len(starts))
    levels = tuple(Level(group, place[parents[group]] if i else None, row[start[group]] + 1) for i, group in enumerate(groups))
    return Stages(levels, place[starts], row[start[starts]])


def interleaved(groups: Sequence[np.ndarray]) -> bool:
    """Return whether group d holds the numbers d, d + n, d + 2n ... of n groups: one after the other they are a transposed grid."""
    n, count = len(groups), len(groups[0])
    return all(len(g) == count and np.array_equal(g, np.arange(count) * n + d) for d, g in enumerate(groups))
