"""Messages and texts that name frames: what an edge cannot take the place of, parents that are no single frame, short reprs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import EdgeError, ShapeError, UnknownFrameError, UnknownJointError

E = jf.edges


def scene():
    b = jf.TreeBuilder()
    b.add("left", parent="world", edge=E.Revolute())
    b.add("right", parent="world", edge=E.Prismatic())
    b.add("box", parent="world", edge=E.Attachable())
    b.add("gaze", parent="left", edge=E.Prescribed())
    return b.build()


TREE = scene()


def test_an_edge_that_cannot_take_a_place_is_told_apart_from_the_one_there():
    wrong = E.Revolute().replace(axis=jnp.ones(4))  # prints as the edge does that is there
    with pytest.raises(EdgeError, match=r"frame 'left': .* the place of revolute about \(0, 0, 1\): its axis has shape \(4,\) instead"):
        TREE.with_edge("left", wrong)
    with pytest.raises(EdgeError, match=r"frame 'left': .*: it is prismatic along \(0, 0, 1\), of another family"):
        TREE.with_edge("left", E.Prismatic())
    with pytest.raises(EdgeError, match=r"frame 'gaze': .* the place of prescribed: its accelerations is False instead of True"):
        TREE.with_edge("gaze", E.Prescribed(False))


def several():
    """States in which the box hangs on two frames."""
    return TREE.attach(TREE.state(), "box", np.array([1, 2]))


@pytest.mark.parametrize(
    "ask",
    [
        lambda s: TREE.move_to(s, "box", jf.Transform.identity()),
        lambda s: TREE.describe(s, of="box", relative_to="left"),
        lambda s: TREE.explain(of="box", relative_to="left", state=s),
        lambda s: TREE.reattached(s, "box", "left"),
    ],
)
def test_parents_that_differ_over_a_batch_are_no_name(ask):
    with pytest.raises(ShapeError, match="what 'box' hangs on differs over a batch of states"):
        ask(several())
    with pytest.raises(ShapeError, match="what 'box' hangs on is traced"):
        jax.jit(lambda s: ask(s) and None)(several())
    ask(TREE.attach(TREE.state(), "box", np.array([1, 1])))  # a batch that hangs on one frame has its name


def test_arrays_are_no_names():
    for name in (np.arange(3), jnp.arange(3)):
        with pytest.raises(UnknownFrameError, match=r"asked for by its name, found an array of int.*\[3\]; tree\.names\[i\]"):
            TREE.transform(TREE.state(), of=name, relative_to="world")
    with pytest.raises(UnknownFrameError, match="asked for by its name, found 2"):
        TREE.parent(2)
    with pytest.raises(ShapeError, match=r"frame indices \(integers\), found an array of float.*\[2\]$"):
        TREE.attach(TREE.state(), "box", jnp.array([0.0, 1.5]))


def test_reprs_are_a_line():
    b = jf.TreeBuilder()
    for i in range(40):
        b.add(f"joint{i}", parent="world", edge=E.Revolute())
        b.add(f"held{i}", parent="world", edge=E.Movable())
        b.add(f"loose{i}", parent="world", edge=E.Attachable())
    state = b.build().state(time=np.arange(3.0))
    texts = [repr(value) for value in (state, state.attachments, state.prefix("q"))]
    odd = (lambda x: 0, lambda x: jnp.zeros(30), lambda x: jnp.sum(x), lambda x: None)  # what may stand for leaves in JAX
    texts += [repr(jax.tree.map(change, state)) for change in odd]
    seen = []
    jax.jit(lambda s: seen.append(repr(s)))(state)
    for text in (*texts, *seen):
        assert len(text) < 300, text
        assert "\n" not in text
    assert texts[1] == "Attachments(40 frames)"


def test_names_of_the_other_kind_and_things_that_are_no_states():
    b = jf.TreeBuilder(root="world")
    b.add("link", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)), joint="j1")
    b.add("tool", parent="link", edge=jf.edges.Fixed())
    tree = b.build()
    with pytest.raises(UnknownFrameError, match=r"no frame 'j1'\. There is a joint of that name: the frame below it is 'link'"):
        tree.transform(tree.state(), of="j1", relative_to="world")
    with pytest.raises(UnknownJointError, match=r"no joint 'link'\. There is a frame of that name: the joint above it is 'j1'"):
        tree.state(q={"link": 1.0})
    with pytest.raises(UnknownJointError, match="no joint 'tool'"):
        tree.state(q={"tool": 1.0})
    for state in ({"q": [0.0]}, [0.0], None):
        with pytest.raises(ShapeError, match=r"a query takes a state, made by tree\.state\(\.\.\.\), and found"):
            tree.transform(state, of="link", relative_to="world")


def test_a_path_up_and_down_is_explained_once():
    b = jf.TreeBuilder(root="world")
    for name in ("a", "b"):
        b.add(name, parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    said = b.build().explain(of="a", relative_to="b").splitlines()[0]
    assert said.endswith("composed one after another")


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (
            lambda t, s: t.transform(s, "gaze", "left"),
            r"transform\(state, of=\.\.\., relative_to=\.\.\.\) was given 'gaze', 'left' without a name",
        ),
        (lambda t, s: t.velocity(s, "gaze", "left"), r"velocity\(.* name what follows: of=, relative_to="),
        (lambda t, s: t.acceleration(s, "gaze", "left"), r"acceleration\(.* name what follows: of=, relative_to="),
        (lambda t, s: t.jacobian(s, "gaze", "left"), r"jacobian\(.* name what follows: of=, relative_to="),
        (lambda t, s: t.chain("gaze", "left"), r"chain\(of=.* was given 'gaze', 'left'"),
        (lambda t, s: t.path("gaze", "left"), r"path\(of=.* was given 'gaze', 'left'"),
        (lambda t, s: t.relative_transforms(s, "left"), "name what follows: relative_to="),
        (lambda t, s: t.express(s, np.ones(3), "gaze", "left"), r"express\(state, vector, of="),
        (lambda t, s: t.state([0.1, 0.2]), "was given a list without a name; name what follows: q=, qd=, qdd=, time="),
        (lambda t, s: t.attached_to(s, "box"), r"attached_to\(state\) was given 'box' .* it takes nothing more"),
        (lambda t, s: t.attach(s, "box", "left", "world"), r"attach\(state, frame, to, keep=.* was given 'world'"),
    ],
)
def test_arguments_without_a_name_are_told_which_there_are(ask, words):
    with pytest.raises(TypeError, match=words):
        ask(TREE, TREE.state())
