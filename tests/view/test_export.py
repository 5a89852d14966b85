"""Graph text of trees."""

import jaxframes as jf


def scene():
    b = jf.TreeBuilder(root="world")
    b.add('the "arm"', parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    b.add("hand", parent='the "arm"', edge=jf.edges.Fixed())
    return b.build()


def test_dot_has_a_node_a_frame_and_an_arrow_an_edge():
    text = jf.to_dot(scene(), title="my scene", label_map={"hand": "gripper"})
    assert text.startswith('digraph "my scene" {')
    assert 'n1 [label="the \\"arm\\""' in text
    assert 'n2 [label="gripper"' in text
    assert 'n0 -> n1 [label="revolute about (0, 0, 1)"' in text
    assert text.count("->") == 2
    assert text.rstrip().endswith("}")


def test_mermaid_escapes_and_colours_by_family():
    text = jf.to_mermaid(scene()).splitlines()
    assert text[0] == "flowchart TD"
    assert '  n1["the #quot;arm#quot;"]' in text
    assert '  n1 -->|"fixed"| n2' in text
    assert "  class n1 Revolute" in text
