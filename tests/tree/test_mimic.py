"""Joints that follow others: values, rates, Jacobians, chains of them, and what is refused."""

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors

E = jf.edges
PLACE = jf.Transform.from_translation((0.1, -0.2, 0.3))


def hand(mimic=True):
    """A chain in which every second joint follows: in a tree of its own coordinates the same places need other numbers."""
    b = jf.TreeBuilder(root="palm")
    b.add("a", parent="palm", edge=E.Universal(PLACE), joint="drive")
    follow = lambda *args, **more: E.Mimic(*args, **more) if mimic else args[1]
    b.add("b", parent="a", edge=follow("drive", E.Revolute((0, 1, 1), PLACE), multiplier=-1.5, offset=0.2, coordinate=1))
    b.add("c", parent="b", edge=follow("b", E.Prismatic((1, 0, 0), PLACE), multiplier=0.5, offset=-0.1))
    b.add("d", parent="c", edge=follow("drive", E.Universal(PLACE, axes=((0, 0, 1), (1, 0, 0))), multiplier=2.0))
    b.add("e", parent="d", edge=E.Revolute((0, 0, 1), PLACE))
    return b.build()


def test_followers_move_like_joints_with_the_same_values(rng, dtype):
    tree, free = hand(), hand(mimic=False)
    assert tree.joint_names == ("drive", "e")
    (q, qd, qdd), spread = rng.normal(size=(3, 3)).astype(dtype), np.zeros((7, 3), dtype)
    for row, (source, factor) in enumerate(((0, 1), (1, 1), (1, -1.5), (1, -0.75), (0, 2), (1, 2), (2, 1))):
        spread[row, source] = factor
    constant = np.array([0, 0, 0.2, 0, 0, 0, 0], dtype)  # the third follows the second: 0.5 * 0.2 - 0.1 = 0
    mine = tree.state(q=q, qd=qd, qdd=qdd)
    other = free.state(q=spread @ q + constant, qd=spread @ qd, qdd=spread @ qdd)
    names = {"of": "e", "relative_to": "palm"}
    bound = 1e-12 if dtype == np.float64 else 3e-5
    a, b = tree.motion(mine, **names), free.motion(other, **names)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_allclose(x, y, atol=bound * max(1.0, float(np.abs(y).max())))
    np.testing.assert_allclose(tree.jacobian(mine, **names), free.jacobian(other, **names) @ spread, atol=bound * 4)
    np.testing.assert_allclose(tree.get_q(mine, "c"), [-0.75 * q[1]], atol=bound)
    np.testing.assert_allclose(tree.get_q(mine, "d"), 2 * q[:2], atol=bound)


def test_multipliers_and_offsets_are_parameters_to_differentiate(dtype):
    tree = hand()
    state = tree.state(q=np.array([0.1, 0.2, 0.3], dtype))
    tip = lambda tree: tree.transform(state, of="e", relative_to="palm").translation[0]
    gradient = jax.jit(jax.grad(tip))(tree).edge("b")
    h = 1e-3
    for field in ("multiplier", "offset"):
        edge = tree.edge("b")
        ends = [tip(tree.with_edge("b", edge.replace(**{field: getattr(edge, field) + s * h}))) for s in (1, -1)]
        np.testing.assert_allclose(getattr(gradient, field)[0], (ends[0] - ends[1]) / (2 * h), atol=1e-6 if dtype == np.float64 else 1e-3)


def test_names_inside_followers_get_the_prefix():
    b = jf.TreeBuilder(root="site")
    b.include(hand(), parent="site", prefix="l/")
    b.include(hand(), parent="site", prefix="r/")
    both = b.build()
    assert both.joint_names == ("l/drive", "l/e", "r/drive", "r/e")
    assert both.edge("r/b").joint == "r/drive"
    assert both.extract("r/palm", prefix="r/").topology == hand().topology
    state = both.state(q={"r/drive": [0.3, 0.4]})
    alone = both.extract_state(state, "r/palm")
    np.testing.assert_array_equal(alone.q, state.q[3:])
    assert jf.from_json(jf.to_json(both)).topology == both.topology
    assert jf.TreeBuilder.from_tree(both).build().topology == both.topology
    assert "follows r/drive" in str(both)


def test_moving_a_subtree_keeps_followers_and_the_order_of_coordinates(tol):
    tree = hand()
    state = tree.state(q=[0.1, 0.2, 0.3])
    moved = tree.reattached(state, "c", "a", keep="world")
    assert moved.joint_names == tree.joint_names
    for name in ("c", "e"):
        here, there = (t.transform(t.state(q=[0.1, 0.2, 0.3]), of=name, relative_to="palm").to_matrix() for t in (tree, moved))
        np.testing.assert_allclose(here, there, atol=20 * tol)


def ring(*pairs):
    b = jf.TreeBuilder()
    for name, source in pairs:
        b.add(name, parent="world", edge=E.Mimic(source, E.Revolute()))
    return b.build()


def below(edge, follower):
    b = jf.TreeBuilder()
    b.add("x", parent="world", edge=edge)
    b.add("y", parent="x", edge=follower)
    return b.build()


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: ring(("a", "a")), errors.TopologyError, ["'a'", "a -> a"]),
        (lambda: ring(("a", "b"), ("b", "c"), ("c", "a")), errors.TopologyError, ["a -> b -> c -> a"]),
        (lambda: ring(("a", "b"), ("b", "c"), ("c", "b")), errors.TopologyError, ["b -> c -> b"]),
        (lambda: ring(("a", "b")), errors.UnknownJointError, ["'a'", "'b'"]),
        (lambda: below(E.Fixed(), E.Mimic("x", E.Revolute())), errors.UnknownJointError, ["'x'"]),
        (lambda: below(E.Ball(), E.Mimic("x", E.Revolute())), errors.EdgeError, ["'y'", "ball", "quaternion"]),
        (lambda: below(E.Revolute(), E.Mimic("x", E.Revolute(), coordinate=1)), errors.EdgeError, ["coordinate 1", "'x'"]),
        (lambda: below(E.Revolute(), E.Mimic("x", E.Universal())), errors.EdgeError, ["'x'", "has 1"]),
        (lambda: E.Mimic("x", E.Ball()), errors.EdgeError, ["ball", "quaternion"]),
        (lambda: E.Mimic("x", E.Fixed()), errors.EdgeError, ["no coordinates"]),
        (lambda: E.Mimic("x", E.Mimic("y", E.Revolute())), errors.EdgeError, ["on its own"]),
        (lambda: E.Mimic("", E.Revolute()), errors.EdgeError, ["name of the joint"]),
        (lambda: E.Mimic("x", E.Revolute(), multiplier=np.nan), errors.EdgeError, ["multiplier", "finite"]),
        (lambda: E.Virtual(0), errors.EdgeError, ["1 or more"]),
        (lambda: E.Universal(axes=((1, 0, 0),)), errors.EdgeError, ["2 axes"]),
        (lambda: E.Universal(axes=((1, 0, 0), (0, 0, 0))), errors.EdgeError, ["zero"]),
        (lambda: E.Universal(limits=((0, 1), (1, 0))), errors.EdgeError, ["reversed"]),
        (lambda: E.Screw(pitch="x"), errors.EdgeError, ["pitch"]),
        (lambda: E.Revolute(velocity_limits=-1.0), errors.EdgeError, ["negative"]),
        (lambda: E.Revolute(placement=np.eye(4)), errors.EdgeError, ["Transform"]),
        (lambda: E.Planar(active=1), errors.EdgeError, ["True or False"]),
    ],
)
def test_refusals(make, error, words):
    with pytest.raises(error) as caught:
        make()
    for word in words:
        assert word in str(caught.value)


def test_setting_a_follower_names_the_joint_to_set():
    tree = hand()
    with pytest.raises(errors.UnknownJointError, match="'b' follows 'drive'"):
        tree.set_q(tree.state(), {"b": 1.0})
    with pytest.raises(errors.UnknownJointError, match="'drive'"):
        tree.frame_of("drve")
    assert tree.frame_of("drive") == "a"
    assert tree.joint_of("c") == "c"
    assert tree.joint_of("palm") is None


FOLLOWERS = {
    "whole": [("whole", E.Continuous(), 2.0), ("whole", E.Revolute(), -1.0), ("whole", E.Prismatic(), 0.0)],
    "half": [("half", E.Continuous(), -0.5)],
    "slide": [("slide", E.Prismatic(), 1.0)],
    "screw": [("screw", E.Screw(pitch=0.1), 1.0)],
    "chain": [("chain", E.Revolute(), 3.0), ("chain 0", E.Continuous(), 1.0 / 3.0)],
    "broken": [("broken", E.Revolute(), 0.5), ("broken 0", E.Continuous(), 2.0)],
}
WRAPS = {"whole", "chain"}
"""Joints whose followers are all back after a whole turn: multipliers 2, -1 and 3, and 3 times a third."""


def wheels():
    b = jf.TreeBuilder()
    for joint, followers in FOLLOWERS.items():
        b.add(joint, parent="world", edge=E.Continuous(placement=PLACE))
        for i, (source, edge, factor) in enumerate(followers):
            b.add(f"{joint} {i}", parent=joint, edge=E.Mimic(source, edge, multiplier=factor, offset=0.3))
    return b.build()


def test_a_difference_leads_every_frame_to_its_place(dtype):
    tree = wheels()
    q0, q1 = (4 * tree.random(jax.random.key(i), (6,)) for i in (1, 2))
    step = jax.jit(tree.difference)(q0, q1)
    with jax.disable_jit():
        here, there = (tree.world_transforms(tree.state(q=q)).to_matrix() for q in (tree.integrate(q0, step), q1))
    np.testing.assert_allclose(here, there, atol=1e-12 if dtype == np.float64 else 2e-5)
    for i, joint in enumerate(tree.joint_names):
        if joint in WRAPS:
            assert np.abs(step[:, i]).max() <= np.pi + 1e-6
        else:
            np.testing.assert_array_equal(step[:, i], (q1 - q0)[:, i])
    assert np.abs(q1 - q0).max(0).min() > np.pi  # each of them could have taken a shorter way
    one = jax.vmap(tree.difference)(q0, q1)
    np.testing.assert_allclose(one, step, atol=1e-14 if dtype == np.float64 else 1e-5)


def test_the_issue_of_half_a_turn_and_multipliers_that_are_traced_or_batched(dtype):
    tree = wheels()
    at = tree.joint_names.index("half")
    q0, q1 = (tree.set_q(tree.state(), {"half": angle}).q for angle in (0.0, 1.5 * np.pi))
    ask = jax.jit(lambda factor: tree.with_values({"half 0.multiplier": factor}).difference(q0, q1)[..., at])
    factors = np.array([[-0.5], [1.0], [0.25]], dtype)
    np.testing.assert_allclose(ask(factors), [1.5 * np.pi, -0.5 * np.pi, 1.5 * np.pi], rtol=1e-6)
    np.testing.assert_allclose(jax.vmap(ask)(factors), ask(factors), rtol=1e-6)
    gradient = jax.grad(lambda q: tree.difference(q0, q)[at])(q1)
    np.testing.assert_array_equal(gradient, np.eye(tree.nq)[at])


def test_an_edge_in_place_of_another_names_the_same_joints_and_candidates():
    b = jf.TreeBuilder()
    b.add("a", parent="world", edge=E.Universal())
    b.add("b", parent="world", edge=E.Mimic("a", E.Revolute()))
    b.add("c", parent="world", edge=E.Attachable(candidates=("world", "a")))
    tree = b.build()
    for make, words in (
        (lambda: tree.with_edge("b", E.Mimic("other", E.Revolute())), "frame 'b': joint of its edge would be 'other' instead of 'a'"),
        (
            lambda: tree.with_edge("c", E.Attachable(candidates=("world",))),
            r"frame 'c': candidates .*\('world',\) instead of \('world', 'a'\)",
        ),
        (lambda: tree.with_edge("c", E.Attachable()), "frame 'c': candidates of its edge would be None"),
        (lambda: tree.with_values({"b.joint": "c"}), "joint of its edge would be 'c'.*TreeBuilder"),
        (lambda: tree.with_values({"c.candidates": None}), "candidates of its edge would be None"),
        (lambda: tree.with_edge("b", E.Mimic("a", E.Revolute(), coordinate=1)), "coordinate"),
    ):
        with pytest.raises(errors.EdgeError, match=words):
            make()
    assert tree.with_edge("b", E.Mimic("a", E.Revolute(), multiplier=3.0)).edge("b").multiplier[0] == 3
