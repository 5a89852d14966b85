"""Builder: frames are named and hung on each other here, on the host, with every mistake reported by name."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.edges.attachable import Attachable
from jaxframes.edges.base import Edge
from jaxframes.edges.fixed import Fixed
from jaxframes.edges.mimic import sources
from jaxframes.errors import DuplicateNameError, EdgeError, TopologyError, UnknownFrameError, UnknownJointError, suggest
from jaxframes.kinematics.plan import LARGE
from jaxframes.model.parameters import families, strengthened
from jaxframes.model.properties import Properties, freeze, thaw
from jaxframes.model.topology import Topology
from jaxframes.tables.edge_source import place_tables
from jaxframes.tree.frame_tree import FrameTree


class TreeBuilder:
    """Collects frames and edges, then compiles them into a ``FrameTree``.

    Args:
        root: Name of the root frame.

    Example:
        >>> import jaxframes as jf
        >>> b = jf.TreeBuilder(root="world")
        >>> b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
        >>> b.build().names
        ('world', 'arm')
    """

    def __init__(self, root: str = "world"):
        self._parents: dict[str, str | None] = {_checked_name(root): None}
        self._edges: dict[str, Edge] = {}
        self._joints: dict[str, str] = {}  # frame -> name of its edge; the order is that of the coordinates
        self._properties: dict[str, Properties] = {}
        self._above: dict[str, str] | None = None  # name of an edge -> its frame; made when it is needed

    @classmethod
    def from_tree(cls, tree: FrameTree) -> "TreeBuilder":
        """Return a builder that holds what a tree holds."""
        builder = cls(root=tree.root)
        builder._take(tree, tree.names[1:], "", tree.root)
        builder._properties.update((name, held) for name, held in tree.topology.properties if name == tree.root)
        return builder

    def include(self, tree: FrameTree, *, parent: str, prefix: str = "") -> None:
        """Add all frames of another tree below a frame; its root coincides with that frame's new child ``prefix + root``.

        Args:
            tree: The tree to include; its numbers are taken as they are.
            parent: Frame that the included root is fixed to.
            prefix: Text put before every frame and joint name, e.g. ``"arm/"``.

        Raises:
            UnknownFrameError: The parent does not exist.
            DuplicateNameError: A prefixed name is taken; nothing has been added then.
        """
        if parent not in self._parents:
            raise UnknownFrameError(f"cannot include a tree below {parent!r}: no such frame.{suggest(parent, self._parents)}")
        clash = [prefix + name for name in tree.names if prefix + name in self._parents]
        clash += [f"joint {prefix + name}" for name in tree.topology.edge_index if prefix + name in self._joints.values()]
        if clash:
            raise DuplicateNameError(
                f"cannot include the tree: {', '.join(clash[:5])} exist already; give another prefix (it is {prefix!r})"
            )
        top = prefix + tree.root
        self.add(top, parent=parent, edge=Fixed(), properties=dict(tree.properties[tree.root]))
        self._take(tree, tree.names[1:], prefix, top)

    def _take(self, tree: FrameTree, names: tuple[str, ...], prefix: str, top: str) -> None:
        joints = {tree.names[frame]: joint for frame, joint in zip(tree.topology.joint_frames, tree.joint_names, strict=True)}
        joints |= {tree.names[frame]: joint for joint, frame in tree.topology.edge_index.items() if tree.names[frame] not in joints}
        held = dict(tree.topology.properties)
        for name in names:
            parent = tree.parent(name)
            new = prefix + name
            self._parents[new], self._edges[new] = (top if parent == tree.root else prefix + parent), tree.edge(name).prefixed(prefix)
            if name in held:
                self._properties[new] = held[name]
        self._joints.update((prefix + name, prefix + joint) for name, joint in joints.items())
        self._above = None

    def reordered(self, order: list[str], parents: Mapping[str, str], edges: Mapping[str, Edge]) -> "TreeBuilder":
        """Return a builder with the same frames in another order, some of them with another parent or edge."""
        made = TreeBuilder(root=self.root)
        for name in order[1:]:
            made._parents[name] = parents.get(name, self._parents[name])
            made._edges[name] = edges.get(name, self._edges[name])
        made._joints = dict(self._joints)
        made._properties = {name: self._properties[name] for name in order if name in self._properties}
        return made

    def remove(self, name: str, *, children: str = "remove") -> None:
        """Remove a frame, and what hangs on it.

        Args:
            name: The frame to remove.
            children: ``"remove"`` removes the whole subtree; ``"reparent"`` hangs the children on the frame's parent and keeps
                their edges as they are (their poses change by the edge that is gone).

        Raises:
            UnknownFrameError: No such frame.
            TopologyError: The frame is the root.
        """
        if children not in ("remove", "reparent"):
            raise EdgeError(f"remove(children=...) takes 'remove' or 'reparent', not {children!r}")
        if name not in self._parents:
            raise UnknownFrameError(f"there is no frame {name!r} to remove.{suggest(name, self._parents)}")
        if name == self.root:
            raise TopologyError(f"{name!r} is the root and cannot be removed; start another builder")
        gone = {name}
        for child, parent in self._parents.items():
            if parent == name and children == "reparent":
                self._parents[child] = self._parents[name]
            elif parent in gone:
                gone.add(child)
        self._above = None
        for frame in gone:
            self._parents.pop(frame)
            for held in (self._edges, self._joints, self._properties):
                held.pop(frame, None)

    @property
    def root(self) -> str:
        """Name of the root frame."""
        return next(iter(self._parents))

    @property
    def names(self) -> tuple[str, ...]:
        """Frame names in order of declaration, the root first."""
        return tuple(self._parents)

    def add(self, name: str, *, parent: str, edge: Edge, joint: str | None = None, properties: Mapping[str, Any] | None = None) -> None:
        """Add a frame below an existing one.

        Args:
            name: Name of the new frame.
            parent: Name of the frame it hangs on.
            edge: Motion of the new frame relative to its parent, one of ``jf.edges`` or a table.
            joint: Name of the edge. Default: the frame's name for a joint, no name for other edges.
            properties: Facts kept with the frame, never traced: text, numbers, and tuples or mappings of them.

        Raises:
            DuplicateNameError: The frame or joint name is taken.
            UnknownFrameError: The parent does not exist (close names are suggested).
            TopologyError: The frame would hang on itself.
            EdgeError: ``edge`` is no edge.
        """
        _checked_name(name)
        if name == parent:
            raise TopologyError(f"frame {name!r} cannot be its own parent: that is a cycle; hang it on another frame")
        if name == self.root:
            raise TopologyError(f"the root {name!r} cannot hang on {parent!r}: that is a cycle; build the tree from another root")
        if name in self._parents:
            raise DuplicateNameError(
                f"frame {name!r} exists already, below {self._parents[name]!r}; every frame has one parent and a name of its own"
            )
        if parent not in self._parents:
            raise UnknownFrameError(
                f"frame {name!r}: its parent {parent!r} does not exist yet.{suggest(parent, self._parents)} Add it first."
            )
        if not isinstance(edge, Edge):
            raise EdgeError(f"frame {name!r}: edge must be one of jf.edges or a table, found {type(edge).__name__}: {edge!r}")
        frozen = freeze(properties or {}, f"frame {name!r}")
        if edge.nq or edge.follows is not None or joint is not None:
            self._joints[name] = self._free_joint(name if joint is None else joint, name)
        self._parents[name], self._edges[name] = parent, edge
        if frozen:
            self._properties[name] = frozen

    def add_spice(self, source: Any, *, body: str | int, frame: str | int | None = None, **options: Any) -> str:
        """Return the name of the frame for a body and a SPICE frame; if it is not there, add it and what it hangs on.

        Frames are known by the pair (body id, frame id), which their properties ``spice_body`` and ``spice_frame`` record, so asking twice
        adds nothing. A new frame is named as SPICE names it: ``"EARTH"`` for a body with J2000 axes, ``"ITRF93"`` for a frame at its
        own centre, ``"ITRF93 @ MOON"`` elsewhere. The root is what its properties say, what the tables below it say, or the body it is
        named after (``"SSB"``) in J2000.

        Args:
            source: Open ``jf.spice.Kernels``, or tables: a mapping as ``jf.spice.load`` returns, or a sequence.
            body: Body by name or NAIF id.
            frame: Frame by name or NAIF id. None or 999999 (also as text): the body-fixed frame if SPICE knows one for the body, J2000 for
                barycentres (ids 0 to 9) and spacecraft; among tables, the one frame that is oriented at the body. The resolved ids
                are recorded: load order never changes them silently.
            options: For kernels: ``start`` and ``stop`` of the coverage, and further keywords of ``Kernels.orientation``.

        Raises:
            FrameError: The source knows no such body or frame, or has no data that connect it with the tree.
        """
        if not hasattr(source, "add_to_tree"):
            return place_tables(self, source, body=body, frame=frame, **options)
        return source.add_to_tree(self, body=body, frame=frame, **options)

    def frames(self) -> Iterator[tuple[str, str | None, Edge | None, Mapping[str, Any]]]:
        """Return (name, parent, edge, properties) of each frame in order of declaration; the root has neither parent nor edge."""
        for name, parent in self._parents.items():
            yield name, parent, self._edges.get(name), thaw(self._properties.get(name, ()))

    def set_properties(self, name: str, properties: Mapping[str, Any]) -> None:
        """Replace the properties of a frame (UnknownFrameError, EdgeError)."""
        if name not in self._parents:
            raise UnknownFrameError(f"there is no frame {name!r}.{suggest(name, self._parents)}")
        frozen = freeze(properties, f"frame {name!r}")
        self._properties.pop(name, None)
        if frozen:
            self._properties[name] = frozen

    def _free_joint(self, joint: str, frame: str) -> str:
        if self._above is None:
            self._above = {joint: other for other, joint in self._joints.items()}
        if joint in self._above:
            other = self._above[joint]
            raise DuplicateNameError(f"frame {frame!r}: joint {joint!r} exists already, above frame {other!r}; give joint= another name")
        self._above[joint] = frame
        return joint

    def order_joints(self, names: Sequence[str]) -> None:
        """Set the order of the joints' coordinates in ``q``; without this it is that of declaration.

        Args:
            names: Joint names; joints that are not named come after them in the order that they had.

        Raises:
            UnknownJointError: There is no such joint.
        """
        frames = {joint: frame for frame, joint in self._joints.items()}
        for name in names:
            if name not in frames:
                raise UnknownJointError(f"there is no joint {name!r} to put in order.{suggest(name, frames)}")
        first = {frames[name]: name for name in names}
        self._joints = {**first, **self._joints}

    def build(self) -> FrameTree:
        """Return the tree compiled into static arrays and stacked parameters."""
        names = self.names
        index = {name: i for i, name in enumerate(names)}
        given = {id(edge): edge for edge in self._edges.values()}
        strong = {key: strengthened(edge) for key, edge in given.items()}
        edges = [strong[id(self._edges[name])] for name in names[1:]]
        if len(given) < len(edges) < LARGE:  # one edge above several frames: each gets arrays of its own, so that the tree can be donated
            edges = [jax.tree.map(jnp.copy, edge) for edge in edges]
        groups, stacked, locations = families(edges)
        joints = [name for name in self._joints if self._edges[name].nq]
        coordinates, prescribed, held = self._coordinates(joints), [-1], 0
        for edge in edges:
            prescribed.append(held if edge.is_prescribed else -1)
            held += edge.is_prescribed
        parents = (-1, *(index[parent] for parent in (self._parents[name] for name in names[1:]) if parent is not None))
        attachables, candidates = self._attachables(index)
        topology = Topology(
            names=names,
            parents=parents,
            groups=groups,
            stacked=stacked,
            locations=((-1, -1), *locations),
            coordinates=coordinates,
            joint_names=tuple(self._joints[name] for name in joints),
            joint_frames=tuple(index[name] for name in joints),
            prescribed=tuple(prescribed),
            attachables=attachables,
            candidates=candidates,
            neutral=tuple(value for name in joints for value in self._edges[name].neutral()),
            properties=tuple((name, self._properties[name]) for name in names if name in self._properties),
            edge_names=tuple(self._joints.get(name) for name in names),
            sources=sources(self._edges, self._joints, index),
        )
        return FrameTree(tuple(edges), topology)

    def _coordinates(self, joints: list[str]) -> tuple[tuple[int, int, int, int], ...]:
        """Return (first q, nq, first qd, nv) of each frame's edge; joints take their places in the order given."""
        starts, first_q, first_v = {}, 0, 0
        for name in joints:
            edge = self._edges[name]
            starts[name] = (first_q, edge.nq, first_v, edge.nv)
            first_q, first_v = first_q + edge.nq, first_v + edge.nv
        return tuple(starts.get(name, (0, 0, 0, 0)) for name in self._parents)

    def _attachables(self, index: dict[str, int]) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
        """Return the attachable frames and, for each, the frames that may be its parent."""
        loose = {name: edge for name, edge in self._edges.items() if isinstance(edge, Attachable)}
        island: dict[str, str] = {}
        for name, parent in self._parents.items():
            island[name] = name if parent is None or name in loose else island[parent]
        found = []
        for name, edge in loose.items():
            allowed = [other for other in self._parents if island[other] != name] if edge.candidates is None else list(edge.candidates)
            for other in allowed:
                if other not in self._parents:
                    raise UnknownFrameError(f"frame {name!r}: its candidate {other!r} does not exist.{suggest(other, self._parents)}")
                if island[other] == name:
                    raise TopologyError(f"frame {name!r}: its candidate {other!r} always hangs on it: that would be a cycle")
            first = self._parents[name]
            if first not in allowed:
                raise TopologyError(f"frame {name!r} starts on {first!r}, which is not among its candidates {allowed}; name it there too")
            found.append(tuple(sorted(index[other] for other in allowed)))
        return tuple(index[name] for name in loose), tuple(found)


def _checked_name(name: Any) -> str:
    if not isinstance(name, str) or not name:
        raise EdgeError(f"a frame's name must be text that is not empty, found {name!r}")
    return name
