"""What a tree says of itself: as text, as a dictionary, and which of its numbers are wrong."""

from typing import Any

from jaxframes.kinematics.plan import over_all_frames
from jaxframes.model.state import State
from jaxframes.model.structure import Structure
from jaxframes.tree.check import check
from jaxframes.tree.text import DumpOptions, explain, format_tree, path_in_state


class Described(Structure):
    """The descriptive half of a tree; everything here runs on the host."""

    def format(self, options: DumpOptions | None = None, *, state: State | None = None) -> str:
        """Return the tree as text, one line a frame.

        Args:
            options: What each line says. Default: names and edges.
            state: With a state, each line also gives the pose in the parent (one instant, no batch).
        """
        return format_tree(self, options or DumpOptions(), state)

    def explain(self, *, of: str | None = None, relative_to: str | None = None, state: State | None = None) -> str:
        """Return text that says which edges a query between two frames touches, in which direction, and what each needs.

        Without ``of``: how queries about all frames go through the tree, and why. Where attachable frames stand between two
        frames, the path depends on the state: pass one to see its path.
        """
        if of is None:
            return over_all_frames(self.topology)
        return explain(self, of, self.root if relative_to is None else relative_to, state)

    def describe(self: Any, state: State, *, of: str, relative_to: str) -> dict[str, Any]:
        """Return all read-outs of a pair of frames.

        Returns:
            ``of``, ``relative_to``, ``path``, ``frames``, ``oriented``, ``edges``, ``supports_accelerations``, ``transform``,
            ``velocity``, ``acceleration`` (None where the chain has none), and the ``parent`` of ``of``.
        """
        path = path_in_state(self, state, of, relative_to)
        frames = [relative_to]
        for name, direction in path:
            frames.append(name if direction > 0 else self.parent(name, state))
        accelerates = all(self.edge(name).supports_accelerations for name, _ in path)
        names = {"of": of, "relative_to": relative_to}
        return {
            **names,
            "parent": None if of == self.root else self.parent(of, state),
            "path": path,
            "frames": tuple(frames),
            "oriented": all(direction > 0 for _, direction in path),
            "edges": {name: self.edge(name).describe() for name, _ in path},
            "supports_accelerations": accelerates,
            "transform": self.transform(state, **names),
            "velocity": self.velocity(state, **names),
            "acceleration": self.acceleration(state, **names) if accelerates else None,
        }

    def check(self: Any, state: State) -> tuple[str, ...]:
        """Return what is wrong with a state and with this tree's numbers, a sentence each, by name; empty if nothing is.

        Looked for: numbers that are not finite, quaternions that are not unit, epochs outside a table, joint limits exceeded.
        Runs on the host: not under jit.
        """
        return check(self, state)
