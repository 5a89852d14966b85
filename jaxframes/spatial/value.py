"""What all value types of geometry share: printing, and linear algebra where it has a meaning."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, ClassVar, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics.batch import Batched
from jaxframes.numerics.components import V3, Quat, rotate
from jaxframes.numerics.lift import lift
from jaxframes.staging.arrays import is_concrete

B = TypeVar("B", bound="Based")
L = TypeVar("L", bound="LinearValue")


class Value(Batched):
    """A frozen dataclass whose leaves are arrays ``[..., k]``; leading axes are batch axes and broadcast.

    Equality is identity, as for arrays there is no one answer; see ``allclose``.
    """

    def __repr__(self) -> str:
        parts = ", ".join(f"{f.name}={_shown(getattr(self, f.name))}" for f in fields(self) if f.repr)  # type: ignore[arg-type]
        try:
            batch = f", shape={self.shape}" if self.shape else ""
        except (AttributeError, TypeError, ValueError, IndexError):
            batch = ""
        return f"{type(self).__name__}({parts}{batch})"


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
