"""Joint values and prescribed motions by name: how states are made and changed."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import EdgeError, ShapeError
from jaxframes.spatial import Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform
from jaxframes.staging.arrays import as_float
from jaxframes.tree.edges.attachable import Attachable
from jaxframes.tree.edges.stored import Movable
from jaxframes.tree.state import Attachments, State
from jaxframes.tree.structure import Structure
from jaxframes.tree.topology import Topology

_PARTS = (Transform, SpatialVelocity, SpatialAcceleration)

ROWS = {"q": (0, 1), "qd": (2, 3), "qdd": (2, 3)}
"""Where an edge's (first, count) stand in ``Topology.coordinates``, for each kind of joint value."""


def make_state(tree: Structure, q: Any, qd: Any, qdd: Any, time: Any) -> State:
    """Return a state with what is given, and neutral coordinates, zero rates and motions at rest elsewhere."""
    topology, dtype = tree.topology, tree.dtype
    counts = {"q": topology.nq, "qd": topology.nv, "qdd": topology.nv}
    fields = {}
    for kind, value in (("q", q), ("qd", qd), ("qdd", qdd)):
        rest = jnp.array(np.asarray(topology.neutral if kind == "q" else np.zeros(counts[kind]), dtype))
        if value is None:
            fields[kind] = rest
        elif isinstance(value, Mapping):
            fields[kind] = set_named(topology, rest, value, kind)
        else:
            fields[kind] = _checked(topology, as_float(value), counts[kind], kind)
    held = sum(i >= 0 for i in topology.prescribed)
    clock = None if time is None else Epoch.from_et(time)
    return State(**fields, time=clock, prescribed=_first_motions(tree, held, dtype), attachments=_first_attachments(tree, dtype))


def _first_motions(tree: Structure, held: int, dtype: Any) -> Motion:
    """Return the motions of the prescribed edges at rest, movable ones at their first pose."""
    motions = _at_rest(held, dtype)
    for frame, row in enumerate(tree.topology.prescribed):
        if row >= 0 and isinstance(edge := tree._edge(frame), Movable):
            put = lambda a, b, row=row, frame=frame: _with_row(a, row, as_float(b).astype(dtype), tree.names[frame])  # noqa: E731
            motions = motions.replace(transform=jax.tree.map(put, motions.transform, edge.pose))
    return motions


def _first_attachments(tree: Structure, dtype: Any) -> Attachments | None:
    """Return the attachments that a tree's edges start with."""
    frames = tree.topology.attachables
    if not frames:
        return None
    edges = [tree._edge(frame) for frame in frames]
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


def set_motion(topology: Topology, state: State, name: str, motion: Motion) -> State:
    """Return a state with the motion of one prescribed or attachable edge replaced where ``motion`` is not None."""
    frame = topology.index(name)
    row = topology.prescribed[frame]
    loose = frame in topology.attachables and state.attachments is not None
    if row < 0 and not loose:
        held = [topology.names[i] for i, at in enumerate(topology.prescribed) if at >= 0 or i in topology.attachables]
        known = f"frames that can: {', '.join(held)}" if held else "the tree has no such frame"
        raise EdgeError(f"the motion of frame {name!r} is not prescribed, so it cannot be set; {known}. Use jf.edges.Prescribed()")
    if loose:
        row = topology.attachables.index(frame)

    def put(old: Any, new: Any) -> Any:
        if new is None:
            return old
        return jax.tree.map(lambda a, b: _with_row(a, row, as_float(b).astype(a.dtype), name), old, new)

    for part, kind in zip((motion.transform, motion.velocity, motion.acceleration), _PARTS, strict=True):
        if part is not None and not isinstance(part, kind):
            raise ShapeError(f"the motion of frame {name!r}: expected a jf.{kind.__name__}, found {type(part).__name__}")
    old = state.attachments.motion if loose and state.attachments is not None else state.prescribed
    changed = Motion(put(old.transform, motion.transform), put(old.velocity, motion.velocity), put(old.acceleration, motion.acceleration))
    if loose and state.attachments is not None:
        return replace(state, attachments=replace(state.attachments, motion=changed))
    return replace(state, prescribed=changed)


def _with_row(values: jax.Array, row: int, new: jax.Array, name: str) -> jax.Array:
    if new.ndim == 0 or new.shape[-1] != values.shape[-1]:
        raise ShapeError(f"the motion of frame {name!r} needs arrays [..., {values.shape[-1]}], found shape {new.shape}")
    batch = jnp.broadcast_shapes(values.shape[:-2], new.shape[:-1])
    full = jnp.broadcast_to(values, (*batch, *values.shape[-2:]))
    return full.at[..., row, :].set(jnp.broadcast_to(new, (*batch, new.shape[-1])))
