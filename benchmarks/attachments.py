"""A query through two attachable frames against the same query on the equivalent static tree: batch 65 536, printed as a ratio.

Run: ``python benchmarks/attachments.py [--batch N]``
"""

import argparse

import jax
import jax.numpy as jnp
import numpy as np
from _timing import interleaved, nanoseconds

import jaxframes as jf


def scene(attachable: bool) -> jf.FrameTree:
    b = jf.TreeBuilder(root="world")
    parent = "world"
    for i in range(6):
        placement = jf.Transform(jf.Rotation.from_rpy(0.3 * i, 0.2, -0.1), np.array([0.1, 0.2, 0.3]))
        b.add(f"j{i}", parent=parent, edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=placement))
        parent = f"j{i}"
    b.add("hand", parent=parent, edge=jf.edges.Fixed(jf.Transform.from_translation((0.0, 0.0, 0.1))))
    b.add("table", parent="world", edge=jf.edges.Fixed(jf.Transform.from_translation((0.5, 0.0, 0.0))))
    pose = jf.Transform(jf.Rotation.from_rpy(0.1, 0.2, 0.3), np.array([0.1, 0.0, 0.05]))
    box = jf.edges.Attachable(pose, candidates=("hand", "table")) if attachable else jf.edges.Fixed(pose)
    b.add("box", parent="hand", edge=box)
    note = jf.edges.Attachable(pose, candidates=("box", "table")) if attachable else jf.edges.Fixed(pose)
    b.add("note", parent="box", edge=note)
    return b.build()


def main() -> None:
    """Time both queries in turn, poses and motions, float64."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--batch", type=int, default=65_536)
    batch = parser.parse_args().batch
    jax.config.update("jax_enable_x64", True)
    print(f"jax {jax.__version__}, float64, batch {batch}")
    rng = np.random.default_rng(0)
    attachable, static = scene(True), scene(False)
    q, qd, qdd = (jnp.asarray(rng.normal(size=(batch, 6))) for _ in range(3))
    index = attachable.topology.index
    box = rng.choice([index("hand"), index("table")], batch)
    note = rng.choice([index("box"), index("table")], batch)
    held = attachable.state().attachments
    parents = jnp.asarray(np.stack([box, note], -1), jnp.int32)
    for name, order in (("pose", 0), ("pose, velocity and acceleration", 2)):

        def ask(tree, state, order=order):
            query = tree.transform if order == 0 else tree.motion
            return query(state, of="note", relative_to="world")

        moving = attachable.state(q=q, qd=qd, qdd=qdd).replace(attachments=jf.Attachments(parents, held.motion))
        still = static.state(q=q, qd=qd, qdd=qdd)
        through = jax.jit(lambda s, ask=ask: ask(attachable, s))
        plain = jax.jit(lambda s, ask=ask: ask(static, s))
        runs = interleaved({"attachable": lambda f=through, s=moving: f(s), "static": lambda f=plain, s=still: f(s)}, 15)
        mine, theirs = (nanoseconds(runs[side], batch)[1] for side in ("attachable", "static"))
        print(f"{name}: {mine:.1f} ns a sample through two attachable frames, {theirs:.1f} ns on the equivalent static tree: ", end="")
        print(f"ratio {mine / theirs:.2f} (asked: at most 3)")


if __name__ == "__main__":
    main()
