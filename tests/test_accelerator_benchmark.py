"""The benchmark of every kind of query on any device: it runs small on a CPU, times everything, and the values are right."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
QUERIES = {
    *("pose", "pose, velocity, acceleration", "all frames", "Jacobian", "gradient of a pose loss", "gradient of a motion loss"),
    *("DE440 table, Moon", "ITRF93 table", "light time", "1000 frames"),
}
BOTH = {(query, dtype) for query in QUERIES for dtype in ("float64", "float32")}


@pytest.mark.float64
def test_the_small_run_times_every_query_and_all_values_are_right(tmp_path):
    figures = tmp_path / "figures.json"
    command = [
        sys.executable,
        "benchmarks/accelerator.py",
        "--small",
        "--no-peers",
        "--json",
        str(figures),
    ]  # peers are measured, not judged
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "JAX_PLATFORMS": "cpu"}
    environment["JAX_DISABLE_MOST_OPTIMIZATIONS"] = "1"  # programs compile faster; how fast they run is not judged here
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(figures.read_text())

    assert found["skipped"] == []
    assert found["copy bytes/s"] > 0
    assert {(row["query"], row["dtype"]) for row in found["times"]} == BOTH
    for row in found["times"]:
        assert all(math.isfinite(row[x]) and row[x] > 0 for x in ("ns", "share", "lowering s", "compiling s")), row

    assert {(row["query"], row["dtype"]) for row in found["values"]} == BOTH
    for row in found["values"]:
        assert len(row["ulp"]) == len(row["bounds"])
        assert all(off <= bound for off, bound in zip(row["ulp"], row["bounds"], strict=True)), row
