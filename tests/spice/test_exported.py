"""Programs that are exported and read back say the same, bit for bit."""

import jax
import jax.export
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.tables import evaluate
from tests.spice.test_iau import PCK


@pytest.fixture(scope="module")
def mars():
    with jf.spice.Kernels(PCK) as kernels:
        return kernels.orientation(frame="IAU_MARS")


def exported(program, *arguments):
    """A function as it comes out of the bytes that its export is written as."""
    return jax.export.deserialize(jax.export.export(jax.jit(program))(*arguments).serialize()).call


@pytest.mark.parametrize("count", [3, 2 * evaluate.BLOCK + 5])
def test_tables_and_models(moon, itrf93, mars, rng, dtype, count):
    def program(hi, lo):
        epoch = jf.Epoch(hi, lo)
        return [table.evaluate(epoch) for table in (moon, itrf93, mars)], moon.evaluate_two_part(epoch), moon.coverage_code(epoch)

    hi, lo = (rng.integers(820497600 // 64, 852033600 // 64, count) * 64).astype(dtype), rng.uniform(0, 64, count).astype(dtype)
    again, here = exported(program, hi, lo)(hi, lo), jax.jit(program)(hi, lo)
    assert jax.tree.structure(again) == jax.tree.structure(here)
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(here), strict=True):
        assert a.dtype == b.dtype
        assert np.array_equal(a, b)
        assert np.isfinite(a).all()


def test_a_tree(kernels, rng, dtype):
    tree = kernels.tree(bodies="MOON", frames="ITRF93", start="2026-01-01", stop="2026-02-01")

    def program(hi, lo):
        motion = tree.motion(tree.state(time=jf.Epoch(hi, lo)), of="MOON", relative_to="ITRF93")
        return motion.transform.translation, motion.velocity.linear, motion.acceleration.linear

    hi, lo = (820497600 + rng.integers(0, 40000, 50) * 64).astype(dtype), rng.uniform(0, 64, 50).astype(dtype)
    for a, b in zip(exported(program, hi, lo)(hi, lo), jax.jit(program)(hi, lo), strict=True):
        assert np.array_equal(a, b)
        assert np.isfinite(a).all()
