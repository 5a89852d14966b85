"""Tables against their peers: the Moon from the Earth and ITRF93 over one year of epochs, in one process.

``python benchmarks/spice_tables.py [epochs]`` prints nanoseconds a state, the ratios to CSPICE through spiceypy (a Python loop, and
``cyice``, its compiled interface) and to ANISE where it is installed, and the largest differences from CSPICE. None of the peers gives
accelerations; the tables do. ANISE uses all cores, the others one.
"""

import platform
import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import spiceypy
from _peers import Peer, anise, cyice, loop, table

import jaxframes as jf

START, STOP = 820497600.0, 852033600.0
ROUNDS = 9
LOOP = 20_000
MANY = 200_000


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
    times = rng.integers(START, STOP, epochs).astype(float)
    print(f"jax {jax.__version__}, {spiceypy.tkvrsn('TOOLKIT')}, {platform.machine()}, float64, {epochs} epochs in 2026, {ROUNDS} rounds")
    names = ("value", "value + rate", "value + rate + acceleration")
    some, many, fast = times[:LOOP], times[:MANY], cyice()

    peers = {"spkezr": Peer(loop(lambda t: spiceypy.spkezr("MOON", t, "J2000", "NONE", "EARTH"), some), LOOP, 80)}
    if fast:
        peers["cyice"] = Peer(lambda: fast.spkezr_v("MOON", many, "J2000", "NONE", "EARTH"), len(many), 15)
    if (run := anise(paths[0], START, STOP, MANY, "MOON_J2000", "EARTH_J2000")) is not None:
        peers["ANISE"] = Peer(run, MANY, 8)
    ours: dict[str, Any] = {name: lambda t, k=k: moon.evaluate(t, k) for k, name in enumerate(names)}
    direction = jnp.array([1.0, 2.0, 3.0])
    ours["gradient along a direction"] = jax.grad(lambda t: jnp.sum(moon.evaluate(t, 0)[0] @ direction))
    ours["gradient of the distance"] = jax.grad(lambda t: jnp.sum(jnp.linalg.norm(moon.evaluate(t, 0)[0], axis=-1)))
    ours["range rate by hand"] = lambda t: range_rate(*moon.evaluate(t, 1))
    # A distance costs what JAX spends on norms; by hand from position and velocity it costs that too.
    bounded = [("gradient along a direction", names[1])]
    table("Moon from the Earth", ours, times, peers, names[2], ROUNDS, bounded)
    p, v = (np.asarray(x) for x in moon.evaluate(times[:5000], order=1))
    reference = np.array([spiceypy.spkezr("MOON", t, "J2000", "NONE", "EARTH")[0] for t in times[:5000]]) * 1e3
    print(f"  largest difference: {np.abs(p - reference[:, :3]).max():.2g} m, {np.abs(v - reference[:, 3:]).max():.2g} m/s\n")

    peers = {"sxform": Peer(loop(lambda t: spiceypy.sxform("J2000", "ITRF93", t), some), LOOP, 10)}
    if fast:
        peers["cyice"] = Peer(lambda: fast.sxform_v("J2000", "ITRF93", many), len(many))
    ours = {name: lambda t, k=k: itrf93.evaluate(t, k) for k, name in enumerate(names)}
    table("ITRF93 from J2000", ours, times, peers, names[2], ROUNDS)
    print("  largest difference: {:.2g} rad, {:.2g} rad/s".format(*orientation_differences(itrf93, times[:2000])))


def range_rate(position: Any, velocity: Any) -> Any:
    """Return the rate of a distance."""
    return jnp.sum(position * velocity, -1) / jnp.linalg.norm(position, axis=-1)


def orientation_differences(edge: Any, times: np.ndarray) -> tuple[float, float]:
    """Return the largest angle and the largest difference of angular velocity from ``sxform``."""
    q, w = (np.asarray(x) for x in edge.evaluate(times, order=1))
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
