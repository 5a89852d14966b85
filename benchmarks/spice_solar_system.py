"""A tree of the Solar System against CSPICE: twelve edges, all frames at once, and one pair of frames that turn.

``python benchmarks/spice_solar_system.py [epochs]`` prints nanoseconds an epoch and the ratios to spiceypy in a loop and to ``cyice``.
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
BODIES = ("1", "2", "4", "5", "6", "7", "8", "9", "SUN", "3", "EARTH", "MOON")
ROUNDS = 7
LOOP = 2_000
MANY = 20_000


def main(epochs: int) -> None:
    jax.config.update("jax_enable_x64", True)
    paths = jf.spice.find_kernels()
    with jf.spice.Kernels(paths) as kernels:
        tree = kernels.tree(bodies=BODIES, start=START, stop=STOP)
        turning = kernels.tree(bodies=["EARTH", "MOON"], frames=["ITRF93"], start=START, stop=STOP)
    for path in paths:
        spiceypy.furnsh(str(path))
    times = np.random.default_rng(1).integers(START, STOP, epochs).astype(float)
    some, many, fast = times[:LOOP], times[:MANY], cyice()
    print(f"jax {jax.__version__}, {spiceypy.tkvrsn('TOOLKIT')}, {platform.machine()}, float64, {epochs} epochs in 2026, {ROUNDS} rounds")

    def all_states(order: int, t: Any) -> Any:
        state = tree.state(time=jf.Epoch(t, jnp.zeros_like(t)))
        return (tree.world_transforms, tree.world_velocities, tree.world_motions)[order](state)

    direction = jnp.array([1.0, 2.0, 3.0])

    ours: dict[str, Any] = {
        "positions": lambda t: all_states(0, t).translation,
        "positions + velocities": lambda t: (all_states(0, t).translation, all_states(1, t).linear),
        "positions + velocities + accelerations": lambda t: _linear(all_states(2, t)),
        "gradient along a direction": jax.grad(lambda t: jnp.sum(all_states(0, t).translation @ direction)),
    }
    peers = {"spkezr": Peer(loop(lambda t: [spiceypy.spkezr(b, t, "J2000", "NONE", "SSB") for b in BODIES], some), LOOP, 40)}
    if fast:
        peers["cyice"] = Peer(lambda: [fast.spkezr_v(b, many, "J2000", "NONE", "SSB") for b in BODIES], len(many))
    bounded = [("gradient along a direction", "positions + velocities")]
    table("Twelve bodies from the Solar System barycentre", ours, times, peers, "positions + velocities + accelerations", ROUNDS, bounded)
    print()

    def moon(t: Any) -> Any:
        return turning.motion(turning.state(time=jf.Epoch(t, jnp.zeros_like(t))), of="MOON", relative_to="ITRF93")

    peers = {"spkezr": Peer(loop(lambda t: spiceypy.spkezr("MOON", t, "ITRF93", "NONE", "EARTH"), some), LOOP)}
    if fast:
        peers["cyice"] = Peer(lambda: fast.spkezr_v("MOON", many, "ITRF93", "NONE", "EARTH"), len(many))
    table("Moon in ITRF93: pose, velocity, acceleration", {"motion": lambda t: _linear(moon(t))}, times, peers, "motion", ROUNDS)


def _linear(motion: Any) -> Any:
    return motion.transform.translation, motion.velocity.linear, motion.acceleration.linear


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
