"""Graph text and pictures of trees: labels, chains and colours, and names that stay data."""

import re
import sys

import numpy as np
import pytest
from PIL import Image

import jaxframes as jf
from jaxframes.view.arrangement import STEP, arranged
from tests.view.hostile import LINES, NAMES, TURNED
from tests.view.trees import every_kind, large


def scene():
    b = jf.TreeBuilder(root="world")
    b.add('the "arm"', parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    b.add("hand", parent='the "arm"', edge=jf.edges.Fixed())
    b.add("box", parent="world", edge=jf.edges.Attachable())
    return b.build()


def test_dot_has_a_node_a_frame_and_an_arrow_an_edge():
    text = jf.to_dot(scene(), title="my scene", label_map={"hand": "gripper", 3: "cargo"})
    assert text.startswith('digraph "my scene" {')
    assert 'n1 [label="the \\"arm\\""' in text
    assert 'n2 [label="gripper"' in text
    assert 'n3 [label="cargo"' in text
    assert 'n0 -> n1 [label="revolute about (0, 0, 1)"' in text
    assert text.count("->") == 3
    assert text.rstrip().endswith("}")


def test_mermaid_escapes_and_colours_by_family():
    text = jf.to_mermaid(scene()).splitlines()
    assert text[0] == "flowchart TD"
    assert '  n1["the #quot;arm#quot;"]' in text
    assert '  n1 -->|"fixed"| n2' in text
    assert "  class n1 k0" in text


def test_chains_and_valency_and_the_state():
    tree = scene()
    state = tree.attach(tree.state(), "box", "hand")
    dot = jf.to_dot(tree, chains=True, coloring="valency", state=state)
    assert "n2 -> n3 [label=" in dot
    assert "n0 -> n3 [style=dashed" in dot  # where it came from
    assert re.search(r'n0 \[label="world", fillcolor="(#\w+)"', dot).group(1) != re.search(r'n2 \[.*fillcolor="(#\w+)"', dot).group(1)
    mermaid = jf.to_mermaid(tree, chains=[("hand", "world"), tree.chain(of="world", relative_to="hand")], coloring="valency")
    assert "  n0 -.- n2" in mermaid
    assert "  n2 -.- n0" in mermaid
    assert "dashed" not in jf.to_dot(tree)


@pytest.mark.parametrize("draw", ["to_dot", "to_mermaid", "to_html", "save_png"])
def test_unknown_keys_are_refused_everywhere(draw, tmp_path):
    function = getattr(jf, draw)
    arguments = [scene(), *([tmp_path / "x.png"] if draw == "save_png" else [])]
    for options, words in (
        ({"label_map": {"hnad": "x"}}, "Did you mean 'hand'"),
        ({"label_map": {4: "x"}}, "numbered 0 to 3"),
        ({"label_map": {True: "x"}}, "True"),
        ({"chains": [("hand", "hnad")]}, "hnad"),
        ({"chains": [("hand", "box", "world")]}, "pairs"),
        ({"coloring": "colour"}, "'type'"),
    ):
        with pytest.raises(jf.FrameError, match=words):
            function(*arguments, **options)


def hostile():
    b = jf.TreeBuilder(root="world")
    for name in (*NAMES, 'a"]; n0 -> n1 [', "`code`", "%%{init: {}}%%", "a & &amp; \\N \\", "end", "x]:::k0"):
        b.add(name, parent="world", edge=jf.edges.Fixed())
    return b.build()


LABELS = {"end": "\ud800", NAMES[0]: LINES, NAMES[1]: TURNED}


def test_hostile_names_stay_labels_in_dot():
    tree = hostile()
    lines = jf.to_dot(tree, title='"} digraph {', label_map=LABELS).splitlines()
    assert len(lines) == 3 + len(tree.names) + len(tree.names) - 1
    quoted = r'"(?:[^"\\]|\\\\|\\"|\\n)*"'
    assert re.fullmatch(rf"digraph {quoted} {{", lines[0])
    for line in lines[2 : 2 + len(tree.names)]:
        assert re.fullmatch(rf'  n\d+ \[label={quoted}(, fillcolor="#\w+")?\];', line), line
        assert line.isprintable()
    assert "&amp;amp;" in "".join(lines)


def test_hostile_names_stay_labels_in_mermaid():
    tree = hostile()
    lines = jf.to_mermaid(tree, label_map=LABELS).splitlines()
    assert len(lines) == 1 + len(tree.names) + len(tree.names) - 1 + 2
    for line in lines[1 : 1 + len(tree.names)]:
        text = re.fullmatch(r'  n\d+\["(.*)"\]', line).group(1).replace("<br/>", "")
        assert re.fullmatch(r"(?:[\w _\-./(),=+*·]|#\w+;)*", text), line
        assert line.isprintable()


def test_hostile_names_can_be_written_to_a_file(tmp_path):
    jf.to_html(hostile(), tmp_path / "tree.html", label_map=LABELS)
    assert "ud800" in (tmp_path / "tree.html").read_text()


def test_pictures_grow_and_their_text_does_not_shrink(tmp_path, rng):
    sizes = []
    for count in (8, 60, 200):
        tree, _ = large(rng, count)
        jf.save_png(tree, tmp_path / "tree.png", title=f"{count} frames")
        with Image.open(tmp_path / "tree.png") as picture:
            sizes.append(picture.size)
            dark = np.asarray(picture.convert("L")) < 90
        assert dark.sum() > 30 * count  # there is text, at the size that it has in a small picture
    assert sizes[0][1] < sizes[1][1] < sizes[2][1]


def test_a_picture_takes_hostile_names_and_moved_frames(tmp_path):
    jf.save_png(hostile(), tmp_path / "hostile.png", title="$x$ \u202e", label_map={**LABELS, 0: "$\\frac{"})
    tree = scene()
    jf.save_png(tree, tmp_path / "moved.png", state=tree.attach(tree.state(), "box", "hand"), chains=True)
    jf.save_png(tree, tmp_path / "still.png")
    assert (tmp_path / "moved.png").read_bytes() != (tmp_path / "still.png").read_bytes()


def test_a_tree_that_is_too_large_for_a_picture_is_refused(tmp_path):
    b = jf.TreeBuilder(root="world")
    for i in range(1200):
        b.add(f"f{i}", parent="world", edge=jf.edges.Fixed())
    with pytest.raises(jf.FrameError, match=r"tree.extract\(frame\)"):
        jf.save_png(b.build(), tmp_path / "tree.png")


def test_a_missing_matplotlib_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(jf.FrameError, match=r"pip install 'jaxframes\[plot\]'"):
        jf.save_png(scene(), tmp_path / "tree.png")


def test_the_layout_keeps_pills_apart(rng):
    tree, _ = every_kind(rng)
    for widest in (10_000.0, 300.0):
        places = arranged(tree.topology.parents, lambda frame: 100.0, widest).places
        assert len(set(places)) == len(places)
        for i, (x, y) in enumerate(places):
            for other, (u, v) in enumerate(places[:i]):
                assert abs(y - v) >= STEP - 1e-9 or abs(x - u) >= 100, (i, other)


def test_frames_on_a_cycle_are_shown_below_the_root():
    b = jf.TreeBuilder(root="world")
    for name in ("a", "b"):
        b.add(name, parent="world", edge=jf.edges.Attachable())
    tree = b.build()
    state = tree.attach(tree.state(), "a", 2)
    state = state.replace(attachments=jf.Attachments(np.array([2, 1], np.int32), state.attachments.motion))
    assert tree.check(state)
    dot = jf.to_dot(tree, state=state)
    assert dot.count("->") == 2
    assert "n0 -> n1" in dot
    assert "cycle" in jf.to_html(tree, state=state)


def test_frames_without_a_label_may_be_called_by_their_number():
    tree = scene()
    labels = jf.numbered_labels(tree, {"hand": "gripper", 3: "cargo"})
    hand = tree.names.index("hand")
    assert labels == {i: {hand: "gripper", 3: "cargo"}.get(i, str(i)) for i in range(len(tree.names))}
    for text in (jf.to_dot(tree, label_map=labels), jf.to_mermaid(tree, label_map=labels)):
        assert "gripper" in text
        assert "world" not in text
    with pytest.raises(jf.FrameError, match="Did you mean 'hand'"):
        jf.numbered_labels(tree, {"hnad": "x"})
