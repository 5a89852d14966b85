"""Trees through JSON: every number exactly, and damaged text refused."""

import json

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import FormatError
from tests.random_trees import random_tree


def leaves_equal(a, b):
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("seed", range(3))
def test_round_trip_is_lossless(seed, dtype):
    tree, _, _ = random_tree(np.random.default_rng(seed), 12, dtype)
    again = jf.from_json(jf.to_json(tree))
    assert again.topology == tree.topology
    leaves_equal(again, tree)


def test_joint_names_properties_and_limits_survive():
    b = jf.TreeBuilder(root="world")
    b.add("a", parent="world", edge=jf.edges.Revolute(limits=(-1, np.inf)), joint="j", properties={"k": {"n": [1, 2.5, "x", None]}})
    b.set_properties("world", {"origin": "here"})
    tree = b.build()
    again = jf.from_json(jf.to_json(tree, indent=None))
    assert again.topology == tree.topology
    assert again.properties["a"]["k"]["n"] == (1, 2.5, "x", None)
    np.testing.assert_array_equal(again.edge("a").limits, [-1, np.inf])


def change(text, path, value):
    whole = json.loads(text)
    at = whole
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return json.dumps(whole)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda text: text[:-20], "no JSON"),
        (lambda text: "[]", "no tree"),
        (lambda text: change(text, ["jaxframes_tree"], 99), "99"),
        (lambda text: change(text, ["frames", 0, "edge", "type"], "os:path"), "os:path"),
        (lambda text: change(text, ["frames", 0, "edge", "type"], "jaxframes.edges.fixed:Nothing"), "Nothing"),
        (lambda text: change(text, ["frames", 0, "edge", "fields"], {}), "fields"),
        (lambda text: change(text, ["frames", 0], {}), "damaged"),
        (lambda text: change(text, ["frames", 0, "parent"], "nowhere"), "nowhere"),
    ],
)
def test_damaged_text_is_refused(damage, words):
    b = jf.TreeBuilder(root="world")
    b.add("a", parent="world", edge=jf.edges.Fixed())
    with pytest.raises(jf.FrameError, match=words):
        jf.from_json(damage(jf.to_json(b.build())))


def test_the_error_is_of_its_own_kind():
    with pytest.raises(FormatError):
        jf.from_json("no")
