"""Building trees: what is refused, and with which words; include, remove, rebuild, properties."""

import re

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.edges.mimic import ring_in
from tests.compilations import compilations


def base():
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1), limits=(-1, 2)), properties={"maker": "acme", "sizes": [1, 2]})
    b.add("hand", parent="arm", edge=jf.edges.Prismatic(axis=(1, 0, 0)), joint="grip")
    b.add("camera", parent="hand", edge=jf.edges.Fixed())
    return b


@pytest.mark.parametrize(
    ("action", "error", "words"),
    [
        (
            lambda b: b.add("tool", parent="hnad", edge=jf.edges.Fixed()),
            errors.UnknownFrameError,
            ["tool", "'hnad'", "Did you mean 'hand'"],
        ),
        (lambda b: b.add("arm", parent="hand", edge=jf.edges.Fixed()), errors.DuplicateNameError, ["'arm'", "'world'", "one parent"]),
        (lambda b: b.add("loop", parent="loop", edge=jf.edges.Fixed()), errors.TopologyError, ["'loop'", "cycle"]),
        (lambda b: b.add("world", parent="hand", edge=jf.edges.Fixed()), errors.TopologyError, ["'world'", "'hand'", "cycle"]),
        (lambda b: b.add("", parent="hand", edge=jf.edges.Fixed()), errors.EdgeError, ["empty"]),
        (lambda b: b.add("x", parent="hand", edge=np.eye(4)), errors.EdgeError, ["'x'", "ndarray", "jf.edges"]),
        (lambda b: b.add("x", parent="hand", edge=jf.edges.Fixed(), joint="grip"), errors.DuplicateNameError, ["'grip'", "'hand'"]),
        (lambda b: b.add("x", parent="hand", edge=jf.edges.Revolute(), joint="grip"), errors.DuplicateNameError, ["'grip'", "'hand'"]),
        (lambda b: b.add("x", parent="hand", edge=jf.edges.Fixed(), properties={"f": open}), errors.EdgeError, ["'f'", "'x'"]),
        (lambda b: b.remove("wrold"), errors.UnknownFrameError, ["'wrold'", "'world'"]),
        (lambda b: b.remove("world"), errors.TopologyError, ["'world'", "root"]),
        (lambda b: b.include(base().build(), parent="world"), errors.DuplicateNameError, ["world", "prefix"]),
        (lambda b: b.include(base().build(), parent="wrld", prefix="b/"), errors.UnknownFrameError, ["'wrld'", "'world'"]),
        (lambda b: jf.edges.Revolute(axis=(0, 0, 0)), errors.EdgeError, ["zero", "(0, 0, 1)"]),
        (lambda b: jf.edges.Revolute(axis=(0, np.nan, 0)), errors.EdgeError, ["finite"]),
        (lambda b: jf.edges.Revolute(axis=(0, 1)), errors.EdgeError, ["three numbers"]),
        (lambda b: jf.edges.Prismatic(limits=(2, 1)), errors.EdgeError, ["reversed", "swap"]),
        (lambda b: jf.edges.Prescribed(supports_accelerations=1), errors.EdgeError, ["True or False"]),
    ],
)
def test_refusals_name_the_thing_and_the_remedy(action, error, words):
    b = base()
    before = b.names
    with pytest.raises(error) as caught:
        action(b)
    assert isinstance(caught.value, jf.FrameError)
    for word in words:
        assert word in str(caught.value)
    assert b.names == before


@pytest.mark.parametrize(
    ("ask", "error", "words"),
    [
        (lambda t, s: t.transform(s, of="hnd", relative_to="arm"), errors.UnknownFrameError, ["'hnd'", "'hand'"]),
        (lambda t, s: t.state(q=[1.0]), errors.ShapeError, ["(1,)", "[..., 2]", "arm, grip"]),
        (lambda t, s: t.state(q={"hand": 1.0}), errors.UnknownJointError, ["'hand'", "arm"]),
        (lambda t, s: t.set_qd(s, {"arm": np.zeros(())[None][None, :, None]}).qd, None, []),
        (lambda t, s: t.set_motion(s, "hand"), errors.EdgeError, ["'hand'", "Prescribed"]),
        (lambda t, s: t.edge("world"), errors.TopologyError, ["'world'", "root"]),
        (lambda t, s: t.parent("world"), errors.TopologyError, ["'world'", "root"]),
        (lambda t, s: t.chain(of="world", relative_to="hand", oriented=True), errors.TopologyError, ["'world'", "'hand'", "descend"]),
        (lambda t, s: t.with_edge("hand", jf.edges.Fixed()), errors.EdgeError, ["'hand'", "prismatic", "fixed"]),
        (lambda t, s: s.replace(qq=1), errors.FrameError, ["'qq'"]),
        (lambda t, s: t.transform(s.replace(q=np.zeros(3)), of="hand", relative_to="arm"), errors.ShapeError, ["(3,)", "[..., 2]"]),
    ],
)
def test_bad_questions_are_answered_by_name(ask, error, words):
    tree = base().build()
    if error is None:
        ask(tree, tree.state())
        return
    with pytest.raises(error) as caught:
        ask(tree, tree.state())
    for word in words:
        assert word in str(caught.value)


def test_frames_by_position_are_a_type_error():
    tree = base().build()
    with pytest.raises(TypeError):
        tree.transform(tree.state(), "hand", "world")


def test_missing_time_and_accelerations_are_trace_time_errors():
    b = jf.TreeBuilder()
    b.add("craft", parent="world", edge=jf.edges.Prescribed(supports_accelerations=False))
    b.add("tool", parent="craft", edge=jf.edges.Revolute())
    tree = b.build()
    state = tree.state()
    assert tree.velocity(state, of="tool", relative_to="world").linear.shape == (3,)
    assert tree.acceleration(state, of="tool", relative_to="craft").linear.shape == (3,)
    assert not tree.chain(of="tool", relative_to="world").supports_accelerations
    assert tree.chain(of="tool", relative_to="craft").supports_accelerations
    for ask in (tree.acceleration, tree.motion):
        with pytest.raises(errors.NoAccelerationError, match="'craft'"):
            ask(state, of="tool", relative_to="world")
    with pytest.raises(errors.NoAccelerationError, match="'craft'"):
        tree.world_motions(state)


def test_prescribed_edges_start_at_identity_and_rest():
    b = jf.TreeBuilder()
    b.add("craft", parent="world", edge=jf.edges.Prescribed())
    tree = b.build()
    motion = tree.motion(tree.state(), of="craft", relative_to="world")
    np.testing.assert_array_equal(motion.transform.rotation.wxyz, [1, 0, 0, 0])
    for leaf in (motion.transform.translation, motion.velocity.as_vector(), motion.acceleration.as_vector()):
        assert not np.any(leaf)


def test_properties_are_immutable_and_survive_include_and_rebuild():
    tree = base().build()
    assert tree.properties["arm"] == {"maker": "acme", "sizes": (1, 2)}
    assert tree.properties["hand"] == {}
    with pytest.raises(TypeError):
        tree.properties["arm"]["maker"] = "other"
    b = jf.TreeBuilder(root="site")
    b.include(tree, parent="site", prefix="left/")
    b.include(tree, parent="site", prefix="right/")
    both = b.build()
    assert both.properties["right/arm"]["maker"] == "acme"
    assert both.joint_names == ("left/arm", "left/grip", "right/arm", "right/grip")
    assert both.parent("left/world") == "site"
    assert both.path(of="left/camera", relative_to="left/world") == (("left/arm", 1), ("left/hand", 1), ("left/camera", 1))
    again = jf.TreeBuilder.from_tree(both).build()
    assert again.topology == both.topology


def test_included_trees_move_as_they_did(tol):
    tree = base().build()
    b = jf.TreeBuilder(root="site")
    b.include(tree, parent="site", prefix="a/")
    both = b.build()
    alone = tree.transform(tree.state(q=[0.3, 0.7]), of="camera", relative_to="world")
    inside = both.transform(both.state(q=[0.3, 0.7]), of="a/camera", relative_to="a/world")
    np.testing.assert_allclose(inside.translation, alone.translation, atol=tol)


def test_remove_takes_the_subtree_or_reparents_the_children():
    b = base()
    b.remove("hand")
    assert b.names == ("world", "arm")
    assert b.build().joint_names == ("arm",)
    b = base()
    b.remove("hand", children="reparent")
    tree = b.build()
    assert tree.names == ("world", "arm", "camera")
    assert tree.parent("camera") == "arm"
    b.add("hand", parent="camera", edge=jf.edges.Revolute(), joint="grip")
    assert b.build().joint_names == ("arm", "grip")


def test_an_edge_that_does_not_fit_says_why():
    b = jf.TreeBuilder()
    b.add("arm", parent="world", edge=jf.edges.Mimic("lead", jf.edges.Revolute(axis=(0, 0, 1))))
    b.add("lead", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    b.add("poly", parent="world", edge=jf.edges.Prescribed(supports_accelerations=False))
    tree = b.build()
    with pytest.raises(errors.EdgeError, match="another family"):
        tree.with_edge("lead", jf.edges.Prismatic(axis=(0, 0, 1)))
    with pytest.raises(errors.EdgeError, match="its accelerations is True instead of False"):
        tree.with_edge("poly", jf.edges.Prescribed())


@pytest.mark.parametrize("name", ["\x1b[31mred", "a\rb", "a\nb", "a\u202eb", "a\u2028b", "a\0b", "\ud800", "tab\t"])
def test_names_print_as_they_are(name):
    """What a terminal, a page or a file would show otherwise, or not at all, is refused where a name is given, and shown harmlessly."""
    b = jf.TreeBuilder(root="world")
    shown = re.escape(ascii(name))
    with pytest.raises(errors.EdgeError, match=rf"a frame's name must be printable, found {shown} with the character U\+"):
        b.add(name, parent="world", edge=jf.edges.Fixed())
    with pytest.raises(errors.EdgeError, match=f"frame 'a': a joint's name must be printable, found {shown}"):
        b.add("a", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)), joint=name)
    with pytest.raises(errors.EdgeError, match="must be printable"):
        jf.TreeBuilder(root=name)
    b.add("Erde \u5730\u7403 \u00b5 a/b", parent="world", edge=jf.edges.Fixed())
    with pytest.raises(errors.EdgeError, match="at most 1000 characters, found 1001"):
        b.add("x" * 1001, parent="world", edge=jf.edges.Fixed())


def test_long_lines_of_followers_are_checked_in_one_pass():
    """Thirty times as many joints are thirty times the work: counted, not timed."""

    class Counted(dict):
        asked = 0

        def get(self, key, default=None):
            self.asked += 1
            return super().get(key, default)

    for n in (100, 3000):
        line = Counted({f"j{i}": f"j{i - 1}" for i in range(n, 0, -1)})
        assert ring_in(line) == ()
        assert line.asked <= 2 * n
    assert ring_in({"a": "b", "b": "c", "c": "b", "d": "a"}) == ("b", "c", "b")
    assert ring_in({"a": "a"}) == ("a", "a")


def test_properties_set_later_compile_nothing_and_are_for_the_host():
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute(), properties={"mass": 1.0})
    b.add("tool", parent="arm", edge=jf.edges.Fixed(), properties={"maker": "us"})
    tree = b.build()
    other = tree.with_properties({"arm": {"mass": 2.0, "tags": ("a", "b")}, "tool": {}})
    assert dict(other.properties["arm"]) == {"mass": 2.0, "tags": ("a", "b")}
    assert dict(other.properties["tool"]) == {}
    assert dict(tree.properties["arm"]) == {"mass": 1.0}
    chex.clear_trace_counter()
    seen = []

    @jax.jit
    @chex.assert_max_traces(n=1)
    def moved(tree, q):
        seen.append(tree.properties["arm"]["mass"])
        return tree.with_values({"tool.transform.translation": q * jnp.ones(3)})

    for one in (other, tree):  # the program that one is compiled for serves the other, so neither's own properties may be in it
        assert dict(moved(one, jnp.ones(1)).properties["arm"]) == {"mass": 1.0}
    assert seen == [1.0]
    assert other.topology == tree.topology
    ask = lambda tree: tree.transform(tree.state(), of="tool", relative_to="world")
    ask(tree)
    assert compilations(ask, other) == 0
    kept = [jax.tree.map(lambda x: x + 0, other), other.astype(np.float32), jf.TreeBuilder.from_tree(other).build()]
    kept.append(jf.from_json(jf.to_json(other)))
    for same in kept:
        assert same.properties["arm"]["mass"] == 2.0
    assert other.extract("arm").properties["arm"]["mass"] == 2.0
    with pytest.raises(errors.UnknownFrameError, match="'amr'"):
        tree.with_properties({"amr": {}})
    with pytest.raises(errors.EdgeError, match="static"):
        tree.with_properties({"arm": {"mass": object()}})
    with pytest.raises(jf.FrameError, match="outside of jit"):
        jax.jit(lambda tree: tree.with_properties({"arm": {}}))(tree)
