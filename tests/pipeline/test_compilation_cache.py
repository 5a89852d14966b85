"""With a compilation cache a second process compiles nothing, and its numbers are the first one's to the last bit."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.float64
def test_a_second_process_compiles_nothing_and_gets_the_same(tmp_path):
    def run(name):
        command = [sys.executable, "-m", "tests.pipeline.cached", str(tmp_path / "cache"), str(tmp_path / name)]
        environment = {**os.environ, "JAX_PLATFORMS": "cpu", "PYTHONPATH": str(ROOT)}
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stderr
        return [int(number) for number in done.stdout.split()], dict(np.load(tmp_path / name))

    (hits, misses), first = run("first.npz")
    assert hits == 0
    assert misses > 8
    counted, second = run("second.npz")
    assert counted == [misses, 0]
    assert set(first) == set(second)
    for name, values in first.items():
        np.testing.assert_array_equal(second[name], values)
