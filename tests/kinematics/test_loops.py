"""Derivatives through loops: queries, tables and value types inside scan, fori_loop and map, differentiated once, twice and three times."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf

pytestmark = pytest.mark.float64

START = jf.Epoch.from_tdb("2026-03-01")


def robot():
    rng, b = np.random.default_rng(4), jf.TreeBuilder(root="base")
    for i in range(2):
        placement = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))
        b.add(f"{i}", parent=f"{i - 1}" if i else "base", edge=jf.edges.Revolute(axis=rng.normal(size=3), placement=placement))
    return b.build()


TREE, TABLES = robot(), jf.spice.example_tables()


def joints(x):
    return jnp.stack([x, x * x])


def of_a_pose(x):
    pose = TREE.transform(TREE.state(q=joints(x)), of="1", relative_to="base")
    return jnp.sum(pose.translation * pose.rotation.wxyz[..., 1:])


def of_a_motion(x):
    motion = TREE.motion(TREE.state(q=joints(x), qd=2 * joints(x), qdd=joints(x) + 1), of="1", relative_to="base")
    return jnp.sum(motion.transform.translation * motion.velocity.linear) + jnp.sum(motion.acceleration.linear)


def of_all_frames(x):
    return jnp.sum(TREE.world_transforms(TREE.state(q=joints(x))).translation ** 2 * jnp.arange(1.0, 4.0)[:, None])


def of_a_jacobian(x):
    return jnp.sum(jnp.sin(TREE.jacobian(TREE.state(q=joints(x)), of="1", relative_to="base")))


def of_the_moon(x):
    position, velocity, _ = TABLES["moon"].evaluate(START + x * 86400.0)
    return jnp.sum(position * jnp.arange(1.0, 4.0)) / 1e8 + jnp.sum(velocity) / 1e3


def of_the_earth(x):
    """The Earth's orientation over some hours."""
    wxyz, angular, _ = TABLES["itrf93"].evaluate(START + x * 3600.0)
    return jnp.sum(wxyz * jnp.arange(1.0, 5.0)) + jnp.sum(angular * 1e4)


def of_rotations(x):
    turn = jf.Rotation.exp(jnp.stack([x, 2 * x, x * x])) @ jf.Rotation.from_rpy(x, 0.3, x * x)
    return jnp.sum(turn.log() * jnp.arange(1.0, 4.0)) + turn.angle()


FUNCTIONS = {
    "pose": of_a_pose,
    "motion": of_a_motion,
    "all frames": of_all_frames,
    "jacobian": of_a_jacobian,
    "moon": of_the_moon,
    "earth": of_the_earth,
    "rotations": of_rotations,
}


def scanned(function, x):
    return jax.lax.scan(lambda c, i: (c + function(x + 0.01 * i), None), 0.0, jnp.arange(3.0))[0]


def carried(function, x):
    return jax.lax.fori_loop(0, 2, lambda i, c: c + 0.1 * jnp.sin(function(c)), x)


def mapped(function, x):
    return jnp.sum(jax.lax.map(function, x + 0.01 * jnp.arange(3.0)))


@functools.cache
def without_loops(name):
    """A function with its first and second derivative."""
    function = FUNCTIONS[name]
    return jax.jit(lambda x: (function(x), jax.grad(function)(x), jax.jacfwd(jax.grad(function))(x)))


def wanted(name, way, x):
    """The first and second derivative of a loop over a function, by the chain rule."""
    if way is not carried:
        sums = [without_loops(name)(x + 0.01 * i) for i in range(3)]
        return sum(s[1] for s in sums), sum(s[2] for s in sums)

    def step(x):
        value, first, second = without_loops(name)(x)
        bend = jnp.cos(value) * second - jnp.sin(value) * first**2
        return x + 0.1 * jnp.sin(value), 1 + 0.1 * jnp.cos(value) * first, 0.1 * bend

    once = step(x)
    twice = step(once[0])
    return twice[1] * once[1], twice[2] * once[1] ** 2 + twice[1] * once[2]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_second_derivatives_are_those_of_the_function(name):
    found, h = without_loops(name), 1e-4
    ends = [found(0.4 + s * h) for s in (1, -1)]
    for order in (1, 2):
        difference = (ends[0][order - 1] - ends[1][order - 1]) / (2 * h)
        assert np.isclose(found(0.4)[order], difference, rtol=1e-5), name


BRIEF = ("pose", "all frames", "moon")


@pytest.mark.parametrize(
    ("name", "way"),
    [
        *(pytest.param(name, scanned, marks=() if name in BRIEF else pytest.mark.slow) for name in FUNCTIONS),
        *((name, way) for name in ("pose", "moon") for way in (carried, mapped)),
    ],
)
def test_derivatives_through_loops(name, way):
    looped = functools.partial(way, FUNCTIONS[name])
    over = jax.jacfwd if way is carried else jax.grad  # reverse over reverse; forward over reverse
    found = jax.jit(lambda x: (jax.grad(looped)(x), over(jax.grad(looped))(x)))(0.4)
    for mine, theirs in zip(found, wanted(name, way, 0.4), strict=True):
        assert np.isclose(mine, theirs, rtol=1e-9), (float(mine), float(theirs))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pose", "moon", "earth"])
def test_third_derivatives_through_a_scan(name):
    looped = functools.partial(scanned, FUNCTIONS[name])
    third, h = jax.jit(jax.grad(jax.grad(jax.grad(looped))))(0.4), 1e-4
    ends = [wanted(name, scanned, 0.4 + s * h)[1] for s in (1, -1)]
    assert np.isclose(third, (ends[0] - ends[1]) / (2 * h), rtol=1e-5)


def test_scans_of_vmapped_queries(rng):
    """A batch in a loop: derivatives by the batch agree with those of each sample."""
    q = jnp.asarray(rng.normal(size=(3, 2)))

    def loss(q):
        def step(c, _):
            places = jax.vmap(lambda q: TREE.transform(TREE.state(q=q), of="1", relative_to="base").translation)(c)
            return c + 0.1 * places[..., :2], None

        return jnp.sum(jnp.sin(jax.lax.scan(step, q, None, length=2)[0]))

    hessian = jax.jit(jax.hessian(loss))
    whole = hessian(q)
    for i in range(3):
        np.testing.assert_allclose(whole[i, :, i], hessian(q[i : i + 1])[0, :, 0], atol=1e-12)
        np.testing.assert_allclose(whole[i, :, (i + 1) % 3], 0.0, atol=1e-15)
