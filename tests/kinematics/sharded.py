"""Queries over a batch that is spread over devices, compared with each device's share by itself; prints what it finds as JSON.

Run as a program, because the number of devices is settled before JAX starts.
"""

import contextlib
import json
import os
import re
import sys

os.environ["XLA_FLAGS"] = "--xla_force_host_platform_device_count=4"

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P

import jaxframes as jf

BATCH, DEVICES = 8192, 4
APART = {"jacobian"}
"""What is asked in a program of its own. All others share one: they compile in half the time, and what one gathers is seen there too."""
COLLECTIVE = re.compile(r"\b(all-reduce|all-gather|all-to-all|collective-permute|reduce-scatter)(?:-start)?\(")


def scene():
    """Return tables, a tree of tables, joints, a prescribed and an attachable frame, and the arm by itself."""
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("itrf93", parent="earth", edge=tables["itrf93"])
    b.add("craft", parent="earth", edge=jf.edges.Prescribed())
    for i in range(6):
        edge = jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=jf.Transform.from_translation((0.1, 0.2, 0.3)))
        b.add(f"j{i}", parent=f"j{i - 1}" if i else "craft", edge=edge)
    b.add("load", parent="j1", edge=jf.edges.Attachable(candidates=("j1", "craft")))
    tree = b.build()
    return tables, tree, tree.extract("craft")


def queries():
    """Return functions of joint values [n, 6] and times [n] (s)."""
    tables, tree, arm = scene()
    start = jf.Epoch.from_tdb("2026-01-02")

    def loss(q, t):
        motion = tree.motion(tree.state(q=q, qd=q, qdd=q, time=start + t), of="j1", relative_to="craft")
        return sum(jnp.sum(x**2) for x in jax.tree.leaves(motion))

    return {
        "pose": lambda q, t: tree.transform(tree.state(q=q, time=start + t), of="j1", relative_to="itrf93"),
        "motion": lambda q, t: tree.motion(tree.state(q=q, qd=q, qdd=q, time=start + t), of="j1", relative_to="emb"),
        "gradient": jax.vmap(jax.grad(loss)),
        "all frames": lambda q, t: arm.world_motions(arm.state(q=q, qd=q)),
        "jacobian": lambda q, t: tree.jacobian(tree.state(q=q, time=start + t), of="j5", relative_to="craft"),
        "attached": lambda q, t: tree.motion(tree.state(q=q, qd=q, time=start + t), of="load", relative_to="craft"),
        "moon": lambda q, t: tables["moon"].evaluate(start + t),
        "itrf93": lambda q, t: tables["itrf93"].evaluate(start + t),
        "values": lambda q, t: jf.Rotation.exp(q[:, :3]) @ q[:, 3:],
    }


def spread(function, kind, q, t):
    """Return a function's results over all devices, and the compiled program."""
    mesh = jax.make_mesh((DEVICES,), ("b",), axis_types=(AxisType.Explicit if kind == "explicit" else AxisType.Auto,))
    own = NamedSharding(mesh, P("b"))
    arguments = jax.device_put(q, own), jax.device_put(t, own)
    if kind == "shard_map":
        function = jax.shard_map(function, mesh=mesh, in_specs=P("b"), out_specs=P("b"))
    with jax.set_mesh(mesh) if kind == "explicit" else contextlib.nullcontext():
        program = jax.jit(function).lower(*arguments).compile()
        return program(*arguments), program


def main():
    """Compare every query in every way of spreading a batch."""
    jax.config.update("jax_enable_x64", True)
    rng, asked, found = np.random.default_rng(0), queries(), {}
    q, t = rng.normal(size=(BATCH, 6)), np.linspace(0, 86400 * 300, BATCH)
    for names in (APART, asked.keys() - APART):

        def ask(q, t, names=names):
            return {name: jax.tree.leaves(asked[name](q, t)) for name in sorted(names)}

        share = jax.jit(ask)
        parts = [share(*(jnp.asarray(x[i : i + BATCH // DEVICES]) for x in (q, t))) for i in range(0, BATCH, BATCH // DEVICES)]
        alone = jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)
        for kind in ("auto", "explicit", "shard_map"):
            results, program = spread(ask, kind, q, t)
            collectives = sorted({match.group(1) for match in COLLECTIVE.finditer(program.as_text())})
            for name, leaves in results.items():
                off = [float(np.abs(np.asarray(a) - b).max() / np.abs(b).max()) for a, b in zip(leaves, alone[name], strict=True)]
                found[f"{name}, {kind}"] = {
                    "same": all(np.array_equal(np.asarray(a), b) for a, b in zip(leaves, alone[name], strict=True)),
                    "off": max(off),
                    "spread": all(leaf.sharding.shard_shape(leaf.shape)[0] == BATCH // DEVICES for leaf in leaves),
                    "collectives": collectives,
                }
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
