"""Layout: arrays that meet in an operation brought to one shape and, where types say how arrays lie on a mesh, to one layout.

Outside a mesh nothing is done. On a mesh with Explicit axes ``lax.select`` and ``lax.concatenate`` take only arrays that lie alike; within
``jax.shard_map`` the state of a loop must say over which axes it varies before the loop does.
"""

import math
from collections.abc import Sequence
from typing import Any

import jax
import jax.core
import jax.numpy as jnp
from jax import lax
from jax.sharding import AxisType, NamedSharding, PartitionSpec


def aligned(*arrays: jax.Array, shape: tuple[int, ...] | None = None) -> list[jax.Array]:
    """Return arrays broadcast to one shape, all lying on a mesh as those of them do that are spread."""
    common = jnp.broadcast_shapes(*(a.shape for a in arrays)) if shape is None else shape
    full = [jnp.broadcast_to(a, common) for a in arrays]
    return [_laid(a, full) for a in full] if any(map(is_explicit, full)) else full


def is_explicit(array: Any) -> bool:
    """Whether an array's type says how it lies on a mesh of devices."""
    return AxisType.Explicit in _mesh(array).axis_types


def is_manual(array: Any) -> bool:
    """Whether an array is one device's share, within ``jax.shard_map``."""
    return AxisType.Manual in _mesh(array).axis_types


def _mesh(array: Any) -> Any:
    """Return the mesh of an array, or of the type of one."""
    return (array if isinstance(array, jax.core.ShapedArray) else jax.typeof(array)).sharding.mesh


def like(array: jax.Array, *others: jax.Array) -> jax.Array:
    """Return an array, such as the start of a loop, that lies on a mesh and varies over it as others do."""
    missing = tuple(sorted(frozenset[str]().union(*map(_varies, others)) - _varies(array)))
    return lax.pcast(array, missing, to="varying") if missing else array


def _varies(array: Any) -> frozenset[str]:
    """Return the axes of a mesh over which an array varies within ``jax.shard_map``."""
    return getattr(jax.typeof(array).manual_axis_type, "varying", None) or frozenset()


def alike(*arrays: jax.Array) -> list[jax.Array]:
    """Return arrays of one rank, whose last axes may differ, all lying on a mesh as those of them do that are spread."""
    return [_laid(a, list(arrays)) for a in arrays] if any(map(is_explicit, arrays)) else list(arrays)


def stack_arrays(arrays: Sequence[jax.Array], axis: int) -> jax.Array:
    """Return arrays of one shape stacked on a new axis."""
    return jnp.stack(alike(*arrays), axis)


def rows_at(rows: jax.Array, index: jax.Array) -> jax.Array:
    """Return the rows [..., k] of a table [n, k] at an index within its bounds, lying on a mesh as the index does."""
    spread = PartitionSpec(*_spec(jax.typeof(index).sharding, index.ndim), None) if is_explicit(index) else None
    return rows.at[index].get(mode="promise_in_bounds", out_sharding=spread)


def _laid(array: jax.Array, others: list[jax.Array]) -> jax.Array:
    kinds = [jax.typeof(o).sharding for o in others]
    mesh = next(kind.mesh for kind in kinds if AxisType.Explicit in kind.mesh.axis_types)
    spec = [next((name for name in names if name is not None), None) for names in zip(*(_spec(k, array.ndim) for k in kinds), strict=True)]
    return jax.sharding.reshard(array, NamedSharding(mesh, PartitionSpec(*spec)))


def _spec(kind: Any, rank: int) -> tuple[Any, ...]:
    return (*kind.spec, *(None,) * (rank - len(kind.spec))) if not kind.mesh.empty else (None,) * rank


def may_block(array: Any) -> bool:
    """Return whether a batch lies on one device, so that it may be cut into blocks on a CPU.

    A loop over blocks of a batch that is spread over devices would gather it on each. Within ``jax.shard_map`` a batch is one device's
    share. Elsewhere a batch may turn out to be spread where there are several CPU devices: then none is cut.
    """
    mesh = jax.typeof(array).sharding.mesh
    if not mesh.empty:
        return all(kind == AxisType.Manual for kind in mesh.axis_types)
    return jax.local_device_count("cpu") == 1


def is_large(shape: Sequence[Any], block: int) -> bool:
    """Return whether a batch is known to hold more than a block of samples; False where its size is symbolic, as in an exported program."""
    return all(isinstance(size, int) for size in shape) and math.prod(shape) > block
