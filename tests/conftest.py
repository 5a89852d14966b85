"""Shared set-up: the precision of a run, strict promotion, and tolerances for each dtype."""

import jax
import numpy as np
import pytest


def pytest_addoption(parser):
    parser.addoption("--precision", choices=("float64", "float32"), default="float64", help="default float dtype of the run")


def pytest_configure(config):
    jax.config.update("jax_enable_x64", config.getoption("--precision") == "float64")
    jax.config.update("jax_numpy_dtype_promotion", "strict")
    jax.config.update("jax_numpy_rank_promotion", "raise")
    jax.config.update("jax_platforms", "cpu")


def pytest_collection_modifyitems(config, items):
    if config.getoption("--precision") == "float64":
        return
    left_out = [item for item in items if item.get_closest_marker("float64")]
    items[:] = [item for item in items if not item.get_closest_marker("float64")]
    config.hook.pytest_deselected(items=left_out)


@pytest.fixture
def dtype():
    """The default float dtype of the run."""
    return np.dtype(jax.numpy.zeros(()).dtype)


@pytest.fixture
def tol(dtype):
    """Relative tolerance of a short chain of operations on numbers near one."""
    return 1e-12 if dtype == np.float64 else 2e-5


@pytest.fixture
def rng():
    """A generator with a fixed seed, so that a failure can be run again."""
    return np.random.default_rng(20260101)
