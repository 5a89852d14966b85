"""Trees as text, dictionaries and check lists."""

import numpy as np

import jaxframes as jf
from jaxframes.tree.text import DumpOptions


def scene():
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1), limits=(-1, 2), placement=jf.Transform.from_translation((0, 0, 1))))
    b.add("hand", parent="arm", edge=jf.edges.Prismatic(axis=(1, 0, 0)), joint="grip")
    b.add("camera", parent="hand", edge=jf.edges.Fixed())
    b.add("craft", parent="world", edge=jf.edges.Prescribed(supports_accelerations=False))
    return b.build()


def test_print_shows_the_tree():
    assert str(scene()).splitlines() == [
        "world",
        "├── arm  [revolute about (0, 0, 1)]",
        "│   └── hand  [prismatic along (1, 0, 0), joint 'grip']",
        "│       └── camera  [fixed]",
        "└── craft  [prescribed, no accelerations]",
    ]


def test_options_add_and_remove_facts(tol):
    tree = scene()
    state = tree.state(q={"arm": 9.0})
    text = tree.format(DumpOptions(type_string=True, edge_type=False, health=True, index=True, depth=True), state=state).splitlines()
    assert text[0] == "0: world  [depth 0; ok]"
    assert text[1].startswith("├── 1: arm  [Revolute; depth 1; q = 9 is outside its limits [-1, 2]; at (0, 0, 1) m")
    assert text[3].startswith("│       └── 3: camera  [Fixed; depth 3; ok; at (0, 0, 0) m, wxyz (1.0000, 0.0000")
    assert tree.format(DumpOptions(edge_type=False)).splitlines()[1] == "├── arm"


def test_explain_lists_the_edges_of_a_query():
    text = scene().explain(of="craft", relative_to="hand").splitlines()
    assert text[0].startswith("hand -> craft: 3 edges through their common ancestor 'world'")
    assert text[1] == "  -1  hand -> arm  [prismatic along (1, 0, 0); needs q[1]]"
    assert text[3] == "  +1  world -> craft  [prescribed, no accelerations; needs prescribed motion; no accelerations]"


def test_describe_gives_all_read_outs():
    tree = scene()
    facts = tree.describe(tree.state(), of="camera", relative_to="arm")
    assert facts["path"] == (("hand", 1), ("camera", 1))
    assert facts["frames"] == ("arm", "hand", "camera")
    assert facts["oriented"]
    assert facts["supports_accelerations"]
    assert facts["parent"] == "hand"
    assert facts["acceleration"].linear.shape == (3,)
    assert tree.describe(tree.state(), of="craft", relative_to="arm")["acceleration"] is None


def test_check_names_what_is_wrong():
    tree = scene()
    assert tree.check(tree.state()) == ()
    q = np.zeros((3, 2))
    q[1, 0], q[2, 1] = 5.0, np.nan
    wrong = tree.check(tree.state(q=q))
    assert any(line.startswith("joint 'arm': q = 5 is outside its limits [-1, 2] at batch index 1") for line in wrong)
    assert any(line.startswith("joint 'grip': q is not finite at batch index 2") for line in wrong)
    state = tree.set_motion(tree.state(), "craft", jf.Transform(jf.Rotation(np.array([2.0, 0, 0, 0])), np.zeros(3)))
    assert any("'craft'" in line and "not unit" in line for line in tree.check(state))
    bent = tree.with_edge("camera", jf.edges.Fixed(jf.Transform(jf.Rotation(np.array([1.0, 0.5, 0, 0])), np.array([np.nan, 0, 0]))))
    lines = [line for line in bent.check(bent.state()) if "'camera'" in line]
    assert any("norm 1.1" in line for line in lines)
    assert any("not finite" in line for line in lines)
