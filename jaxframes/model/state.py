"""State: the numbers of one instant (or a batch of instants): joint values, rates, time and prescribed motions."""

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.errors import FrameError, ShapeError, suggest
from jaxframes.numerics.batch import Batched, tag
from jaxframes.numerics.components import select
from jaxframes.spatial import Epoch, Motion
from jaxframes.spatial.serialization import register
from jaxframes.staging.arrays import as_float, is_concrete, widest


@jax.tree_util.register_pytree_with_keys_class
@dataclass(frozen=True, eq=False, repr=False, init=False)
class Attachments:
    """What the attachable frames hang on, in order of declaration.

    JAX refuses to differentiate by a value that holds whole numbers, as parents are. So the leaf is ``links``, the same numbers as floats
    (exact up to 16 million frames), whose derivatives are zero; ``parents`` reads them.

    Attributes:
        links: Index in ``tree.names`` of each one's parent [..., n_attachable], in the dtype of the motion (float32 at least); the
            constructor takes whole numbers.
        motion: Motion of each one relative to its parent, leaves [..., n_attachable, 4 or 3].
    """

    links: jax.Array
    motion: Motion
    kind: str = tag("Attachments")

    def __init__(self, links: Any, motion: Motion, kind: str = "Attachments"):
        whole = isinstance(links, (jax.Array, np.ndarray)) and jnp.issubdtype(links.dtype, jnp.integer)
        links = jnp.asarray(links).astype(widest(jnp.float32, motion.transform.translation.dtype)) if whole else links
        for name, value in (("links", links), ("motion", motion), ("kind", kind)):
            object.__setattr__(self, name, value)

    @property
    def parents(self) -> jax.Array:
        """Index in ``tree.names`` of each one's parent, int32 [..., n_attachable]; -1 where it is no number."""
        links = self.links
        if not isinstance(links, (jax.Array, np.ndarray)) or not jnp.issubdtype(links.dtype, jnp.floating):
            return links  # while JAX handles it as a tree, anything may stand there
        with jax.ensure_compile_time_eval() if is_concrete(links) else contextlib.nullcontext():
            known = jnp.isfinite(links)
            nearest = lax.floor(lax.stop_gradient(links) + 0.5)  # of numbers that are whole already
            return select(known, nearest, -1.0).astype(jnp.int32)

    def tree_flatten_with_keys(self) -> tuple[tuple[tuple[Any, Any], ...], tuple[str]]:
        """Return the leaves with their names, and the tag (for JAX)."""
        key = jax.tree_util.GetAttrKey
        return ((key("links"), self.links), (key("motion"), self.motion)), (self.kind,)

    def tree_flatten(self) -> tuple[tuple[Any, Any], tuple[str]]:
        """Return the leaves, and the tag (for JAX)."""
        return (self.links, self.motion), (self.kind,)

    @classmethod
    def tree_unflatten(cls, kind: tuple[str], leaves: Any) -> "Attachments":
        """Return the attachments of some leaves (for JAX)."""
        links, motion = leaves
        return cls(links, motion)

    def __repr__(self) -> str:
        """Return how many frames there are, and the shape of a batch; the numbers are in the fields."""
        links = self.links
        if not isinstance(links, (jax.Array, np.ndarray, jax.ShapeDtypeStruct)) or not links.ndim:
            return f"Attachments({_brief(links)}, {_brief(self.motion)})"
        return f"Attachments({links.shape[-1]} frames{f', shape={links.shape[:-1]}' if links.shape[:-1] else ''})"


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False, repr=False)
class State(Batched):
    """What moves: every field is made of leaves, so any subset can be batched, differentiated or replaced.

    ``tree.state(...)`` makes one; leading batch axes of the fields broadcast against each other and against the tree. A state is indexed,
    iterated over, reshaped and joined (``jf.stack``, ``jf.concatenate``) by its batch axes as other values are;
    ``state.broadcast_to(state.shape)`` gives every field all of them, for ``lax.map``, ``lax.scan`` and shardings.

    Attributes:
        q: Joint coordinates [..., nq] in the order of ``tree.joint_names``, rad or m.
        qd: Joint rates [..., nv], rad/s or m/s.
        qdd: Second derivatives [..., nv], rad/s2 or m/s2.
        time: The instant as an ``Epoch``, or None for a tree queried without one.
        prescribed: Motions of the prescribed edges, leaves [..., n_prescribed, 4 or 3], in order of declaration.
        attachments: What the attachable frames hang on; None for a tree without any. Derivatives by it are those by the motions.
    """

    q: jax.Array
    qd: jax.Array
    qdd: jax.Array
    time: Epoch | None
    prescribed: Motion
    attachments: Attachments | None = None
    kind: str = tag("State")

    def replace(self, **changes: Any) -> "State":
        """Return a copy with fields replaced; ``time`` may be an ``Epoch`` or seconds past J2000 TDB.

        Raises:
            FrameError: There is no such field.
            ShapeError: Joint values do not have as many columns as those that they replace.
        """
        _check_fields(changes)
        for name in ("q", "qd", "qdd"):
            if name in changes:
                changes[name] = as_float(changes[name])
                found, wanted = changes[name].shape, np.shape(getattr(self, name))
                if found[-1:] != wanted[-1:]:
                    raise ShapeError(f"{name} has shape {found}, but this state holds [..., {wanted[-1]}]; joints by name: tree.set_{name}")
        if changes.get("time") is not None:
            changes["time"] = Epoch.from_et(changes["time"])
        return replace(self, **changes)

    def own_axes_of_leaves(self) -> list[int]:
        """Return, for each leaf, how many axes at its end are not batch axes."""
        return jax.tree.leaves(trailing(self))

    def prefix(self, *fields: str, chosen: Any = 0, other: Any = None) -> "State":
        """Return a state that holds one value for each field: what ``jax.vmap`` takes as ``in_axes``, or shardings for ``jax.device_put``.

        Args:
            fields: Names of the fields chosen, such as ``"q"`` and ``"time"``.
            chosen: What stands for these, such as 0, or a sharding over the batch.
            other: What stands for the others, such as None, or a sharding that repeats them.

        Raises:
            FrameError: There is no such field.

        Example:
            >>> import jax, jaxframes as jf
            >>> state = jf.TreeBuilder().build().state(time=[0.0, 60.0])
            >>> jax.vmap(lambda s: s.time - 60.0, in_axes=(state.prefix("time"),))(state).shape
            (2,)
        """
        _check_fields(fields)
        held = {name: getattr(self, name) for name in FIELDS}
        return replace(self, **{name: None if held[name] is None else chosen if name in fields else other for name in FIELDS})

    def __repr__(self) -> str:
        try:
            parts = [f"nq={self.q.shape[-1]}, nv={self.qd.shape[-1]}, time={self.time!r}"]
            if held := self.prescribed.transform.translation.shape[-2]:
                parts.append(f"{held} prescribed")
            if self.attachments is not None:
                parts.append(f"{self.attachments.links.shape[-1]} attachable")
            return f"State({', '.join(parts)}{f', shape={self.shape}' if self.shape else ''})"
        except (AttributeError, IndexError, TypeError, ValueError):  # while JAX handles it as a tree, anything may stand for its leaves
            return f"State({', '.join(f'{name}={_brief(getattr(self, name))}' for name in FIELDS)})"


def _brief(value: Any) -> str:
    """Return a few words for whatever stands in a field: a value with one thing in all its places is that thing."""
    leaves = jax.tree.leaves(value, is_leaf=lambda x: x is None)
    words = list(dict.fromkeys(f"{x.dtype}{list(x.shape)}" if isinstance(x, jax.Array | np.ndarray) else repr(x) for x in leaves))
    return words[0] if len(words) == 1 else f"{words[0]} and {len(words) - 1} others"


FIELDS = ("q", "qd", "qdd", "time", "prescribed", "attachments")


def _check_fields(names: Iterable[str]) -> None:
    """Refuse names that are no fields of a state."""
    for name in names:
        if name not in FIELDS:
            raise FrameError(f"a state has no field {name!r}.{suggest(name, FIELDS)}")


def trailing(state: State) -> State:
    """Return how many axes of each leaf of a state are not batch axes, in the structure of the state."""
    ranks = {"q": 1, "qd": 1, "qdd": 1, "time": 0, "prescribed": 2}
    found = {name: jax.tree.map(lambda _, rank=rank: rank, getattr(state, name)) for name, rank in ranks.items()}
    held = state.attachments
    if held is not None:
        held = Attachments(1, jax.tree.map(lambda _: 2, held.motion))  # pyright: ignore[reportArgumentType]
    return replace(state, **found, attachments=held)


register((Attachments, State))
