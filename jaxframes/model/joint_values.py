"""Joint values and prescribed motions by name: how states are made and changed."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.attachable import Attachable
from jaxframes.edges.prescribed import Movable
from jaxframes.errors import EdgeError, ShapeError
from jaxframes.model.state import Attachments, State
from jaxframes.model.structure import Structure
from jaxframes.model.topology import Topology
from jaxframes.spatial import Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.staging.arrays import as_float, widest

_PARTS = (Transform, SpatialVelocity, SpatialAcceleration)

ROWS = {"q": (0, 1), "qd": (2, 3), "qdd": (2, 3)}
"""Where an edge's (first, count) stand in ``Topology.coordinates``, for each kind of joint value."""


def make_state(tree: Structure, q: Any, qd: Any, qdd: Any, time: Any) -> State:
    """Return a state with what is given, and coordinates at rest, zero rates and motions at rest elsewhere."""
    topology, dtype = tree.topology, tree.dtype
    counts = {"q": topology.nq, "qd": topology.nv, "qdd": topology.nv}
    fields = {}
    for kind, value in (("q", q), ("qd", qd), ("qdd", qdd)):
        rest = jnp.array(np.asarray(tree.rest if kind == "q" else np.zeros(counts[kind]), dtype))
        if value is None:
            fields[kind] = rest
        elif isinstance(value, Mapping):
            given = {joint: in_dtype(one, dtype) for joint, one in value.items()}
            wide = rest.astype(widest(rest.dtype, *(one.dtype for one in given.values())))
            fields[kind] = set_named(topology, wide, given, kind)
        else:
            fields[kind] = _checked(topology, in_dtype(value, dtype), counts[kind], kind)
    held = sum(i >= 0 for i in topology.prescribed)
    clock = None if time is None else Epoch.from_et(time)
    return State(**fields, time=clock, prescribed=_first_motions(tree, held, dtype), attachments=_first_attachments(tree, dtype))


def in_dtype(value: Any, dtype: Any) -> jax.Array:
    """Return numbers as an array: those that have a float dtype keep it, plain numbers and lists take the one given."""
    if isinstance(value, (jax.Array, np.ndarray, np.generic)) and jnp.issubdtype(value.dtype, jnp.floating) and not _is_weak(value):
        return as_float(value)
    return lax.convert_element_type(as_float(value), dtype)


def _is_weak(value: Any) -> bool:
    return isinstance(value, jax.Array) and value.weak_type


def _first_motions(tree: Structure, held: int, dtype: Any) -> Motion:
    """Return the motions of the prescribed edges at rest, movable ones at their first pose."""
    motions = _at_rest(held, dtype)
    for frame, row in enumerate(tree.topology.prescribed):
        if row >= 0 and isinstance(edge := tree.edge_of(frame), Movable):
            put = lambda a, b, row=row, frame=frame: _with_rows(a, [row], [b], [tree.names[frame]])  # noqa: E731
            motions = motions.replace(transform=jax.tree.map(put, motions.transform, edge.pose))
    return motions


def _first_attachments(tree: Structure, dtype: Any) -> Attachments | None:
    """Return the attachments that a tree's edges start with."""
    frames = tree.topology.attachables
    if not frames:
        return None
    edges = [tree.edge_of(frame) for frame in frames]
    poses = [edge.pose for edge in edges if isinstance(edge, Attachable)]
    wxyz = jnp.stack(jnp.broadcast_arrays(*(jnp.asarray(pose.rotation.wxyz) for pose in poses)), axis=-2)
    translation = jnp.stack(jnp.broadcast_arrays(*(jnp.asarray(pose.translation) for pose in poses)), axis=-2)
    rest = _at_rest(len(frames), dtype)
    motion = rest.replace(transform=Transform(Rotation(wxyz), translation))
    return Attachments(jnp.asarray([tree.topology.parents[frame] for frame in frames], jnp.int32), motion)


def _checked(topology: Topology, values: jax.Array, count: int, kind: str) -> jax.Array:
    if values.ndim == 0 or values.shape[-1] != count:
        raise ShapeError(
            f"{kind} has shape {values.shape}, but the tree's joints need [..., {count}]: "
            f"{', '.join(topology.joint_names) or 'no joints'}; or pass a mapping of joint names to values"
        )
    return values


def _at_rest(count: int, dtype: Any) -> Motion:
    """Return motions at rest. Every leaf has a buffer of its own, so that a state can be donated."""
    wxyz, zeros = np.zeros((count, 4), dtype), np.zeros((count, 3), dtype)
    wxyz[:, 0] = 1
    zero = lambda: jnp.array(zeros)  # noqa: E731
    return Motion(Transform(Rotation(jnp.array(wxyz)), zero()), SpatialVelocity(zero(), zero()), SpatialAcceleration(zero(), zero()))


def set_named(topology: Topology, values: jax.Array, named: Mapping[str, Any], kind: str) -> jax.Array:
    """Return joint values with those of some joints replaced.

    Args:
        topology: The tree's topology.
        values: All values [..., n].
        named: For each joint, its value: [...] for a joint of one coordinate, [..., k] for one of k.
        kind: ``q``, ``qd`` or ``qdd``.

    Raises:
        UnknownJointError: A joint does not exist.
        ShapeError: A value does not fit its joint.
    """
    for joint, value in named.items():
        frame = topology.joint_frames[topology.joint(joint)]
        first, count = (topology.coordinates[frame][i] for i in ROWS[kind])
        new = as_float(value).astype(values.dtype)
        if count == 1:
            new = new[..., None]
        if new.ndim == 0 or new.shape[-1] != count:
            raise ShapeError(f"{kind} of joint {joint!r} has shape {new.shape}, but the joint needs [..., {count}]")
        values = _with_columns(values, slice(first, first + count), new)
    return values


def _with_columns(values: jax.Array, columns: slice, new: jax.Array) -> jax.Array:
    batch = jnp.broadcast_shapes(values.shape[:-1], new.shape[:-1])
    full = jnp.broadcast_to(values, (*batch, values.shape[-1]))
    return full.at[..., columns].set(jnp.broadcast_to(new, (*batch, new.shape[-1])))


def set_motions(topology: Topology, state: State, motions: Mapping[str, Any]) -> State:
    """Return a state with the motions of prescribed or attachable edges replaced, field by field where one is not None.

    Those of many edges go in together, so the program is as small for a thousand as for one.
    """
    rows: dict[bool, dict[str, int]] = {False: {}, True: {}}
    for name in motions:
        attachable, row = _row_of(topology, state, name)
        rows[attachable][name] = row
    parts = {name: _parts_of(name, motion) for name, motion in motions.items()}
    if rows[False]:
        state = replace(state, prescribed=_with_motions(state.prescribed, rows[False], parts))
    if rows[True] and state.attachments is not None:
        state = replace(state, attachments=replace(state.attachments, motion=_with_motions(state.attachments.motion, rows[True], parts)))
    return state


def _row_of(topology: Topology, state: State, name: str) -> tuple[bool, int]:
    """Return whether a frame is attachable, and the row of its motion in the state (EdgeError where the state holds none)."""
    frame = topology.index(name)
    if frame in topology.attachables and state.attachments is not None:
        return True, topology.attachables.index(frame)
    if topology.prescribed[frame] < 0:
        held = [topology.names[i] for i, at in enumerate(topology.prescribed) if at >= 0 or i in topology.attachables]
        known = f"frames that can: {', '.join(held)}" if held else "the tree has no such frame"
        raise EdgeError(f"the motion of frame {name!r} is not prescribed, so it cannot be set; {known}. Use jf.edges.Prescribed()")
    return False, topology.prescribed[frame]


def _parts_of(name: str, motion: Any) -> tuple[Any, Any, Any]:
    """Return pose, velocity and acceleration of a ``Motion`` or of a pose alone, each None if it is not given (ShapeError)."""
    parts = (motion, None, None) if isinstance(motion, Transform) else ()
    if isinstance(motion, Motion):
        parts = (motion.transform, motion.velocity, motion.acceleration)
    if not parts:
        raise ShapeError(f"the motion of frame {name!r}: expected a jf.Motion or a jf.Transform, found {type(motion).__name__}")
    for part, kind in zip(parts, _PARTS, strict=True):
        if part is not None and not isinstance(part, kind):
            raise ShapeError(f"the motion of frame {name!r}: expected a jf.{kind.__name__}, found {type(part).__name__}")
    return parts


def _with_motions(old: Motion, rows: Mapping[str, int], parts: Mapping[str, tuple[Any, Any, Any]]) -> Motion:
    fields = []
    for i, field in enumerate((old.transform, old.velocity, old.acceleration)):
        given = {name: parts[name][i] for name in rows if parts[name][i] is not None}
        leaves, structure = jax.tree.flatten(field)
        new = [jax.tree.leaves(value) for value in given.values()]
        at = [rows[name] for name in given]
        fresh = [_with_rows(leaf, at, [one[k] for one in new], list(given)) if at else leaf for k, leaf in enumerate(leaves)]
        fields.append(jax.tree.unflatten(structure, fresh))
    return Motion(*fields)


def _with_rows(values: jax.Array, rows: list[int], new: list[Any], names: list[str]) -> jax.Array:
    arrays = [as_float(one).astype(values.dtype) for one in new]
    for array, name in zip(arrays, names, strict=True):
        if array.ndim == 0 or array.shape[-1] != values.shape[-1]:
            raise ShapeError(f"the motion of frame {name!r} needs arrays [..., {values.shape[-1]}], found shape {array.shape}")
    batch = jnp.broadcast_shapes(values.shape[:-2], *(array.shape[:-1] for array in arrays))
    full = jnp.broadcast_to(values, (*batch, *values.shape[-2:]))
    wide = jnp.stack([jnp.broadcast_to(array, (*batch, array.shape[-1])) for array in arrays], -2)
    return full.at[..., np.array(rows, np.int32), :].set(wide, mode="promise_in_bounds", unique_indices=True)
