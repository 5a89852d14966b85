"""Reference epochs of edges as numbers in two parts: read from a user, and the time past them."""

from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.edges.base import Edge, Inputs
from jaxframes.errors import EdgeError, FrameError
from jaxframes.numerics.two_part import two_sum
from jaxframes.time.epoch import Epoch


def two_part_epoch(value: Any, family_name: str) -> jax.Array:
    """Return an epoch [...] as numbers in two parts [..., 2], seconds past J2000 TDB (EdgeError)."""
    try:
        epoch = Epoch.from_text(value) if isinstance(value, str) else Epoch.from_et(value)
    except FrameError as error:
        raise EdgeError(f"{family_name}(epoch=...): {error}") from None
    return jnp.stack(jnp.broadcast_arrays(jnp.asarray(epoch.hi), jnp.asarray(epoch.lo)), -1)


def since_epoch(edge: Edge, inputs: Inputs, epoch: jax.Array) -> jax.Array:
    """Return the seconds from an edge's epoch to the state's time [...]; the difference loses nothing before it is rounded.

    Args:
        edge: The edge, for the message where the state has no time.
        inputs: What it reads.
        epoch: Its epoch [..., 2] in two parts.

    Raises:
        MissingInputError: The state has no time.
    """
    hi, lo = map(jnp.asarray, inputs.epoch_for(edge))
    since_hi, since_lo = (jnp.asarray(part, hi.dtype) for part in inputs.components(epoch))
    coarse, error = two_sum(*jnp.broadcast_arrays(hi, -since_hi))
    return coarse + (error + (lo - since_lo))
