"""Options of ``Kernels.translation`` and ``orientation``: tolerances, layouts, corrections; checked, and looked up as requests."""

import numbers
import threading
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from jaxframes.errors import NoPathError, SpiceError, ToleranceError, suggest
from jaxframes.spice.reading.naming import FrameFacts
from jaxframes.tables.instants import Instant

LAYOUTS = ("uniform", "dyadic")
CORRECTIONS = ("NONE", "CN", "CN+S", "XCN", "XCN+S", "LT", "LT+S", "XLT", "XLT+S")
NAMES = {"translation": ("position", "velocity"), "orientation": ("angle", "rate")}


@dataclass(frozen=True)
class Tolerance:
    """The largest errors that a fitted table may have against CSPICE.

    Attributes:
        position: Metres, for translations.
        velocity: Metres per second, for translations.
        angle: Radians, for orientations.
        rate: Radians per second, for orientations.
    """

    position: float | None = None
    velocity: float | None = None
    angle: float | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        given = [v for v in (self.position, self.velocity, self.angle, self.rate) if v is not None]
        if not given or not all(_is_positive(v) for v in given):
            raise ToleranceError(
                f"{self!r}: give at least one of position, velocity (m, m/s) or angle, rate (rad, rad/s), greater than zero."
            )

    def bounds(self, kind: str) -> tuple[float, float]:
        """Return the bounds of value and rate for a translation or an orientation, infinite where none is given."""
        chosen = (self.position, self.velocity) if kind == "translation" else (self.angle, self.rate)
        if chosen == (None, None):
            raise ToleranceError(f"{self!r} says nothing about {self._article(kind)}: give {'= and '.join(NAMES[kind])}=.")
        value, rate = (np.inf if v is None else float(v) for v in chosen)
        return value, rate

    @staticmethod
    def _article(kind: str) -> str:
        return f"{'an' if kind[0] == 'o' else 'a'} {kind}"


def _is_positive(value: Any) -> bool:
    try:
        return not isinstance(value, (bool, str)) and bool(np.isfinite(value) and value > 0)
    except (TypeError, ValueError):
        return False


def is_number(value: Any) -> bool:
    """Whether a value is one real number, of Python or NumPy, and no truth value."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def one_of(**given: Any) -> tuple[Any, str]:
    """Return the one value that is given under several names, and its name (SpiceError unless exactly one is given)."""
    named = [(value, name) for name, value in given.items() if value is not None]
    if len(named) != 1:
        found = " and ".join(f"{name}={value!r}" for value, name in named) or "neither"
        raise SpiceError(f"give one of {'= and '.join(given)}=, which name the same body; found {found}.")
    return named[0]


def checked_tolerance(tolerance: Any) -> Tolerance | None:
    """Return a tolerance or None.

    Raises:
        ToleranceError: If it is something else.
    """
    if tolerance is None or isinstance(tolerance, Tolerance):
        return tolerance
    raise ToleranceError(f"tolerance={tolerance!r}: give jf.spice.Tolerance(position=..., velocity=..., angle=..., rate=...).")


def checked_layout(layout: Any, fitted: bool) -> str:
    """Return the name of a layout.

    Raises:
        ToleranceError: If there is none of this name, or it asks for a fit where nothing says how good that is to be.
    """
    if layout not in LAYOUTS:
        raise ToleranceError(f"layout={layout!r}: records are 'uniform' or 'dyadic'.")
    if not fitted and layout != LAYOUTS[0]:
        raise ToleranceError(f"layout={layout!r} is for fitted tables: give tolerance=jf.spice.Tolerance(...), or size= for positions.")
    return layout


def checked_size(size: Any) -> int | None:
    """Return a number of bytes or None (ToleranceError if it is something else)."""
    if size is None or (isinstance(size, (int, np.integer)) and not isinstance(size, bool) and size > 0):
        return None if size is None else int(size)
    raise ToleranceError(f"size={size!r}: give the most bytes that the table may have, a whole number.")


def checked_bridge(bridge: Any) -> float | None:
    """Return the longest time in seconds to join attitudes over, None if none is given (SpiceError if it is something else)."""
    if bridge is None:
        return None
    if is_number(bridge) and bridge >= 0:
        return float(bridge)
    raise SpiceError(
        f"bridge={bridge!r}: give the longest time in seconds between two attitudes of a C-kernel of type 1 that are to be joined, "
        "zero or more; None for kernels without such."
    )


def checked_correction(name: str) -> str:
    """Return a correction's name as SPICE spells it.

    Raises:
        NoPathError: If there is none of this name.
    """
    found = str(name).upper().replace(" ", "")
    if found not in CORRECTIONS:
        raise NoPathError(f"correction={name!r} is none of SPICE's.{suggest(found, CORRECTIONS)}")
    return found


def checked_timeout(timeout: Any) -> float | None:
    """Return a time-out in seconds, None for none at all.

    Raises:
        SpiceError: If it is something else, or longer than a thread can wait.
    """
    if timeout is None:
        return None
    if is_number(timeout) and 0 < timeout <= threading.TIMEOUT_MAX:
        return float(timeout)
    raise SpiceError(f"timeout={timeout!r}: give the seconds that one answer may take, more than zero, or None for any time.")


@dataclass(frozen=True)
class TranslationRequest:
    """What a translation table is asked for, bodies and axes looked up.

    Attributes:
        names: Name and id of the target, name and id of the center, name of the axes.
        bounds: Start and stop.
        tolerance: Errors to meet, None for any.
        size: Most bytes, None for any.
        layout: Records of a fit.
        correction: SPICE's aberration correction.
        compose: Whether the record tables of an exact chain are added up on one grid.
    """

    names: tuple[str, int, str, int, str]
    bounds: tuple[Fraction, Fraction]
    tolerance: Tolerance | None
    size: int | None
    layout: str
    correction: str
    compose: bool

    @property
    def fitted(self) -> bool:
        """Whether the table is fitted to what CSPICE computes, and not extracted."""
        return self.tolerance is not None or self.size is not None or self.correction != "NONE"


@dataclass(frozen=True)
class OrientationRequest:
    """What an orientation is asked for, frames looked up.

    Attributes:
        of: The frame that is oriented.
        base: The frame that the parent has the axes of.
        start: Start of the coverage, None for as early as the kernels have data.
        stop: End of the coverage, likewise.
        ck: How C-kernels are read between their knots: ``"smooth"`` or ``"spice"``.
        tolerance: Fit to within these errors instead of what the class of the frame would be read by.
        layout: Records of such a fit.
        bridge: For C-kernels of type 1: longest time in seconds to interpolate over.
    """

    of: FrameFacts
    base: FrameFacts
    start: Instant | None
    stop: Instant | None
    ck: str
    tolerance: Tolerance | None
    layout: str
    bridge: float | None

    @property
    def names(self) -> tuple[str, int, str, int, str]:
        """Name and id of the frame, of the base, and the name of the axes."""
        return self.of.name, self.of.id, self.base.name, self.base.id, self.base.name
