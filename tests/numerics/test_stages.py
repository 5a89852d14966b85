"""Stages: parts of a CPU program that stay apart, in derivatives and loops too; other platforms have none."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.numerics.stages import by_platform, stage, staged
from tests.lowered import calls_within_stages, stages


def kept(x):
    return stage(lambda x: jnp.tanh(x) * x)(x) + 1.0


def test_a_stage_is_a_call_on_cpu_only():
    x = jnp.ones(4)
    assert stages(kept, x) == 1
    for platform in ("cuda", "rocm", "tpu"):
        assert stages(kept, x, platforms=(platform,)) == 0
    assert stages(kept, x, platforms=("cpu", "cuda")) == 1  # one program for both: it is in the branch for CPUs


def test_values_and_derivatives_of_every_order():
    x = jnp.linspace(-1.0, 1.0, 5)
    plain = lambda x: jnp.tanh(x) * x + 1.0
    grad = lambda f: jax.grad(lambda x: jnp.sum(f(x)))
    for a, b in ((kept, plain), (grad(kept), grad(plain)), (grad(grad(kept)), grad(grad(plain)))):
        np.testing.assert_allclose(jax.jit(a)(x), b(x), rtol=1e-6)
        np.testing.assert_allclose(jax.jit(jax.vmap(a))(x[:, None])[:, 0], b(x), rtol=1e-6)
    assert stages(grad(kept), x) >= 1
    looped = lambda x: jax.lax.scan(lambda c, _: (kept(c), None), x, None, length=3)[0]
    assert stages(looped, x) == 1
    np.testing.assert_allclose(jax.jit(looped)(x), plain(plain(plain(x))), rtol=1e-6)


def test_compiled_programs_keep_it_apart():
    text = jax.jit(lambda x: jnp.cumsum(kept(x)) * kept(x)[0]).lower(jnp.ones(64)).compile().as_text()
    assert "call(" in text  # it was not inlined


def test_numbers_known_while_tracing_stay_known():
    def program(x):
        a, (b, c) = staged(lambda: (x * 2, (0.0, x + 1)))
        assert b == 0.0
        return a + c

    assert np.array_equal(jax.jit(program)(jnp.ones(2)), [4.0, 4.0])


def test_the_platform_is_told_apart_once():
    seen = []

    def inner(x):
        return by_platform(x, cpu=lambda x: seen.append("cpu") or x, default=lambda x: seen.append("default") or x)

    def program(x):
        return by_platform(x, cpu=inner, default=inner)

    jax.jit(program).trace(jnp.ones(2)).lower(lowering_platforms=("cpu", "cuda"))
    assert sorted(seen) == ["cpu", "default"]


def arm():
    rng, b = np.random.default_rng(0), jf.TreeBuilder()
    for i in range(4):
        placement = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))
        b.add(f"{i}", parent=f"{i - 1}" if i else "world", edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=placement))
    b.add("load", parent="3", edge=jf.edges.Attachable())
    b.add("craft", parent="world", edge=jf.edges.Prescribed())
    return b.build()


def total(value):
    return sum(jnp.sum(x * x) for x in jax.tree.leaves(value))


@functools.cache
def queries():
    tree, tables = arm(), jf.spice.example_tables()
    b = jf.TreeBuilder(root="emb")
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("itrf93", parent="earth", edge=tables["itrf93"])
    sky = b.build()
    robot = tree.extract("world")
    start = jf.Epoch.from_tdb("2026-02-01")
    held = lambda q: tree.state(q=q, qd=q, qdd=q)
    return {
        "pose": lambda q: tree.transform(held(q), of="3", relative_to="world"),
        "motion": lambda q: tree.motion(held(q), of="3", relative_to="craft"),
        "all frames": lambda q: tree.world_motions(held(q)),
        "attached": lambda q: tree.motion(held(q), of="load", relative_to="craft"),
        "jacobian": lambda q: tree.jacobian(held(q), of="3", relative_to="world"),
        "tables": lambda q: sky.motion(sky.state(time=start + q[..., 0]), of="itrf93", relative_to="emb"),
        "robot": lambda q: robot.world_transforms(robot.state(q=q)),
    }


@pytest.mark.float64
@pytest.mark.parametrize("name", ["pose", "motion", "all frames", "attached", "jacobian", "tables", "robot"])
def test_nothing_is_called_from_within_a_stage(name, dtype):
    # Such a call is compiled by itself: its loops would run once for each number that the stage takes from it.
    query = queries()[name]
    q = jnp.ones((3, 4), dtype)
    for program in (query, jax.vmap(jax.grad(lambda q: total(query(q))))):
        assert calls_within_stages(program, q) == []
