"""Whatever a user does with a result, the compiled program stays small: no huge fused computation, no work done over and over."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests.lowered import compiled_shape

BATCH, JOINTS = 64, 4
LARGEST = 2500
"""Instructions in one fused computation; XLA:CPU slows down by orders of magnitude from about 3 000."""

pytestmark = pytest.mark.float64


def arm(joints=JOINTS):
    rng, b = np.random.default_rng(0), jf.TreeBuilder()
    for i in range(joints):
        placement = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))
        b.add(f"{i}", parent=f"{i - 1}" if i else "world", edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=placement))
    return b.build()


TREE = arm()


def query(q):
    """Return quaternion and translation of two frames of the arm."""
    state = TREE.state(q=q)
    found = [TREE.transform(state, of=name, relative_to="world") for name in ("1", "3")]
    return [(t.rotation.wxyz, t.translation) for t in found]


def block(a, b):
    (p, x), (q, y) = a, b
    return jnp.block([[p[..., :3], x], [q[..., :3], y]])


CONSUMERS = {
    "stack": lambda a, b, q: jnp.stack([a[0], b[0]]),
    "concatenate": lambda a, b, q: jnp.concatenate([a[0], a[1], b[0], b[1], q]),
    "block": lambda a, b, q: block(a, b),
    "pad": lambda a, b, q: jnp.pad(b[1], (1, 2)),
    "roll": lambda a, b, q: jnp.roll(b[0], 1) + b[0],
    "take": lambda a, b, q: jnp.take(b[0], jnp.array([2, 0, 2]), mode="clip"),
    "reshape": lambda a, b, q: b[0].reshape(2, 2).T.reshape(-1),
    "reverse": lambda a, b, q: b[0][::-1] * b[0],
    "scatter": lambda a, b, q: jnp.zeros(9).at[jnp.array([1, 5, 7])].add(b[1]),
    "sort": lambda a, b, q: jnp.sort(b[1]),
    "where": lambda a, b, q: jnp.where(b[1] > 0, b[1], a[1]),
    "cumsum": lambda a, b, q: jnp.cumsum(b[0]),
    "matmul": lambda a, b, q: jnp.matmul(jnp.arange(12.0).reshape(3, 4), b[0], precision="highest"),
    "fft": lambda a, b, q: jnp.abs(jnp.fft.fft(b[0])),
    "scan": lambda a, b, q: jax.lax.scan(lambda c, x: (c + x, c * x), jnp.zeros(()), b[1])[1],
    "scan carry": lambda a, b, q: jax.lax.scan(lambda c, _: (jnp.roll(c, 1) + c, None), b[0], None, length=3)[0],
    "while carry": lambda a, b, q: jax.lax.fori_loop(0, 3, lambda i, c: jnp.roll(c, 1) * c, b[0]),
    "jit in jit": lambda a, b, q: jax.jit(lambda x, y: jnp.concatenate([x, y]))(b[0], b[1]),
}


def consumed(name, q):
    a, b = query(q)
    return CONSUMERS[name](a, b, q)


def plain(q):
    return [part for pose in query(q) for part in pose]


def alone(name, parts):
    """The consumer on poses that are given: what it costs itself."""
    q, *poses = parts
    return CONSUMERS[name](tuple(poses[:2]), tuple(poses[2:]), q)


def weighted(value):
    return sum(jnp.sum(x * jnp.cos(jnp.arange(x.size, dtype=x.dtype)).reshape(x.shape)) for x in jax.tree.leaves(value))


def given():
    q = jnp.asarray(np.random.default_rng(1).normal(size=(BATCH, JOINTS)))
    return q, (q, *jax.vmap(plain)(q))


@functools.cache
def baseline(kind):
    """Operations of the query itself and of its derivative."""
    q, _ = given()
    return compiled_shape(jax.vmap(WAYS[kind](plain)), q)[1]


def gradient(function):
    return jax.grad(lambda x: weighted(function(x)))


WAYS = {"value": lambda f: f, "gradient": gradient, "jacobian": jax.jacfwd}


@pytest.mark.parametrize("name", CONSUMERS)
@pytest.mark.parametrize("kind", ["value", "gradient"])
def test_consumers_leave_the_program_small(name, kind):
    q, parts = given()
    way = WAYS[kind]
    size, flops = compiled_shape(jax.vmap(way(functools.partial(consumed, name))), q)
    bare = functools.partial(alone, name)
    own = compiled_shape(jax.vmap(bare if kind == "value" else gradient(bare)), parts)[1]
    assert size <= LARGEST
    values = baseline("value") if kind == "gradient" else 0.0  # consumers that are not linear need the poses too
    assert flops <= 1.5 * (baseline(kind) + values + own), f"{flops / baseline(kind):.2f} times the plain query"


@pytest.mark.parametrize("name", ["concatenate", "block", "fft"])
def test_jacobians_through_consumers(name):
    q, _ = given()
    size, flops = compiled_shape(jax.vmap(jax.jacfwd(functools.partial(consumed, name))), q)
    assert size <= LARGEST
    assert flops <= 1.5 * baseline("jacobian") + 1e3 * BATCH


@pytest.mark.parametrize("name", ["concatenate", "roll"])
def test_native_batches_are_as_small_as_vmapped_ones(name):
    q, _ = given()
    across = {"concatenate": lambda a, b, q: jnp.concatenate([*a, *b, q], -1), "roll": lambda a, b, q: jnp.roll(b[0], 1, -1) + b[0]}
    size, flops = compiled_shape(lambda q: across[name](*query(q), q), q)
    assert size <= LARGEST
    assert flops <= 1.6 * baseline("value")


@pytest.mark.parametrize("joints", [10, 16])
def test_long_paths_are_cut(joints):
    tree = arm(joints)
    tip = str(joints - 1)
    q = jnp.asarray(np.random.default_rng(1).normal(size=(3, BATCH, joints)))

    def loss(q):
        return weighted(tree.motion(tree.state(q=q[0], qd=q[1], qdd=q[2]), of=tip, relative_to="world"))

    size, flops = compiled_shape(jax.grad(lambda q: loss(q) ** 2), q)
    assert size <= LARGEST
    assert flops <= 2200 * joints * BATCH  # linear in the path
