"""Plans on the host: in which stages the frames of a large tree are worked out. NumPy only."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jaxframes.edges.fixed import Fixed
from jaxframes.model.compile import LARGE
from jaxframes.model.structure import Structure
from jaxframes.model.topology import Topology

MAX_UNROLLED = 19
"""Trees of up to so many frames are unrolled, frame after frame; larger ones go by level. Unrolled, a tree runs up to twice as
fast on large batches, and compiles in a time that grows with its frames."""
MANY_TABLES = 8
"""Trees with at least so many tables of one kind go by level too: these are evaluated together, and else each is compiled by itself."""
SPAN = 10
"""Levels in a segment of a deep tree."""
MAX_IN_ONE_PIECE = {0: 12, 1: 10, 2: 8}
"""Moving edges that are worked out in one piece, for poses, velocities and accelerations: longer paths are cut, because XLA:CPU slows
down by orders of magnitude on loops of some thousand instructions."""
PIECE = {0: 9, 1: 6, 2: 5}
"""Moving edges in a piece of a path that is cut."""
LONGEST_PERIOD = 6
FEWEST_PIECES = 4
"""Pieces that make a scan over them worth while."""


class Repeats(NamedTuple):
    """How a path repeats.

    Attributes:
        groups: The kinds of edges in a piece, by their group in the tree.
        pieces: How many pieces there are.
    """

    groups: tuple[int, ...]
    pieces: int

    @property
    def edges(self) -> int:
        """How many edges the pieces have together."""
        return len(self.groups) * self.pieces


def is_deep(levels: int) -> bool:
    """Return whether so many levels are cut into segments."""
    return levels > SPAN + SPAN // 2


def pieces_of(tree: Structure, frames: Sequence[int], order: int) -> tuple[Repeats | None, list[list[int]]]:
    """Return how the edges above the frames of a downward path are cut: how they repeat, None if they do not, and the pieces after that.

    A path without edges is one empty piece.
    """
    pieces = _cut(tree, frames, order)
    timed = any(tree.edge_of(frame).needs_time for frame in frames)
    pattern = repeats(tree.topology, frames, PIECE[order]) if len(pieces) > 1 and not timed else None
    if pattern is None:
        return None, pieces
    return pattern, [list(frames[pattern.edges :])] if len(frames) > pattern.edges else []


def _cut(tree: Structure, frames: Sequence[int], order: int) -> list[list[int]]:
    edges = [tree.edge_of(frame) for frame in frames]
    weights = [max(edge.nv, int(not isinstance(edge, Fixed))) for edge in edges]
    most = MAX_IN_ONE_PIECE[order] if sum(weights) <= MAX_IN_ONE_PIECE[order] else PIECE[order]
    pieces, filled = [list[int]()], 0
    for frame, weight in zip(frames, weights, strict=True):
        if pieces[-1] and weight and filled + weight > most:
            pieces.append([])
            filled = 0
        pieces[-1].append(frame)
        filled += weight
    return pieces


def repeats(topology: Topology, frames: Sequence[int], most: int) -> Repeats | None:
    """Return how edges that read no epoch repeat, in pieces of up to so many joints; None where they do not, or a few times only."""
    groups = [topology.locations[frame][0] for frame in frames]
    counts = [topology.coordinates[frame] for frame in frames]
    plain = all(
        topology.stacked[group] and nq == nv <= 1 and topology.prescribed[frame] < 0 and topology.sources[frame] < 0
        for frame, group, (_, nq, _, nv) in zip(frames, groups, counts, strict=True)
    )
    for period in range(1, LONGEST_PERIOD + 1) if plain else ():
        joints = sum(nv for _, _, _, nv in counts[:period])
        if joints and all(group == groups[i % period] for i, group in enumerate(groups)):
            piece = max(most // joints, 1) * period
            found = Repeats(tuple(groups[:piece]), len(frames) // piece)
            return found if found.pieces >= FEWEST_PIECES else None
    return None


def along_path(tree: Structure, up: Sequence[int], down: Sequence[int]) -> str:
    """Return text on how poses and motions along a path are worked out, from the frames on both sides of the common ancestor."""
    poses, motions = (" and ".join(dict.fromkeys(_side(tree, side, order) for side in (up, down) if side)) for order in (0, 2))
    if not poses:
        return "nothing to compose"
    return f"composed {poses}" if poses == motions else f"composed {poses}; motions {motions}"


def _side(tree: Structure, frames: Sequence[int], order: int) -> str:
    pattern, pieces = pieces_of(tree, frames, order)
    if pattern is not None:
        rest = f", {len(pieces[0])} edges more after it" if pieces else ""
        return f"by a scan over {pattern.pieces} alike pieces of {len(pattern.groups)} edges{rest}"
    if len(pieces) == 1:
        return "one after another"
    return f"one after another, in {len(pieces)} pieces of up to {PIECE[order]} moving edges"


def by_level(topology: Topology) -> bool:
    """Return whether queries about all frames go by level."""
    tables = max((len(own) for own, stacked in zip(topology.members, topology.stacked, strict=True) if not stacked), default=0)
    return len(topology.names) >= (LARGE if topology.attachables else MAX_UNROLLED + 1) or tables >= MANY_TABLES


def over_all_frames(topology: Topology) -> str:
    """Return text on how a query about all frames is worked out, and why."""
    count, levels = len(topology.names), max(topology.depths) + 1
    kinds = len({group for group, _ in topology.locations if group >= 0})
    head = f"all {count} frames, {levels} levels, {kinds} kinds of edges: "
    fewest = LARGE if topology.attachables else MAX_UNROLLED + 1
    many = f"{fewest} frames or more" if count >= fewest else f"{MANY_TABLES} tables or more of one kind, which are evaluated together"
    if topology.attachables and by_level(topology):
        return head + f"by level; the links of {len(topology.attachables)} attachable frames are composed by pointer doubling ({many})"
    if topology.attachables:
        links = len(topology.attachables)
        return head + f"static parts unrolled, the links of {links} attachable frames composed by pointer doubling (their parents are data)"
    if not by_level(topology):
        blocks = "; on a CPU a large batch goes block by block, so that all frames of a block stay in the cache"
        return head + f"unrolled outward from the observer, each frame a stage of its own (fewer than {MAX_UNROLLED + 1} frames{blocks})"
    if is_deep(levels):
        return head + f"by level in segments of {SPAN} levels, whose starts are again a tree ({many}, and deep)"
    return head + f"by level, all frames of a level at a time ({many}, and shallow)"


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
