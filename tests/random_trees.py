"""Random trees of mixed edges, built twice: as a jaxframes tree with a state, and as the oracle's links."""

import numpy as np

import jaxframes as jf
from tests import oracle


def unit(rng, n):
    v = rng.normal(size=n)
    return v / np.linalg.norm(v)


def placement(rng, dtype):
    wxyz, translation = unit(rng, 4).astype(dtype), rng.normal(size=3).astype(dtype)
    return jf.Transform(jf.Rotation.from_quaternion_wxyz(wxyz), translation + 0), oracle.fixed(wxyz, translation)


def random_tree(rng, count, dtype=np.float64, kinds=("fixed", "prescribed", "revolute", "prismatic")):
    """Return (tree, state, links): ``count`` frames below the root, every edge kind mixed."""
    b, links, q, motions = jf.TreeBuilder(root="f0"), [oracle.Link(-1, None)], [], []
    for i in range(1, count + 1):
        parent, kind = int(rng.integers(max(0, i - 4), i)), kinds[rng.integers(len(kinds))]
        if kind == "fixed":
            transform, curve = placement(rng, dtype)
            edge = jf.edges.Fixed(transform)
        elif kind == "prescribed":
            edge = jf.edges.Prescribed()
            wxyz, (l, w, v, alpha, a) = unit(rng, 4).astype(dtype), rng.normal(size=(5, 3)).astype(dtype)
            motions.append((f"f{i}", wxyz, l, w, v, alpha, a))
            curve = oracle.prescribed(wxyz, l, w, v, alpha, a)
        else:
            axis = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)]
            axis = axis / np.linalg.norm(axis)
            transform, base = placement(rng, dtype)
            numbers = rng.normal(size=3).astype(dtype)
            q.append(numbers)
            edge = (jf.edges.Revolute if kind == "revolute" else jf.edges.Prismatic)(axis=axis, placement=transform)
            curve = oracle.joint(kind, axis, base, *numbers)
        b.add(f"f{i}", parent=f"f{parent}", edge=edge)
        links.append(oracle.Link(parent, curve))
    tree = b.build()
    values = np.array(q, dtype).reshape(-1, 3)
    state = tree.state(q=values[:, 0], qd=values[:, 1], qdd=values[:, 2])
    for name, wxyz, l, w, v, alpha, a in motions:
        transform = jf.Transform(jf.Rotation.from_quaternion_wxyz(wxyz), l)
        state = tree.set_motion(state, name, transform, jf.SpatialVelocity(w, v), jf.SpatialAcceleration(alpha, a))
    return tree, state, links


def parts(motion):
    """R, l, w, v, alpha, a of a Motion as NumPy arrays."""
    t, v, a = motion.transform, motion.velocity, motion.acceleration
    return tuple(np.asarray(x) for x in (t.rotation.to_matrix(), t.translation, v.angular, v.linear, a.angular, a.linear))
