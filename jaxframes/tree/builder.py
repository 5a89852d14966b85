"""Builder: frames are named and hung on each other here, on the host, with every mistake reported by name."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.edges.family import is_family
from jaxframes.edges.fixed import Fixed
from jaxframes.errors import (
    DuplicateNameError,
    EdgeError,
    FrameError,
    FrameWarning,
    ShapeError,
    TopologyError,
    UnknownFrameError,
    UnknownJointError,
    says_keywords,
    suggest,
)
from jaxframes.model.compile import Declared, compile_frames
from jaxframes.model.names import checked_name
from jaxframes.model.properties import freeze, thaw
from jaxframes.staging.arrays import is_concrete
from jaxframes.tables.edge_source import TableSource
from jaxframes.tables.placing import OffersEdges, misplaced, place
from jaxframes.tree.frame_tree import FrameTree


@says_keywords
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
        self._declared = Declared({checked_name(root): None})
        self._above: dict[str, str] | None = None  # name of an edge -> its frame; made when it is needed

    @classmethod
    def from_tree(cls, tree: FrameTree) -> "TreeBuilder":
        """Return a builder that holds what a tree holds."""
        builder = cls(root=tree.root)
        builder._declared = Declared.of(tree)
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
        if parent not in self._declared.parents:
            raise UnknownFrameError(f"cannot include a tree below {parent!r}: no such frame.{suggest(parent, self._declared.parents)}")
        clash = [prefix + name for name in tree.names if prefix + name in self._declared.parents]
        clash += [f"joint {prefix + name}" for name in tree.topology.edge_index if prefix + name in self._declared.edge_names.values()]
        if clash:
            raise DuplicateNameError(
                f"cannot include the tree: {', '.join(clash[:5])} exist already; give another prefix (it is {prefix!r})"
            )
        top = prefix + tree.root
        self.add(top, parent=parent, edge=Fixed(), properties=dict(tree.properties[tree.root]))
        part = Declared.of(tree).renamed(lambda name: prefix + name)
        for name, edge in part.edges.items():
            self._declared.parents[name], self._declared.edges[name] = part.parents[name], edge
        self._declared.edge_names.update(part.edge_names)
        self._declared.properties.update((name, held) for name, held in part.properties.items() if name != top)
        self._above = None

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
        if name not in self._declared.parents:
            raise UnknownFrameError(f"there is no frame {name!r} to remove.{suggest(name, self._declared.parents)}")
        if name == self.root:
            raise TopologyError(f"{name!r} is the root and cannot be removed; start another builder")
        gone = {name}
        for child, parent in self._declared.parents.items():
            if parent == name and children == "reparent":
                self._declared.parents[child] = self._declared.parents[name]
            elif parent in gone:
                gone.add(child)
        self._above = None
        for frame in gone:
            self._declared.parents.pop(frame)
            for held in (self._declared.edges, self._declared.edge_names, self._declared.properties):
                held.pop(frame, None)

    @property
    def root(self) -> str:
        """Name of the root frame."""
        return next(iter(self._declared.parents))

    @property
    def names(self) -> tuple[str, ...]:
        """Frame names in order of declaration, the root first."""
        return tuple(self._declared.parents)

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
        checked_name(name)
        if name == parent:
            raise TopologyError(f"frame {name!r} cannot be its own parent: that is a cycle; hang it on another frame")
        if name == self.root:
            raise TopologyError(f"the root {name!r} cannot hang on {parent!r}: that is a cycle; build the tree from another root")
        if name in self._declared.parents:
            raise DuplicateNameError(
                f"frame {name!r} exists already, below {self._declared.parents[name]!r}; every frame has one parent and a name of its own"
            )
        if parent not in self._declared.parents:
            raise UnknownFrameError(
                f"frame {name!r}: its parent {parent!r} does not exist yet.{suggest(parent, self._declared.parents)} Add it first."
            )
        if not isinstance(edge, Edge):
            raise EdgeError(f"frame {name!r}: edge must be one of jf.edges or a table, found {type(edge).__name__}: {edge!r}")
        if not is_family(type(edge)):
            raise EdgeError(f"frame {name!r}: {type(edge).__name__} is no edge family yet; decorate the class with @jf.edges.family()")
        frozen = freeze(properties or {}, f"frame {name!r}")
        if edge.nq or edge.follows is not None or joint is not None:
            self._declared.edge_names[name] = self._free_joint(name if joint is None else joint, name)
        self._declared.parents[name], self._declared.edges[name] = parent, edge
        if frozen:
            self._declared.properties[name] = frozen

    def add_many(
        self, names: Sequence[str], *, parent: str | Sequence[str], edge: Edge | Sequence[Edge], properties: Mapping[str, Any] | None = None
    ) -> None:
        """Add many frames of one family: a constellation, the teeth of a gear, a camera rig.

        Their numbers are stored together and evaluated at once; ``tree.group`` names them together in queries.

        Args:
            names: Names of the new frames.
            parent: Name of the frame that they hang on, or one name for each.
            edge: One edge whose numbers have a leading axis over the frames ``[n, ..., k]``, those without it being the same for all; or
                an edge for each frame, such as trajectories of different lengths.
            properties: Facts kept with each frame.

        Raises:
            ShapeError: There are not as many parents, edges or numbers as frames.
            FrameError: As for ``add``; nothing has been added then.

        Example:
            >>> import numpy as np, jaxframes as jf
            >>> b = jf.TreeBuilder(root="earth")
            >>> orbits = jf.edges.Kepler(periapsis=7e6, node=np.linspace(0, 6, 100), mu=3.986004418e14)
            >>> b.add_many([f"sat/{i}" for i in range(100)], parent="earth", edge=orbits)
            >>> tree = b.build()
            >>> tree.transform(tree.state(time=0.0), of=tree.group("sat/*"), relative_to="earth").translation.shape
            (100, 3)
        """
        given = [names] if isinstance(names, str) else list(names)
        parents = [parent] * len(given) if isinstance(parent, str) else list(parent)
        edges = _each(edge, len(given)) if isinstance(edge, Edge) else list(edge)
        for what, count in (("parents", len(parents)), ("edges", len(edges))):
            if count != len(given):
                raise ShapeError(f"add_many: there are {len(given)} names and {count} {what}; each frame takes one")
        added = []
        try:
            for name, above, own in zip(given, parents, edges, strict=True):
                self.add(name, parent=above, edge=own, properties=properties)
                added.append(name)
        except FrameError:
            for name in reversed(added):
                self.remove(name)
            raise

    def add_spice(self, source: Any, *, body: str | int, frame: str | int | None = None, **options: Any) -> str:
        """Return the name of the frame for a body and a SPICE frame; if it is not there, add it and what it hangs on.

        Frames are known by the pair (body id, frame id), which their properties ``spice_body`` and ``spice_frame`` record, so asking twice
        adds nothing. A new frame is named as SPICE names it: ``"EARTH"`` for a body with J2000 axes, ``"ITRF93"`` for a frame at its
        own centre, ``"ITRF93 @ MOON"`` elsewhere. The root is what its properties say, what the tables below it say, or the body it is
        named after (``"SSB"``) in J2000.

        Args:
            source: Open ``jf.spice.Kernels``, or tables: one, a sequence, or a mapping as ``jf.spice.load`` returns.
            body: Body by name or NAIF id.
            frame: Frame by name or NAIF id. None or 999999 (also as text): the body-fixed frame if SPICE knows one for the body, J2000 for
                barycentres (ids 0 to 9) and spacecraft; among tables, the one frame that is oriented at the body. The resolved ids
                are recorded: load order never changes them silently.
            options: For kernels: ``start`` and ``stop`` of the coverage, and further keywords of ``Kernels.orientation``.

        Raises:
            FrameError: The source knows no such body or frame, or has no data that connect it with the tree.
        """
        if isinstance(source, OffersEdges):
            return place(self, source.edge_source(**options), body, frame)
        tables = [source] if isinstance(source, Edge) else source
        if not isinstance(tables, (Mapping, Sequence)) or isinstance(tables, str) or not tables:
            raise EdgeError(f"add_spice takes jf.spice.Kernels or tables made by them, found {type(source).__name__}: {source!r}")
        if options:
            raise EdgeError(f"add_spice(..., {next(iter(options))}=) is for kernels; tables are taken as they are, cut with jf.spice.crop")
        return place(self, TableSource(tables), body, frame)

    def frames(self) -> Iterator[tuple[str, str | None, Edge | None, Mapping[str, Any]]]:
        """Return (name, parent, edge, properties) of each frame in order of declaration; the root has neither parent nor edge."""
        for name, parent in self._declared.parents.items():
            yield name, parent, self._declared.edges.get(name), thaw(self._declared.properties.get(name, ()))

    def set_properties(self, name: str, properties: Mapping[str, Any]) -> None:
        """Replace the properties of a frame (UnknownFrameError, EdgeError)."""
        if name not in self._declared.parents:
            raise UnknownFrameError(f"there is no frame {name!r}.{suggest(name, self._declared.parents)}")
        frozen = freeze(properties, f"frame {name!r}")
        self._declared.properties.pop(name, None)
        if frozen:
            self._declared.properties[name] = frozen

    def _free_joint(self, joint: str, frame: str) -> str:
        checked_name(joint, f"frame {frame!r}: a joint's name")
        if self._above is None:
            self._above = {joint: other for other, joint in self._declared.edge_names.items()}
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
        frames = {joint: frame for frame, joint in self._declared.edge_names.items()}
        for name in names:
            if name not in frames:
                raise UnknownJointError(f"there is no joint {name!r} to put in order.{suggest(name, frames)}")
        first = {frames[name]: name for name in names}
        self._declared.edge_names = {**first, **self._declared.edge_names}

    def build(self) -> FrameTree:
        """Return the tree compiled into static arrays and stacked parameters.

        A table that hangs on another frame than it starts from is named in a ``FrameWarning``, and by ``tree.check``.

        Raises:
            UnknownFrameError: A candidate of an attachable frame does not exist.
            UnknownJointError: A joint that is followed does not exist.
            TopologyError: Joints follow each other in a ring, or an attachable frame could never hang on one of its candidates.
            EdgeError: A joint that is followed has no such coordinate.
        """
        for sentence in misplaced(self.frames()):
            warnings.warn(sentence, FrameWarning, stacklevel=2)
        return FrameTree(*compile_frames(self._declared))


def _each(edge: Edge, count: int) -> list[Edge]:
    """Return the edges that one stands for whose numbers have a leading axis over them."""
    if edge.batch_shape[:1] != (count,):
        found = edge.batch_shape[0] if edge.batch_shape else "no axis over frames"
        raise ShapeError(
            f"add_many: there are {count} names, and the numbers of the edge ({edge.describe()}) have {found}; they are [{count}, ..., k]"
        )
    known = all(map(is_concrete, jax.tree.leaves(edge)))
    whole = jax.tree.map(np.asarray, edge) if known else edge  # rows of NumPy arrays are taken a hundred times faster
    return [whole.at(row) for row in range(count)]
