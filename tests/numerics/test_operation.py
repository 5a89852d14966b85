"""Operations with a derivative and a batching of their own: the rules hold under every transformation, also within loops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes.numerics.operation import anywhere, changes_of, elementwise, run


class Twice:
    """x * y and x, whose derivative is said to be that of 2 x y and x: so that it shows which rule was used."""

    def compute(self, x, y):
        return x * y, x

    def results(self, x, y):
        return [jax.ShapeDtypeStruct(jnp.broadcast_shapes(x.shape, y.shape), x.dtype), jax.ShapeDtypeStruct(x.shape, x.dtype)]

    def derivative(self, primals, tangents):
        first = changes_of(lambda x, y: 2 * x * y, primals, tangents)
        return run(self, *primals), (first, tangents[0])

    def mapped(self, count, axes, *arrays):
        return elementwise(self)(count, axes, *arrays)


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


def test_a_branch_on_anywhere_stays_one_under_vmap():
    def program(x):
        return jax.lax.cond(anywhere(x > 1), lambda x: -x, lambda x: x, x)

    x = jnp.asarray([0.0, 2.0, 0.5])
    assert np.array_equal(jax.vmap(program)(x), -x)  # told for the whole batch
    assert np.array_equal(jax.vmap(program)(x - 2), x - 2)
    assert "stablehlo.case" in jax.jit(jax.vmap(program)).lower(x).as_text()
    assert bool(anywhere(jnp.asarray([False, True])))
    assert not bool(anywhere(jnp.zeros((0,), bool)))
