"""Facts about a table: bodies and frames, coverage, reference epoch, and the kernels it was made from."""

from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Any

from jaxframes.tables.instants import span_text

EXTRACTION = "exact extraction of Chebyshev records"
UNITS = {"translation": ("m", "m/s", "m/s2"), "orientation": ("rad", "rad/s", "rad/s2")}
"""Units of value, rate and acceleration."""


@dataclass(frozen=True)
class Source:
    """A kernel file: its base name and the SHA-256 of its content."""

    name: str
    sha256: str


@dataclass(frozen=True)
class Info:
    """Static facts about a table; hashable, and plain enough to be written as JSON.

    Attributes:
        kind: ``"translation"``, ``"orientation"`` or ``"iau"``.
        of: Name of the target body, or of the frame that is oriented.
        of_id: Its SPICE id.
        relative_to: Name of the centre body, or of the base frame.
        relative_id: Its SPICE id.
        axes: Name of the inertial frame in whose axes the values are.
        start: Start of the coverage: exact seconds past J2000 TDB as text; empty where there is no end.
        stop: End of the coverage, likewise.
        reference: The epoch that the records' times count from, likewise.
        sources: The kernels whose numbers are in the table, then those that named things or placed frames.
        segments: One line for each segment used.
        toolkit: Version of CSPICE that read them.
        method: How the numbers of the kernels became the table.
        correction: SPICE's aberration correction that is in the values; ``"NONE"`` for geometric ones.
        measured: What was measured while the table was made, by name: errors against CSPICE and the kernels' own jumps, SI units.
        notes: Lines for the report.
        center: Id of the body that an oriented frame belongs to; None for positions, and where it is not known.
    """

    kind: str
    of: str
    of_id: int
    relative_to: str
    relative_id: int
    axes: str
    start: str
    stop: str
    reference: str
    sources: tuple[Source, ...]
    segments: tuple[str, ...]
    toolkit: str
    method: str = EXTRACTION
    correction: str = "NONE"
    measured: tuple[tuple[str, float], ...] = ()
    notes: tuple[str, ...] = ()
    center: int | None = None

    @property
    def coverage(self) -> str:
        """The coverage as text."""
        if not self.start:
            return "every instant"
        return span_text(Fraction(self.start), Fraction(self.stop))

    def to_json(self) -> dict[str, Any]:
        """Return plain lists, texts and numbers."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Info":
        """Return the facts that ``to_json`` wrote."""
        sources = tuple(Source(**s) for s in data["sources"])
        measured = tuple((str(name), float(value)) for name, value in data["measured"])
        texts = {name: tuple(data[name]) for name in ("segments", "notes")}
        return cls(**{**data, "sources": sources, "measured": measured, **texts})


def decimal(exact: Fraction) -> str:
    """Return a number with a finite decimal expansion (every double has one) as exact text; others as a fraction."""
    twos = fives = 0
    rest = exact.denominator
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    if rest != 1:
        return str(exact)
    places = max(twos, fives)
    digits = str(abs(exact.numerator) * 10**places // exact.denominator).rjust(places + 1, "0")
    whole, part = (digits[:-places], digits[-places:]) if places else (digits, "")
    return ("-" if exact < 0 else "") + whole + (f".{part}" if part else "")
