"""Topology answers against brute force on thousands of random trees."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.model.topology import Topology


def random_topology(rng, count):
    parents = (-1, *(int(rng.integers(0, i)) for i in range(1, count)))
    names = tuple(f"f{i}" for i in range(count))
    nothing = ((0, 0, 0, 0),) * count
    return Topology(names, parents, (), (), ((-1, -1),) * count, nothing, (), (), (-1,) * count)


def chain_to_root(parents, frame):
    out = [frame]
    while parents[out[-1]] >= 0:
        out.append(parents[out[-1]])
    return out


@pytest.mark.parametrize("seed", range(4))
def test_topology_against_brute_force(seed):
    rng = np.random.default_rng(seed)
    for _ in range(600):
        count = int(rng.integers(1, 30))
        t = random_topology(rng, count)
        tree = jf.FrameTree((), t)
        lines = [chain_to_root(t.parents, i) for i in range(count)]
        for _ in range(4):
            a, b = (int(i) for i in rng.integers(0, count, 2))
            shared = next(x for x in lines[a] if x in lines[b])
            na, nb = f"f{a}", f"f{b}"
            assert tree.common_ancestor(na, nb) == f"f{shared}"
            assert tree.depth(na) == len(lines[a]) - 1
            assert tree.is_ancestor(na, nb) == (a in lines[b])
            assert tree.is_ancestor(na, nb, strict=True) == (a in lines[b] and a != b)
            assert tree.ancestors(na) == tuple(f"f{i}" for i in lines[a][1:])
            assert tree.children(na) == tuple(f"f{i}" for i in range(count) if t.parents[i] == a)
            assert tree.subtree(na) == tuple(f"f{i}" for i in range(count) if a in lines[i])
            up = lines[b][: lines[b].index(shared)]
            down = lines[a][: lines[a].index(shared)][::-1]
            expected = (*((f"f{i}", -1) for i in up), *((f"f{i}", 1) for i in down))
            assert tree.path(of=na, relative_to=nb) == expected


def inside(whole, part):
    return any(whole[i : i + len(part)] == part for i in range(len(whole) - len(part) + 1))


@pytest.mark.parametrize("seed", range(3))
def test_subchain_orientation_against_brute_force(seed):
    rng = np.random.default_rng(seed)
    for _ in range(400):
        t = random_topology(rng, int(rng.integers(2, 14)))
        tree = jf.FrameTree((), t)
        a, b, c, d = (f"f{i}" for i in rng.integers(0, len(t.names), 4))
        chain, sub = tree.chain(of=a, relative_to=b), tree.chain(of=c, relative_to=d)
        frames = [b]
        for name, direction in chain.path:
            frames.append(name if direction > 0 else tree.parent(name))
        assert chain.frames == tuple(frames)
        mine, steps = list(chain.path), list(sub.path)
        reverse = [(name, -direction) for name, direction in reversed(steps)]
        if not steps:
            expected = True if c in frames else None
        elif inside(mine, steps):
            expected = True
        else:
            expected = False if inside(mine, reverse) else None
        assert chain.subchain_orientation(sub) is expected


def test_lookup_takes_patterns():
    b = jf.TreeBuilder(root="world")
    for name in ("arm/base", "arm/tool", "leg/tool", "arm[1]", "*"):
        b.add(name, parent="world", edge=jf.edges.Fixed())
    tree = b.build()
    assert tree.lookup("arm/*") == ("arm/base", "arm/tool")
    assert tree.lookup("*/tool") == ("arm/tool", "leg/tool")
    assert tree.lookup("[al]??/base") == ("arm/base",)
    assert tree.lookup("arm[1]") == ("arm[1]",)  # a name before a pattern
    assert tree.lookup("*") == ("*",)
    with pytest.raises(errors.UnknownFrameError, match=r"'Arm/\*'"):
        tree.lookup("Arm/*")


def test_lookup_suggests_close_names():
    tree = jf.FrameTree((), random_topology(np.random.default_rng(0), 5))
    assert tree.lookup("f3") == ("f3",)
    with pytest.raises(jf.FrameError, match=r"'f33'.*'f3'"):
        tree.lookup("f33")


def scene():
    b = jf.TreeBuilder(root="world")
    b.add("table", parent="world", edge=jf.edges.Fixed(jf.Transform.from_translation((0.5, 0.0, 0.2))))
    b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    b.add("hand", parent="arm", edge=jf.edges.Fixed(jf.Transform.from_translation((0.4, 0.0, 0.2))))
    b.add("box", parent="table", edge=jf.edges.Attachable(jf.Transform.from_translation((0.1, 0.1, 0.0))))
    b.add("lid", parent="box", edge=jf.edges.Revolute(axis=(0, 1, 0)))
    b.add("note", parent="lid", edge=jf.edges.Attachable(jf.Transform.from_translation((0.02, 0.0, 0.0))))
    return b.build()


@pytest.mark.parametrize("where", [{"box": "hand"}, {"box": "hand", "note": "table"}, {"note": "world"}, {}])
def test_questions_about_a_state_are_those_of_the_static_tree(where):
    tree = scene()
    state = tree.state(q={"arm": 0.4, "lid": -0.3})
    for frame, to in where.items():
        state = tree.attach(state, frame, to, keep="world")
    b = jf.TreeBuilder(root="world")
    hung = {name: tree.parent(name, state) for name in tree.names if name != "world"}
    while hung:  # parents first
        name = next(n for n, p in hung.items() if p in b.names)
        b.add(name, parent=hung.pop(name), edge=tree.edge(name) if name not in ("box", "note") else jf.edges.Fixed())
    still = b.build()
    for a in tree.names:
        assert tree.depth(a, state) == still.depth(a)
        assert tree.ancestors(a, state) == still.ancestors(a)
        assert set(tree.subtree(a, state)) == set(still.subtree(a))
        for c in tree.names:
            assert tree.common_ancestor(a, c, state) == still.common_ancestor(a, c)
            assert tree.is_ancestor(a, c, state=state) == still.is_ancestor(a, c)
            assert tree.is_ancestor(a, c, strict=True, state=state) == still.is_ancestor(a, c, strict=True)
            assert tree.path(of=a, relative_to=c, state=state) == still.path(of=a, relative_to=c)
            chain, known = tree.chain(of=a, relative_to=c, state=state), still.chain(of=a, relative_to=c)
            assert (chain.path, chain.frames, chain.oriented) == (known.path, known.frames, known.oriented)
    chain = tree.chain(of="lid", relative_to="table", state=state)
    assert jf.allclose(chain.transform(state), tree.transform(state, of="lid", relative_to="table"))


def test_questions_across_attachable_frames_need_a_state():
    tree = scene()
    for ask in (lambda: tree.path(of="lid", relative_to="hand"), lambda: tree.chain(of="lid", relative_to="hand")):
        with pytest.raises(errors.TopologyError, match="no static path between"):
            ask()
    with pytest.raises(errors.TopologyError, match="no static path"):
        tree.common_ancestor("lid", "hand")
    with pytest.raises(errors.TopologyError, match="'lid' does not descend from 'table'; its ancestors: 'box', 'hand'"):
        tree.chain(of="lid", relative_to="table", oriented=True, state=tree.attach(tree.state(), "box", "hand"))
    both = jf.stack([tree.state(), tree.attach(tree.state(), "box", "hand")])
    with pytest.raises(errors.ShapeError, match="what 'box' hangs on differs over a batch of states"):
        tree.ancestors("lid", both)
    assert tree.ancestors("hand", both) == ("arm", "world")


def test_a_chain_of_a_state_solves_for_a_part_of_it():
    tree = scene()
    state = tree.attach(tree.state(q={"arm": 0.4, "lid": -0.3}, qd={"arm": 0.5, "lid": 0.2}), "box", "hand")
    chain, sub = (tree.chain(of=of, relative_to="world", state=state) for of in ("lid", "hand"))
    target = tree.motion(state, of="lid", relative_to="world")
    assert jf.allclose(chain.solve_transform(sub, target.transform, state), sub.transform(state))
    # Pose and velocity of the part are by default those that it has.
    assert jf.allclose(chain.solve_velocity(sub, target.velocity, state), sub.velocity(state))
    assert jf.allclose(chain.solve_acceleration(sub, target.acceleration, state), sub.acceleration(state), atol=1e-5)


def test_text_of_a_part_of_the_tree():
    tree = scene()
    state = tree.attach(tree.state(), "box", "hand")
    lines = tree.format(jf.DumpOptions(edge_type=False, depth=True), frame="hand", state=state, prefix="  ").splitlines()
    assert [line.split("  [")[0] for line in lines] == ["  hand", "  └── box", "      └── lid", "          └── note"]
    assert "depth 4" in lines[2]
    first, second = tree.format(frame="lid").splitlines()
    assert first == "lid  [revolute about (0, 1, 0)]"
    assert second.startswith("└── note  [attachable")
    with pytest.raises(errors.MissingInputError, match=r"tree\.format\(options, state=\.\.\.\)"):
        tree.format(jf.DumpOptions(health=True))
    with pytest.raises(errors.UnknownFrameError):
        tree.format(frame="nowhere")
