"""What is written runs: the README's Python blocks, and the examples in docstrings."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxframes

README = Path(__file__).resolve().parent.parent / "README.md"
MODULES = sorted(
    m.name for m in pkgutil.walk_packages(jaxframes.__path__, "jaxframes.") if not m.name.endswith(("__main__", "worker", "demo_plot"))
)


@pytest.mark.float64
def test_the_readme_runs_as_written():
    text = README.read_text()
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) >= 2
    scope = {}
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        exec("\n".join(blocks[:1]), scope)
        shown = re.search(r"```text\n(.*?)```", text, re.DOTALL)
        assert str(scope["tree"]) == shown.group(1).rstrip()
        assert scope["ranges"].shape == (10_000,)
        velocity = scope["tree"].velocity(scope["state"], of="moon", relative_to="station").linear
        position = scope["tree"].transform(scope["state"], of="moon", relative_to="station").translation
        rate = float(position @ velocity / jax.numpy.linalg.norm(position))
        assert abs(float(scope["range_rates"][0]) - rate) < 1e-9 * abs(rate)
        exec("\n".join(blocks[1:]), scope)
        assert scope["scene"].parent("box", scope["state"]) == "hand"


@pytest.mark.float64
def test_the_page_on_pipelines_runs_as_written():
    text = (README.parent / "docs" / "pipeline.md").read_text()
    scope = {}
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), scope)
    assert scope["mapped"].shape == (2, 3)
    assert abs(float(scope["step"][2]) + 0.2) < 1e-6  # the camera was moved up by 0.1


@pytest.mark.float64
def test_the_page_on_motion_runs_as_written():
    text = (README.parent / "docs" / "motion.md").read_text()
    scope = {}
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), scope)
        swing, rate, t = 0.2, 0.5, 3.0
        s, c = np.sin(rate * t), np.cos(rate * t)
        angle, turning = swing * s, swing * rate * c
        np.testing.assert_allclose(scope["hook"].velocity.linear[0], -5.0 * turning * np.cos(angle), rtol=1e-12)
        change = swing * (c - rate * t * s) * np.cos(angle) - turning * np.sin(angle) * swing * t * c
        np.testing.assert_allclose(scope["by_rate"], [-5.0 * change], rtol=1e-12)
        assert 0.1 < abs(scope["off"]) < 0.25
        assert scope["slope"].shape == (11, 3)
        assert scope["motion"].transform.translation.shape == (66, 3, 3)
        np.testing.assert_allclose(scope["nearest"], 7.2e6, rtol=2e-3)
        y = jax.numpy.concatenate(scope["first"])
        pull = scope["pull"](y[:3]) + 1e-9 * np.array([7e6, 0, 2])
        np.testing.assert_allclose(scope["right_hand_side"](0.0, y, None)[3:], pull, rtol=1e-12)
        b = jaxframes.TreeBuilder()
        b.add("craft", parent="world", edge=scope["flown"])
        tree = b.build()
        flown = tree.motion(tree.state(time=scope["start"] + 300.0), of="craft", relative_to="world")
        np.testing.assert_allclose(flown.transform.translation, scope["r"][30], rtol=1e-12)
        np.testing.assert_allclose(flown.velocity.linear, scope["v"][30], rtol=1e-12)
        np.testing.assert_allclose(flown.acceleration.linear, scope["a"][30], rtol=1e-9, atol=1e-9)
        assert np.linalg.norm(scope["turn"]) > 0.05


@pytest.mark.float64
@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples(name):
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        result = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0
