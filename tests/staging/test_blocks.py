"""Work in blocks is what the work is at once: values, sums, derivatives of either mode and order, mapped, on batches that divide or not."""

from dataclasses import dataclass

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes.staging.blocks import SIZES, Batch, Work, run_work


@dataclass(frozen=True)
class Product(Work):
    """Rows [n, 3] turned by a matrix [3, 3], with sines; and, where asked for, their sum."""

    with_sum: bool = False

    def __call__(self, *arrays):
        rows, matrix = arrays
        out = jnp.sin(rows) @ matrix
        return (out, jnp.sum(out**2, 0)) if self.with_sum else (out,)


def plain(rows, matrix):
    return (jnp.sin(rows) @ matrix).sum(1)


def blocked(rows, matrix):
    (out,) = run_work(Product(), Batch(len(rows), (True, False), (True,)), rows, matrix)
    return out.sum(1)


@pytest.fixture(params=[SIZES[1] * 2, SIZES[1] + SIZES[0], SIZES[1] + 3, 5], ids=["two blocks", "small blocks", "no divisor", "small"])
def given(request, rng):
    return jnp.asarray(rng.normal(size=(request.param, 3))), jnp.asarray(rng.normal(size=(3, 3)))


@pytest.mark.float64
def test_values_and_derivatives(given):
    rows, matrix = given
    weights = jnp.linspace(0.0, 1.0, len(rows))
    loss = lambda f: lambda rows, matrix: jnp.sum(weights * f(rows, matrix) ** 2)
    close = lambda a, b: chex.assert_trees_all_close(a, b, rtol=1e-11, atol=1e-11)
    close(jax.jit(blocked)(rows, matrix), plain(rows, matrix))
    close(blocked(rows, matrix), plain(rows, matrix))
    close(jax.jit(jax.grad(loss(blocked), (0, 1)))(rows, matrix), jax.grad(loss(plain), (0, 1))(rows, matrix))
    tangents = jnp.cos(rows), matrix * 0.1
    close(jax.jit(lambda: jax.jvp(blocked, given, tangents))(), jax.jvp(plain, given, tangents))
    twice = lambda f: jax.jit(jax.grad(lambda matrix: jnp.sum(jax.grad(loss(f), 1)(rows, matrix) ** 2)))(matrix)
    close(twice(blocked), twice(plain))


@pytest.mark.float64
def test_sums_over_the_batch(given):
    rows, matrix = given
    work = lambda rows, matrix: run_work(Product(True), Batch(len(rows), (True, False), (True, False)), rows, matrix)[1]
    sums = lambda rows, matrix: jnp.sum((jnp.sin(rows) @ matrix) ** 2, 0)
    chex.assert_trees_all_close(jax.jit(work)(rows, matrix), sums(rows, matrix), rtol=1e-11)
    slope = lambda f: jax.jit(jax.grad(lambda rows, matrix: jnp.sum(f(rows, matrix) ** 2), (0, 1)))(rows, matrix)
    chex.assert_trees_all_close(slope(work), slope(sums), rtol=1e-10, atol=1e-10)


@pytest.mark.float64
def test_a_mapped_axis_becomes_the_batch(given):
    rows, matrix = given
    one = lambda row, matrix: run_work(Product(), None, row[None], matrix)[0].sum()
    loss = lambda matrix: jnp.sum(jax.vmap(one, in_axes=(0, None))(rows, matrix) ** 2)
    exact = lambda matrix: jnp.sum(plain(rows, matrix) ** 2)
    chex.assert_trees_all_close(jax.jit(jax.value_and_grad(loss))(matrix), jax.value_and_grad(exact)(matrix), rtol=1e-11)
    each = jax.jit(jax.vmap(jax.grad(lambda matrix, rows: jnp.sum(blocked(rows, matrix))), in_axes=(0, None)))(
        jnp.stack([matrix, 2 * matrix]), rows
    )
    chex.assert_trees_all_close(each[0], jax.grad(lambda matrix: jnp.sum(plain(rows, matrix)))(matrix), rtol=1e-11)


def test_only_batches_that_divide_are_cut():
    def has_loop(count):
        rows = jax.ShapeDtypeStruct((count, 3), np.float32)
        return "stablehlo.while" in jax.jit(blocked).lower(rows, jax.ShapeDtypeStruct((3, 3), np.float32)).as_text()

    assert has_loop(2 * SIZES[1])
    assert has_loop(SIZES[1] + SIZES[0])
    assert not has_loop(SIZES[1])
    assert not has_loop(SIZES[1] + 3)
