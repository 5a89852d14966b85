"""Tables against CSPICE: the Moon from the Earth and ITRF93 over one year of epochs, in one process.

``python benchmarks/spice_tables.py [epochs]`` prints the rate of both, their ratio and the largest differences. CSPICE is called through
spiceypy in a Python loop, on a part of the same epochs; it gives no accelerations, the tables do.
"""

import platform
import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import spiceypy
from _timing import compiled, interleaved, nanoseconds

import jaxframes as jf

START, STOP = "2026-01-01", "2027-01-01"
ROUNDS = 9
LOOP = 20_000
TARGET = 60


def main(epochs: int) -> None:
    jax.config.update("jax_enable_x64", True)
    paths = jf.spice.find_kernels()
    with jf.spice.Kernels(paths) as kernels:
        moon = kernels.translation(target="MOON", center="EARTH", start=START, stop=STOP)
        itrf93 = kernels.orientation(frame="ITRF93", start=START, stop=STOP)
    for path in paths:
        spiceypy.furnsh(str(path))
    rng = np.random.default_rng(1)
    # Whole seconds: CSPICE and the table are then asked for exactly the same instant.
    times = rng.integers(820497600, 852033600, epochs).astype(float)
    some = times[:LOOP].tolist()
    print(f"jax {jax.__version__}, {spiceypy.tkvrsn('TOOLKIT')}, {platform.machine()}, float64, {epochs} epochs in 2026, {ROUNDS} rounds")
    position = [spiceypy.spkezr("MOON", t, "J2000", "NONE", "EARTH")[0] * 1e3 for t in some[:5000]]
    compare("Moon from the Earth", moon, times, lambda: [spiceypy.spkezr("MOON", t, "J2000", "NONE", "EARTH") for t in some], "spkezr")
    p, v = (np.asarray(x) for x in moon.evaluate(times[:5000], order=1))
    reference = np.array(position)
    print(f"  largest difference: {np.abs(p - reference[:, :3]).max():.2g} m, {np.abs(v - reference[:, 3:]).max():.2g} m/s\n")
    compare("ITRF93 from J2000", itrf93, times, lambda: [spiceypy.sxform("J2000", "ITRF93", t) for t in some], "sxform")
    print("  largest difference: {:.2g} rad, {:.2g} rad/s".format(*orientation_differences(itrf93, times[:2000])))


def compare(title: str, table: Any, times: np.ndarray, loop: Any, peer: str) -> None:
    """Time a table to each order, and the peer's loop, and print rates and ratios."""
    epochs = jnp.asarray(times)
    print(title)
    contenders, names = {peer: loop}, ("value", "value + rate", "value + rate + acceleration")
    for order, name in enumerate(names):
        run, seconds = compiled(lambda table, t, order=order: table.evaluate(t, order), table, epochs)
        contenders[name] = lambda run=run: run(table, epochs)
        print(f"  compile {name}: {seconds:.2f} s")
    taken = interleaved(contenders, ROUNDS)
    base = nanoseconds(taken[peer], LOOP)
    print(f"  {peer + ' in a loop':32s} {base[0]:9.1f} ns minimum {base[1]:9.1f} median")
    for name in names:
        least, median = nanoseconds(taken[name], len(times))
        print(f"  {name:32s} {least:9.1f} ns minimum {median:9.1f} median   ratio {base[0] / least:6.1f} and {base[1] / median:6.1f}")
        if peer == "spkezr" and name == names[-1] and base[1] / median < TARGET:
            print(f"  below the target of {TARGET}")


def orientation_differences(table: Any, times: np.ndarray) -> tuple[float, float]:
    """Return the largest angle and the largest difference of angular velocity from ``sxform``."""
    q, w = (np.asarray(x) for x in table.evaluate(times, order=1))
    angle = rate = 0.0
    for (w0, x, y, z), mine, t in zip(q, w, times, strict=True):
        matrix, spin = spiceypy.xf2rav(spiceypy.sxform("J2000", "ITRF93", t))
        rotation = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w0 * z), 2 * (x * z + w0 * y)],
            [2 * (x * y + w0 * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w0 * x)],
            [2 * (x * z - w0 * y), 2 * (y * z + w0 * x), 1 - 2 * (x * x + y * y)],
        ]
        d = np.array(rotation) @ matrix
        angle = max(angle, float(np.linalg.norm([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / 2))
        rate = max(rate, float(np.linalg.norm(mine - spin)))
    return angle, rate


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
