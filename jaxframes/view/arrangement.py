"""Where frames lie in a picture: the layout of the graph page, for pictures that no browser draws."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

STEP, GAP, BETWEEN = 27.0, 46.0, 8.0
"""From row to row, between columns, between stacks: the page's pixels (``page/layout.js``)."""


@dataclass(frozen=True)
class Arrangement:
    """Places of the left ends of pills, and their extent.

    Attributes:
        places: (x, y) of each frame, x to the right and y downwards.
        width: Width of the whole.
        height: Height of the whole.
    """

    places: list[tuple[float, float]]
    width: float
    height: float


def arranged(parents: Sequence[int], width_of: Callable[[int], float], widest: float) -> Arrangement:
    """Return the layout from left to right: parents beside the middle of their children, columns as wide as their longest label.

    Args:
        parents: Parent of each frame; -1 for the root, frame 0.
        width_of: Width of a frame's pill.
        widest: Where the whole is wider than this, runs of only children become stacks.
    """
    children: list[list[int]] = [[] for _ in parents]
    for frame, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(frame)
    order = [0]
    for frame in order:
        order.extend(children[frame])
    plain = _stacked(children, order, width_of, fold=False)
    return plain if plain.width <= widest else _stacked(children, order, width_of, fold=True)


def _stacked(children: Sequence[Sequence[int]], order: Sequence[int], width_of: Callable[[int], float], fold: bool) -> Arrangement:
    """Return the layout whose units are stacks, one frame each unless runs of only children fold."""
    parent_of = {child: frame for frame, below in enumerate(children) for child in below}
    head: dict[int, int] = {}
    stacks: dict[int, list[int]] = {}
    column: dict[int, int] = {}
    for frame in order:
        parent = parent_of.get(frame, -1)
        if fold and parent >= 0 and len(children[parent]) == 1:
            head[frame] = head[parent]
            stacks[head[frame]].append(frame)
        else:
            head[frame] = frame
            stacks[frame] = [frame]
            column[frame] = column[head[parent]] + 1 if parent >= 0 else 0
    widths: dict[int, float] = {}
    for first, stack in stacks.items():
        widths[column[first]] = max(widths.get(column[first], 0.0), *map(width_of, stack))
    left = [0.0]
    for place in range(len(widths)):
        left.append(left[-1] + widths[place] + GAP)
    heights: dict[int, float] = {}
    for first in reversed(stacks):
        below = sum(heights[child] for child in children[stacks[first][-1]])
        heights[first] = max(len(stacks[first]) * STEP + (BETWEEN if fold else 0.0), below)
    places = [(0.0, 0.0)] * len(children)
    top = {0: 0.0}
    for first, stack in stacks.items():
        below = children[stack[-1]]
        y = top[first] + (heights[first] - sum(heights[child] for child in below)) / 2
        for child in below:
            top[child] = y
            y += heights[child]
        middle = top[first] + (heights[first] - (len(stack) - 1) * STEP) / 2
        for i, frame in enumerate(stack):
            places[frame] = (left[column[first]], middle + i * STEP)
    return Arrangement(places, left[-1] - GAP, heights[0])
