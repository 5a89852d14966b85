"""Value types as containers: trees with any leaves, indexing, joining, printing, comparison, operators with arrays on the left."""

import copy
import pickle

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes import spatial as s
from jaxframes.errors import FrameError, ShapeError
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench

CLASSES = (Rotation, Transform, SpatialVelocity, SpatialAcceleration, Motion, Twist, Wrench)


def example(cls, batch=()):
    if cls in (Rotation, Transform):
        return cls.random(jax.random.key(1), batch)
    if cls is Motion:
        return Motion(example(Transform, batch), example(SpatialVelocity, batch), example(SpatialAcceleration, batch))
    return cls.from_vector(jax.random.normal(jax.random.key(2), (*batch, 6)))


@pytest.mark.parametrize("cls", CLASSES)
def test_any_leaf_passes_through_a_tree(cls):
    value = example(cls, (2,))
    for leaf in (None, object(), 0, "x", jax.ShapeDtypeStruct((2, 3), np.float32), [1, 2]):
        assert isinstance(jax.tree.map(lambda _, leaf=leaf: leaf, value), cls)
        repr(jax.tree.map(lambda _, leaf=leaf: leaf, value))
    assert jax.tree.structure(value) == jax.tree.structure(example(cls))
    shapes = jax.eval_shape(lambda x: x, value)
    assert isinstance(shapes, cls)
    assert shapes.shape == (2,)
    out = jax.vmap(lambda x: x, in_axes=(jax.tree.map(lambda _: 0, value),), out_axes=1)(value)
    assert jax.tree.leaves(out)[0].shape[1] == 2
    jacobian = jax.jacfwd(lambda x: x)(example(cls))
    assert isinstance(jacobian, cls)
    for other in (copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert s.allclose(value, other)


@pytest.mark.parametrize("cls", CLASSES)
def test_indexing_reaches_batch_axes_only(cls):
    value = example(cls, (4, 3, 2))
    assert value.shape == (4, 3, 2)
    assert value.ndim == 3
    for index in (
        0,
        -1,
        slice(1, 3),
        (1, 2),
        (..., 0),
        (slice(None), ..., 1),
        None,
        (0, None),
        np.array([2, 0]),
        np.array([True, False, True, False]),
    ):
        part = value[index]
        for leaf, whole in zip(jax.tree.leaves(part), jax.tree.leaves(value), strict=True):
            expected = np.stack([np.asarray(whole[..., k])[index] for k in range(whole.shape[-1])], -1)
            assert np.array_equal(leaf, expected)
    assert [item.shape for item in value] == [(3, 2)] * 4
    for index in (4, -5, (0, 3), (..., 2), (0, 0, 0, 0), (0, 0, 0, slice(None))):
        with pytest.raises(IndexError):
            value[index]
    single = example(cls)
    with pytest.raises(IndexError):
        single[0]
    with pytest.raises(TypeError):
        iter(single)
    assert value[jnp.asarray(1)].shape == (3, 2)
    assert jax.jit(lambda v, i: v[i])(value, 2).shape == (3, 2)


def test_leaves_of_different_batches_are_indexed_together():
    pose = Transform(Rotation.identity(), jnp.arange(6.0).reshape(2, 3))
    assert pose.shape == (2,)
    assert pose[1].rotation.wxyz.shape == (4,)
    assert pose[1].translation.tolist() == [3, 4, 5]
    assert pose.reshape(1, 2).translation.shape == (1, 2, 3)
    assert pose.reshape(2, 1)[1, 0].translation.tolist() == [3, 4, 5]


@pytest.mark.parametrize("cls", CLASSES)
def test_joining(cls):
    values = [example(cls, (2,)), example(cls, (1,)), example(cls)]
    joined = s.stack(values)
    assert joined.shape == (3, 2)
    for i, value in enumerate(values):
        assert s.allclose(joined[i], value, rtol=0, atol=0)
    assert s.stack(values, axis=-1).shape == (2, 3)
    assert s.concatenate(values[:2]).shape == (3,)
    assert s.allclose(s.concatenate(values[:2])[2], values[1][0], rtol=0, atol=0)
    with pytest.raises(ShapeError, match="at least one"):
        s.stack([])
    with pytest.raises(ShapeError, match="one type"):
        s.stack([example(cls), s.Epoch.from_et(0.0)])


def test_repr():
    assert repr(Rotation.identity()) == "Rotation(wxyz=[1., 0., 0., 0.])"
    text = repr(Transform.from_translation([1.0, 2.0, 3.5]))
    assert text == "Transform(rotation=Rotation(wxyz=[1., 0., 0., 0.]), translation=[1. , 2. , 3.5])"
    assert repr(Twist.zero((2,))) == "Twist(linear=[[0., 0., 0.], [0., 0., 0.]], angular=[[0., 0., 0.], [0., 0., 0.]], shape=(2,))"
    name = jnp.zeros(()).dtype.name
    assert repr(Rotation.identity((100,))) == f"Rotation(wxyz={name}[100, 4], shape=(100,))"
    seen = []
    jax.jit(lambda r: seen.append(repr(r)) or r)(Rotation.identity())
    assert seen == [f"Rotation(wxyz={name}[4])"]


def test_allclose():
    a = Rotation.from_rpy(0.1, 0.2, 0.3)
    assert s.allclose(a, Rotation(-a.wxyz))
    assert not s.allclose(a, Rotation.from_rpy(0.1, 0.2, 0.3001))
    assert s.allclose(a, Rotation.from_rpy(0.1, 0.2, 0.3001), atol=1e-3)
    assert not s.allclose(a, Rotation(a.wxyz * jnp.nan))
    assert s.allclose(a, s.stack([a, a]))
    assert jax.jit(s.allclose)(Twist.zero(), Twist.zero())
    assert s.allclose(jnp.ones(3), np.ones((2, 3)))
    far = Transform.from_translation([1e8, 0, 0])
    assert s.allclose(far, Transform.from_translation([1e8, 1e-3, 0]))  # relative to the length of the vector
    with pytest.raises(ShapeError, match="Twist and Wrench"):
        s.allclose(Twist.zero(), Wrench.zero())
    with pytest.raises(TypeError):
        hash([Twist.zero()])
    assert Twist.zero() != Twist.zero()  # identity, as documented: use allclose


@pytest.mark.parametrize("left", [np.ones(3), np.ones((3, 3)), jnp.ones(3), 2, np.float64(2), "x"])
def test_nothing_on_the_left_takes_over(left):
    for value in (Rotation.identity(), Transform.identity(), Motion.identity()):
        with pytest.raises(TypeError):
            left @ value
    with pytest.raises(TypeError):
        left + Twist.zero()


def test_products_with_numbers(dtype):
    twist = example(Twist)
    for two in (2, 2.0, dtype.type(2), np.array(2, dtype), jnp.asarray(2.0), np.int64(2)):
        for result in (two * twist, twist * two):
            assert isinstance(result, Twist)
            assert np.array_equal(result.linear, twist.linear * 2)
    half = example(Twist, (3,)) / np.array([1.0, 2.0, 4.0])
    assert np.array_equal(half.linear[2], example(Twist, (3,)).linear[2] / 4)
    with pytest.raises(TypeError):
        twist * twist
    with pytest.raises(TypeError):
        twist + Wrench.zero()
    with pytest.raises(TypeError):
        Rotation.identity() @ Transform.identity()
    with pytest.raises(TypeError):
        Transform.identity() @ SpatialVelocity.zero()
    assert (twist - twist).linear.tolist() == [0, 0, 0]


def test_shapes_are_checked_where_they_are_used():
    for call in (
        lambda: Rotation.from_matrix(np.ones((3, 4))),
        lambda: Transform.from_matrix(np.ones((3, 3))),
        lambda: Rotation.from_quaternion_wxyz(np.ones(3)),
        lambda: Rotation.identity() @ np.ones(4),
        lambda: Rotation.identity() @ 1.0,
        lambda: s.kdl.norm(np.ones(2)),
    ):
        with pytest.raises(ShapeError):
            call()
    with pytest.raises(FrameError, match="relative_to"):
        Motion.identity().spatial_acceleration_featherstone(at="world")
    with pytest.raises(FrameError, match="axes"):
        Motion.identity().to_oframe_observed(np.ones(3), np.ones(3), expressed_in="world")


def test_dtypes(dtype):
    """Results are of the default dtype, or of the dtype given, and never weakly typed."""
    for value in (Rotation.from_rpy(0, 0, 1), Rotation.rot_x(1), Transform.from_translation([1, 2, 3]), Twist.zero(), Motion.identity()):
        for leaf in jax.tree.leaves(value):
            assert leaf.dtype == dtype
            assert not leaf.weak_type
    narrow = Transform.random(jax.random.key(0), (2,), np.float32)
    for value in (
        narrow @ narrow,
        narrow.inverse(),
        narrow.log(),
        narrow.rotation.log(),
        Rotation.identity(dtype=np.float32) @ narrow.translation,
    ):
        assert all(leaf.dtype == np.float32 for leaf in jax.tree.leaves(value))
    assert narrow.astype(np.float16).dtype == np.float16
    traces = []
    turn = jax.jit(lambda a: traces.append(1) or Rotation.rot_z(a).wxyz)
    turn(Rotation.rot_z(0.3).angle())
    turn(Rotation.rot_z(0.4).log()[2])
    assert len(traces) == 1


def test_classes_are_not_taken_for_each_other():
    """Tree structures differ between classes of as many leaves, so a compiled function never answers for another class."""
    values = [example(cls) for cls in CLASSES]
    structures = [jax.tree.structure(value) for value in values]
    assert all((a == b) == (i == j) for i, a in enumerate(structures) for j, b in enumerate(structures))
    index = jax.jit(lambda x: jnp.asarray(CLASSES.index(type(x))))
    assert [int(index(value)) for value in values] == list(range(len(CLASSES)))


def test_norm_of_an_infinite_vector_is_infinite(dtype):
    for vector in ([np.inf, 0.0, 0.0], [1.0, -np.inf, np.inf]):
        assert float(s.kdl.norm(jnp.asarray(vector, dtype))) == np.inf
    assert np.isnan(s.kdl.norm(jnp.asarray([np.inf, np.nan, 0.0], dtype)))


def test_epochs_are_close_by_the_seconds_between_them(dtype):
    """Not by their size: half a second is small beside the seconds since 2000, and never the same instant."""
    e = s.Epoch.from_tdb("2026-03-01T12:00:00.25")
    assert s.allclose(e, e)
    assert not s.allclose(e, e + 0.5)
    assert not s.allclose(e, e + 1e-3)
    assert s.allclose(e, e + 0.5, atol=0.6)
    assert not s.allclose({"t": s.stack([e, e])}, {"t": s.stack([e, e + 0.5])})
    assert s.allclose(s.Epoch(jnp.asarray(1.0, dtype), jnp.asarray(0.0, dtype)), s.Epoch(jnp.asarray(0.0, dtype), jnp.asarray(1.0, dtype)))
    with pytest.raises(ShapeError, match="found Epoch and Transform"):
        s.allclose(e, s.Transform.identity())


def test_equal_and_dot_take_the_classes(rng, dtype):
    """Elementwise and absolute, rotations by their matrices, as KDL's ``Equal``; the power of a wrench on a twist in either order."""
    rotation = s.Rotation.exp(jnp.asarray(rng.normal(size=3), dtype))
    pose = s.Transform(rotation, jnp.asarray(rng.normal(size=3), dtype))
    twist = s.Twist(linear=jnp.asarray([1.0, 2.0, 3.0], dtype), angular=jnp.asarray([4.0, 5.0, 6.0], dtype))
    wrench = s.Wrench(force=jnp.asarray([1.0, 0.0, 2.0], dtype), torque=jnp.asarray([0.5, 1.0, 0.0], dtype))
    moved = s.Transform(rotation, pose.translation + 1e-3)
    turned = s.Transform(rotation @ s.Rotation.rot_z(1e-3), pose.translation)
    opposite = s.Transform(s.Rotation(-rotation.wxyz), pose.translation)
    assert s.kdl.equal(pose, pose)
    assert s.kdl.equal(pose, opposite)
    for other in (moved, turned):
        assert not s.kdl.equal(pose, other)
        assert s.kdl.equal(pose, other, 2e-3)
    assert not s.kdl.equal(rotation, turned.rotation)
    assert s.kdl.equal(twist, twist + twist * 1e-8)
    assert not s.kdl.equal(wrench, wrench * 1.01)
    both = s.stack([pose, moved])
    assert s.kdl.equal(pose, both).tolist() == [True, False]
    assert s.kdl.equal(pose, both, jnp.asarray([1e-6, 2e-3], dtype)).tolist() == [True, True]
    assert float(s.kdl.dot(twist, wrench)) == float(s.kdl.dot(wrench, twist)) == 1 + 6 + 2 + 5
    for pair in ((twist, twist), (twist, jnp.ones(3)), (pose, wrench)):
        with pytest.raises(TypeError, match="dot takes two vectors, or a Twist and a Wrench; found"):
            s.kdl.dot(*pair)
    with pytest.raises(TypeError, match="equal needs two values of one type; found Twist and Wrench"):
        s.kdl.equal(twist, wrench)


def test_twists_and_wrenches_are_made_by_name_and_of_vectors(dtype):
    """KDL has the linear part first and 6-vectors the angular one: no order of arguments to mistake."""
    six = jnp.arange(12.0, dtype=dtype).reshape(2, 6)
    twist, wrench = Twist.from_vector(six), Wrench.from_vector(six)
    assert np.array_equal(twist.angular, six[:, :3])
    assert np.array_equal(twist.linear, six[:, 3:])
    assert np.array_equal(wrench.torque, six[:, :3])
    assert np.array_equal(wrench.force, six[:, 3:])
    for value in (twist, wrench):
        assert np.array_equal(value.as_vector(), six)
        with pytest.raises(TypeError, match="positional"):
            type(value)(six[0, :3], six[0, 3:])


def test_what_is_no_rotation_is_refused_and_nan_under_jit(dtype):
    """A zero quaternion, a reflection, a flat matrix: an error that says where; under jit NaN in value and gradient."""
    mirror = np.diag([1.0, 1.0, -1.0]).astype(dtype)
    flat = np.diag([1.0, 1.0, 0.0]).astype(dtype)
    for make, bad in (
        (Rotation.from_quaternion_wxyz, np.zeros(4, dtype)),
        (Rotation.from_quaternion_xyzw, np.zeros(4, dtype)),
        (Rotation.from_matrix, mirror),
        (Rotation.from_matrix, flat),
        (lambda m: Rotation.from_rows(*m), mirror),
        (lambda m: Rotation.from_columns(*m), mirror),
    ):
        with pytest.raises(FrameError, match="no rotation"):
            make(bad)
        assert np.isnan(jax.jit(lambda x, make=make: make(x).wxyz)(bad)).all()
        assert np.isnan(jax.jit(jax.grad(lambda x, make=make: make(x).wxyz.sum()))(bad)).any()
    with pytest.raises(FrameError, match=r"\(at batch index 2, 0\)"):
        Rotation.from_matrix(np.stack([[np.eye(3)], [np.eye(3)], [mirror]]))
    # What is not finite already stays NaN: it is no mistake about rotations.
    assert np.isnan(Rotation.from_matrix(np.full((3, 3), np.nan, dtype)).wxyz).all()
    turn = Rotation.from_rpy(0.1, -0.2, 0.3)
    assert s.allclose(Rotation.from_matrix(turn.to_matrix()), turn)


def test_products_by_a_star_point_to_the_operator():
    for value, how in ((Rotation.identity(), "R @ v"), (Transform.identity(), "T @ p")):
        for other in (jnp.ones(3), value, 2.0):
            with pytest.raises(TypeError, match=how):
                value * other
