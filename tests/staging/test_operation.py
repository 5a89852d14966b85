"""Operations with a derivative and a batching of their own: the rules hold under every transformation, also within loops."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes.staging.operation import Operation, changes_of, run


@dataclass(frozen=True)
class Twice(Operation):
    """x * y and x, whose derivative is said to be that of 2 x y and x: so that it shows which rule was used."""

    def compute(self, x, y):
        return x * y, x

    def results(self, x, y):
        return [jax.ShapeDtypeStruct(jnp.broadcast_shapes(x.shape, y.shape), x.dtype), jax.ShapeDtypeStruct(x.shape, x.dtype)]

    def derivative(self, primals, tangents):
        first = changes_of(lambda x, y: 2 * x * y, primals, tangents)
        return run(self, *primals), (first, tangents[0])


def product(x, y):
    return run(Twice(), x, y)[0]


def test_values(dtype):
    x, y = jnp.asarray([1.0, 2.0], dtype), jnp.asarray([3.0, 5.0], dtype)
    for how in (product, jax.jit(product)):
        assert np.array_equal(how(x, y), [3.0, 10.0])
    assert np.array_equal(run(Twice(), x, y)[1], x)


def test_derivatives_are_those_that_the_operation_states():
    assert jax.grad(product)(3.0, 5.0) == 10.0
    assert jax.jvp(product, (3.0, 5.0), (1.0, 1.0))[1] == 16.0
    assert jax.grad(jax.grad(product), 1)(3.0, 5.0) == 2.0
    # What does not change has no derivative: only y moves here.
    assert jax.jvp(lambda y: run(Twice(), jnp.asarray(3.0), y), (5.0,), (1.0,))[1][1] == 0.0


@pytest.mark.parametrize("loop", ["scan", "fori_loop", "map"])
def test_derivatives_within_loops_are_the_same(loop):
    def within(x):
        step = lambda c: product(c, x)
        if loop == "scan":
            return jax.lax.scan(lambda c, _: (step(c), None), x, None, length=2)[0]
        if loop == "fori_loop":
            return jax.lax.fori_loop(0, 2, lambda _, c: step(c), x)
        return jax.lax.map(lambda c: product(product(c, x), x), x[None])[0]

    plain = lambda x: product(product(x, x), x)
    for way in (jax.grad, lambda f: jax.grad(jax.grad(f)), lambda f: jax.jacfwd(jax.grad(f)), lambda f: jax.grad(jax.jacfwd(f))):
        if loop == "fori_loop" and way is not jax.grad:
            continue
        assert jax.jit(way(within))(jnp.asarray(1.5)) == way(plain)(jnp.asarray(1.5))


def test_batching_of_some_arguments_and_in_layers(rng):
    x, y = jnp.asarray(rng.normal(size=(3, 2))), jnp.asarray(rng.normal(size=2))
    assert np.array_equal(jax.vmap(product, (0, None))(x, y), np.asarray(x) * np.asarray(y))
    assert np.array_equal(jax.vmap(product, (1, 0), 1)(x, y), np.asarray(x) * np.asarray(y))
    layered = jax.vmap(jax.vmap(product, (None, 0)), (0, None))(x[:, 0], y)
    assert np.array_equal(layered, np.outer(x[:, 0], y))
    gradients = jax.vmap(jax.grad(product), (0, None))(x[:, 0], y[0])
    assert np.array_equal(gradients, np.full(3, 2 * y[0]))
    inside = jax.grad(lambda x: jnp.sum(jax.vmap(product, (0, None))(x, y[0])))(x[:, 0])
    assert np.array_equal(inside, gradients)


@jax.custom_jvp
def inner(x):
    return x * x


@jax.custom_jvp
def outer(x):
    return x * x


@inner.defjvp
def _inner_jvp(primals, tangents):
    return inner(primals[0]), 5 * primals[0] * tangents[0]  # not the derivative of the arithmetic, to show which one is used


@outer.defjvp
def _outer_jvp(primals, tangents):
    return outer(primals[0]), inner(primals[0]) * tangents[0]


@jax.custom_batching.custom_vmap
def squared(x):
    return x * x


@squared.def_vmap
def _squared_vmap(count, batched, x):
    return x * x, True


def once(function):
    return lambda x: jax.lax.scan(lambda c, _: (function(c), None), x, None, length=1)[0]


def test_custom_rules_of_jax_are_lost_in_loops():
    """Why operations are primitives; where this fails, the rules that JAX offers may do by now."""
    with pytest.raises(ValueError, match="Linearization failed"):
        jax.grad(once(squared))(1.5)
    assert jax.grad(jax.grad(outer))(1.5) == 7.5
    looped = jax.jit(jax.grad(jax.grad(once(outer))))(1.5)
    assert looped == (7.5 if jax.__version_info__ >= (0, 11) else 3.0)  # 2 x is the derivative of the arithmetic


@dataclass(frozen=True)
class OnCpu(Operation):
    """Minus one on CPUs, plus one elsewhere."""

    def compute(self, x):
        return (x + 1,)

    def compute_on_cpu(self, x):
        return (x - 1,)

    def results(self, x):
        return [jax.ShapeDtypeStruct(x.shape, x.dtype)]


def test_what_serves_cpus_is_chosen_where_a_program_is_lowered():
    program = lambda x: run(OnCpu(), x)[0]
    x = jnp.ones(2)
    assert np.array_equal(jax.jit(program)(x), [0.0, 0.0])
    assert np.array_equal(program(x), [0.0, 0.0])
    assert np.array_equal(jax.jit(jax.vmap(program))(x), [0.0, 0.0])
    texts = [jax.jit(program).trace(x).lower(lowering_platforms=(platform,)).as_text() for platform in ("cpu", "cuda")]
    assert ["stablehlo.subtract" in text for text in texts] == [True, False]


def test_operations_hold_no_tracers_and_leave_none_behind():
    with jax.checking_leaks():
        jax.jit(jax.grad(product))(3.0, 5.0)
        jax.jit(jax.vmap(product))(jnp.ones(2), jnp.ones(2))
