"""What is written runs: the README's Python blocks, and the examples in docstrings."""

import doctest
import importlib
import pkgutil
import re
from pathlib import Path

import jax
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
@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples(name):
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        result = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0
