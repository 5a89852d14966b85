"""``jaxframes demo --verify``: every SPICE edge of the demonstration against CSPICE on the real kernels."""

import sys
from fractions import Fraction
from pathlib import Path

import numpy as np

from jaxframes import spice
from jaxframes.cli.progress import progress
from jaxframes.tables import TranslationTable

KERNELS = ("de440", "leapseconds", "eop-high-prec")
BOUNDS = {"m": 5e-4, "m/s": 1e-10, "rad": 1e-12, "rad/s": 1e-18}
"""Largest differences accepted: a few units in the last place of the largest numbers met."""


def verify(epochs: int = 20_000) -> int:
    """Compare each table that ships with the package with CSPICE at random whole seconds; 0 if all agree within ``BOUNDS``.

    Raises:
        MissingKernelError: A kernel's package is not installed; the message names it.
    """
    tables = spice.example_tables()
    found = spice.find_kernels(*KERNELS)
    rng, failed = np.random.default_rng(0), False
    print(f"{len(tables)} tables against CSPICE at {epochs} random epochs each, on")
    for kernel in found:
        print(f"  {Path(kernel).name}")
    rows = []
    with spice.Kernels(found) as kernels:
        for name, table in progress(list(tables.items()), "comparing"):
            start, stop = (float(Fraction(t)) for t in (table.info.start, table.info.stop))
            times = rng.integers(int(np.ceil(start)), int(np.floor(stop)), epochs, endpoint=True).astype(float)
            rows.append((name, table, spice.compare(kernels, table, times)))
    print(f"\n{'edge':8s} {'what':38s} {'worst difference':>18s} {'of at most':>12s} {'worst rate':>18s} {'of at most':>12s}")
    for name, table, worst in rows:
        units = ("m", "m/s") if isinstance(table, TranslationTable) else ("rad", "rad/s")
        good = worst.value <= BOUNDS[units[0]] and worst.rate <= BOUNDS[units[1]]
        failed |= not good
        print(
            f"{name:8s} {table.describe().removeprefix('table: '):38s} {worst.value:12.2e} {units[0]:5s} {worst.largest_value:12.3e} "
            f"{worst.rate:12.2e} {units[1]:5s} {worst.largest_rate:12.3e} {'' if good else '  beyond its bound'}"
        )
    if failed:
        print(f"a difference is beyond its bound ({', '.join(f'{v:g} {k}' for k, v in BOUNDS.items())})", file=sys.stderr)
    return int(failed)
