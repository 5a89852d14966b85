"""The goal of a fit: the largest errors and the size that are asked for, and the errors that say that no records meet them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from jaxframes.errors import ToleranceError
from jaxframes.spice.options import NAMES
from jaxframes.tables.info import UNITS


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
