"""Columns put together and taken out: values, shapes, batching, and that each is the other's transpose."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes.staging.columns import column, join_columns


@pytest.mark.parametrize("shape", [(), (1,), (2, 3)])
@pytest.mark.parametrize("count", [1, 2, 7])
def test_values(shape, count, rng, dtype):
    parts = [jnp.asarray(rng.normal(size=shape), dtype) for _ in range(count)]
    for how in (join_columns, jax.jit(join_columns)):
        whole = how(parts)
        assert whole.dtype == dtype
        assert np.array_equal(whole, np.stack(parts, -1))
    for i, part in enumerate(parts):
        assert np.array_equal(column(whole, i), part)
        assert np.array_equal(jax.jit(column, static_argnums=1)(whole, i), part)


def test_batching_where_some_have_the_axis(rng, dtype):
    a, b = jnp.asarray(rng.normal(size=(4, 3)), dtype), jnp.asarray(rng.normal(size=3), dtype)
    made = jax.vmap(lambda x, y: join_columns([x, y]), in_axes=(0, None))(a, b)
    assert np.array_equal(made, np.stack([a, np.broadcast_to(b, (4, 3))], -1))
    across = jax.vmap(lambda x: join_columns([x, b[:1].repeat(4)]), in_axes=1, out_axes=0)(a)
    assert np.array_equal(across[2, :, 0], a[:, 2])
    whole = jnp.asarray(rng.normal(size=(5, 2, 3)), dtype)
    assert np.array_equal(jax.vmap(lambda x: column(x, 1), in_axes=1)(whole), np.swapaxes(whole[..., 1], 0, 1))


def test_derivatives_of_every_order_are_the_other_way(rng, dtype):
    x = jnp.asarray(rng.normal(size=(2, 3)), dtype)
    weights = jnp.asarray(rng.normal(size=(2, 3)), dtype)

    def back(x):
        return jnp.sum(join_columns([column(x, i) for i in (2, 0, 1)]) ** 3 * weights)

    def plain(x):
        return jnp.sum(x[:, jnp.array([2, 0, 1])] ** 3 * weights)

    same = lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12 if dtype == np.float64 else 1e-5, atol=1e-12)
    same(jax.grad(back)(x), jax.grad(plain)(x))
    same(jax.hessian(back)(x), jax.hessian(plain)(x))
    same(jax.jvp(back, (x,), (weights,))[1], jax.jvp(plain, (x,), (weights,))[1])
    third = lambda f: jax.grad(lambda x: jnp.sum(jax.grad(lambda y: jnp.sum(jax.grad(f)(y) ** 2))(x)))
    same(third(back)(x), third(plain)(x))


def test_derivatives_are_neither_pads_nor_sums():
    program = lambda x: jnp.sum(join_columns([column(x, 0) * column(x, 1), column(x, 2)]) ** 2)
    text = jax.jit(jax.grad(program)).lower(jnp.ones((8, 3))).as_text()
    for word in ("stablehlo.pad", "stablehlo.concatenate", "stablehlo.scatter"):
        assert word not in text
    assert text.count("stablehlo.reduce(") == 0
