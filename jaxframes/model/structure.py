"""Questions about a tree's structure: answered on the host from static arrays, without JAX."""

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.errors import ShapeError, TopologyError, UnknownJointError, by_keyword, says_keywords, suggest
from jaxframes.model.group import Group, group_of
from jaxframes.model.properties import Properties, thaw
from jaxframes.model.state import Attachments, State
from jaxframes.model.topology import Topology
from jaxframes.staging.arrays import is_concrete


@says_keywords
class Structure(ABC):
    """What hangs on what, by name. Every name that is not in the tree is an UnknownFrameError.

    Without a state, attachable frames count as hanging on the parent that they were declared on; ``path`` and ``common_ancestor`` refuse
    to cross them then, because what they hang on is data in a state. How a tree keeps its numbers is left to its subclasses.
    """

    topology: Topology

    @abstractmethod
    def edge_of(self, frame: int) -> Edge:
        """Return the edge above a frame given by its index, which is not the root's."""

    @abstractmethod
    def numbers(self, frames: Sequence[int]) -> tuple[Any, ...]:
        """Return the numbers of the edges above frames, all of one family, leaf by leaf: arrays [..., n_frames, k]."""

    @abstractmethod
    def family(self, group: int) -> tuple[Any, ...]:
        """Return the numbers of all edges of a family that stacks, leaf by leaf: arrays [..., n_edges, k], or ``PartlyBatched``."""

    @abstractmethod
    def together(self, group: int) -> Edge:
        """Return the edges of a family that does not stack as one edge: the edge itself where there is one."""

    @property
    @abstractmethod
    def is_known(self) -> bool:
        """Whether all numbers of the tree are known, outside any trace."""

    @property
    @abstractmethod
    def dtype(self) -> Any:
        """Float dtype of the tree's numbers: JAX's default where it has none."""

    @property
    @abstractmethod
    def batch_shape(self) -> tuple[int, ...]:
        """Batch axes of the tree's own numbers, broadcast: () unless some edges hold a batch of numbers."""

    @property
    def names(self) -> tuple[str, ...]:
        """Frame names in order of declaration, the root first."""
        return self.topology.names

    @property
    def root(self) -> str:
        """Name of the root frame."""
        return self.topology.names[0]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of their coordinates in ``q``."""
        return self.topology.joint_names

    def joint_of(self, name: str) -> str | None:
        """Return the name of the edge above a frame: its joint, a fixed joint's too; None where it has none (UnknownFrameError)."""
        return self.topology.edge_names[self.topology.index(name)]

    def frame_of(self, joint: str) -> str:
        """Return the frame below a joint, a fixed one or one that follows another too (UnknownJointError)."""
        found = self.topology.edge_index
        if joint not in found:
            raise UnknownJointError(f"the tree has no joint {joint!r}.{suggest(str(joint), found)}")
        return self.names[found[joint]]

    @property
    def nq(self) -> int:
        """Number of stored joint coordinates."""
        return self.topology.nq

    @property
    def nv(self) -> int:
        """Number of joint rates (the mobility)."""
        return self.topology.nv

    @functools.cached_property
    def rest(self) -> tuple[float, ...]:
        """The nq coordinates of all joints at rest: what each joint's ``rest`` says, else zeros and identity quaternions."""
        return tuple(value for frame in self.topology.joint_frames for value in self.edge_of(frame).neutral())

    @functools.cached_property
    def properties(self) -> Mapping[str, Mapping[str, Any]]:
        """Facts kept with each frame: read-only, static, empty where none were given.

        In a program (under ``jit`` and its like) those that the tree was built with: what ``with_properties`` sets later is for the host.
        """
        known = self.frozen_properties()
        return MappingProxyType({name: thaw(known.get(name, ())) for name in self.names})

    def frozen_properties(self) -> dict[str, Properties]:
        """Return the properties of the frames that have some as they are kept: hashable."""
        later = self.topology.notes if self.is_known else ()
        return {name: held for name, held in {**dict(self.topology.properties), **dict(later)}.items() if held}

    @property
    def edges(self) -> Mapping[str, Edge]:
        """The edge above each frame but the root, by the frame's name."""
        return MappingProxyType({name: self.edge_of(i) for i, name in enumerate(self.names) if i})

    def edge(self, name: str) -> Edge:
        """Return the edge between a frame and its parent (TopologyError for the root, which has none)."""
        return self.edge_of(self._below_root(name, "so it has no edge"))

    def held(self, key: str, make: Callable[[], Any]) -> Any:
        """Return what a function makes, which the tree keeps under a key: made once, gone with the tree."""
        if key not in self._held:
            self._held[key] = make()
        return self._held[key]

    @functools.cached_property
    def _held(self) -> dict[str, Any]:
        return {}

    def _below_root(self, name: str, consequence: str) -> int:
        frame = self.topology.index(name)
        if frame == 0:
            raise TopologyError(f"{name!r} is the root: it hangs on nothing, {consequence}")
        return frame

    def lookup(self, name: str) -> tuple[str, ...]:
        """Return the frames that a name or pattern fits, in order of declaration; never none.

        Args:
            name: A frame's name, or a pattern with ``*``, ``?`` and ``[...]`` such as ``"arm/*"``. A frame that is called so comes alone.

        Raises:
            UnknownFrameError: It fits no frame; close names are suggested.
        """
        return group_of(self.topology, name).names

    def group(self, *patterns: str | Sequence[str]) -> Group:
        """Return several frames to ask about at once: ``tree.motion(state, of=tree.group("sat/*"), relative_to="earth")``.

        A group is a sequence of names: ``group[3:10]`` is a group, ``group[3]`` a name. Results of queries have a leading axis over it.

        Args:
            patterns: Names, patterns with ``*``, ``?`` and ``[...]``, or sequences of names; in the order given, those of a pattern in
                the order of declaration, each frame once.

        Raises:
            UnknownFrameError: A pattern fits no frame.
        """
        return group_of(self.topology, *patterns)

    def parent(self, name: str, state: State | None = None) -> Any:
        """Return the name of a frame's parent: the declared one, or with a state the one that it hangs on there.

        For a batch of states an attachable frame's parents are an array of frame indices [...].

        Raises:
            UnknownFrameError: No such frame.
            TopologyError: The root has no parent.
        """
        if state is not None and self.is_attachable(name):
            return self.attached_to(state)[name]
        return self.names[self.topology.parents[self._below_root(name, "so it has no parent")]]

    def parent_name(self, name: str, state: State | None) -> str:
        """Return the name of the frame that a frame hangs on, for what asks for one alone (arguments and errors as for ``parent``).

        Raises:
            ShapeError: It hangs on several over a batch of states, or what it hangs on is traced.
        """
        found = self.parent(name, state)
        if isinstance(found, str):
            return found
        known = np.unique(np.asarray(found)) if is_concrete(found) else ()
        if len(known) == 1:
            return self._name_of(int(known[0]))
        why = "differs over a batch of states; ask one state at a time" if len(known) else "is traced; ask outside of jit and vmap"
        raise ShapeError(f"what {name!r} hangs on {why} (tree.attached_to(state) holds it)")

    def children(self, name: str, state: State | None = None) -> tuple[str, ...]:
        """Return a frame's children in order of declaration: those declared, or with a state those that hang on it there.

        Raises:
            UnknownFrameError: No such frame.
            ShapeError: A batch of states, in which attachable frames may hang on several.
        """
        declared = self.topology.names_of(self.topology.children[self.topology.index(name)])
        if state is None:
            return declared
        here = self._attached_in_one(state, name)
        fixed = tuple(child for child in declared if child not in here)
        return fixed + tuple(child for child, parent in here.items() if parent == name)

    def is_attachable(self, name: str) -> bool:
        """Return whether a frame's parent is data in the state; False for the root."""
        return self.topology.index(name) in self.topology.attachables

    is_daf = is_attachable

    @by_keyword
    def attached_to(self, state: State) -> dict[str, Any]:
        """Return the parent of each attachable frame: its name, or an array of frame indices [...] for a batch or a trace."""
        names = self.topology.names_of(self.topology.attachables)
        parents = self.attachments_in(state).parents if names else None
        if parents is None or (parents.ndim == 1 and is_concrete(parents)):
            return dict(zip(names, map(self._name_of, () if parents is None else np.asarray(parents).tolist()), strict=True))
        return {name: parents[..., row] for row, name in enumerate(names)}

    def _attached_in_one(self, state: State, name: str) -> dict[str, str]:
        """Return what ``attached_to`` does, for questions about one instant (ShapeError for a batch)."""
        here = self.attached_to(state)
        if any(not isinstance(parent, str) for parent in here.values()):
            raise ShapeError(f"the children of {name!r} differ over a batch of states; ask one state at a time, or tree.attached_to(state)")
        return here

    def attachments_in(self, state: State) -> Attachments:
        """Return a state's attachments (ShapeError if they are not those of this tree)."""
        held, count = state.attachments, len(self.topology.attachables)
        if held is None or held.links.shape[-1] != count:
            found = "none" if held is None else held.links.shape[-1]
            raise ShapeError(f"this tree has {count} attachable frames, the state holds {found}; make it with this tree.state(...)")
        return held

    def _name_of(self, index: int) -> str:
        return self.names[index] if 0 <= index < len(self.names) else f"no frame: {index}"

    def depth(self, name: str, state: State | None = None) -> int:
        """Return the number of edges between the root and a frame; with a state, as attachable frames hang in it."""
        return self.topology.depths[self.topology.index(name)] if state is None else len(self.ancestors(name, state))

    def ancestors(self, name: str, state: State | None = None) -> tuple[str, ...]:
        """Return a frame's ancestors from its parent up to the root; empty for the root.

        Args:
            name: The frame.
            state: With a state, those that it has as attachable frames hang in it; one instant on the host.

        Raises:
            UnknownFrameError: No such frame.
            TopologyError: The frame hangs on itself in this state.
            ShapeError: What a frame on the way hangs on differs over a batch of states, or is traced.
        """
        frame = self.topology.index(name)
        if state is None or not self.topology.attachables:
            return self.topology.names_of(self.topology.ancestors(frame))[1:]
        line = [name]
        while line[-1] != self.root:
            line.append(self.parent_name(line[-1], state))
            if len(line) > len(self.names):
                raise TopologyError(
                    f"frame {name!r} hangs on a cycle in this state: {' -> '.join(line[:6])} ...; tree.check(state) says where"
                )
        return tuple(line[1:])

    def subtree(self, name: str, state: State | None = None) -> tuple[str, ...]:
        """Return a frame and all frames below it, in order of declaration; with a state (arguments as for ``ancestors``), those there."""
        if state is None or not self.topology.attachables:
            return self.topology.names_of(self.topology.subtree(self.topology.index(name)))
        here, below = self._attached_in_one(state, name), dict[str, list[str]]()
        for frame, parent in zip(self.names[1:], self.topology.parents[1:], strict=True):
            below.setdefault(here.get(frame, self.names[parent]), []).append(frame)
        found, ahead = {name}, [name]
        while ahead:
            for child in below.get(ahead.pop(), ()):
                if child in found:
                    raise TopologyError(f"frame {child!r} hangs on a cycle in this state; tree.check(state) says where")
                found.add(child)
                ahead.append(child)
        return tuple(frame for frame in self.names if frame in found)

    def common_ancestor(self, a: str, b: str, state: State | None = None) -> str:
        """Return the deepest frame that both frames descend from (a frame descends from itself).

        Args:
            a: A frame.
            b: Another one.
            state: Where attachable frames stand between them, the state that says what they hang on.

        Raises:
            UnknownFrameError: A name is not in the tree.
            TopologyError: Attachable frames stand between them and there is no state; or one hangs on itself.
        """
        if state is None:
            return self.names[self.topology.common_ancestor(self.topology.index(a), self.topology.index(b))]
        line = (b, *self.ancestors(b, state))
        return next(name for name in (a, *self.ancestors(a, state)) if name in line)

    def is_ancestor(self, a: str, b: str, strict: bool = False, state: State | None = None) -> bool:
        """Return whether ``b`` descends from ``a``; with a state, as attachable frames hang in it.

        Args:
            a: The frame above.
            b: The frame below.
            strict: Whether a frame does not count as its own ancestor.
            state: As for ``ancestors``.
        """
        self.topology.index(a)
        return (a == b and not strict) or a in self.ancestors(b, state)

    def path(self, *, of: str, relative_to: str, state: State | None = None) -> tuple[tuple[str, int], ...]:
        """Return the edges between two frames, from ``relative_to`` to ``of``.

        Each is the name of the edge's child frame with +1 where it is walked from parent to child, -1 where backwards.

        Args:
            of: Frame at the far end.
            relative_to: Frame at the near end.
            state: Where attachable frames stand between them, the state that says what they hang on.

        Raises:
            UnknownFrameError: A name is not in the tree.
            TopologyError: Attachable frames stand between them and there is no state; or one hangs on itself.
        """
        if state is None:
            up, down = self.topology.route(self.topology.index(of), self.topology.index(relative_to))
            names = self.names
            return (*((names[i], -1) for i in reversed(up)), *((names[i], 1) for i in down))
        upward, downward = ([name, *self.ancestors(name, state)] for name in (relative_to, of))
        while upward and downward and upward[-1] == downward[-1]:
            upward.pop()
            downward.pop()
        return (*((name, -1) for name in upward), *((name, 1) for name in reversed(downward)))
