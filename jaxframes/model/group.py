"""Groups: several frames of a tree that queries are asked about at once."""

import fnmatch
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

from jaxframes.errors import ShapeError
from jaxframes.model.topology import Topology


@dataclass(frozen=True)
class Group(Sequence[str]):
    """Frames of a tree in an order: what ``tree.group`` returns and queries take as ``of=``. Static: hashable, and equal by value.

    Attributes:
        names: Names of the frames.
    """

    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> "Group": ...
    def __getitem__(self, index: int | slice) -> "str | Group":
        """Return the name of one frame, or the group of some."""
        return Group(self.names[index]) if isinstance(index, slice) else self.names[index]

    def __repr__(self) -> str:
        shown = ", ".join(map(repr, self.names[:3]))
        return f"Group({shown}{', ...' if len(self) > 3 else ''}; {len(self)} frames)"

    def indices(self, topology: Topology) -> tuple[int, ...]:
        """Return the indices of the frames in a tree (UnknownFrameError; ShapeError for a group of none)."""
        if not self.names:
            raise ShapeError("a query about a group needs at least one frame, and this group has none")
        return tuple(map(topology.index, self.names))


def group_of(topology: Topology, *patterns: str | Sequence[str]) -> Group:
    """Return the frames that patterns name, as ``FrameTree.group`` says."""
    found: dict[str, None] = {}
    for pattern in patterns:
        if isinstance(pattern, Sequence) and not isinstance(pattern, str):
            found |= dict.fromkeys(topology.names[topology.index(name)] for name in pattern)
            continue
        known = not isinstance(pattern, str) or pattern in topology.index_of
        fits = [] if known else [frame for frame in topology.names if fnmatch.fnmatchcase(frame, pattern)]
        if not fits:  # a frame may be called as a pattern is; what is neither is refused by its name
            fits = [topology.names[topology.index(pattern)]]
        found |= dict.fromkeys(fits)
    return Group(tuple(found))
