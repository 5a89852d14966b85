"""State: the numbers of one instant (or a batch of instants): joint values, rates, time and prescribed motions."""

from dataclasses import dataclass, replace
from typing import Any

import jax

from jaxframes.errors import FrameError, suggest
from jaxframes.spatial import Epoch, Motion
from jaxframes.spatial.value import tag
from jaxframes.staging.arrays import as_float


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class Attachments:
    """What the attachable frames hang on, in order of declaration.

    Attributes:
        parents: Index in ``tree.names`` of each one's parent, int32 [..., n_attachable].
        motion: Motion of each one relative to its parent, leaves [..., n_attachable, 4 or 3].
    """

    parents: jax.Array
    motion: Motion
    kind: str = tag("Attachments")


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class State:
    """What moves: every field is made of leaves, so any subset can be batched, differentiated or replaced.

    ``tree.state(...)`` makes one; leading batch axes of the fields broadcast against each other and against the tree.

    Attributes:
        q: Joint coordinates [..., nq] in the order of ``tree.joint_names``, rad or m.
        qd: Joint rates [..., nv], rad/s or m/s.
        qdd: Second derivatives [..., nv], rad/s2 or m/s2.
        time: The instant as an ``Epoch``, or None for a tree queried without one.
        prescribed: Motions of the prescribed edges, leaves [..., n_prescribed, 4 or 3], in order of declaration.
        attachments: What the attachable frames hang on; None for a tree without any.
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
        """
        for name in changes:
            if name not in self.__dataclass_fields__ or name == "kind":
                raise FrameError(f"a state has no field {name!r}.{suggest(name, self.__dataclass_fields__)}")
        for name in ("q", "qd", "qdd"):
            if name in changes:
                changes[name] = as_float(changes[name])
        if changes.get("time") is not None:
            changes["time"] = Epoch.from_et(changes["time"])
        return replace(self, **changes)
