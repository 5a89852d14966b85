"""Attaching by name: the checks that can be made on the host, before the state changes."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import EdgeError, FrameError, ShapeError, TopologyError
from jaxframes.model.state import Attachments, State
from jaxframes.staging.arrays import is_concrete
from jaxframes.tree.engine import engine
from jaxframes.tree.states import Stateful

KEEP = ("relative", "world", "motion")


class Attaching(Stateful):
    """What a tree can do with its attachable frames."""

    def is_attachable(self, name: str) -> bool:
        """Return whether a frame's parent is data in the state; False for the root."""
        return self.topology.index(name) in self.topology.attachables

    is_daf = is_attachable

    def attach(self: Any, state: State, frame: str, to: Any, keep: str = "relative") -> State:
        """Return a state in which an attachable frame hangs on another frame; nothing retraces when the parent changes.

        Args:
            state: Where everything is now.
            frame: The attachable frame.
            to: The new parent: a name, or frame indices [...] that may be traced (``tree.topology.index(name)``).
            keep: ``"relative"`` keeps the motion relative to the parent, so the frame jumps with its parent's pose. ``"world"``
                keeps the pose in the world and puts the frame at rest on the new parent: a grip. ``"motion"`` keeps pose,
                velocity and acceleration (where every edge of the tree has one) at this instant; it assumes that the caller
                moves the frame on, because a state holds values of one instant only.

        Returns:
            A new state; the old one is as it was, also after an error.

        Raises:
            UnknownFrameError: A name is not in the tree.
            EdgeError: ``frame`` is not attachable.
            TopologyError: ``to`` is the frame itself, hangs on it, or is not among its candidates. For traced indices nothing can
                be raised: poses that depend on the frame are then NaN, and ``attachments_valid`` says where.
        """
        if keep not in KEEP:
            raise FrameError(f"attach(keep=...) takes one of {', '.join(map(repr, KEEP))}, not {keep!r}")
        index = self._attachable(frame, to)
        self._check_state(state)
        target = self.topology.index(to) if isinstance(to, str) else to
        if not np.issubdtype(jnp.result_type(target), np.integer):
            raise ShapeError(f"attach {frame!r} to a frame's name or to frame indices (integers), found {target!r}")
        known = not isinstance(target, jax.Array) or is_concrete(target)
        if known:
            self._check_target(state, index, np.asarray(target))
        return engine().attached(self, state, jnp.asarray(target, jnp.int32), frame=index, keep=keep)

    def detach(self: Any, state: State, frame: str, keep: str = "world") -> State:
        """Return a state in which an attachable frame hangs on the root (arguments and errors as for ``attach``)."""
        return self.attach(state, frame, self.root, keep=keep)

    def attached_to(self, state: State) -> dict[str, Any]:
        """Return the parent of each attachable frame: its name, or an array of frame indices [...] for a batch or a trace."""
        found: dict[str, Any] = {}
        for row, frame in enumerate(self.topology.attachables):
            parents = self._check_state(state).parents[..., row]
            single = is_concrete(parents) and parents.ndim == 0
            found[self.names[frame]] = self._name_of(int(parents)) if single else parents
        return found

    def _check_state(self, state: State) -> Attachments:
        """Return a state's attachments (ShapeError if they are not those of this tree)."""
        held, count = state.attachments, len(self.topology.attachables)
        if held is None or held.parents.shape[-1] != count:
            found = "none" if held is None else held.parents.shape[-1]
            raise ShapeError(f"this tree has {count} attachable frames, the state holds {found}; make it with this tree.state(...)")
        return held

    def _name_of(self, index: int) -> str:
        return self.names[index] if 0 <= index < len(self.names) else f"no frame: {index}"

    def attachments_valid(self: Any, state: State) -> jax.Array:
        """Return where all attachable frames hang, link by link, on the root: bool [...], also under jit."""
        if not self.topology.attachables:
            return jnp.ones((), bool)
        return engine().attachments_valid(self, state)

    def parent(self, name: str, state: State | None = None) -> Any:
        """Return the name of a frame's parent: the declared one, or with a state the one that it hangs on there.

        For a batch of states an attachable frame's parents are an array of frame indices [...].

        Raises:
            UnknownFrameError: No such frame.
            TopologyError: The root has no parent.
        """
        if state is not None and self.is_attachable(name):
            return self.attached_to(state)[name]
        return super().parent(name)

    def children(self, name: str, state: State | None = None) -> tuple[str, ...]:
        """Return a frame's children: those declared, or with a state those that hang on it there (one instant, no batch)."""
        if state is None:
            return super().children(name)
        here = self.attached_to(state)
        if any(not isinstance(parent, str) for parent in here.values()):
            raise ShapeError(f"the children of {name!r} differ over a batch of states; ask one state at a time, or tree.attached_to(state)")
        fixed = tuple(child for child in super().children(name) if child not in here)
        return fixed + tuple(child for child, parent in here.items() if parent == name)

    def _attachable(self, frame: str, to: Any) -> int:
        index = self.topology.index(frame)
        if index not in self.topology.attachables:
            what = "is the root" if index == 0 else f"is {self._edge(index).describe()} on {super().parent(frame)!r}"
            loose = ", ".join(repr(self.names[i]) for i in self.topology.attachables) or "none"
            raise EdgeError(
                f"cannot attach {frame!r} to {to!r}: {frame!r} {what}, so it stays there; attachable frames: {loose}. "
                f"Use jf.edges.Attachable()"
            )
        return index

    def _check_target(self, state: State, frame: int, targets: np.ndarray) -> None:
        topology, row = self.topology, self.topology.attachables.index(frame)
        name = topology.names[frame]
        for target in np.unique(targets):
            if not 0 <= target < len(topology.names):
                raise TopologyError(f"cannot attach {name!r} to frame number {target}: the tree has frames 0 to {len(topology.names) - 1}")
            other = topology.names[int(target)]
            if target == frame:
                raise TopologyError(f"cannot attach {name!r} to itself ({other!r})")
            if topology.islands[int(target)] == frame:
                raise TopologyError(
                    f"cannot attach {name!r} to {other!r}, which hangs on it: that would be a cycle; attach {other!r} elsewhere first"
                )
            if int(target) not in topology.candidates[row]:
                allowed = ", ".join(repr(n) for n in topology.names_of(topology.candidates[row]))
                raise TopologyError(f"cannot attach {name!r} to {other!r}: its candidates are {allowed}; name {other!r} among them too")
        assert state.attachments is not None
        if is_concrete(state.attachments.parents) and np.any(hangs_on(topology, np.asarray(state.attachments.parents), targets, frame)):
            other = topology.names[int(np.unique(targets)[0])]
            raise TopologyError(
                f"cannot attach {name!r} to {other!r}, which hangs on it in this state: that would be a cycle; detach {other!r} first"
            )


def hangs_on(topology: Any, parents: np.ndarray, frames: np.ndarray, ancestor: int) -> np.ndarray:
    """Return where frames [...] hang on an attachable one, by the parents [..., n_attachable] of a state."""
    islands, rows = np.asarray(topology.islands), {frame: row for row, frame in enumerate(topology.attachables)}
    batch = np.broadcast_shapes(parents.shape[:-1], np.shape(frames))
    at, found = islands[np.broadcast_to(frames, batch)], np.zeros(batch, bool)
    for _ in topology.attachables:
        found |= at == ancestor
        above = at.copy()
        for frame, row in rows.items():
            seat = np.broadcast_to(parents[..., row], batch)
            inside = (seat >= 0) & (seat < len(islands))  # a number that is no frame hangs on nothing, so on no cycle
            above = np.where(at == frame, islands[np.where(inside, seat, 0)], above)
        at = above
    return found | (at == ancestor)
