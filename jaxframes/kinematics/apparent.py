"""What it means to look: the options of an apparent state, and the result."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax

from jaxframes.errors import FrameError
from jaxframes.model.structure import Structure
from jaxframes.numerics.batch import tag
from jaxframes.spatial.serialization import register

SPEED_OF_LIGHT = 299792458.0
"""m/s, exact by definition."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True, eq=False)
class ApparentState:
    """Where a frame's origin appears to an observer; made by ``tree.apparent``. What lies beyond the order asked for is None.

    Attributes:
        position: [..., 3] from the observer, m.
        velocity: Its time derivative by the observer's time, m/s, in axes that do not turn.
        acceleration: Its second time derivative, m/s2; None for ``light_time="LT"``, which has none.
        light_time: Seconds that the light is under way [...]; zero where it counts as instant.
        light_time_rate: Its time derivative [...], s/s.
        coverage: int32 [...]: 0 where every table on both paths covers the instants looked at; -1 where one begins later, +1
            where one ended before. Elsewhere than at 0 the numbers are NaN, and so are their gradients.
    """

    position: jax.Array
    velocity: jax.Array | None
    acceleration: jax.Array | None
    light_time: jax.Array
    light_time_rate: jax.Array | None
    coverage: jax.Array
    kind: str = tag("ApparentState")


class Looking(NamedTuple):
    """The static options of an apparent state.

    Attributes:
        of: Frame looked at, by index.
        relative_to: Frame of the observer.
        expressed_in: Frame that gives the axes.
        light_time: True for light time solved to convergence, "LT" for one step, False for none.
        aberration: Whether the observer's velocity turns the line of sight.
        sign: -1 where light arrives at the state's time, +1 where it departs.
        order: 0, 1 or 2: with velocity, with acceleration.
    """

    of: int
    relative_to: int
    expressed_in: int
    light_time: bool | str
    aberration: bool
    sign: int
    order: int


def checked(tree: Structure, of: str, relative_to: str, expressed_in: str | None, options: dict[str, Any]) -> Looking:
    """Return the options of ``tree.apparent`` with names looked up.

    Raises:
        FrameError: An option has a value that it does not take, or both frames are one.
        UnknownFrameError: A name is not in the tree.
    """
    index = tree.topology.index
    light_time, aberration, direction, order = (options[k] for k in ("light_time", "aberration", "direction", "order"))
    if not (isinstance(light_time, bool) or light_time == "LT"):
        raise FrameError(
            f"light_time={light_time!r}: give True (solved to convergence, SPICE's 'CN'), 'LT' (one step, as SPICE's) or False (geometric)"
        )
    if not isinstance(aberration, bool):
        raise FrameError(f"aberration={aberration!r}: give True (stellar aberration, SPICE's '+S') or False")
    if aberration and light_time is False:
        raise FrameError("aberration=True needs light_time=True or 'LT': it is the direction of light under way that appears turned")
    if direction not in ("reception", "transmission"):
        raise FrameError(f"direction={direction!r}: give 'reception' (light arrives at the state's time) or 'transmission' (it departs)")
    if order not in (0, 1, 2):
        raise FrameError(f"order={order!r}: give 0 (position), 1 (and velocity) or 2 (and acceleration)")
    if of == relative_to:
        raise FrameError(f"of and relative_to are the same frame {of!r}: there is no line of sight; name two frames")
    axes = 0 if expressed_in is None else index(expressed_in)
    sign = 1 if direction == "transmission" else -1
    return Looking(index(of), index(relative_to), axes, light_time, aberration, sign, order)


register((ApparentState,))
