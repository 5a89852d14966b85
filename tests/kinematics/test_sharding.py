"""Batches spread over several devices: Auto and Explicit meshes and shard_map give each device's share as if it were alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.float64

KINDS = ("auto", "explicit", "shard_map")
EXACT = ("motion", "gradient", "jacobian", "values")
"""What is the same to the last bit in every way. In the others XLA folds the constants of a program of one device otherwise than those of a
program of several, and a last bit may differ."""


@pytest.fixture(scope="module")
def found():
    root = Path(__file__).parents[2]
    run = subprocess.run(
        [sys.executable, "-m", "tests.kinematics.sharded"],
        capture_output=True,
        text=True,
        cwd=root,
        env={**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": str(root)},
        timeout=600,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


@pytest.mark.parametrize("kind", KINDS)
def test_values_are_those_of_each_share(found, kind):
    own = {name.rpartition(", ")[0]: result for name, result in found.items() if name.endswith(f", {kind}")}
    assert set(EXACT) < set(own)
    for name, result in own.items():
        assert result["off"] <= 4e-15, name
        assert result["same"] or name not in EXACT, name


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_gathered(found, kind):
    for name, result in found.items():
        if name.endswith(f", {kind}"):
            assert result["spread"], name
            assert result["collectives"] == [], name
