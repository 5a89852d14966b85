"""Large trees: 100 000 frames against NumPy by level, and a chain of 1 000 joints against a hand-written ``lax.scan``, as ratios.

Run: ``python benchmarks/large_trees.py [--branches N]``
"""

import argparse

import jax
import jax.numpy as jnp
import numpy as np
from _timing import compiled, interleaved, nanoseconds

import jaxframes as jf


def branches(count: int, depth: int) -> jf.FrameTree:
    """Return branches of revolute joints below one root."""
    rng, b = np.random.default_rng(0), jf.TreeBuilder()
    mounts = [jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3)) for _ in range(20)]
    edges = [jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=mount) for i, mount in enumerate(mounts)]
    for i in range(count):
        for d in range(depth):
            b.add(f"{i}/{d}", parent=f"{i}/{d - 1}" if d else "world", edge=edges[(i + d) % 20])
    return b.build()


def numbers(tree: jf.FrameTree) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return placements (quaternion, translation) and axes of all edges."""
    edges = [tree.edge(name) for name in tree.names[1:]]
    parts = ([np.asarray(x) for x in (e.placement.rotation.wxyz, e.placement.translation, e.axis)] for e in edges)
    return tuple(np.stack(column) for column in zip(*parts, strict=True))


def product(a, b, np=np):
    (w, x, y, z), (W, X, Y, Z) = (tuple(v[..., i] for i in range(4)) for v in (a, b))
    parts = (w * W - x * X - y * Y - z * Z, w * X + x * W + y * Z - z * Y, w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W)
    return np.stack(parts, -1)


def turned(q, v, np=np):
    t = 2 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * t + np.cross(q[..., 1:], t)


def wide(count: int, depth: int) -> None:
    """Time one sample of a wide tree."""
    tree = branches(count, depth)
    fixed, arms, axes = (x.reshape(count, depth, -1) for x in numbers(tree))
    q = np.random.default_rng(1).normal(size=tree.nq)

    def by_level():
        half = q.reshape(count, depth, 1) / 2
        local = product(fixed, np.concatenate([np.cos(half), np.sin(half) * axes], -1))
        here, at = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.zeros((count, 3))
        found = []
        for d in range(depth):
            at, here = at + turned(here, arms[:, d]), product(here, local[:, d])
            found.append((here, at))
        return [np.stack(column, 1) for column in zip(*found, strict=True)]

    given = jnp.asarray(q)
    ours, seconds = compiled(lambda q: tree.world_transforms(tree.state(q=q)), given)
    assert np.allclose(np.asarray(ours(given).translation)[1:].reshape(count, depth, 3), by_level()[1], atol=1e-9)
    runs = interleaved({"ours": lambda: ours(given), "NumPy": by_level}, 9)
    mine, theirs = (nanoseconds(runs[name], tree.nq)[0] for name in ("ours", "NumPy"))
    print(f"{tree.nq} frames, one sample: {mine:.1f} ns a frame, {theirs / mine:.1f}x NumPy by level, compiled in {seconds:.1f} s")


def long(joints: int, batch: int) -> None:
    """Time all poses of a chain."""
    tree = branches(1, joints)
    fixed, arms, axes = (jnp.asarray(x) for x in numbers(tree))
    q = jnp.asarray(np.random.default_rng(1).normal(size=(batch, joints)))

    def scanned(q):
        def step(carry, edge):
            here, at = carry
            half, fixed, arm, axis = edge
            local = product(fixed, jnp.concatenate([jnp.cos(half)[:, None], jnp.sin(half)[:, None] * axis], -1), jnp)
            at = at + turned(here, jnp.broadcast_to(arm, at.shape), jnp)
            return (product(here, local, jnp), at), (product(here, local, jnp), at)

        start = jnp.tile(jnp.array([1.0, 0.0, 0.0, 0.0]), (batch, 1)), jnp.zeros((batch, 3))
        _, found = jax.lax.scan(step, start, (q.T / 2, fixed, arms, axes))
        return jax.tree.map(lambda x: jnp.moveaxis(x, 0, 1), found)

    ours, seconds = compiled(lambda q: tree.world_transforms(tree.state(q=q)), q)
    scan, _ = compiled(scanned, q)
    assert np.allclose(ours(q).translation[:, 1:], scan(q)[1], atol=1e-8)
    runs = interleaved({"ours": lambda: ours(q), "scan": lambda: scan(q)}, 15)
    mine, theirs = (nanoseconds(runs[name], batch)[0] for name in ("ours", "scan"))
    print(f"chain of {joints}, batch {batch}: {mine / 1e3:.1f} us a sample, {theirs / mine:.2f}x lax.scan, compiled in {seconds:.1f} s")


def main() -> None:
    """Print both rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--branches", type=int, default=10_000)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"jax {jax.__version__}, float64")
    wide(options.branches, 10)
    long(1000, 256)


if __name__ == "__main__":
    main()
