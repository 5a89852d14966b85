"""What all value types share: batch shape, indexing, joining, comparison, printing, and linear algebra where it has a meaning."""

from collections.abc import Iterator, Sequence
from dataclasses import field, fields, replace
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.errors import ShapeError
from jaxframes.numerics.boundary import common_float, is_concrete
from jaxframes.numerics.components import V3, Quat, rotate
from jaxframes.numerics.lift import lift

Self = TypeVar("Self", bound="Value")
B = TypeVar("B", bound="Based")
L = TypeVar("L", bound="LinearValue")


def tag(name: str) -> Any:
    """Return the static field that tells a class's tree structure from that of another class with as many leaves.

    JAX 0.10 takes two registered dataclasses without static fields for one structure, and a jitted function may then run what it
    compiled for the other class (google/jax: ``PyTreeDef`` equality; a test shows it).
    """
    return field(default=name, kw_only=True, repr=False, metadata={"static": True})


class Value:
    """A frozen dataclass whose leaves are arrays ``[..., k]``; leading axes are batch axes and broadcast.

    Constructors check nothing: leaves may be tracers, shapes or axis numbers while JAX handles the value as a tree. Equality is
    identity, as for arrays there is no one answer; see ``allclose``.
    """

    __array_ufunc__ = None  # so that a NumPy array on the left lets this class answer
    __array_priority__ = 1000

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape: the leading axes, broadcast over the leaves."""
        return np.broadcast_shapes(*(np.shape(leaf)[:-1] for leaf in jax.tree.leaves(self)))

    @property
    def ndim(self) -> int:
        """Number of batch axes."""
        return len(self.shape)

    @property
    def dtype(self) -> Any:
        """Promoted dtype of the leaves."""
        return jnp.result_type(*jax.tree.leaves(self))

    def replace(self: Self, **changes: Any) -> Self:
        """Return a copy with the fields given replaced."""
        return replace(self, **changes)  # type: ignore[type-var]

    def astype(self: Self, dtype: Any) -> Self:
        """Return a copy with every leaf of the dtype given."""
        return jax.tree.map(lambda leaf: jnp.asarray(leaf).astype(dtype), self)

    def broadcast_to(self: Self, shape: Sequence[int]) -> Self:
        """Return a copy whose leaves all have the batch shape given."""
        return jax.tree.map(lambda leaf: jnp.broadcast_to(_ranked(leaf, len(shape)), (*shape, leaf.shape[-1])), self)

    def reshape(self: Self, *shape: int) -> Self:
        """Return a copy with the batch axes reshaped."""
        full = self.broadcast_to(self.shape)
        return jax.tree.map(lambda leaf: leaf.reshape(*shape, leaf.shape[-1]), full)

    def __getitem__(self: Self, index: Any) -> Self:
        """Return a part of the batch: any index that NumPy takes, over the batch axes only.

        Raises:
            IndexError: More indices than batch axes, or a known integer outside its axis.
        """
        shape = self.shape
        index = _checked(index if isinstance(index, tuple) else (index,), shape)
        return jax.tree.map(lambda leaf: leaf[index], self.broadcast_to(shape))

    def __iter__(self: Self) -> Iterator[Self]:
        if not self.shape:
            raise TypeError(f"a {type(self).__name__} without batch axes cannot be iterated over")
        return (self[i] for i in range(self.shape[0]))

    def __repr__(self) -> str:
        parts = ", ".join(f"{f.name}={_shown(getattr(self, f.name))}" for f in fields(self) if f.repr)  # type: ignore[arg-type]
        try:
            batch = f", shape={self.shape}" if self.shape else ""
        except (AttributeError, TypeError, ValueError, IndexError):
            batch = ""
        return f"{type(self).__name__}({parts}{batch})"


def _ranked(leaf: Any, rank: int) -> jax.Array:
    """Return a leaf with its batch axes padded on the left to a rank."""
    leaf = jnp.asarray(leaf)
    return lax.expand_dims(leaf, range(rank + 1 - leaf.ndim)) if leaf.ndim < rank + 1 else leaf


def _axes_of(item: Any) -> int:
    """Return how many axes one entry of an index takes."""
    if item is None or item is Ellipsis:
        return 0
    return np.ndim(item) if getattr(item, "dtype", None) == np.bool_ and np.ndim(item) else 1


def _checked(index: tuple[Any, ...], shape: tuple[int, ...]) -> tuple[Any, ...]:
    """Return an index that leaves the last axis of a leaf alone, after the checks that JAX's clamping indexing omits."""
    used = sum(_axes_of(item) for item in index)
    if used > len(shape):
        raise IndexError(f"{used} indices for {len(shape)} batch axes; the components of a value are read from its fields")
    axis = 0
    for i, item in enumerate(index):
        if item is Ellipsis:
            axis = len(shape) - sum(_axes_of(later) for later in index[i + 1 :])
            continue
        if isinstance(item, (int, np.integer)) and not isinstance(item, bool) and not -shape[axis] <= item < shape[axis]:
            raise IndexError(f"index {item} is outside batch axis {axis} of size {shape[axis]}")
        axis += _axes_of(item)
    return (*index, slice(None)) if any(item is Ellipsis for item in index) else (*index, Ellipsis, slice(None))


def _shown(leaf: Any) -> str:
    """Return the text of one field: values when they are known and few, else dtype and shape."""
    if isinstance(leaf, Value):
        return repr(leaf)
    if isinstance(leaf, (jax.Array, np.ndarray)) and is_concrete(leaf) and leaf.size <= 24:
        return np.array2string(np.asarray(leaf), precision=6, suppress_small=True, separator=", ").replace("\n", "")
    if hasattr(leaf, "shape") and hasattr(leaf, "dtype"):
        return f"{leaf.dtype}{list(leaf.shape)}"
    return repr(leaf)


@lift(V3, V3, V3, V3, out=(V3, V3))
def _add(a: V3, b: V3, c: V3, d: V3) -> tuple[V3, V3]:
    return a + c, b + d


@lift(V3, V3, None, out=(V3, V3))
def _scale(a: V3, b: V3, s: jax.Array) -> tuple[V3, V3]:
    return a * s, b * s


@lift(V3, V3, None, out=(V3, V3))
def _divide(a: V3, b: V3, s: jax.Array) -> tuple[V3, V3]:
    return V3(a.x / s, a.y / s, a.z / s), V3(b.x / s, b.y / s, b.z / s)


@lift(Quat, V3, V3, out=(V3, V3))
def _turn(q: Quat, a: V3, b: V3) -> tuple[V3, V3]:
    return rotate(q, a), rotate(q, b)


class Based(Value):
    """A value whose vectors are resolved along some axes, so that a rotation can change them."""

    def change_base(self: B, rotation: Any) -> B:
        """Return the same quantity along other axes: each 3-vector turned by ``a_R_b``, from b axes to a axes.

        Observer and reference point stay.
        """
        raise NotImplementedError


class LinearValue(Based):
    """A value of two 3-vectors that forms a linear space: sums, differences, and products with numbers ``[...]``."""

    _names: ClassVar[tuple[str, str]]

    def _pair(self) -> tuple[Any, Any]:
        return getattr(self, self._names[0]), getattr(self, self._names[1])

    def _made(self: L, first: Any, second: Any) -> L:
        return type(self)(**dict(zip(self._names, (first, second), strict=True)))

    @classmethod
    def zero(cls: type[L], batch: Sequence[int] = (), dtype: Any = None) -> L:
        """Return zeros of a batch shape."""
        zeros = jnp.zeros((*batch, 3), float if dtype is None else dtype)
        return cls(**dict.fromkeys(cls._names, zeros))

    def change_base(self: L, rotation: Any) -> L:
        """Return the same quantity along other axes: both vectors turned by ``a_R_b``, from b axes to a axes.

        Observer and reference point stay.
        """
        return self._made(*_turn(rotation.wxyz, *self._pair()))

    def _operand(self, other: Any) -> bool:
        return type(other) is type(self)

    def __add__(self, other: Any) -> Any:
        return self._made(*_add(*self._pair(), *other._pair())) if self._operand(other) else NotImplemented

    def __sub__(self, other: Any) -> Any:
        return self + (-other) if self._operand(other) else NotImplemented

    def __neg__(self: L) -> L:
        return self._made(*(-jnp.asarray(v) for v in self._pair()))

    def __mul__(self, scalar: Any) -> Any:
        return NotImplemented if isinstance(scalar, Value) else self._made(*_scale(*self._pair(), scalar))

    __rmul__ = __mul__

    def __truediv__(self, scalar: Any) -> Any:
        return NotImplemented if isinstance(scalar, Value) else self._made(*_divide(*self._pair(), scalar))


def _joined(values: Sequence[Any], kind: str) -> list[Any]:
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
    values = _joined(values, "stack")
    shape = np.broadcast_shapes(*(v.shape for v in values))
    axis = axis + len(shape) + 1 if axis < 0 else axis
    return jax.tree.map(lambda *leaves: jnp.stack(common_float(*leaves), axis), *(v.broadcast_to(shape) for v in values))


def concatenate(values: Sequence[Self], axis: int = 0) -> Self:
    """Return one value that joins several along a batch axis that they have.

    Raises:
        ShapeError: No values, or values of several types.
    """
    values = [v.broadcast_to(v.shape) for v in _joined(values, "concatenate")]
    axis = axis + values[0].ndim if axis < 0 else axis
    return jax.tree.map(lambda *leaves: jnp.concatenate(common_float(*leaves), axis), *values)
