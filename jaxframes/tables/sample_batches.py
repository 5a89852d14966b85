"""Batches of samples at the same times: each trajectory of the batch at the epochs that belong to it, by ``jax.vmap``."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.edges.base import Inputs
from jaxframes.numerics.steps import Step

Samples = Mapping[str, jax.Array]


def over_batch(
    steps_of: Callable[[Samples, Inputs], Sequence[Step]], samples: Samples, batch: tuple[int, ...], inputs: Inputs
) -> tuple[Step, ...]:
    """Return the steps of trajectories with batch axes, broadcast against the epochs as everywhere.

    Args:
        steps_of: Returns the steps of one trajectory, of samples [n, k] by name and inputs.
        samples: Samples [..., n, k].
        batch: Their batch axes, broadcast.
        inputs: What the edge reads; its time has the rank of the batch, or none.
    """
    assert inputs.time is not None
    padded = (1,) * (inputs.batch_rank - len(batch)) + batch
    hi, lo = map(jnp.asarray, inputs.time)
    shape = jnp.broadcast_shapes(hi.shape, lo.shape, padded)
    own = [axis for axis, size in enumerate(padded) if size > 1]
    count, rest = math.prod(batch), [size for axis, size in enumerate(shape) if axis not in own]
    times = [jnp.moveaxis(jnp.broadcast_to(part, shape), own, range(len(own))).reshape(count, *rest) for part in (hi, lo)]
    flat = {name: jnp.broadcast_to(array, (*batch, *array.shape[-2:])).reshape(count, *array.shape[-2:]) for name, array in samples.items()}
    made: list[Any] = []

    def one(samples: Samples, hi: jax.Array, lo: jax.Array) -> list[jax.Array]:
        leaves, structure = jax.tree.flatten(tuple(steps_of(samples, inputs._replace(time=(hi, lo), batch_rank=hi.ndim))))
        made[:] = structure, [leaf if isinstance(leaf, float) else None for leaf in leaves]
        return [leaf for leaf in leaves if not isinstance(leaf, float)]

    found = iter(jax.vmap(one)(flat, *times))
    structure, known = made
    back = lambda array: jnp.moveaxis(array.reshape(*(shape[axis] for axis in own), *rest), range(len(own)), own)  # noqa: E731
    return jax.tree.unflatten(structure, [back(next(found)) if value is None else value for value in known])
