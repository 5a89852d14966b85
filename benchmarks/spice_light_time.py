"""Light time and stellar aberration against CSPICE: Mars from the Earth.

``python benchmarks/spice_light_time.py [epochs]`` prints nanoseconds a state, the ratios to spiceypy and the largest differences.
"""

import platform
import sys
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import spiceypy
from _peers import Peer, cyice, loop, table

import jaxframes as jf

START, STOP = 820497600.0, 852033600.0
MARS = "MARS BARYCENTER"
ROUNDS = 7
LOOP = 5_000
MANY = 50_000


def main(epochs: int) -> None:
    jax.config.update("jax_enable_x64", True)
    paths = jf.spice.find_kernels()
    with jf.spice.Kernels(paths) as kernels:
        tree = kernels.tree(bodies=["EARTH", MARS], start=START - 86400, stop=STOP + 86400)
    for path in paths:
        spiceypy.furnsh(str(path))
    times = np.random.default_rng(1).integers(START, STOP, epochs).astype(float)
    some, many, fast = times[:LOOP], times[:MANY], cyice()
    print(f"jax {jax.__version__}, {spiceypy.tkvrsn('TOOLKIT')}, {platform.machine()}, float64, {epochs} epochs in 2026, {ROUNDS} rounds")
    for correction, options in {"CN": {}, "CN+S": {"aberration": True}}.items():

        def look(t: Any, order: int, options: Any = options) -> Any:
            state = tree.state(time=jf.Epoch(t, jnp.zeros_like(t)))
            found = tree.apparent(state, of=MARS, relative_to="EARTH", order=order, **options)
            return [x for x in (found.position, found.velocity, found.acceleration) if x is not None]

        def distances(t: Any, look: Any = look) -> Any:
            return jnp.sum(jnp.linalg.norm(look(t, 0)[0], axis=-1))

        names = ("position", "position + velocity", "position + velocity + acceleration")
        ours: dict[str, Any] = {name: lambda t, k=k, look=look: look(t, k) for k, name in enumerate(names)}
        ours["gradient of the distance"] = jax.grad(distances)
        peers = {"spkezr": Peer(loop(lambda t, c=correction: spiceypy.spkezr(MARS, t, "J2000", c, "EARTH"), some), LOOP)}
        if fast:
            peers["cyice"] = Peer(lambda c=correction: fast.spkezr_v(MARS, many, "J2000", c, "EARTH"), len(many))
        table(f"Mars from the Earth, {correction}", ours, times, peers, names[2], ROUNDS)
        p, v = (np.asarray(x) for x in look(jnp.asarray(some), 1))
        reference = np.array([spiceypy.spkezr(MARS, t, "J2000", correction, "EARTH")[0] for t in some]) * 1e3
        apart = [np.linalg.norm(a, axis=1).max() for a in (p - reference[:, :3], v - reference[:, 3:])]
        print(f"  largest difference: {apart[0]:.2g} m, {apart[1]:.2g} m/s\n")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
