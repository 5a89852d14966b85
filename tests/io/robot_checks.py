"""Comparing whole robots with an oracle: motions of all links in the root and in another link.

Whole robots are worked op by op (``jax.disable_jit``): that runs the same arithmetic as a compiled program without its compile time.
"""

import jax
import numpy as np

from jaxframes.kinematics import queries
from tests.random_trees import parts


def relative_to(motions, observer):
    """Return the motions [n, ...] of all links as one of them sees them, from those in the root (semantics 0.3), in NumPy."""
    R, l, w, v, alpha, a = motions
    back, wo, alpha_o = R[observer].T, w[observer], alpha[observer]
    r = l - l[observer]
    u = v - v[observer] - np.cross(wo, r)
    angular2 = alpha - alpha_o - np.cross(wo, w)
    linear2 = a - a[observer] - np.cross(alpha_o, r) - np.cross(wo, np.cross(wo, r)) - 2 * np.cross(wo, u)
    turned = lambda x: x @ back.T
    return back @ R, turned(r), turned(w - wo), turned(u), turned(angular2), turned(linear2)


def assert_motions(tree, state, theirs, observer, bound):
    """Compare all links with an oracle's motions in the root, relative to the root and relative to a link."""
    with jax.disable_jit():
        for index, expected in ((0, theirs), (observer, relative_to(theirs, observer))):
            found = parts(queries.all_frames(tree, state, tree.names[index], order=2))
            for name, mine, other in zip(("R", "l", "w", "v", "alpha", "a"), found, expected, strict=True):
                assert np.abs(mine - other).max() <= bound * max(1.0, np.abs(other).max()), (name, tree.names[index])
