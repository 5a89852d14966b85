"""Blocks: work over a batch that a CPU does block after block, whatever is summed over the batch summed on the way.

A chain of stages over a large batch goes through memory at each of them; within a block of some hundred samples it stays in the cache.
Derivatives by numbers that are the same for all samples are sums over the batch: block after block they need no array of the batch's size.

Work is a primitive of its own. It differentiates, transposes and maps as what it does; a vmapped axis becomes its batch.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax
from jax.interpreters import ad, batching, mlir

from jaxframes.staging.internals import Primitive
from jaxframes.staging.operation import Arrays, changes_of
from jaxframes.staging.sharding import like, may_block

SIZES = (256, 4096)
"""Least and most samples of a block: the largest divisor of the batch between them is taken; where there is none, the batch is not cut."""


class Work:
    """A function of arrays that is linear or smooth in them: a frozen dataclass that holds no arrays, equal by value.

    Some of its arguments and results have the batch as their leading axis, of any size; other results are sums over the batch.
    """

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        """Return the results."""
        raise NotImplementedError


@dataclass(frozen=True)
class Batch:
    """Where the batch is.

    Attributes:
        count: Samples, the leading axis of what has one.
        inputs: Which arguments have it.
        results: Which results have it; the others are sums over the batch.
    """

    count: int
    inputs: tuple[bool, ...]
    results: tuple[bool, ...]


def run_work(work: Work, batch: Batch | None, *arrays: jax.Array) -> Sequence[jax.Array]:
    """Return what some work gives.

    Args:
        work: The work.
        batch: Where the batch is; None without one (``jax.vmap`` may bring it).
        arrays: The arguments.
    """
    return WORK.bind(*arrays, work=work, batch=batch)


WORK = Primitive("work")
WORK.multiple_results = True


@functools.lru_cache(maxsize=1024)
def _compiled(work: Work, batch: Batch | None) -> Any:
    return jax.jit(functools.partial(run_work, work, batch))


WORK.def_impl(lambda *arrays, work, batch: _compiled(work, batch)(*arrays))
WORK.def_abstract_eval(lambda *kinds, work, batch: jax.make_jaxpr(lambda *arrays: tuple(work(*arrays)))(*kinds).out_avals)


def _block_size(count: int) -> int | None:
    least, most = SIZES
    return next((size for size in range(most, least - 1, -1) if count % size == 0), None) if count > most else None


def _on_cpu(*arrays: jax.Array, work: Work, batch: Batch | None) -> Sequence[jax.Array]:
    size = None if batch is None else _block_size(batch.count)
    if batch is None or size is None or not all(map(may_block, arrays)):
        return tuple(work(*arrays))
    steps = batch.count // size
    cut = [a.reshape(steps, size, *a.shape[1:]) if own else a for a, own in zip(arrays, batch.inputs, strict=True)]

    def block(i: jax.Array, out: Sequence[jax.Array]) -> Sequence[jax.Array]:
        own = (lax.dynamic_index_in_dim(a, i, 0, keepdims=False) if is_batch else a for a, is_batch in zip(cut, batch.inputs, strict=True))
        return tuple(
            lax.dynamic_update_index_in_dim(o, part, i, 0) if is_batch else o + part
            for o, part, is_batch in zip(out, work(*own), batch.results, strict=True)
        )

    kinds = jax.eval_shape(lambda *arrays: tuple(work(*arrays)), *arrays)
    shapes = ((steps, size, *k.shape[1:]) if is_batch else k.shape for k, is_batch in zip(kinds, batch.results, strict=True))
    start = tuple(like(jnp.zeros(shape, k.dtype), *arrays) for shape, k in zip(shapes, kinds, strict=True))
    whole = lax.fori_loop(0, steps, block, start)
    return tuple(w.reshape(k.shape) for w, k in zip(whole, kinds, strict=True))


mlir.register_lowering(WORK, mlir.lower_fun(lambda *arrays, work, batch: tuple(work(*arrays))))
mlir.register_lowering(WORK, mlir.lower_fun(_on_cpu), platform="cpu")


@dataclass(frozen=True)
class _Change(Work):
    """The change of the results: of the arguments, then the tangents of some of them."""

    work: Work
    moved: tuple[int, ...]

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        count = len(arrays) - len(self.moved)
        tangents: list[jax.Array | None] = [None] * count
        for i, tangent in zip(self.moved, arrays[count:], strict=True):
            tangents[i] = tangent
        return changes_of(lambda *inputs: tuple(self.work(*inputs)), arrays[:count], tangents)


def _derivative(primals: Arrays, tangents: Sequence[Any], *, work: Work, batch: Batch | None) -> tuple[Any, Any]:
    moved = tuple(i for i, tangent in enumerate(tangents) if not isinstance(tangent, ad.Zero))
    over = batch and Batch(batch.count, (*batch.inputs, *(batch.inputs[i] for i in moved)), batch.results)
    change = run_work(_Change(work, moved), over, *primals, *(tangents[i] for i in moved))
    return run_work(work, batch, *primals), change


@dataclass(frozen=True)
class _Adjoint(Work):
    """The cotangents of the arguments in which some work is linear: of the others, then the cotangents of some results.

    Attributes:
        work: The work.
        linear: Those arguments.
        given: The results whose cotangents are given.
        kinds: Shape and dtype of each of those arguments, without the batch.
        has_batch: Whether each has the batch as its leading axis.
        sized_by: An argument of this work that has the batch as its leading axis, if any has.
    """

    work: Work
    linear: tuple[int, ...]
    given: tuple[int, ...]
    kinds: tuple[tuple[tuple[int, ...], str], ...]
    has_batch: tuple[bool, ...]
    sized_by: int | None

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        others, cotangents = arrays[: len(arrays) - len(self.given)], arrays[len(arrays) - len(self.given) :]
        size = () if self.sized_by is None else arrays[self.sized_by].shape[:1]
        moving = [
            jax.ShapeDtypeStruct((*size, *shape) if own else shape, dtype)
            for (shape, dtype), own in zip(self.kinds, self.has_batch, strict=True)
        ]

        def forward(*steps: jax.Array) -> list[jax.Array]:
            own, rest = dict(zip(self.linear, steps, strict=True)), iter(others)
            results = self.work(*(own[i] if i in own else next(rest) for i in range(len(others) + len(steps))))
            return [results[i] for i in self.given]

        return jax.linear_transpose(forward, *moving)(list(cotangents))


def _transposed(cotangents: Sequence[Any], *arrays: Any, work: Work, batch: Batch | None) -> list[Any]:
    linear = tuple(i for i, array in enumerate(arrays) if ad.is_undefined_primal(array))
    given = tuple(i for i, ct in enumerate(cotangents) if not isinstance(ct, ad.Zero))
    if not given:
        return [ad.Zero(array.aval) if i in linear else None for i, array in enumerate(arrays)]
    others = [i for i in range(len(arrays)) if i not in linear]
    inputs = [*(arrays[i] for i in others), *(cotangents[i] for i in given)]
    has_batch = tuple(batch is not None and batch.inputs[i] for i in linear)
    along = (*(batch.inputs[i] for i in others), *(batch.results[i] for i in given)) if batch else (False,) * len(inputs)
    kinds = tuple((arrays[i].aval.shape[own:], arrays[i].aval.dtype.name) for i, own in zip(linear, has_batch, strict=True))
    sized_by = next((i for i, own in enumerate(along) if own), None)
    over = batch and Batch(batch.count, along, has_batch)
    found = run_work(_Adjoint(work, linear, given, kinds, has_batch, sized_by), over, *inputs)
    back = dict(zip(linear, found, strict=True))
    return [back.get(i) for i in range(len(arrays))]


@dataclass(frozen=True)
class _Mapped(Work):
    """The work over a further axis of some arguments."""

    work: Work
    axes: tuple[int | None, ...]

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        return jax.vmap(lambda *given: tuple(self.work(*given)), in_axes=self.axes)(*arrays)


def _batched(arrays: Arrays, axes: Sequence[int | None], *, work: Work, batch: Batch | None) -> tuple[Any, Any]:
    count = next(a.shape[axis] for a, axis in zip(arrays, axes, strict=True) if axis is not None)
    moved = [a if axis is None else jnp.moveaxis(a, axis, 0) for a, axis in zip(arrays, axes, strict=True)]
    over = _Mapped(work, tuple(None if axis is None else 0 for axis in axes))
    # An axis around a batch is not cut: what is summed over the batch is wanted for each of its places.
    results = run_work(over, None, *moved) if batch else _along(over, count, moved)
    return results, [0] * len(results)


def _along(over: _Mapped, count: int, arrays: Sequence[jax.Array]) -> Sequence[jax.Array]:
    results = len(jax.eval_shape(lambda *given: tuple(over(*given)), *arrays))
    along = tuple(axis is not None for axis in over.axes)
    return run_work(over, Batch(count, along, (True,) * results) if isinstance(count, int) else None, *arrays)


ad.primitive_jvps[WORK] = _derivative
ad.primitive_transposes[WORK] = _transposed
batching.primitive_batchers[WORK] = _batched
