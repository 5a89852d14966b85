"""The seam between a tree and the computation on it: the layer above registers itself here, so nothing imports upward."""

from typing import TYPE_CHECKING, Any, Protocol

import jax

if TYPE_CHECKING:
    from jaxframes.kinematics.apparent import ApparentState, Looking
    from jaxframes.model.state import State
    from jaxframes.spatial import Motion, Transform
    from jaxframes.tree.frame_tree import FrameTree


class Engine(Protocol):
    """What computes: every query of a tree ends in one of these calls, with frames given by index.

    ``order`` is 0 for poses, 1 with velocities, 2 with accelerations; what lies beyond it is None in the result.
    """

    def between(self, tree: "FrameTree", state: "State", *, of: int, relative_to: int, expressed_in: int, order: int) -> "Motion":
        """Return the motion of one frame relative to another."""
        ...

    def all_frames(self, tree: "FrameTree", state: "State", *, relative_to: int, order: int) -> "Motion":
        """Return the motions of all frames relative to one, stacked on the axis before the last."""
        ...

    def pairs(self, tree: "FrameTree", state: "State", *, of: tuple[int, ...], relative_to: tuple[int, ...]) -> "Transform":
        """Return the poses of several frames in several others, leaves [..., n_relative_to, n_of, k]."""
        ...

    def jacobian(self, tree: "FrameTree", state: "State", *, of: int, relative_to: int, expressed_in: int) -> jax.Array:
        """Return the Jacobian [..., 6, nv] of a relative velocity with respect to the joint rates, angular first."""
        ...

    def jacobian_dot(self, tree: "FrameTree", state: "State", *, of: int, relative_to: int, expressed_in: int) -> jax.Array:
        """Return the time derivative [..., 6, nv] of the Jacobian along the state's motion."""
        ...

    def rate(self, tree: "FrameTree", state: "State") -> "State":
        """Return the time derivative of a state: what each number of it changes by per second."""
        ...

    def apparent(self, tree: "FrameTree", state: "State", *, looking: "Looking") -> "ApparentState":
        """Return where a frame appears to an observer."""
        ...

    def attached(self, tree: "FrameTree", state: "State", to: jax.Array, *, frame: int, keep: str) -> "State":
        """Return a state in which an attachable frame hangs on the frame with index ``to`` [...]."""
        ...

    def attachments_valid(self, tree: "FrameTree", state: "State") -> jax.Array:
        """Return where every attachable frame hangs, link by link, on the root: bool [...]."""
        ...


_registered: list[Any] = []


def register(engine: Engine) -> None:
    """Make an engine the one that trees use."""
    _registered[:] = [engine]


def engine() -> Engine:
    """Return the registered engine."""
    return _registered[0]
