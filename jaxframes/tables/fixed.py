"""Fixed frames: edges between frames at a constant rotation that know which frames they are (fixed offsets, inertial frames)."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.family import family
from jaxframes.edges.fixed import Fixed
from jaxframes.spatial import Epoch, Rotation, Transform
from jaxframes.staging.arrays import default_float
from jaxframes.tables.base import checked_order
from jaxframes.tables.info import Info
from jaxframes.tables.table_edge import TableEdge


@family(static=("info",))
class FixedFrame(Fixed, TableEdge):
    """A frame of SPICE at a constant rotation from another: ``jf.edges.Fixed`` that can be saved and placed by its names and ids.

    Made by ``Kernels.orientation`` or ``jf.spice.load``.

    Attributes:
        transform: Pose of the frame in the other, ``parent_T_child``, without translation.
        info: Names, ids and kernels; static. Its ``start`` and ``stop`` are empty: it holds at every instant.
    """

    transform: Transform
    info: Info

    def __init__(self, transform: Transform, info: Info):
        super().__init__(transform)
        object.__setattr__(self, "info", info)

    def describe(self) -> str:
        """Return the kind of the edge and its frames."""
        return f"fixed: {self.info.of} from {self.info.relative_to}"

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return the quaternion wxyz [..., 4], and zeros [..., 3] as angular velocity and acceleration; as the tables do.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2; the first ``order + 1`` of the three are returned.
        """
        shape = time.shape if isinstance(time, Epoch) else np.shape(time)
        wxyz = jnp.broadcast_to(self.transform.rotation.wxyz, (*shape, 4))
        return (wxyz, *[jnp.zeros((*shape, 3), wxyz.dtype)] * checked_order(order))

    def report(self) -> str:
        """Return what the edge is made of, in lines."""
        info = self.info
        lines = [
            f"orientation of {info.of} ({info.of_id}) relative to {info.relative_to} ({info.relative_id})",
            f"method:   {info.method}",
            f"coverage: {info.coverage}",
            f"size:     {sum(leaf.nbytes for leaf in jax.tree.leaves(self))} bytes, {self.transform.dtype.name}",
            *(f"kernel:   {source.name} sha256 {source.sha256}" for source in info.sources),
            f"read by:  {info.toolkit}",
        ]
        return "\n".join(lines)

    def inverted(self) -> "FixedFrame":
        """Return the edge of the other frame relative to this one."""
        info = self.info
        swapped = {"of": info.relative_to, "of_id": info.relative_id, "relative_to": info.of, "relative_id": info.of_id, "axes": info.of}
        return FixedFrame(self.transform.inverse(), replace(info, **swapped, center=None))

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return the numbers as float64 arrays; exact, so that ``from_arrays`` gives the same edge again."""
        return {"rotation": np.array(self.transform.rotation.wxyz, np.float64)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, np.ndarray], info: Info) -> "FixedFrame":
        """Return the edge of float64 arrays, in the default float dtype."""
        return cls(rotation_only(arrays["rotation"]), info)


def rotation_only(wxyz: np.ndarray) -> Transform:
    """Return the pose of a quaternion [4] without translation, in the default float dtype."""
    return Transform(Rotation(jnp.asarray(wxyz, default_float())), jnp.zeros(3, default_float()))
