"""Batch axes of values: shape, indexing, iterating, reshaping, joining; shared by everything that is a tree of arrays with leading axes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.errors import ShapeError
from jaxframes.staging.arrays import common_float, is_concrete, widest

Self = TypeVar("Self", bound="Batched")


def tag(name: str) -> Any:
    """Return the static field that tells a class's tree structure from that of another class with as many leaves.

    JAX 0.10 takes two registered dataclasses without static fields for one structure, and a jitted function may then run what it
    compiled for the other class (google/jax: ``PyTreeDef`` equality; a test shows it).
    """
    return field(default=name, kw_only=True, repr=False, metadata={"static": True})


class Batched:
    """A frozen dataclass whose leaves are arrays ``[..., own axes]``; the leading axes are batch axes and broadcast.

    Constructors check nothing: leaves may be tracers, shapes or axis numbers while JAX handles the value as a tree.
    """

    __array_ufunc__ = None  # so that a NumPy array on the left lets this class answer
    __array_priority__ = 1000
    own_axes: ClassVar[int] = 1
    """How many axes at the end of each leaf are not batch axes."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape: the leading axes, broadcast over the leaves."""
        return jnp.broadcast_shapes(*(np.shape(leaf)[: np.ndim(leaf) - own] for leaf, own in self._with_own()))

    def own_axes_of_leaves(self) -> list[int]:
        """Return, for each leaf, how many axes at its end are not batch axes."""
        return [self.own_axes] * len(jax.tree.leaves(self))

    def _with_own(self) -> list[tuple[Any, int]]:
        return list(zip(jax.tree.leaves(self), self.own_axes_of_leaves(), strict=True))

    def _mapped(self: Self, function: Callable[[Any, int], Any]) -> Self:
        """Return a copy whose leaves are what a function makes of each leaf and the number of its own axes."""
        return jax.tree.unflatten(jax.tree.structure(self), [function(leaf, own) for leaf, own in self._with_own()])

    @property
    def ndim(self) -> int:
        """Number of batch axes."""
        return len(self.shape)

    @property
    def dtype(self) -> Any:
        """Promoted dtype of the leaves."""
        return widest(*(leaf.dtype for leaf in jax.tree.leaves(self)))

    def replace(self: Self, **changes: Any) -> Self:
        """Return a copy with the fields given replaced."""
        return replace(self, **changes)  # type: ignore[type-var]

    def astype(self: Self, dtype: Any) -> Self:
        """Return a copy with every leaf of the dtype given."""
        return jax.tree.map(lambda leaf: jnp.asarray(leaf).astype(dtype), self)

    def broadcast_to(self: Self, shape: Sequence[int]) -> Self:
        """Return a copy whose leaves all have the batch shape given."""
        rank = len(shape)
        return self._mapped(lambda leaf, own: jnp.broadcast_to(_ranked(leaf, rank + own), (*shape, *_tail(leaf, own))))

    def reshape(self: Self, *shape: Any) -> Self:
        """Return a copy with the batch axes reshaped: numbers, or one tuple of them."""
        wanted = tuple(shape[0]) if len(shape) == 1 and isinstance(shape[0], Sequence) else shape
        return self.broadcast_to(self.shape)._mapped(lambda leaf, own: leaf.reshape(*wanted, *_tail(leaf, own)))

    def __getitem__(self: Self, index: Any) -> Self:
        """Return a part of the batch: any index that NumPy takes, over the batch axes only.

        Raises:
            IndexError: More indices than batch axes, or a known integer, or one in an array of them, outside its axis. What a traced
                index does there is JAX's own rule, which clamps.
        """
        shape = self.shape
        index = _checked(index if isinstance(index, tuple) else (index,), shape)
        dots = () if any(item is Ellipsis for item in index) else (Ellipsis,)

        def part(leaf: Any, own: int) -> Any:
            return leaf[(*index, *dots, *[slice(None)] * own) if own else index]

        return self.broadcast_to(shape)._mapped(part)

    def __len__(self) -> int:
        if not self.shape:
            raise TypeError(f"{_article(self)} without batch axes has no length")
        return self.shape[0]

    def __bool__(self) -> bool:
        return True  # as of any object; not by its length

    def __iter__(self: Self) -> Iterator[Self]:
        if not self.shape:
            raise TypeError(f"{_article(self)} without batch axes cannot be iterated over")
        return (self[i] for i in range(self.shape[0]))


def _article(value: Any) -> str:
    name = type(value).__name__
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"


def _tail(leaf: Any, own: int) -> tuple[int, ...]:
    shape = np.shape(leaf)
    return shape[len(shape) - own :]


def _ranked(leaf: Any, rank: int) -> jax.Array:
    """Return a leaf with its batch axes padded on the left until it has a rank."""
    leaf = jnp.asarray(leaf)
    return lax.expand_dims(leaf, range(rank - leaf.ndim)) if leaf.ndim < rank else leaf


def _axes_of(item: Any) -> int:
    """Return how many axes one entry of an index takes."""
    if item is None or item is Ellipsis:
        return 0
    return np.ndim(item) if getattr(item, "dtype", None) == np.bool_ and np.ndim(item) else 1


def _checked(index: tuple[Any, ...], shape: tuple[int, ...]) -> tuple[Any, ...]:
    """Return an index after the checks that JAX's clamping indexing omits."""
    used = sum(_axes_of(item) for item in index)
    if used > len(shape):
        raise IndexError(f"{used} indices for {len(shape)} batch axes; the components of a value are read from its fields")
    axis = 0
    for i, item in enumerate(index):
        if item is Ellipsis:
            axis = len(shape) - sum(_axes_of(later) for later in index[i + 1 :])
            continue
        outside = _outside(item, shape[axis]) if _axes_of(item) == 1 else None
        if outside is not None:
            raise IndexError(f"index {outside} is outside batch axis {axis} of size {shape[axis]}")
        axis += _axes_of(item)
    return index


def _outside(item: Any, size: int) -> int | None:
    """Return an integer of an index's entry that lies outside an axis, None where there is none or the numbers are traced."""
    if isinstance(item, bool) or not is_concrete(item):
        return None
    if not isinstance(item, int) and getattr(getattr(item, "dtype", None), "kind", "") not in ("i", "u"):
        return None
    numbers = np.asarray(item)
    wrong = numbers[(numbers < -size) | (numbers >= size)]
    return int(wrong.flat[0]) if wrong.size else None


def _values_of_one_type(values: Sequence[Any], kind: str) -> list[Any]:
    values = list(values)
    if not values or any(jax.tree.structure(v) != jax.tree.structure(values[0]) for v in values):
        kinds = sorted({type(v).__name__ for v in values})
        raise ShapeError(f"{kind} needs values of one type, at least one; found {', '.join(kinds) or 'none'}")
    return values


def stack(values: Sequence[Self], axis: int = 0) -> Self:
    """Return one value that holds several along a new batch axis; their batch shapes broadcast.

    Raises:
        ShapeError: No values, or values of several types.
    """
    values = _values_of_one_type(values, "stack")
    shape = np.broadcast_shapes(*(v.shape for v in values))
    axis = axis + len(shape) + 1 if axis < 0 else axis
    return jax.tree.map(lambda *leaves: jnp.stack(_common(*leaves), axis), *(v.broadcast_to(shape) for v in values))


def concatenate(values: Sequence[Self], axis: int = 0) -> Self:
    """Return one value that joins several along a batch axis that they have.

    Raises:
        ShapeError: No values, or values of several types.
    """
    values = [v.broadcast_to(v.shape) for v in _values_of_one_type(values, "concatenate")]
    axis = axis + values[0].ndim if axis < 0 else axis
    return jax.tree.map(lambda *leaves: jnp.concatenate(_common(*leaves), axis), *values)


def _common(*leaves: Any) -> tuple[jax.Array, ...]:
    """Return leaves of one dtype: floats of their promoted one, whole numbers as they are."""
    if all(jnp.issubdtype(jnp.result_type(leaf), jnp.integer) for leaf in leaves):
        return tuple(map(jnp.asarray, leaves))
    return common_float(*leaves)
