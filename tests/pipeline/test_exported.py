"""Exported programs: symbolic batches, for CPUs and CUDA, with our types in the signature, read where the package is not installed."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import export

from tests.pipeline.trees import queries

pytestmark = pytest.mark.float64

READER = """
import sys
sys.modules["jaxframes"] = None  # as if it were not installed
import jax, numpy as np
jax.config.update("jax_enable_x64", True)
from jax import export
program = export.deserialize(bytearray(open(sys.argv[1], "rb").read()))
given = np.load(sys.argv[2])
for size in (1, 513, 5000):
    found = program.call(given["q"][:size], given["t"][:size])
    for i, leaf in enumerate(found):
        wanted = given[f"{size}_{i}"]
        np.testing.assert_allclose(leaf, wanted, rtol=1e-13, atol=1e-13 * np.abs(wanted).max())
"""


def exported(function):
    (b,) = export.symbolic_shape("b")
    kinds = jax.ShapeDtypeStruct((b, 2), jnp.float64), jax.ShapeDtypeStruct((b,), jnp.float64)
    return export.export(jax.jit(function), platforms=("cpu", "cuda"))(*kinds).serialize()


def batch(size):
    rng = np.random.default_rng(0)
    return rng.normal(size=(size, 2)), rng.uniform(0.0, 1e6, size)


@pytest.mark.parametrize("name", ["pose", "motion", "all frames", "jacobian", "table", "gradient", "light time"])
def test_symbolic_batches(name):
    """Values of our types too may stand in a signature."""
    gradient = jax.grad(lambda q, t: jnp.sum(queries()["pose"](q, t).translation), (0, 1))
    query = gradient if name == "gradient" else queries()[name]
    program, compiled = export.deserialize(exported(query)), jax.jit(query)
    for size in (3,) if name in ("light time", "gradient", "motion") else (1, 1500):
        q, t = batch(size)
        found, wanted = program.call(q, t), compiled(q, t)
        assert type(found) is type(wanted)
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-13 * float(jnp.abs(b).max()))


def test_a_process_without_the_package_gets_the_same(tmp_path):
    query = lambda q, t: jax.tree.leaves((queries()["pose"](q, t), queries()["all frames"](q, t)))
    (tmp_path / "program").write_bytes(exported(query))
    q, t = batch(5000)
    results = {f"{n}_{i}": leaf for n in (1, 513, 5000) for i, leaf in enumerate(jax.jit(query)(q[:n], t[:n]))}
    np.savez(tmp_path / "given.npz", q=q, t=t, **results)
    subprocess.run([sys.executable, "-c", READER, str(tmp_path / "program"), str(tmp_path / "given.npz")], check=True)
