"""What the tests of this folder ask of: a tree with tables, joints, a prescribed and an attachable frame, and queries of every kind."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

import jaxframes as jf

START = jf.Epoch.from_tdb("2026-02-01")


def turned(rng):
    """A mount in a random place."""
    return jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))


@functools.cache
def scene():
    """The tree and the arm by itself."""
    rng, tables = np.random.default_rng(0), jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    for name, parent in (("emb", "ssb"), ("earth", "emb"), ("moon", "earth"), ("itrf93", "earth")):
        b.add(name, parent=parent, edge=tables[name])
    b.add("craft", parent="earth", edge=jf.edges.Prescribed())
    b.add("j0", parent="craft", edge=jf.edges.Revolute(axis=(0, 0, 1), placement=turned(rng), limits=(-2.0, 2.0)))
    b.add("j1", parent="j0", edge=jf.edges.Prismatic(axis=(0, 1, 1), placement=turned(rng)))
    b.add("camera", parent="j1", edge=jf.edges.Fixed(turned(rng)))
    b.add("load", parent="j1", edge=jf.edges.Attachable(candidates=("j1", "craft")))
    tree = b.build()
    return tree, tree.extract("craft")


def total(value):
    """The sum of squares of all floats."""
    return sum(jnp.sum(x * x) for x in jax.tree.leaves(value) if jnp.issubdtype(x.dtype, jnp.floating))


def queries():
    """Functions of joint values [..., 2] and seconds [...]."""
    tree, arm = scene()
    held = lambda q, t: tree.state(q=q, qd=q, qdd=q, time=START + t)
    return {
        "pose": lambda q, t: tree.transform(held(q, t), of="camera", relative_to="itrf93"),
        "motion": lambda q, t: tree.motion(held(q, t), of="camera", relative_to="craft"),
        "all frames": lambda q, t: arm.world_motions(arm.state(q=q, qd=q, qdd=q)),
        "jacobian": lambda q, t: tree.jacobian(held(q, t), of="camera", relative_to="craft"),
        "attached": lambda q, t: tree.transform(held(q, t), of="load", relative_to="craft"),
        "attach": lambda q, t: tree.attach(held(q, t), "load", "craft", keep="world"),
        "table": lambda q, t: tree.edge("moon").evaluate(START + t),
        "light time": lambda q, t: tree.apparent(held(q, t), of="moon", relative_to="craft", order=0),
        "values": lambda q, t: (jf.Rotation.from_rpy(q[..., 0], q[..., 1], t) @ jf.Rotation.exp(jnp.stack([t, t, t], -1))).log(),
    }
