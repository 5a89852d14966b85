"""Topology answers against brute force on thousands of random trees."""

import numpy as np
import pytest

import jaxframes as jf
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


def test_lookup_suggests_close_names():
    tree = jf.FrameTree((), random_topology(np.random.default_rng(0), 5))
    assert tree.lookup("f3") == ("f3",)
    with pytest.raises(jf.FrameError, match=r"'f33'.*'f3'"):
        tree.lookup("f33")
