"""Operations of our own: computations that bring their own derivative and their own way of taking an axis of ``vmap``.

``jax.custom_jvp`` and ``jax.custom_batching.custom_vmap`` would do the same, but lose their rules inside loops: where reverse mode meets a
``scan``, JAX keeps of such a function only what it computes, and a second derivative then fails or is that of the arithmetic. An
operation is a primitive, which keeps its rules wherever it is.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import jax
import jax.core
import jax.numpy as jnp
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from jaxframes.numerics.layout import is_explicit, is_manual

Arrays = Sequence[jax.Array]


class Operation(Protocol):
    """What an operation says of itself; all arrays are leaves, as a flat sequence."""

    def compute(self, *arrays: jax.Array) -> Arrays:
        """Return the results."""
        ...

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        """Return the shapes and dtypes of the results, from anything that has the arrays' shapes and dtypes."""
        ...

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        """Return the results and their tangents, None for those that are zero."""
        ...

    def mapped(self, count: int, axes: Sequence[int | None], *arrays: jax.Array) -> Arrays:
        """Return the results for arrays of which some have a further leading axis (0 in ``axes``); so have all results."""
        ...


def run(operation: Operation, *arrays: jax.Array) -> Arrays:
    """Return the results of an operation."""
    return _operation.bind(*arrays, operation=operation)


class Mapped:
    """An operation over a further axis, element by element."""

    def __init__(self, operation: Operation, count: int, axes: Sequence[int | None]):
        self._operation, self._count, self._axes = operation, count, tuple(axes)

    def _over(self, function: Callable[..., Any], axes: Any) -> Callable[..., Any]:
        return jax.vmap(function, in_axes=axes, axis_size=self._count)

    def compute(self, *arrays: jax.Array) -> Arrays:
        """See ``Operation``."""
        return self._over(self._operation.compute, self._axes)(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        """See ``Operation``."""
        one = (a if axis is None else jax.ShapeDtypeStruct(a.shape[1:], a.dtype) for a, axis in zip(arrays, self._axes, strict=True))
        return [jax.ShapeDtypeStruct((self._count, *r.shape), r.dtype) for r in self._operation.results(*one)]

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        """See ``Operation``."""
        known = [i for i, tangent in enumerate(tangents) if tangent is not None]

        def one(primals: Arrays, given: Arrays) -> Any:
            full: list[jax.Array | None] = [None] * len(primals)
            for i, tangent in zip(known, given, strict=True):
                full[i] = tangent
            return self._operation.derivative(primals, full)

        # A tangent has the axis of its primal.
        return self._over(one, (self._axes, tuple(self._axes[i] for i in known)))(tuple(primals), tuple(tangents[i] for i in known))

    def mapped(self, count: int, axes: Sequence[int | None], *arrays: jax.Array) -> Arrays:
        """See ``Operation``."""
        return run(Mapped(self, count, axes), *arrays)


def elementwise(operation: Operation) -> Callable[..., Arrays]:
    """Return the ``mapped`` of an operation that takes a further axis element by element."""
    return lambda count, axes, *arrays: run(Mapped(operation, count, axes), *arrays)


def with_changes(function: Callable[..., Any], primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Any, Any]:
    """Return a function's results and their tangents, from those of its arguments that are not None."""
    known = [i for i, tangent in enumerate(tangents) if tangent is not None]

    def of_known(*given: jax.Array) -> Any:
        full = list(primals)
        for i, value in zip(known, given, strict=True):
            full[i] = value
        return function(*full)

    return jax.jvp(of_known, tuple(primals[i] for i in known), tuple(tangents[i] for i in known))


def changes_of(function: Callable[..., Any], primals: Arrays, tangents: Sequence[jax.Array | None]) -> Any:
    """Return the tangents of a function's results, from those of its arguments that are not None."""
    return with_changes(function, primals, tangents)[1]


_operation = Primitive("operation")
_operation.multiple_results = True
_operation.def_impl(lambda *arrays, operation: jax.jit(operation.compute)(*arrays))
mlir.register_lowering(_operation, mlir.lower_fun(lambda *arrays, operation: operation.compute(*arrays), multiple_results=True))


@_operation.def_abstract_eval
def _kinds(*kinds: Any, operation: Operation) -> Sequence[Any]:
    if any(is_explicit(kind) or is_manual(kind) for kind in kinds):  # how results lie on a mesh follows from what they are made of
        return jax.make_jaxpr(operation.compute)(*kinds).out_avals
    return [jax.core.ShapedArray(r.shape, r.dtype) for r in operation.results(*kinds)]


def _derivative(primals: Arrays, tangents: Sequence[Any], *, operation: Operation) -> tuple[Arrays, Sequence[Any]]:
    given = [None if isinstance(tangent, ad.Zero) else tangent for tangent in tangents]
    results, changes = operation.derivative(primals, given)
    zeros = (ad.Zero(jax.typeof(r).to_tangent_aval()) for r in results)
    return results, [zero if change is None else change for zero, change in zip(zeros, changes, strict=True)]


def _batched(arrays: Arrays, axes: Sequence[int | None], *, operation: Operation) -> tuple[Arrays, Sequence[int]]:
    count = next(a.shape[axis] for a, axis in zip(arrays, axes, strict=True) if axis is not None)
    moved = (a if axis is None else jnp.moveaxis(a, axis, 0) for a, axis in zip(arrays, axes, strict=True))
    results = operation.mapped(count, [None if axis is None else 0 for axis in axes], *moved)
    return results, [0] * len(results)


ad.primitive_jvps[_operation] = _derivative
batching.primitive_batchers[_operation] = _batched


def anywhere(condition: jax.Array) -> jax.Array:
    """Return whether a condition holds anywhere: over all axes, and over those of every ``vmap`` around it.

    So a ``cond`` on it stays one under ``vmap``, instead of becoming a select of both branches.
    """
    return _anywhere.bind(condition)


_anywhere = Primitive("anywhere")
_anywhere.def_impl(jax.jit(jnp.any))
_anywhere.def_abstract_eval(lambda condition: jax.make_jaxpr(jnp.any)(condition).out_avals[0])
mlir.register_lowering(_anywhere, mlir.lower_fun(jnp.any, multiple_results=False))
batching.primitive_batchers[_anywhere] = lambda arrays, axes: (anywhere(arrays[0]), None)
