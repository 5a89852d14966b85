"""Stages: parts of a CPU program that stay apart, in derivatives and loops too; other platforms have none."""

import functools
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.staging.stages import stage, staged
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


PROBE = """
import jax, jax.numpy as jnp
traced = []
def before(x):
    traced.append(1)
    return x + 1
compiled = jax.jit(before)
compiled(jnp.ones(2))
import jaxframes as jf
compiled(jnp.ones(2))
assert len(traced) == 1, "importing the package made a program trace again"
jf.Rotation.exp(jnp.ones(3))
compiled(jnp.ones(2))
assert len(traced) == 1, "using the package made a program trace again"
"""


def test_programs_compiled_before_the_import_stay():
    subprocess.run([sys.executable, "-c", PROBE], check=True)


def test_what_a_stage_holds_is_an_input():
    """Arrays that a function holds, traced or not, are no part of what JAX keeps of a stage."""
    table = jnp.arange(6.0).reshape(2, 3)

    def program(x, y):
        return stage(lambda x: x * y + table[0])(x)

    (equation,) = [e for e in jax.make_jaxpr(program)(jnp.ones(3), jnp.ones(3)).eqns if e.primitive.name == "stage"]
    kept = equation.params["program"]
    assert len(kept.kinds) == 3  # y, the row of the table, and x
    assert jax.tree.leaves(kept) == [kept]
    with jax.checking_leaks():
        assert np.array_equal(jax.jit(program)(jnp.ones(3), jnp.ones(3)), [1.0, 2.0, 3.0])
        jax.jit(jax.grad(lambda x: jnp.sum(program(x, x))))(jnp.ones(3))


def test_equal_programs_are_equal():
    def make(scale):
        return jax.make_jaxpr(lambda x: stage(lambda x: jnp.tanh(x) * scale)(x))(jnp.ones(3)).eqns[0].params["program"]

    assert make(2.0) == make(2.0)
    assert hash(make(2.0)) == hash(make(2.0))
    assert make(2.0) != make(3.0)


def test_a_transpose_reads_what_is_asked_of_it(rng):
    """Of several inputs and results some are linear, some are asked for; the others keep out of it."""
    function = stage(lambda x, y: (x * y, x, jnp.sum(y)))
    x, y = jnp.asarray(rng.normal(size=3)), jnp.asarray(rng.normal(size=3))
    back = jax.vjp(lambda x, y: function(x, y)[0], x, y)[1]
    assert np.array_equal(back(jnp.ones(3))[0], y)
    (only,) = jax.linear_transpose(lambda x: function(x, y)[1], x)(jnp.ones(3))
    assert np.array_equal(only, np.ones(3))
    (nothing,) = jax.vjp(lambda x: function(x, y)[2], x)[1](jnp.ones(()))
    assert np.array_equal(nothing, np.zeros(3))


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
