"""Motions as few arrays: pose [..., 7] (quaternion, translation), velocity [..., 6], acceleration [..., 6] (angular, linear).

Few, because a loop that writes several columns works out what these share only once; not one of all, because XLA:CPU does not
unroll the loop over more than ten columns, and a rolled one selects each column anew for every number (measured: a motion as 7, 6
and 6 columns takes a half of the time of six arrays, and a third of that of one).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import jax

from jaxframes.numerics.components import V3, Component, Quat
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.step_derivatives import Change
from jaxframes.staging.columns import assemble, take_apart
from jaxframes.staging.sharding import alike

Packed: TypeAlias = tuple[jax.Array, ...]
"""One, two or three arrays: pose, velocity, acceleration, as far as the order goes."""


WIDEST = 10
"""Columns up to which XLA:CPU unrolls the loop over them."""
COLUMNS = (7, 6, 6)
"""How many columns each array has."""


@dataclass(frozen=True)
class Kind:
    """What a motion as arrays is like: batch shape, dtype, and order (0 for poses, 1 with velocities, 2 with accelerations)."""

    shape: tuple[int, ...]
    dtype: Any
    order: int

    def packed(self, motion: Rigid) -> Packed:
        """Return a motion as arrays of this kind."""
        pose = (*motion.rotation, *motion.translation)
        groups = (pose, (*motion.angular, *motion.linear), (*motion.angular2, *motion.linear2))
        return tuple(alike(*(assemble(group, self.shape, self.dtype) for group in groups[: 1 + self.order])))

    def packed_change(self, groups: Sequence[Sequence[Component]]) -> Packed:
        """Return the change of a motion as arrays of six columns: small rotation and translation, angular and linear, twice."""
        return tuple(alike(*(assemble(group, self.shape, self.dtype) for group in groups[: 1 + self.order])))

    @property
    def results(self) -> list[jax.ShapeDtypeStruct]:
        """The shapes and dtypes of a motion's arrays."""
        return [jax.ShapeDtypeStruct((*self.shape, columns), self.dtype) for columns in COLUMNS[: 1 + self.order]]


def unpacked(arrays: Sequence[jax.Array]) -> Rigid:
    """Return a motion from its arrays; what they do not hold is a known zero. No arrays are the identity, at rest."""
    return _from_groups([take_apart(array) for array in arrays]) if arrays else Rigid()


def unpacked_change(tangents: Sequence[jax.Array | None]) -> Rigid:
    """Return the change of a motion from those of its arrays: known zeros for None and for what they do not hold."""
    zeros = ((0.0,) * 7, *((0.0,) * 6 for _ in tangents[1:]))
    found = [zero if tangent is None else take_apart(tangent) for tangent, zero in zip(tangents, zeros, strict=False)]
    return _from_groups(found or zeros)


def change_of(arrays: Sequence[jax.Array]) -> Change:
    """Return the change of a motion of its arrays; what they do not hold is a known zero."""
    return Change(*(V3(*half) for six in map(take_apart, arrays) for half in (six[:3], six[3:])))


def _from_groups(found: Sequence[tuple[Component, ...]]) -> Rigid:
    pose, *sixes = found
    return Rigid(Quat(*pose[:4]), V3(*pose[4:]), *(V3(*half) for six in sixes for half in (six[:3], six[3:])))
