"""Operations over a batch that a CPU works block after block, and that take a vmapped axis as a further axis of their batch."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Self

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.kinematics.state_rate import batch_of
from jaxframes.staging.operation import Arrays, Operation, run
from jaxframes.staging.sharding import like

SIZES = (4, 3, 3, 3, 3, 3)
"""Columns of quaternion, translation and the halves of velocity and acceleration."""


class BatchOperation(Operation):
    """An operation of a tree's numbers and a state's arrays, over a batch.

    Attributes:
        ranks: For each array, how many axes at its end are none of the batch; -1 for numbers of the tree.
        shape: Batch shape.
    """

    ranks: tuple[int, ...]
    shape: tuple[int, ...]

    def over(self, shape: tuple[int, ...]) -> Self:
        """Return the operation over a batch of another shape."""
        return replace(self, shape=shape)  # pyright: ignore[reportArgumentType]

    def in_blocks(
        self, size: int, start: Sequence[jax.Array], write: Callable[[Self, Arrays, Arrays, jax.Array], Arrays], arrays: Arrays
    ) -> list[jax.Array]:
        """Return the results block after block. The last block starts early enough to be whole.

        Args:
            size: Samples a block.
            start: What the results are written into, the batch as one leading axis.
            write: Returns the results, of the operation for one block, that block's arrays, the results before, and where it starts.
            arrays: What the operation is of.
        """
        count, inner = math.prod(self.shape), self.over((size,))
        flat = [self._flat(a, rank) for a, rank in zip(arrays, self.ranks, strict=True)]

        def block(i: jax.Array, out: Arrays) -> Arrays:
            at = jnp.minimum(i * size, count - size)
            own = [lax.dynamic_slice_in_dim(a, at, size) if is_batch else a for a, is_batch in flat]
            return tuple(write(inner, own, out, at))

        whole = lax.fori_loop(0, -(-count // size), block, tuple(like(o, *arrays) for o in start))
        return [w.reshape(r.shape) for w, r in zip(whole, self.results(*arrays), strict=True)]

    def _flat(self, array: jax.Array, rank: int) -> tuple[jax.Array, bool]:
        """Return an array with its batch axes as one, and True; or without batch axes, and False, where it is the same for all samples."""
        if rank < 0:
            return array, False
        tail = array.shape[array.ndim - rank :]
        if math.prod(batch_of(array, rank)) == 1:
            return array.reshape(tail), False
        return jnp.broadcast_to(array, (*self.shape, *tail)).reshape(-1, *tail), True

    def mapped(self, count: int, axes: tuple[int | None, ...], *arrays: jax.Array) -> Arrays:
        """Take a vmapped axis as a further batch axis, unless trees differ."""
        if any(axis is not None and rank < 0 for axis, rank in zip(axes, self.ranks, strict=True)):
            return super().mapped(count, axes, *arrays)
        aligned: list[Any] = []
        for array, axis, rank in zip(arrays, axes, self.ranks, strict=True):
            missing = len(self.shape) - (array.ndim - rank - 1)
            aligned.append(array if axis is None else lax.expand_dims(array, range(1, 1 + missing)))
        return run(self.over((count, *self.shape)), *aligned)
