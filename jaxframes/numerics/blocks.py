"""Blocks: when a large batch is worked piece by piece, in pieces that the cache holds."""

from typing import Any

import jax
from jax.sharding import AxisType


def may_block(array: Any) -> bool:
    """Return whether a batch lies on one device, so that it may be cut into blocks on a CPU.

    A loop over blocks of a batch that is spread over devices would gather it on each. Within ``jax.shard_map`` a batch is one device's
    share. Elsewhere a batch may turn out to be spread where there are several CPU devices: then none is cut.
    """
    mesh = jax.typeof(array).sharding.mesh
    if not mesh.empty:
        return all(kind == AxisType.Manual for kind in mesh.axis_types)
    return jax.local_device_count("cpu") == 1
