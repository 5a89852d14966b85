"""Trees through JSON: every number exactly, and damaged text refused."""

import importlib
import json
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
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


E = jf.edges
POSE = jf.Transform.from_translation((0.1, -0.2, 0.3))


@E.family(name="test.crank", static=("teeth",))
class Crank(E.Edge):
    """A family of a user's own, whose constructor checks."""

    nq = nv = 1
    radius: jax.Array
    teeth: int

    def __init__(self, radius, teeth=8):
        if not np.all(np.asarray(radius) > 0):
            raise jf.FrameError(f"a crank has a positive radius, found {radius}")
        object.__setattr__(self, "radius", jnp.atleast_1d(jnp.asarray(radius, float)))
        object.__setattr__(self, "teeth", teeth)

    def steps(self, inputs, order):
        (radius,), (q,) = inputs.components(self.radius), inputs.q
        return (E.steps.Rigid(translation=E.steps.V3(radius * q, 0.0, 0.0)),)


def every_kind():
    joints = (E.Revolute((1, 2, 3), POSE, (-1, np.inf), 2.0, 3.0, False), E.Continuous((0, 1, 1)), E.Prismatic(), E.Screw(pitch=0.3))
    joints += (E.Cylindrical(limits=((-1, -2), (1, np.inf))), E.Universal(), E.Spherical(POSE, limits=(-1, 1)), E.PrismaticSpherical())
    joints += (E.PrismaticUniversal(), E.Planar((0, 1, 1)), E.Ball(POSE), E.Free(), E.Virtual(3, limits=((-1, -1, -1), (1, 1, 1))))
    others = (E.Fixed(POSE), E.Prescribed(False), E.Movable(POSE), E.Attachable(POSE, ["f0", "world"]), Crank(0.2, 9))
    b = jf.TreeBuilder()
    for i, edge in enumerate((*joints, *others)):
        b.add(f"f{i}", parent="world", edge=edge)
    b.add("follower", parent="world", edge=E.Mimic("f0", E.Screw((0, 1, 0), 0.2), -2.0, 0.1))
    return b.build()


def test_every_family_keeps_every_number():
    tree = every_kind()
    again = jf.from_json(jf.to_json(tree))
    assert again.topology == tree.topology
    for name, edge in tree.edges.items():
        assert type(again.edge(name)) is type(edge)
        assert jax.tree.structure(again.edge(name)) == jax.tree.structure(edge), name  # limits and other static facts included
    leaves_equal(again, tree)


def test_numbers_that_an_optimiser_left_are_kept_as_they_are(dtype):
    tree = every_kind().with_values({"f0.axis": [0.3, 0.1, 0.2], "f13.transform.rotation": np.array([2.0, 0.1, 0, 0], dtype)})
    leaves_equal(jf.from_json(jf.to_json(tree)), tree)
    batch = tree.with_values({"f0.axis": np.ones((3, 3), dtype)})
    leaves_equal(jf.from_json(jf.to_json(batch)), batch)


def test_a_text_names_families_and_nothing_else():
    whole = json.loads(jf.to_json(every_kind()))
    names = [frame["edge"]["family"] for frame in whole["frames"]]
    assert names[:3] == ["revolute", "continuous", "prismatic"]
    assert names[-2:] == ["test.crank", "mimic"]
    assert "jaxframes." not in json.dumps(whole)


def test_a_family_without_a_name_is_refused_by_name():
    @E.family()
    class Wheel(E.Edge):
        radius: jax.Array

    b = jf.TreeBuilder()
    b.add("hub", parent="world", edge=Wheel(0.3))
    with pytest.raises(errors.EdgeError, match=r"frame 'hub': Wheel has no name for files.*@jf\.edges\.family\(name=...\)"):
        jf.to_json(b.build())


def test_a_constructor_that_takes_something_else_is_refused_before_anything_is_written():
    @E.family(name="test.shaft")
    class Shaft(E.Edge):
        radius: jax.Array

        def __init__(self, diameter):
            object.__setattr__(self, "radius", jnp.full(1, diameter / 2))

    b = jf.TreeBuilder()
    b.add("shaft", parent="world", edge=Shaft(0.3))
    with pytest.raises(errors.EdgeError, match=r"frame 'shaft': the constructor of Shaft does not take.*override arguments\(\)"):
        jf.to_json(b.build())


def test_properties_that_json_cannot_keep_are_refused_by_name():
    for value, words in ((b"x", "frame 'a': a property holds b'x'"), (np.inf, "frame 'a': a property holds inf")):
        b = jf.TreeBuilder()
        b.add("a", parent="world", edge=E.Fixed(), properties={"k": [value]})
        with pytest.raises(jf.FrameError, match=words):
            jf.to_json(b.build())
    deep = "x"
    for _ in range(150):
        deep = [deep]
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=E.Fixed(), properties={"k": deep})
    with pytest.raises(jf.FrameError, match="more than 100"):
        jf.to_json(b.build())


EDGE = ["frames", 0, "edge"]
ARGUMENTS = [*EDGE, "arguments"]


def example():
    b = jf.TreeBuilder(root="world")
    b.add("a", parent="world", edge=E.Revolute(limits=(-1, 1)), properties={"k": 1})
    return jf.to_json(b.build())


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda text: text[:-20], "no JSON"),
        (lambda text: text.replace('"k": 1', '"k": NaN'), "no JSON: NaN"),
        (lambda text: None, "no JSON"),
        (lambda text: "[" * 100_000, "no JSON"),
        (lambda text: "[]", "no tree"),
        (lambda text: change(text, ["jaxframes_tree"], 99), "schema 1, the only one.*99.*jf.to_json"),
        (lambda text: change(text, ["jaxframes_tree"], True), "True"),
        (lambda text: change(text, [*EDGE, "family"], "os:path"), "frame 'a': there is no edge family 'os:path'"),
        (lambda text: change(text, [*EDGE, "family"], "jaxframes.__main__:X"), "no edge family 'jaxframes.__main__:X'"),
        (lambda text: change(text, [*EDGE, "family"], "revolut"), "Did you mean 'revolute'.*has been imported"),
        (lambda text: change(text, [*EDGE, "type"], "os:path"), "frame 'a': an object with the keys .*stands for nothing"),
        (lambda text: change(text, ARGUMENTS, {"angle": 1}), "frame 'a': 'revolute' does not take these arguments.*angle"),
        (lambda text: change(text, ARGUMENTS, 3), "frame 'a': its JSON is damaged"),
        (lambda text: change(text, [*ARGUMENTS, "active"], "x"), "frame 'a': Revolute.active=.... takes True or False, not 'x'"),
        (lambda text: change(text, [*ARGUMENTS, "limits"], [1, 2, 3]), "frame 'a': joint limits are .lower, upper."),
        (lambda text: change(text, [*ARGUMENTS, "limits"], [1, -1]), "frame 'a': joint limits are reversed"),
        (lambda text: change(text, [*ARGUMENTS, "velocity_limits"], [-1]), "frame 'a': velocity limits.*negative"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "numbers"], ["nan", 0, 1]), "frame 'a': a joint axis must be finite"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "numbers"], [0, 1]), "needs 3 numbers, found 2"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "numbers"], [0, None, 1]), "of another kind"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "numbers"], [0, "one", 1]), "one of 'inf', '-inf', 'nan'"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "numbers"], [0, 10**400, 1]), "frame 'a'"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "shape"], [-1]), "whole numbers"),
        (lambda text: change(text, [*ARGUMENTS, "axis", "dtype"], "U9"), "a dtype is one of 'float16'"),
        (lambda text: change(text, [*ARGUMENTS, "axis"], {"float": "0x1p99999"}), "one of 'inf', '-inf', 'nan', found '0x1p99999'"),
        (lambda text: text.replace("-1.0", "1e999"), "beyond what a float holds"),
        (lambda text: change(text, [*ARGUMENTS, "placement", "value"], "Epoch"), "Epoch has the fields .'hi', 'lo'."),
        (lambda text: change(text, [*ARGUMENTS, "placement", "value"], "Rotation3"), "a value is one of"),
        (
            lambda text: change(text, [*ARGUMENTS, "placement", "fields", "translation", "shape"], [3, 1]),
            "Transform: translation is an array",
        ),
        (lambda text: change(text, [*ARGUMENTS, "placement", "fields", "rotation"], 1), "Transform: rotation is Rotation, found int"),
        (lambda text: change(text, [*ARGUMENTS, "placement"], [1]), "placement must be a jf.Transform"),
        (lambda text: change(text, EDGE, {"table": "AAAA"}), "frame 'a': the table is not a table file"),
        (lambda text: change(text, EDGE, {"table": "?"}), "frame 'a'"),
        (lambda text: change(text, EDGE, 3), "an edge is an object"),
        (lambda text: change(text, ["frames", 0], {}), "damaged: a frame has the keys"),
        (lambda text: change(text, ["frames"], {}), "frames is a list"),
        (lambda text: change(text, ["joint_order"], "a"), "joint_order is a list"),
        (lambda text: change(text, ["more"], {}), "damaged: a tree has the keys"),
        (lambda text: change(text, ["frames", 0, "parent"], "nowhere"), "nowhere"),
        (lambda text: change(text, ["frames", 0, "parent"], []), "damaged"),
        (lambda text: change(text, ["frames", 0, "joint"], 5), "a joint's name must be text"),
        (lambda text: change(text, ["frames", 0, "properties"], 5), "damaged"),
        (lambda text: change(text, ["frames", 0, "properties", "k"], json.loads("[" * 900 + "]" * 900)), "more than 100"),
        (lambda text: change(text, ARGUMENTS, json.loads("[" * 900 + "]" * 900)), "more than 100"),
        (lambda text: change(text, ["root"], 5), "text that is not empty"),
        (lambda text: change(text, ["joint_order"], ["b"]), "no joint 'b'"),
    ],
)
def test_damaged_text_is_refused(damage, words):
    with pytest.raises(jf.FrameError, match=words):
        jf.from_json(damage(example()))


def test_whatever_a_damaged_text_holds_the_error_is_of_the_family(rng):
    text = jf.to_json(every_kind(), indent=None)
    pieces = ["0", "-1", "1e400", '"x"', "null", "true", "[]", "{}", "[[1]]", '{"float": "nan"}', '{"dtype": "int8"}', ",", "}", "9" * 30]
    refused = 0
    for _ in range(600):
        at = int(rng.integers(len(text)))
        end = at + int(rng.choice([0, 1, 2, 5, 30]))
        damaged = text[:at] + pieces[rng.integers(len(pieces))] + text[end:]
        try:
            jf.from_json(damaged)
        except jf.FrameError:
            refused += 1
    assert refused > 400


def test_loading_imports_nothing(monkeypatch):
    text = change(example(), [*EDGE, "family"], "antigravity:fly")
    monkeypatch.setattr(importlib, "import_module", lambda *given: pytest.fail("imported"))
    before = set(sys.modules)
    with pytest.raises(FormatError, match="antigravity"):
        jf.from_json(text)
    assert set(sys.modules) == before


def test_the_error_is_of_its_own_kind():
    with pytest.raises(FormatError):
        jf.from_json("no")


def test_a_table_whose_numbers_were_changed_beyond_what_its_file_keeps_is_refused():
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=jf.spice.example_tables()["earth"])
    tree = b.build()
    leaves_equal(jf.from_json(jf.to_json(tree)), tree)
    moved = tree.with_values({"earth.reference": tree.get("earth.reference") + 1})
    with pytest.raises(jf.FrameError, match=r"frame 'earth': table: EARTH.*were changed since it was made"):
        jf.to_json(moved)
