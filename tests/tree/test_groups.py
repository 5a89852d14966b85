"""Groups: many frames added at once, named by pattern and slice, and asked about together."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import DuplicateNameError, EdgeError, ShapeError, UnknownFrameError
from tests.compilations import compilations

E = jf.edges


def spiral(params, seconds):
    return params["rate"] * seconds * jnp.ones(3, params["rate"].dtype)


def small():
    b = jf.TreeBuilder(root="hub")
    angles = np.arange(5) * 0.7
    b.add_many(
        [f"arm/{i}" for i in range(5)],
        parent="hub",
        edge=E.Fixed(jf.Transform(jf.Rotation.from_axis_angle((0, 0, 1), angles), np.eye(5)[:, :3])),
    )
    b.add_many(
        [f"hand/{i}" for i in range(5)], parent=[f"arm/{i}" for i in range(5)], edge=E.Revolute(np.eye(3)[np.arange(5) % 3], limits=(-1, 1))
    )
    return b.build()


TREE = small()


def state_of(tree, dtype):
    rng = np.random.default_rng(0)
    return tree.state(q=rng.normal(size=(2, tree.nq)).astype(dtype), qd=rng.normal(size=tree.nv).astype(dtype), time=0.25)


def test_many_are_one_family_with_names():
    assert TREE.names[1:3] == ("arm/0", "arm/1")
    assert TREE.parent("hand/3") == "arm/3"
    assert [len(own) for own in TREE.topology.members] == [5, 5]
    assert TREE.joint_names == tuple(f"hand/{i}" for i in range(5))
    np.testing.assert_array_equal(TREE.get("hand/4.axis"), [0, 1, 0])
    group = TREE.group("hand/*")
    assert (len(group), group[1], tuple(group[1:3]), group[-1]) == (5, "hand/1", ("hand/1", "hand/2"), "hand/4")
    assert tuple(TREE.group("hub", "arm/[01]", ["hand/2", "hub"])) == ("hub", "arm/0", "arm/1", "hand/2")
    assert hash(group) == hash(TREE.group("hand/*"))
    assert repr(group) == "Group('hand/0', 'hand/1', 'hand/2', ...; 5 frames)"


def test_queries_have_a_leading_axis(dtype, tol):
    state, group = state_of(TREE, dtype), TREE.group("hand/*", "hub")
    whole = TREE.motion(state, of=group, relative_to="arm/1")
    assert whole.transform.translation.shape == (6, 2, 3)
    turned = TREE.acceleration(state, of=group, relative_to="arm/1", expressed_in="hub")
    for row in (0, 1, 5):
        one = TREE.motion(state, of=group[row], relative_to="arm/1")
        for a, b in zip(jax.tree.leaves(whole), jax.tree.leaves(one), strict=True):
            np.testing.assert_allclose(a[row], b, atol=10 * tol)
        other = TREE.acceleration(state, of=group[row], relative_to="arm/1", expressed_in="hub")
        np.testing.assert_allclose(turned.as_vector()[row], other.as_vector(), atol=10 * tol)
    np.testing.assert_array_equal(TREE.transform(state, of=group, relative_to="arm/1").translation, whole.transform.translation)
    assert compilations(lambda: TREE.motion(state, of=TREE.group("hand/*", "hub"), relative_to="arm/1")) == 0


def test_derivatives_through_a_group(dtype):
    group = TREE.group("hand/*")
    place = lambda tree: jnp.sum(tree.transform(state_of(tree, dtype), of=group, relative_to="hub").translation)
    slope = jax.jit(jax.grad(place))(TREE)
    np.testing.assert_allclose(slope.get("arm/3.transform.translation"), [2.0, 2.0, 2.0], rtol=1e-6)


def test_large_groups_of_every_kind(rng, dtype, tol):
    b = jf.TreeBuilder(root="earth")
    count = 9
    b.add_many([f"sat/{i}" for i in range(count)], parent="earth", edge=E.Kepler(periapsis=7e6, node=np.arange(count) / 3, mu=3.986e14))
    b.add_many(
        [f"line/{i}" for i in range(count)],
        parent="earth",
        edge=E.Function(spiral, {"rate": 1.0}).replace(params={"rate": jnp.arange(float(count))[:, None]}),
    )
    times = np.arange(6.0)
    b.add_many([f"track/{i}" for i in range(count)], parent="earth", edge=jf.tables.Sampled(times, rng.normal(size=(count, 6, 3))))
    lengths = [jf.tables.Sampled(np.arange(4.0 + i), rng.normal(size=(4 + i, 3)), method="linear") for i in range(3)]
    b.add_many(["a", "b", "c"], parent="sat/0", edge=lengths)
    tree = b.build()
    state = tree.state(time=jnp.asarray([0.5, 1.25], dtype))
    for pattern, names in (("sat/*", ("sat/0", "sat/8")), ("line/*", ("line/7",)), ("track/*", ("track/2",)), ("[abc]", ("c",))):
        group = tree.group(pattern)
        whole = tree.velocity(state, of=group, relative_to="earth").linear
        for name in names:
            one = tree.velocity(state, of=name, relative_to="earth").linear
            np.testing.assert_allclose(
                whole[group.names.index(name)], one, rtol=50 * tol, atol=50 * tol * max(1.0, float(np.abs(one).max()))
            )


def test_groups_across_links(dtype, tol):
    b = jf.TreeBuilder.from_tree(TREE)
    b.add("cup", parent="hand/0", edge=E.Attachable(jf.Transform.from_translation((0, 0, 1)), candidates=("hand/0", "hand/1")))
    tree = b.build()
    state = tree.attach(state_of(tree, dtype), "cup", "hand/1")
    group = tree.group("cup", "arm/2", "cup")
    assert len(group) == 2
    whole = tree.transform(state, of=group, relative_to="hub")
    np.testing.assert_allclose(whole.translation[0], tree.transform(state, of="cup", relative_to="hub").translation, atol=10 * tol)
    np.testing.assert_allclose(whole.translation[1], tree.transform(state, of="arm/2", relative_to="hub").translation, atol=10 * tol)


def test_what_is_wrong_is_said_and_nothing_is_added():
    b = jf.TreeBuilder.from_tree(TREE)
    edge = E.Fixed(jf.Transform.from_translation(np.zeros((3, 3))))
    with pytest.raises(ShapeError, match=r"there are 2 names, and the numbers of the edge \(fixed\) have 3"):
        b.add_many(["x", "y"], parent="hub", edge=edge)
    with pytest.raises(ShapeError, match="no axis over frames"):
        b.add_many(["x", "y"], parent="hub", edge=E.Fixed())
    with pytest.raises(ShapeError, match="2 names and 3 parents"):
        b.add_many(["x", "y"], parent=["hub", "hub", "hub"], edge=[E.Fixed()] * 2)
    with pytest.raises(DuplicateNameError, match="'arm/0' exists already"):
        b.add_many(["x", "y", "arm/0"], parent="hub", edge=edge)
    with pytest.raises(EdgeError, match=r"edge must be one of jf\.edges"):
        b.add_many(["x", "y"], parent="hub", edge=[E.Fixed(), None])
    assert b.names == TREE.names
    with pytest.raises(UnknownFrameError, match=r"the tree has no frame 'leg/\*'"):
        TREE.group("leg/*")
    with pytest.raises(ShapeError, match="this group has none"):
        TREE.transform(TREE.state(), of=TREE.group("arm/*")[5:], relative_to="hub")
