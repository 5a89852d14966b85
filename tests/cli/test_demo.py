"""The command line as its users run it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


def run(*arguments, **options):
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False, **options)


@pytest.mark.float64
def test_the_demo_prints_a_table_and_draws_a_plot(tmp_path):
    plot = tmp_path / "deep" / "demo.png"
    done = run("-m", "jaxframes", "demo", "--samples", "1500", "--plot", str(plot), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "samples a second" in done.stdout
    assert "└── antenna  [revolute about (0, -1, 0)]" in done.stdout
    rows = [line.split() for line in done.stdout.splitlines() if line.startswith("2026-03")]
    assert len(rows) == 6
    ranges = np.array([float(row[1]) for row in rows])
    assert ((ranges > 3.5e5) & (ranges < 4.2e5)).all()  # km: the Moon's distance, give or take the orbit and the station
    assert plot.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.float64
def test_the_demo_agrees_with_cspice():
    done = run("-m", "jaxframes", "demo", "--verify")
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("sun", "emb", "earth", "moon", "mars", "itrf93"):
        assert any(line.startswith(name) for line in done.stdout.splitlines())
    assert "beyond" not in done.stdout


@pytest.mark.float64
def test_the_demos_samples_are_right():
    """Range rates are derivatives of ranges, and the antenna's boresight points at the station."""
    import jax

    from jaxframes.cli import demo_scene
    from jaxframes.spatial import Epoch
    from jaxframes.spice import example_tables

    tree = demo_scene.build_tree(example_tables())
    times = Epoch.from_tdb(demo_scene.START) + np.array([0.0, 1.0, 2.0, 3.0, 4.0, 9.9e5])
    samples = demo_scene.evaluate(tree, times)
    weights = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12  # central differences of fourth order, one second apart
    assert abs(float(weights @ np.asarray(samples.range[:5])) - float(samples.range_rate[2])) < 1e-6
    state = demo_scene.tracking_state(tree, times)
    sight = tree.transform(state, of="station", relative_to="antenna").translation
    offset = np.asarray(sight)
    angle = np.linalg.norm(offset[:, 1:], axis=1) / offset[:, 0]
    assert (np.abs(angle) < 1e-8).all()  # the gimbal's centre is not the craft's: a metre at lunar distance
    rates = jax.device_get(tree.velocity(state, of="station", relative_to="antenna").linear)
    assert (np.abs(rates[:, 1:]) < 5.0).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["demo", "--samples", "1"], "too few"),
        (["demo", "--samples", "x"], "invalid"),
        (["fly"], "invalid choice"),
        ([], "required"),
    ],
)
def test_bad_arguments_exit_with_two(arguments, words):
    done = run("-m", "jaxframes", *arguments)
    assert done.returncode == 2
    assert words in done.stderr


def test_run_py_says_what_it_can_do():
    done = run(str(ROOT / "run.py"), "--help")
    assert done.returncode == 0
    for verb in ("demo", "test", "check", "bench"):
        assert verb in done.stdout


def test_run_py_says_how_to_get_venv(tmp_path):
    """Where the venv module is missing, the message names the package to install."""
    hide = "import sys, runpy; sys.modules['ensurepip'] = None; sys.argv = ['run.py', 'setup']; "
    start = f"runpy.run_path({str(ROOT / 'run.py')!r}, run_name='__main__')"
    done = run("-c", hide + start, env={"JAXFRAMES_VENV": str(tmp_path / "none"), "PATH": "/usr/bin:/bin"})
    assert done.returncode != 0
    assert "apt-get install python3" in done.stderr
    assert "-venv" in done.stderr
