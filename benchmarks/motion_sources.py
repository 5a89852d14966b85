"""Sources of motion against their targets, as ratios in one run: functions, samples, frames defined by frames, orbits.

Run: ``python benchmarks/motion_sources.py [--trajectories N] [--orbits N]``
"""

import argparse
import time

import jax
import jax.numpy as jnp
import numpy as np
from _timing import compiled, interleaved, nanoseconds

import jaxframes as jf

jax.config.update("jax_enable_x64", True)
MU = 3.986004418e14
ROUNDS = 5


def sway(params, t):
    turn = jf.Rotation.from_rotation_vector(params * jnp.sin(0.7 * t))
    return jf.Transform(turn, jnp.stack([jnp.cos(t), jnp.sin(t), 0.1 * t]))


def tree_of(**edges):
    b = jf.TreeBuilder()
    for name, (parent, edge) in edges.items():
        b.add(name, parent=parent, edge=edge)
    return b.build()


def ratio(name: str, found: float, target: float, unit: str = "x") -> None:
    print(f"  {name}: {found:.2f} {unit} (target: at most {target:g} {unit}) {'met' if found <= target else 'MISSED'}")


def functions(count: int) -> None:
    """An edge against the function's own nested derivatives, without a tree."""
    numbers = jnp.asarray([0.3, 0.2, 0.1])
    tree = tree_of(craft=("world", jf.edges.Function(sway, numbers)))
    times = jnp.linspace(0.0, 1000.0, count)

    def alone(times):
        def one(t):
            parts = lambda t: (lambda pose: (pose.rotation.wxyz, pose.translation))(sway(numbers, t))
            first = lambda t: jax.jvp(parts, (t,), (jnp.ones_like(t),))
            return jax.jvp(first, (t,), (jnp.ones_like(t),))

        return jax.vmap(one)(times)

    ours, seconds = compiled(lambda t: tree.motion(tree.state(time=t), of="craft", relative_to="world"), times)
    theirs, _ = compiled(alone, times)
    found = interleaved({"edge": lambda: ours(times), "alone": lambda: theirs(times)}, ROUNDS)
    edge, own = (nanoseconds(found[name], count)[0] for name in ("edge", "alone"))
    print(f"Function, {count} epochs with accelerations: {edge:.0f} ns, the function alone {own:.0f} ns, compile {seconds:.1f} s")
    ratio("edge / function's own nested derivatives", edge / own, 2.5)


def samples(trajectories: int, epochs: int) -> None:
    """Many trajectories of uneven lengths in one tree."""
    rng, made, start = np.random.default_rng(0), [], time.perf_counter()
    for _ in range(trajectories):
        times = np.r_[0.0, np.cumsum(rng.uniform(20, 100, rng.integers(700, 1300)))]
        made.append(jf.tables.Sampled(times * 6e4 / times[-1], rng.normal(size=(len(times), 3))))
    b = jf.TreeBuilder()
    b.add_many([f"c{i}" for i in range(trajectories)], parent="world", edge=made)
    tree = b.build()
    print(f"Sampled, {trajectories} trajectories of about 1000 samples: made and built in {time.perf_counter() - start:.1f} s")
    state = tree.state(time=jnp.asarray(rng.uniform(0, 6e4, epochs)))
    start = time.perf_counter()
    jax.block_until_ready(tree.world_motions(state))
    first = time.perf_counter() - start
    best = min(interleaved({"tree": lambda: tree.world_motions(state)}, ROUNDS)["tree"])
    print(f"  first answer, records made and compiled: {first:.1f} s")
    ratio("a state with its acceleration, in the tree", best / (trajectories * epochs) * 1e9, 250, "ns")
    ratio("compile", first - best, 1.0, "s")


def derived(count: int) -> None:
    """LVLH and a frame on it, against the motions of what they are made of."""
    orbit = jf.edges.Kepler(periapsis=7e6, eccentricity=0.1, inclination=0.9, mu=MU)
    craft = {"craft": ("world", orbit), "sun": ("world", jf.edges.Fixed(jf.Transform.from_translation((1.5e11, 0, 0))))}
    one = {**craft, "lvlh": ("craft", jf.edges.LVLH("craft", "world"))}
    two = {**one, "panel": ("lvlh", jf.edges.Pointing(at="sun", craft="craft", up=jf.edges.Velocity("craft", "world")))}
    times = jnp.linspace(0.0, 6e3, count)
    programs, compile_s = {}, {}
    for name, edges in (("craft", craft), ("lvlh", one), ("panel", two)):
        tree = tree_of(**edges)
        programs[name], compile_s[name] = compiled(
            lambda t, tree=tree, name=name: tree.motion(tree.state(time=t), of=name, relative_to="world"), times
        )
    found = interleaved({name: lambda run=run: run(times) for name, run in programs.items()}, ROUNDS)
    ns = {name: nanoseconds(seconds, count)[0] for name, seconds in found.items()}
    print(
        f"TwoVector, {count} epochs with accelerations: "
        + ", ".join(f"{n} {v:.0f} ns (compile {compile_s[n]:.1f} s)" for n, v in ns.items())
    )
    ratio("LVLH / its source's motion", ns["lvlh"] / ns["craft"], 3.0)
    ratio("compile of a frame on a frame / of one frame", compile_s["panel"] / compile_s["lvlh"], 3.0)


def newton(elements, times):
    """Positions, velocities and accelerations by NumPy: Newton's steps on Kepler's equation, epoch by epoch."""
    q, e, i, node, w, m0 = elements.T
    a = q / (1 - e)
    n = np.sqrt(MU / a**3)
    (ci, si), (cn, sn), (cw, sw) = ((np.cos(x), np.sin(x)) for x in (i, node, w))
    towards = np.stack([cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si], -1)
    ahead = np.stack([-cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si], -1)
    out = []
    for t in times:
        m = m0 + n * t
        E = m + e * np.sin(m)
        for _ in range(8):
            E = E - (E - e * np.sin(E) - m) / (1 - e * np.cos(E))
        c, s, b = np.cos(E), np.sin(E), a * np.sqrt(1 - e * e)
        r, rate = a * (1 - e * c), n / (1 - e * c)
        place = towards * (a * (c - e))[:, None] + ahead * (b * s)[:, None]
        out.append((place, towards * (-a * s * rate)[:, None] + ahead * (b * c * rate)[:, None], place * (-MU / r**3)[:, None]))
    return out


def orbits(count: int, epochs: int) -> None:
    """A family of orbits against NumPy and against CSPICE's ``conics``."""
    import spiceypy

    rng = np.random.default_rng(1)
    e, angles = rng.uniform(0, 0.7, count), rng.uniform(0, 3, (4, count))
    keys = ("inclination", "node", "argument", "anomaly")
    edge = jf.edges.Kepler(periapsis=7e6, eccentricity=e, mu=MU, **dict(zip(keys, angles, strict=True)))
    b = jf.TreeBuilder()
    start = time.perf_counter()
    b.add_many([f"s{i}" for i in range(count)], parent="world", edge=edge)
    tree = b.build()
    print(f"Kepler, {count} orbits: added and built in {time.perf_counter() - start:.1f} s")
    times = np.linspace(0.0, 86400.0, epochs)
    state, elements = tree.state(time=jnp.asarray(times)), np.asarray(edge.elements)
    start = time.perf_counter()
    jax.block_until_ready(tree.world_motions(state))
    first = time.perf_counter() - start
    found = interleaved({"tree": lambda: tree.world_motions(state), "numpy": lambda: newton(elements, times)}, 3)
    rows = elements[:, [0, 1, 2, 3, 4, 5]] * np.array([1e-3, 1, 1, 1, 1, 1])
    few = 2000
    begin = time.perf_counter()
    for k in range(few):
        spiceypy.conics([*rows[k % count], 0.0, MU / 1e9], 100.0)
    conics = (time.perf_counter() - begin) / few
    ours = min(found["tree"]) / (count * epochs)
    print(f"  {1e-6 / ours:.1f} M states/s with velocity and acceleration in the tree; first answer {first:.1f} s")
    print(f"  NumPy / tree: {min(found['numpy']) / min(found['tree']):.1f} x (target: at least 5 x)")
    print(f"  conics / tree: {conics / ours:.0f} x (target: at least 90 x)")
    ratio("compile", first - min(found["tree"]), 1.0, "s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trajectories", type=int, default=5000)
    parser.add_argument("--orbits", type=int, default=10_000)
    options = parser.parse_args()
    functions(200_000)
    derived(200_000)
    orbits(options.orbits, 100)
    samples(options.trajectories, 100)


if __name__ == "__main__":
    main()
