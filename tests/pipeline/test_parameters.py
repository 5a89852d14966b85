"""Parameters by name: key paths, masks, values, checkpoints by path; limits are none, and unit vectors are read at length one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests.pipeline.trees import turned


def declared(order):
    """The same frames, declared in one order or another."""
    rng, edges = np.random.default_rng(5), {}
    for i, name in enumerate(("left", "right", "camera")):
        joint = jf.edges.Revolute(axis=rng.normal(size=3), placement=turned(rng), limits=(-1.0 - i, 1.0 + i))
        edges[name] = joint if i < 2 else jf.edges.Fixed(turned(rng))
    b = jf.TreeBuilder()
    for name in order:
        b.add(name, parent="world", edge=edges[name])
    b.add("tool", parent="left", edge=jf.edges.Mimic("right", jf.edges.Prismatic(), multiplier=2.0))
    return b.build()


TREE = declared(("left", "right", "camera"))


def test_key_paths_name_frame_and_field():
    paths = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_flatten_with_path(TREE)[0]]
    assert "['left'].placement.translation" in paths
    assert "['camera'].transform.rotation.wxyz" in paths
    assert "['tool'].edge.axis" in paths
    assert len(set(paths)) == len(paths) == len(TREE.parameter_names())
    assert TREE.parameter_names("left.placement") == ("left.placement.rotation.wxyz", "left.placement.translation")


def test_a_checkpoint_by_path_keeps_each_frames_numbers():
    stored = {jax.tree_util.keystr(path): np.asarray(leaf) for path, leaf in jax.tree_util.tree_flatten_with_path(TREE)[0]}
    other = declared(("camera", "right", "left"))
    template = jax.tree.map(jnp.zeros_like, other)
    restored = jax.tree_util.tree_map_with_path(lambda path, leaf: jnp.asarray(stored[jax.tree_util.keystr(path)]), template)
    for name in ("left", "right", "camera"):
        a, b = (t.transform(t.state(q={"left": 0.3, "right": 0.2}), of=name, relative_to="world") for t in (TREE, restored))
        np.testing.assert_array_equal(a.translation, b.translation)
        np.testing.assert_array_equal(a.rotation.wxyz, b.rotation.wxyz)
    with pytest.raises(jf.FrameError, match="does not begin with the name of a frame"):
        TREE.with_values({"top.placement.translation": np.zeros(3)})


def test_masks_and_values_by_name():
    mask = TREE.mask("camera.transform", "*.axis")
    chosen = [name for name, on in zip(TREE.parameter_names(), jax.tree.leaves(mask), strict=True) if on]
    assert chosen == ["left.axis", "right.axis", "camera.transform.rotation.wxyz", "camera.transform.translation", "tool.edge.axis"]
    assert jax.tree.structure(mask) == jax.tree.structure(TREE)
    repr(mask)
    changed = TREE.with_values({"camera.transform.translation": [1.0, 2.0, 3.0], "tool.multiplier": 3.0, "left.limits": (-5.0, 5.0)})
    np.testing.assert_array_equal(changed.get("camera.transform").translation, [1.0, 2.0, 3.0])
    assert changed.get("tool.multiplier")[0] == 3.0
    assert changed.get("left.limits") == (-5.0, 5.0)
    assert TREE.get("left") is TREE.edge("left")
    with pytest.raises(jf.FrameError, match="reversed"):
        TREE.with_values({"left.limits": (1.0, -1.0)})
    with pytest.raises(jf.FrameError, match=r"no field 'plcement'.*'placement'"):
        TREE.get("left.plcement")
    with pytest.raises(jf.FrameError, match="shape"):
        TREE.with_values({"camera.transform.translation": np.zeros(4)})
    with pytest.raises(jf.FrameError, match=r"no parameter is called 'camra"):
        TREE.mask("camra.transform")


def test_derivatives_by_named_values(dtype):
    def place(x):
        tree = TREE.with_values({"left.placement.translation": x})
        return tree.transform(tree.state(q={"left": 0.2}), of="tool", relative_to="world").translation

    x = jnp.asarray([0.1, 0.2, 0.3], dtype)
    for derivative in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(jax.jit(derivative(place))(x), np.eye(3), atol=1e-6)


def test_limits_are_no_parameters():
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(declared(("left", "right", "camera"))))
    free = jf.TreeBuilder()
    free.add("a", parent="world", edge=jf.edges.Revolute())
    tree = free.build()
    assert np.isinf(tree.limits()).all()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(tree))


def test_axes_and_mounts_off_their_spheres_are_read_at_unit_length(dtype, tol):
    """A step of an optimiser off the sphere distorts no pose; its derivative is along the sphere; the check says so by name."""
    scaled = TREE.with_values(
        {"left.axis": 1.3 * TREE.get("left.axis"), "left.placement.rotation": 0.7 * TREE.get("left.placement.rotation.wxyz")}
    )
    for tree in (scaled, jax.jit(lambda t: t)(scaled)):
        state = tree.state(q={"left": 0.4}, qd={"left": 0.5})
        for program in (lambda t, s: t.motion(s, of="left", relative_to="world"), lambda t, s: t.world_motions(s)):
            wanted, found = program(TREE, state), jax.jit(program)(tree, state)
            jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=tol), wanted, found)
            jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=tol), wanted, program(tree, state))
    said = " ".join(scaled.check(scaled.state()))
    assert "'left': axis" in said
    assert "quaternion of norm 0.7" in said
    by_axis = jax.grad(
        lambda a: jnp.sum(
            TREE.with_values({"left.axis": a}).transform(TREE.state(q=[0.4, 0]), of="left", relative_to="world").rotation.wxyz[1:] ** 3
        )
    )
    axis = TREE.get("left.axis").astype(dtype)
    assert abs(jnp.dot(by_axis(axis), axis, precision="highest")) < tol


def test_derivatives_by_numbers_of_large_trees(dtype, tol):
    """Trees that go by level have them too: those of one path, worked out edge by edge."""
    b, rng = jf.TreeBuilder(), np.random.default_rng(1)
    for i in range(72):
        parent = f"{i - 12}" if i >= 12 else "world"
        b.add(f"{i}", parent=parent, edge=jf.edges.Revolute(axis=rng.normal(size=3), placement=turned(rng)))
    tree = b.build().astype(dtype)
    state = tree.state(q=np.linspace(-1.0, 1.0, 72).astype(dtype))
    whole = jax.jit(jax.grad(lambda t: jnp.sum(t.world_transforms(state).translation[-1])))(tree)
    path = jax.jit(jax.grad(lambda t: jnp.sum(t.transform(state, of="71", relative_to="world").translation)))(tree)
    jax.tree.map(lambda a, c: np.testing.assert_allclose(a, c, atol=20 * tol), whole, path)
    assert np.abs(whole.get("11.placement.translation")).max() > 0.1
