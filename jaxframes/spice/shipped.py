"""The small real tables that ship with the package."""

from pathlib import Path

from jaxframes.spice.store import load
from jaxframes.spice.tables import OrientationTable, TranslationTable

SHIPPED = Path(__file__).resolve().parent.parent / "data" / "tables_2026.npz"


def example_tables() -> dict[str, TranslationTable | OrientationTable]:
    """Return tables of 2026 from DE440 and ITRF93, by name.

    ``sun``, ``mars`` (barycentre) and ``emb`` are relative to the Solar System barycentre, ``earth`` to ``emb`` and ``moon`` to
    ``earth``, all in J2000 axes; ``itrf93`` orients the Earth-fixed frame in J2000. ``edge.report()`` says more.
    """
    return load(SHIPPED)
