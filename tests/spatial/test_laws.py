"""Group laws and round trips by hypothesis: any batch shape, eager, jit and vmap agreeing, in the dtype of the run."""

import functools

import hypothesis.extra.numpy as hnp
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaxframes import spatial as s
from jaxframes.spatial import Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench

SHAPES = [(), (1,), (3, 1, 2)]
SIZES = st.sampled_from([0.0, 1e-9, 1e-4, 1.0, 2.5, np.pi - 1e-4, np.pi, 10.0])
laws = settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


@st.composite
def vectors(draw, shape):
    """Vectors [*shape, 3] of lengths that matter: zero, tiny, ordinary, near pi, pi, several turns."""
    directions = draw(hnp.arrays(np.float64, (*shape, 3), elements=st.sampled_from([-1.0, -0.6, 0.0, 0.3, 0.8, 1.0])))
    sizes = draw(hnp.arrays(np.float64, shape, elements=SIZES))
    length = np.maximum(np.linalg.norm(directions, axis=-1, keepdims=True), 1e-30)
    return (directions / length * sizes[..., None]).astype(jnp.zeros(()).dtype)


def poses(x):
    return Transform(Rotation.exp(x[0]), x[1])


def close(a, b):
    """Return the largest difference of two values, rotations up to the sign of their quaternions."""
    worst = jnp.zeros(())
    for x, y in zip(*(jax.tree.leaves(v, is_leaf=lambda n: isinstance(n, Rotation)) for v in (a, b)), strict=True):
        difference = x.to_matrix() - y.to_matrix() if isinstance(x, Rotation) else jnp.asarray(x) - jnp.asarray(y)
        worst = jnp.maximum(worst, jnp.max(jnp.abs(difference)))
    return worst


def residuals(v):
    """Return the residual of every law for vectors v, a tuple of arrays [..., 3]."""
    a, b, c = Transform(Rotation.exp(v[0]), v[1]), Transform(Rotation.exp(v[2]), v[3]), Transform(Rotation.exp(v[4]), v[5])
    x, velocity, twist, wrench = v[5], SpatialVelocity(v[1], v[3]), Twist(linear=v[1], angular=v[3]), Wrench(force=v[5], torque=v[1])
    p, q = (Motion(t, SpatialVelocity(v[i], v[j]), SpatialAcceleration(v[j], v[i])) for t, i, j in ((a, 3, 5), (b, 5, 1)))
    r, o = a.rotation, b.rotation
    pairs = {
        "associative": ((a @ b) @ c, a @ (b @ c)),
        "inverse": (a @ a.inverse(), Transform.identity(a.shape)),
        "inverse on the left": (a.inverse() @ a, Transform.identity(a.shape)),
        "inverse of a product": ((a @ b).inverse(), b.inverse() @ a.inverse()),
        "acts on points": ((a @ b) @ x, a @ (b @ x)),
        "points and back": (a.inverse_apply(a @ x), x),
        "free vectors": (a.apply_vector(x), (a @ x) - (a @ jnp.zeros_like(x))),
        "relative": (b.relative_to(a), a.inverse() @ b),
        "matrix": (Transform.from_matrix(a.to_matrix()), a),
        "matrix of a product": (r.to_matrix() @ o.to_matrix(), (r @ o).to_matrix()),
        "quaternion orders": (Rotation.from_quaternion_xyzw(r.to_quaternion_xyzw()), Rotation.from_quaternion_wxyz(r.to_quaternion_wxyz())),
        "roll pitch yaw": (Rotation.from_rpy(*r.to_rpy()), r),
        "zyx": (Rotation.from_euler_zyx(*r.to_euler_zyx()), r),
        "zyz": (Rotation.from_euler_zyz(*r.to_euler_zyz()), r),
        "logarithm": (Rotation.exp(r.log()), r),
        "axis angle": (Rotation.from_axis_angle(*r.to_axis_angle()[::-1]), r),
        "pose logarithm": (Transform.exp(a.log()), a),
        "screw ends": (a.interpolate_screw(b, 1.0), b),
        "separate ends": (a.interpolate_separate(b, 1.0), b),
        "slerp ends": (r.slerp(o, 1.0), o),
        "two vectors": (
            s.kdl.cross(Rotation.from_two_vectors(x / 11 + 1.0, v[1] / 12 - 1.0) @ (x / 11 + 1.0), v[1] / 12 - 1.0),
            jnp.zeros_like(x),
        ),
        "delta": (s.kdl.add_delta(r, s.kdl.diff(r, o, 0.5), 0.5), o),
        "pose delta": (s.kdl.add_delta(a, s.kdl.diff(a, b, 0.5), 0.5), b),
        "retract": (a.retract(b.relative_to(a).log()), b),
        "jacobians": (
            Rotation.left_jacobian(v[0] / 4) @ Rotation.left_jacobian_inv(v[0] / 4),
            jnp.broadcast_to(jnp.eye(3), (*a.shape, 3, 3)),
        ),
        "right jacobian": (Rotation.right_jacobian(v[0]), jnp.swapaxes(Rotation.left_jacobian(v[0]), -1, -2)),
        "power of rotations": ((r**0.25) ** 4.0, r),
        "powers of a pose": (a**0.25 @ a**0.75, a),
        "canonical": (r.canonical(), r),
        "the long way": (r.slerp(o, 1.0, long_way=True), o),
        "pose jacobians": (
            Transform.left_jacobian(twist / 4) @ Transform.left_jacobian_inv(twist / 4),
            jnp.broadcast_to(jnp.eye(6), (*a.shape, 6, 6)),
        ),
        "pose jacobians of the inverse": (Transform.right_jacobian(twist), Transform.left_jacobian(-twist)),
        "twist there and back": (twist.transform(a).inverse_transform(a), twist),
        "twist by inverse": (twist.inverse_transform(a), twist.transform(a.inverse())),
        "wrench by base and point": (wrench.transform(a), wrench.change_base(r).ref_point(-a.translation)),
        "power": (twist.transform(a).dot(wrench.transform(a)), wrench.dot(twist)),
        "adjoint": (jnp.einsum("...ij,...j->...i", a.adjoint(), twist.as_vector()), twist.transform(a).as_vector()),
        "phi": (jnp.einsum("...ji,...j->...i", s.kdl.phi(x), velocity.as_vector()), velocity.at_point(x).as_vector()),
        "wrench phi": (jnp.einsum("...ij,...j->...i", s.kdl.phi(x), wrench.as_vector()), wrench.ref_point(-x).as_vector()),
        "motion inverse": (p @ p.inverse(), Motion.identity(p.shape)),
        "motion relative": (q.relative_to(p), p.inverse() @ q),
        "motion of inverse": ((p @ q).inverse(), q.inverse() @ p.inverse()),
        "reverse velocity": (p.reverse_velocity(), p.inverse().velocity),
        "reverse acceleration": (p.reverse_acceleration(), p.inverse().acceleration),
    }
    size = 1 + sum(jnp.max(jnp.abs(part)) for part in v)
    return {name: close(*pair) / size**3 for name, pair in pairs.items()}


compiled = jax.jit(residuals)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_laws(shape, dtype):
    limit = 30 * np.finfo(dtype).eps

    @laws
    @given(st.tuples(*[vectors(shape)] * 6))
    def hold(v):
        for name, residual in jax.device_get(compiled(v)).items():
            assert residual < limit, (name, float(residual))

    hold()


def sample(shape):
    rng = np.random.default_rng(5)
    return tuple(rng.normal(size=(*shape, 3)).astype(jnp.zeros(()).dtype) for _ in range(6))


def outcome(v):
    """A function that goes through much of the module, returning every leaf it makes."""
    a, b = Transform(Rotation.exp(v[0]), v[1]), Transform(Rotation.exp(v[2]), v[3])
    motion = Motion(a @ b.inverse(), SpatialVelocity(v[1], v[3]), SpatialAcceleration(v[4], v[5]))
    turned = Rotation.from_matrix(b.rotation.to_matrix())
    return (
        a.interpolate_screw(b, 0.3),
        turned.to_rpy(),
        Twist(linear=v[1], angular=v[2]).transform(a),
        motion @ motion,
        s.kdl.normalize(v[5]),
    )


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_eager_jit_and_vmap_agree(shape, tol):
    """Op by op for the shape of several axes only: each new shape compiles every operation anew."""
    v = sample(shape)
    over_one = functools.reduce(lambda f, _: jax.vmap(f), shape, outcome)
    jitted, mapped = jax.jit(lambda v: (outcome(v), over_one(v)))(v)
    for other in (mapped, outcome(v)) if shape == SHAPES[-1] else (mapped,):
        assert jax.tree.structure(jitted) == jax.tree.structure(other)
        for a, b in zip(jax.tree.leaves(jitted), jax.tree.leaves(other), strict=True):
            assert a.shape == b.shape
            assert a.dtype == b.dtype == v[0].dtype
            assert np.abs(np.asarray(a) - np.asarray(b)).max() < tol


def test_gradients_agree(tol):
    """The gradient through a batch is the gradient of each item; forward and reverse mode agree along a direction."""

    def total(v):
        a, b = Transform(Rotation.exp(v[0]), v[1]), Transform(Rotation.exp(v[2]), v[3])
        motion = Motion(a @ b.inverse(), SpatialVelocity(v[1], v[3]), SpatialAcceleration(v[4], a.rotation.log())).inverse()
        return sum(jnp.sum(leaf * leaf) for leaf in jax.tree.leaves(motion))

    v, direction = sample((3, 1, 2)), sample((3, 1, 2))[::-1]
    items = tuple(x.reshape(6, 3) for x in v)

    @jax.jit
    def ask(v, items, direction):
        return jax.grad(total)(v), jax.vmap(jax.grad(total))(items), jax.jvp(total, (v,), (direction,))[1]

    reverse, alone, forward = jax.device_get(ask(v, items, direction))
    size = max(float(np.abs(g).max()) for g in reverse)
    for a, b in zip(reverse, alone, strict=True):
        assert np.abs(a.reshape(6, 3) - b).max() < tol * size
    assert abs(forward - sum(np.sum(g * d) for g, d in zip(reverse, direction, strict=True))) < 20 * tol * size
