"""An edge whose parent is data: the state says what the frame hangs on, and where."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.edges.fixed import checked_pose
from jaxframes.errors import EdgeError
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Transform


@family(static=("candidates",), name="attachable")
class Attachable(Edge):
    """A frame that can change its parent inside a compiled program: a gripped part, a docked craft, a carried box.

    The parent given to ``TreeBuilder.add`` is the one it starts on; ``tree.attach`` and ``tree.detach`` change it in the state.
    The state also holds its motion relative to the parent: the pose, and the velocity and acceleration, which are zero unless
    ``attach(..., keep="motion")`` gave it some.

    Attributes:
        pose: Pose in the parent that it starts with.
        candidates: Names of the frames that may ever be its parent; None for all frames that do not always hang on it. A query
            works out the poses of all candidates and selects one, so naming a few makes it cheaper. A candidate whose pose is
            not finite (outside a table's span, say) leaves values that do not hang on it alone, but makes their gradients NaN.
    """

    is_attachable: ClassVar[bool] = True
    pose: Transform
    candidates: tuple[str, ...] | None

    def __init__(self, pose: Transform | None = None, candidates: Sequence[str] | None = None):
        if isinstance(candidates, str) or (candidates is not None and not all(isinstance(c, str) for c in candidates)):
            raise EdgeError(f"Attachable(candidates=...) takes a sequence of frame names, found {candidates!r}")
        object.__setattr__(self, "pose", checked_pose(pose, "Attachable"))
        object.__setattr__(self, "candidates", None if candidates is None else tuple(candidates))

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        raise AssertionError("the motion of an attachable edge is held by the state")

    def wiring(self) -> dict[str, Any]:
        return {"candidates": self.candidates}

    def renamed(self, rename: Callable[[str], str]) -> "Attachable":
        return self if self.candidates is None else self.replace(candidates=tuple(map(rename, self.candidates)))

    def bare(self) -> "Attachable":
        """Return the edge without the names of its candidates, which the topology holds."""
        return self.replace(candidates=None)

    def describe(self) -> str:
        return "attachable" if self.candidates is None else f"attachable to {', '.join(self.candidates)}"
