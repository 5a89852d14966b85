"""Operations of our own: computations that bring their own derivative and their own way of taking an axis of ``vmap``.

``jax.custom_jvp`` and ``jax.custom_batching.custom_vmap`` would do the same, but not inside loops: reverse mode through a ``scan`` refuses
a ``custom_vmap`` function, and jax 0.10 loses the rules of ``custom_jvp`` there, so that a second derivative is that of the arithmetic
(tests/staging/test_operation.py has both cases). An operation is a primitive, which keeps its rules wherever it is.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
from jax.interpreters import ad, batching, mlir

from jaxframes.staging.internals import Primitive
from jaxframes.staging.sharding import is_explicit, is_manual

Arrays = Sequence[jax.Array]


class Operation:
    """What an operation says of itself; all arrays are leaves, as a flat sequence.

    It is a frozen dataclass that holds no arrays: hashable, and equal by value.
    """

    def compute(self, *arrays: jax.Array) -> Arrays:
        """Return the results."""
        raise NotImplementedError

    def compute_on_cpu(self, *arrays: jax.Array) -> Arrays:
        """Return the same in the way that is best on CPUs."""
        return self.compute(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        """Return the shapes and dtypes of the results, from anything that has the arrays' shapes and dtypes."""
        raise NotImplementedError

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        """Return the results and their tangents, None for those that are zero."""
        raise NotImplementedError

    def mapped(self, count: int, axes: tuple[int | None, ...], *arrays: jax.Array) -> Arrays:
        """Return the results for arrays of which some have a further leading axis (0 in ``axes``); so have all results."""
        return run(Mapped(self, count, axes), *arrays)


def run(operation: Operation, *arrays: jax.Array) -> Arrays:
    """Return the results of an operation."""
    return OPERATION.bind(*arrays, operation=operation)


@dataclass(frozen=True)
class Mapped(Operation):
    """An operation over a further axis, element by element."""

    operation: Operation
    count: int
    axes: tuple[int | None, ...]

    def _over(self, function: Callable[..., Any], axes: Any) -> Callable[..., Any]:
        return jax.vmap(function, in_axes=axes, axis_size=self.count)

    def compute(self, *arrays: jax.Array) -> Arrays:
        """See ``Operation``."""
        return self._over(self.operation.compute, self.axes)(*arrays)

    def compute_on_cpu(self, *arrays: jax.Array) -> Arrays:
        """See ``Operation``."""
        return self._over(self.operation.compute_on_cpu, self.axes)(*arrays)

    def results(self, *arrays: Any) -> Sequence[jax.ShapeDtypeStruct]:
        """See ``Operation``."""
        one = (a if axis is None else jax.ShapeDtypeStruct(a.shape[1:], a.dtype) for a, axis in zip(arrays, self.axes, strict=True))
        return [jax.ShapeDtypeStruct((self.count, *r.shape), r.dtype) for r in self.operation.results(*one)]

    def derivative(self, primals: Arrays, tangents: Sequence[jax.Array | None]) -> tuple[Arrays, Sequence[jax.Array | None]]:
        """See ``Operation``."""
        known = [i for i, tangent in enumerate(tangents) if tangent is not None]

        def one(primals: Arrays, given: Arrays) -> Any:
            full: list[jax.Array | None] = [None] * len(primals)
            for i, tangent in zip(known, given, strict=True):
                full[i] = tangent
            return self.operation.derivative(primals, full)

        # A tangent has the axis of its primal.
        return self._over(one, (self.axes, tuple(self.axes[i] for i in known)))(tuple(primals), tuple(tangents[i] for i in known))


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


OPERATION = Primitive("operation")
OPERATION.multiple_results = True
mlir.register_lowering(OPERATION, mlir.lower_fun(lambda *arrays, operation: operation.compute(*arrays)))
mlir.register_lowering(OPERATION, mlir.lower_fun(lambda *arrays, operation: operation.compute_on_cpu(*arrays)), platform="cpu")


@functools.lru_cache(maxsize=1024)
def _compiled(operation: Operation) -> Callable[..., Any]:
    return jax.jit(functools.partial(OPERATION.bind, operation=operation))


@OPERATION.def_impl
def _evaluated(*arrays: jax.Array, operation: Operation) -> Arrays:
    plain = jax.config.jax_disable_jit  # pyright: ignore[reportAttributeAccessIssue]
    return operation.compute(*arrays) if plain else _compiled(operation)(*arrays)


@OPERATION.def_abstract_eval
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
    results = operation.mapped(count, tuple(None if axis is None else 0 for axis in axes), *moved)
    return results, [0] * len(results)


ad.primitive_jvps[OPERATION] = _derivative
batching.primitive_batchers[OPERATION] = _batched
