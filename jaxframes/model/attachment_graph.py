"""The graph that attachable frames make: what hangs on what in a state, and which new parents are allowed."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import TopologyError
from jaxframes.model.state import Attachments
from jaxframes.model.topology import Topology
from jaxframes.staging.arrays import is_concrete


def hangs_on(topology: Topology, parents: Any, frames: Any, ancestor: int) -> Any:
    """Return where frames descend from another one, or are it, as attachable frames hang in a state.

    Args:
        topology: The tree's topology.
        parents: Index of the parent of each attachable frame [..., n_attachable], which may be traced. A number that is no frame hangs on
            nothing.
        frames: Indices of the frames asked about [...].
        ancestor: Index of the other frame.

    Returns:
        bool [...]: NumPy's where all is known, else JAX's.
    """
    xp: Any = jnp if any(isinstance(x, jax.Array) and not is_concrete(x) for x in (parents, frames)) else np
    parents, frames = xp.asarray(parents), xp.asarray(frames)
    # Static components are numbered: 0 hangs on the root for good, 1 to n on an attachable frame; n + 1 stands for what descends from
    # the ancestor, and leads nowhere else. Following every link as often as there are links, by doubling, ends at 0, n + 1 or in a cycle.
    rows = {frame: row + 1 for row, frame in enumerate(topology.attachables)}
    target, below = len(rows) + 1, [False] * len(topology.names)
    for frame, parent in enumerate(topology.parents):
        below[frame] = frame == ancestor or (parent >= 0 and frame not in rows and below[parent])
    home = xp.asarray(
        [target if inside else rows.get(component, 0) for component, inside in zip(topology.static_components, below, strict=True)]
    )
    exists = (parents >= 0) & (parents < len(topology.names))
    links = xp.where(exists, home[xp.where(exists, parents, 0)], 0)
    end = lambda value: xp.full((*links.shape[:-1], 1), value, links.dtype)  # noqa: E731
    links = xp.concatenate([end(0), links, end(target)], -1)
    for _ in range(math.ceil(math.log2(target))):
        links = xp.take_along_axis(links, links, -1)
    batch = np.broadcast_shapes(links.shape[:-1], frames.shape)
    links, start = xp.broadcast_to(links, (*batch, target + 1)), xp.broadcast_to(home[frames], batch)
    return xp.take_along_axis(links, start[..., None], -1)[..., 0] == target


def check_target(topology: Topology, held: Attachments, frame: int, targets: np.ndarray) -> None:
    """Refuse new parents [...] of an attachable frame that it cannot have (TopologyError)."""
    row, name = topology.attachables.index(frame), topology.names[frame]
    for target in np.unique(targets):
        if not 0 <= target < len(topology.names):
            raise TopologyError(f"cannot attach {name!r} to frame number {target}: the tree has frames 0 to {len(topology.names) - 1}")
        other = topology.names[int(target)]
        if target == frame:
            raise TopologyError(f"cannot attach {name!r} to itself ({other!r})")
        if topology.static_components[int(target)] == frame:
            raise TopologyError(
                f"cannot attach {name!r} to {other!r}, which hangs on it: that would be a cycle; attach {other!r} elsewhere first"
            )
        if int(target) not in topology.candidates[row]:
            allowed = ", ".join(repr(n) for n in topology.names_of(topology.candidates[row]))
            raise TopologyError(f"cannot attach {name!r} to {other!r}: its candidates are {allowed}; name {other!r} among them too")
    if is_concrete(held.parents) and np.any(hangs_on(topology, np.asarray(held.parents), targets, frame)):
        other = topology.names[int(np.unique(targets)[0])]
        raise TopologyError(
            f"cannot attach {name!r} to {other!r}, which hangs on it in this state: that would be a cycle; detach {other!r} first"
        )
