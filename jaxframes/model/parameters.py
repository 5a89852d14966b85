"""Parameters by name: ``"camera.placement.translation"`` is the translation of the mount of the frame ``camera``.

A parameter is a number that queries depend on and optimisers may change: mounts, axes, pitches, multipliers, coefficients of tables. Its
name is the frame's, a dot, and the path of fields within the frame's edge. Limits are static, so they are none; they are read and set by
the same names all the same.
"""

import dataclasses
import fnmatch
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.errors import EdgeError, FrameError, ShapeError, UnknownFrameError, suggest
from jaxframes.model.families import differs, float_dtype, like, rows_of, stack, stored
from jaxframes.model.properties import freeze
from jaxframes.model.structure import Structure
from jaxframes.model.topology import Topology
from jaxframes.staging.arrays import as_float, is_concrete


@dataclass(frozen=True, eq=False)
class Parameters(Structure):
    """The numbers of a tree, edge by edge: asked for, chosen and replaced by name, all of it under jit and differentiable.

    Attributes:
        frame_edges: The edge above each frame but the root, in the order of ``names``.
        topology: Names, parents and layout; static, hashable, equal by value.

    As a pytree a tree's children are its edges, and their keys the frames' names: the path of a leaf reads
    ``['camera'].placement.translation``, so whatever stores numbers by their paths keeps each with its frame.
    """

    frame_edges: tuple[Edge, ...]
    topology: Topology

    def tree_flatten(self) -> tuple[tuple[Edge, ...], Topology]:
        """Return the edges, and the topology (for JAX), as programs see it where numbers are traced."""
        return self.frame_edges, self.topology if not self.topology.notes or self.is_known else self.topology.plain

    def tree_flatten_with_keys(self) -> tuple[list[tuple[Any, Edge]], Topology]:
        """Return the edges with the names of their frames, and the topology (for JAX)."""
        return list(zip(self.topology.keys, self.frame_edges, strict=True)), self.tree_flatten()[1]

    @classmethod
    def tree_unflatten(cls, topology: Topology, edges: Any) -> Self:
        """Return the tree of some edges (for JAX)."""
        return cls(tuple(edges), topology)

    def edge_of(self, frame: int) -> Edge:
        """Return the edge above a frame given by its index, which is not the root's."""
        return self.frame_edges[frame - 1]

    def numbers(self, frames: Sequence[int]) -> tuple[Any, ...]:
        """Return the numbers of the edges above frames, all of one family, leaf by leaf: arrays [..., n_frames, k]."""
        if not self.is_known:
            return stack([self.edge_of(frame) for frame in frames])
        locations = self.topology.locations
        group, rows = locations[frames[0]][0], np.array([locations[frame][1] for frame in frames])
        return tuple(rows_of(column, rows) for column in self.family(group))

    def family(self, group: int) -> tuple[Any, ...]:
        """Return the numbers of all edges of a family, as ``stored`` keeps them: once, as NumPy arrays, where all are known."""
        make = lambda: stored([self.edge_of(frame) for frame in self.topology.members[group]])  # noqa: E731
        return self.held(f"stacked {group}", make) if self.is_known else make()

    def together(self, group: int) -> Edge:
        """Return the edges of a family that does not stack as one edge: the edge itself where there is one."""
        edges = [self.edge_of(frame) for frame in self.topology.members[group]]
        if len(edges) == 1:
            return edges[0].bare()
        return self.held(f"together {group}", lambda: edges[0].together(edges)) if self.is_known else edges[0].together(edges)

    @functools.cached_property
    def distinct_edges(self) -> tuple[Edge, ...]:
        """The edges, each once: a large tree may be made of a few that stand above many frames."""
        return tuple({id(edge): edge for edge in self.frame_edges}.values())

    @property
    def is_known(self) -> bool:
        """Whether all numbers of the tree are known, outside any trace."""
        return self.held("is_known", lambda: all(map(is_concrete, jax.tree.leaves(self.distinct_edges))))

    @property
    def dtype(self) -> Any:
        """Float dtype of the tree's numbers: JAX's default where it has none."""
        return self.held("dtype", lambda: float_dtype(self.distinct_edges))

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Batch axes of the tree's own numbers, broadcast: () unless some edges hold a batch of numbers."""
        return self.held("batch_shape", self._batch_shape)

    def _batch_shape(self) -> tuple[int, ...]:
        leaves = jax.tree.leaves([edge for edge in self.distinct_edges if edge.stackable])
        others = {edge.batch_shape for edge in self.distinct_edges if not edge.stackable}
        return np.broadcast_shapes(*{np.shape(leaf)[:-1] for leaf in leaves}, *others)

    def with_edge(self, name: str, edge: Edge) -> Self:
        """Return a tree with the numbers of one edge replaced by those of an edge of the same family; nothing retraces.

        Raises:
            UnknownFrameError: No such frame.
            EdgeError: The new edge is of another family, follows another joint or has other candidates; build another tree for that.
        """
        frame, old = self.topology.index(name), self.edge(name)
        if not isinstance(edge, Edge):
            raise EdgeError(f"frame {name!r}: expected an edge, found {type(edge).__name__}")
        fresh = like(edge, old)
        if fresh is None:
            raise EdgeError(f"frame {name!r}: the edge given cannot take the place of {old.describe()}: {differs(edge, old)}")
        _check_wiring(name, edge, old)
        return replace(self, frame_edges=(*self.frame_edges[: frame - 1], fresh, *self.frame_edges[frame:]))

    def astype(self, dtype: Any) -> Self:
        """Return the tree with its float numbers converted, e.g. to compute in float32."""
        converted = {id(edge): edge.astype(dtype) for edge in self.distinct_edges}
        return replace(self, frame_edges=tuple(converted[id(edge)] for edge in self.frame_edges))

    def parameter_names(self, *patterns: str) -> tuple[str, ...]:
        """Return the names of the tree's parameters, in the order of its leaves.

        Args:
            patterns: Names, beginnings of names that end before a dot, or patterns with ``*``, ``?`` and ``[...]``, as for ``mask``.
                Default: all.

        Raises:
            FrameError: A pattern fits no parameter.
        """
        return tuple(name for name, chosen in zip(self._names, self._chosen(patterns or ("*",)), strict=True) if chosen)

    def mask(self, *patterns: str) -> Self:
        """Return a tree of the same structure with True for the parameters chosen and False for the others, as optax and equinox take it.

        Args:
            patterns: ``"camera.placement"`` for a field with all that it holds, ``"camera"`` for a frame, ``"arm/*.axis"`` for many.

        Raises:
            FrameError: A pattern fits no parameter; close names are suggested.

        Example:
            >>> import jax, jaxframes as jf
            >>> b = jf.TreeBuilder()
            >>> b.add("camera", parent="world", edge=jf.edges.Fixed())
            >>> jax.tree.leaves(b.build().mask("camera.transform.translation"))
            [False, True]
        """
        return jax.tree.unflatten(jax.tree.structure(self), self._chosen(patterns))

    def get(self, name: str) -> Any:
        """Return a parameter, or a field with all that it holds: an array, or a value such as a ``Transform``.

        Args:
            name: ``"camera.placement"``, ``"camera.placement.translation"``, ``"arm/j1.limits"``, or a frame's name for its edge.

        Raises:
            UnknownFrameError: No frame has that name.
            FrameError: Its edge has no such field.
        """
        frame, fields = self._split(name)
        return functools.reduce(lambda value, field: _field(value, field, name), fields, self.edge_of(frame))

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """Return a tree with parameters replaced by name; nothing retraces, and derivatives by the values are exact.

        Args:
            values: For each name (as for ``get``) an array-like [..., k] or a value of the same kind; batch axes may lead. Limits are plain
                numbers.

        Raises:
            UnknownFrameError: A name begins with no frame's.
            FrameError: A frame's edge has no such field.
            EdgeError: A field names other frames or joints (``joint`` of a ``Mimic``, ``candidates``): build another tree for that.
            ShapeError: A value does not fit its parameter.
        """
        edges = list(self.frame_edges)
        for name, value in values.items():
            frame, fields = self._split(name)
            if frame == 0:
                raise FrameError(f"{name!r} is the root, which hangs on nothing and has no parameters")
            edges[frame - 1] = _replaced(edges[frame - 1], fields, value, name)
            _check_wiring(self.names[frame], edges[frame - 1], self.frame_edges[frame - 1])
        return replace(self, frame_edges=tuple(edges))

    def with_properties(self, properties: Mapping[str, Mapping[str, Any]]) -> Self:
        """Return a tree in which frames have other properties; nothing compiles again, neither queries nor programs of your own.

        They are for the host: ``tree.properties`` in a program, and of a tree that comes out of one, holds those that the tree was built
        with.
        A builder, an extracted tree and JSON take them over.

        Args:
            properties: For each frame its new properties, as ``TreeBuilder.add`` takes them, in place of all that it had.

        Raises:
            UnknownFrameError: No such frame.
            EdgeError: A value is none that properties hold.
            FrameError: The tree's numbers are traced.
        """
        if not self.is_known:
            raise FrameError("with_properties is for the host: this tree's numbers are traced; set them outside of jit, grad and vmap")
        for name in properties:
            self.topology.index(name)
        fresh = {name: freeze(held, f"frame {name!r}") for name, held in properties.items()}
        return replace(self, topology=replace(self.topology, notes=tuple({**dict(self.topology.notes), **fresh}.items())))

    @functools.cached_property
    def _names(self) -> tuple[str, ...]:
        paths = jax.tree_util.tree_flatten_with_path(self)[0]
        return tuple(jax.tree_util.keystr(path, simple=True, separator=".") for path, _ in paths)

    def _chosen(self, patterns: tuple[str, ...]) -> list[bool]:
        chosen = [False] * len(self._names)
        for pattern in patterns:
            fits = [name == pattern or name.startswith(f"{pattern}.") for name in self._names]
            if not any(fits):
                fits = [fnmatch.fnmatchcase(name, pattern) or fnmatch.fnmatchcase(name, f"{pattern}.*") for name in self._names]
            if not any(fits):
                raise FrameError(
                    f"no parameter is called {pattern!r} or fits it.{suggest(pattern, self._names)} See tree.parameter_names()"
                )
            chosen = [a or b for a, b in zip(chosen, fits, strict=True)]
        return chosen

    def _split(self, name: str) -> tuple[int, tuple[str, ...]]:
        """Return the frame that a name begins with, the longest that fits, and the fields that follow."""
        index, parts = self.topology.index_of, name.split(".")
        for count in range(len(parts), 0, -1):
            frame = ".".join(parts[:count])
            if frame in index:
                return index[frame], tuple(parts[count:])
        raise UnknownFrameError(f"{name!r} does not begin with the name of a frame.{suggest(parts[0], self.names)}")


def _check_wiring(frame: str, new: Edge, old: Edge) -> None:
    """Refuse an edge that names other frames or joints than the one whose place it takes: the topology is compiled for those."""
    ours, theirs = new.wiring(), old.wiring()
    for field in theirs:
        if ours.get(field) != theirs[field]:
            raise EdgeError(
                f"frame {frame!r}: {field} of its edge would be {ours.get(field)!r} instead of {theirs[field]!r}, and the tree is "
                "compiled for that; change it in a builder: jf.TreeBuilder.from_tree(tree)"
            )


def _field(value: Any, field: str, name: str) -> Any:
    """Return a field of an edge or value, or an entry of a tuple; ``name`` is what the user asked for."""
    if isinstance(value, tuple) and field.isdecimal() and int(field) < len(value):
        return value[int(field)]
    if isinstance(value, Mapping) and field in value:
        return value[field]
    known = [str(i) for i in range(len(value))] if isinstance(value, tuple) else list(map(str, value)) if isinstance(value, Mapping) else []
    if dataclasses.is_dataclass(value):
        known = [f.name for f in dataclasses.fields(value)]
    if field not in known or isinstance(value, (tuple, Mapping)):
        raise FrameError(f"{name!r}: there is no field {field!r} in {value!r}.{suggest(field, [f for f in known if f != 'kind'])}")
    return getattr(value, field)


def _replaced(value: Any, fields: tuple[str, ...], new: Any, name: str) -> Any:
    """Return a value in which what a path of fields leads to is replaced."""
    if not fields:
        return _fitted(value, new, name)
    first, *rest = fields
    inner = _replaced(_field(value, first, name), tuple(rest), new, name)
    if isinstance(value, tuple):
        items = [inner if i == int(first) else item for i, item in enumerate(value)]
        return jax.tree.unflatten(jax.tree.structure(value, is_leaf=lambda x: x is not value), items)  # a named tuple stays one
    if isinstance(value, Mapping):
        return {**value, first: inner}
    if not isinstance(value, Edge):
        return replace(value, **{first: inner})
    if first not in value.parameter_fields():
        inner = value.checked_fact(first, inner)
    return value.replace(**{first: inner})


def _fitted(old: Any, new: Any, name: str) -> Any:
    """Return a new value in the structure and dtypes of an old one."""
    leaves, structure = jax.tree.flatten(old)
    if not leaves or not all(isinstance(leaf, (jax.Array, np.ndarray)) for leaf in leaves):
        return new
    if jax.tree.structure(new) == structure:
        given = jax.tree.leaves(new)
    elif len(leaves) == 1:
        given = [as_float(new)]
    else:
        raise ShapeError(f"{name!r} takes a value such as {old!r}, found {new!r}")
    given = [jnp.asarray(b)[None] if np.ndim(b) == 0 and a.shape[-1] == 1 else jnp.asarray(b) for a, b in zip(leaves, given, strict=True)]
    for before, after in zip(leaves, given, strict=True):
        if after.ndim == 0 or after.shape[-1] != before.shape[-1]:
            raise ShapeError(f"{name!r} takes arrays [..., {before.shape[-1]}], found shape {after.shape}")
    return jax.tree.unflatten(structure, [b.astype(a.dtype) for a, b in zip(leaves, given, strict=True)])
