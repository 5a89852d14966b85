"""What a fitted table is asked to be: its largest errors, its size, its layout; and the errors that say it cannot be so."""

import numbers
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxframes.errors import SpiceError, ToleranceError
from jaxframes.tables.info import UNITS

LAYOUTS = ("uniform", "dyadic")
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


@dataclass(frozen=True)
class Goal:
    """What is asked of records.

    Attributes:
        kind: ``"translation"`` or ``"orientation"``.
        bounds: Largest errors of value and rate, infinite where there is none.
        size: Most bytes, None for any.
        layout: ``"uniform"`` or ``"dyadic"``.
        aim: What is fitted, for messages.
        note: What is to be known about the bounds, likewise.
        most: Bytes beyond which nothing is looked at: something smaller was found already.
    """

    kind: str
    bounds: tuple[float, float]
    size: int | None
    layout: str
    aim: str
    note: str = ""
    most: float = np.inf

    @property
    def free(self) -> bool:
        """Whether no error is bounded: as good as the size allows."""
        return not np.isfinite(self.bounds).any()

    def meets(self, worst: Sequence[float] | np.ndarray) -> bool:
        """Whether errors of value and rate are within the bounds."""
        return bool(worst[0] <= self.bounds[0] and worst[1] <= self.bounds[1])

    def ratio(self, errors: Sequence[float] | np.ndarray) -> float:
        """Return by how much errors of value and rate exceed the bounds; where there are none, the error of value."""
        return float(errors[0]) if self.free else float(np.max(np.asarray(errors) / self.bounds))

    def text(self) -> str:
        """Return the bounds with their units."""
        return self.reached(self.bounds) or "any error"

    def reached(self, errors: Sequence[float] | np.ndarray) -> str:
        """Return errors of value and rate with their units, those that are not known left out."""
        return " and ".join(f"{e:.3g} {unit}" for e, unit in zip(errors, UNITS[self.kind], strict=False) if np.isfinite(e))

    def asked(self) -> str:
        """Return the line of the report that says what was asked for."""
        named = zip(NAMES[self.kind], self.bounds, UNITS[self.kind], strict=False)
        parts = [f"{name} within {bound:.3g} {unit}" for name, bound, unit in named if np.isfinite(bound)]
        return ", ".join(parts + ([f"at most {self.size} bytes"] if self.size is not None else []))

    def too_small(self, needed: int) -> ToleranceError:
        """Return the error for a size that does not suffice."""
        within = "" if self.free else f" within {self.text()}"
        return ToleranceError(f"{self.aim}: {needed} bytes are needed{within}, more than size={self.size}.")

    def unmet(self, met: Iterable[Sequence[float] | np.ndarray]) -> "UnmetError":
        """Return the error for bounds that no records meet, of the errors of value and rate that were met."""
        found = [(float(value), float(rate)) for value, rate in met] or [(np.inf, np.inf)]
        alone = min((rate for value, rate in found if value <= self.bounds[0]), default=np.inf)
        best = min(found, key=self.ratio)
        said = f"{self.aim}: no table meets {self.text()}{self.note}. The best reached is {self.reached(best)}: what CSPICE"
        if self.kind == "orientation" and min(found)[0] <= self.bounds[0] * 1e-3 and best[1] > self.bounds[1]:
            return UnmetError(
                f"{said} gives as rate is not the derivative of its angle to better than that (as for frames of date with ROTATION_STATE "
                "'INERTIAL'). Give angle= alone: the table's own rate is the derivative.",
                tuple(found),
            )
        apart = f" Where the {NAMES[self.kind][0]} is met, the {NAMES[self.kind][1]} is off by {alone:.3g} {UNITS[self.kind][1]}."
        return UnmetError(
            f"{said} computes is not smoother than that (its own rounding, the kernel's jumps between records)."
            f"{apart if np.isfinite(alone) and np.isfinite(self.bounds).all() else ''} Ask for less.",
            tuple(found),
        )


class UnmetError(ToleranceError):
    """No records meet the bounds; ``met`` holds the errors of value and rate that some had."""

    def __init__(self, text: str, met: tuple[tuple[float, float], ...]):
        super().__init__(text)
        self.met = met
