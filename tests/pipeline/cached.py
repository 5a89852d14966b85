"""Queries of several kinds with a compilation cache; saves what they give, and prints how many programs the cache gave and how many not.

Run as a program, because what a process compiled once it does not look for in the cache: ``cached.py <folder> <file.npz>``.
"""

import sys

import jax
import jax.numpy as jnp
import numpy as np

from tests.pipeline.trees import queries, total

KINDS = ("pose", "all frames", "table", "jacobian")


def main(folder, file):
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    events = []
    jax.monitoring.register_event_listener(lambda name, **more: events.append(name.rpartition("/")[2]))
    q, t = jnp.asarray(np.random.default_rng(0).normal(size=(5, 2))), jnp.linspace(0.0, 100.0, 5)
    found = {}
    for name in KINDS:
        query = queries()[name]
        found[name] = jax.tree.leaves(jax.jit(query)(q, t))
        found[f"{name} gradient"] = [jax.jit(jax.grad(lambda q, t, query=query: total(query(q, t))))(q, t)]
    np.savez(file, **{f"{name} {i}": np.asarray(leaf) for name, leaves in found.items() for i, leaf in enumerate(leaves)})
    print(events.count("cache_hits"), events.count("cache_misses"))


if __name__ == "__main__":
    main(*sys.argv[1:])
