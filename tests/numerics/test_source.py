"""Sources: structures of components as functions of whole arrays, of which only those that are read count."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics.columns import column
from jaxframes.numerics.components import V3
from jaxframes.numerics.source import source_of


def made_of(x, y, z):
    """Take two columns of the first array, one of the second, and a number; the third is not read."""
    return V3(column(x, 0), column(x, 1) * column(y, 0), 2.0), {"still": column(y, 1)}


def traced(function):
    """Run a check on arrays that are being traced: only these are a source's arrays."""
    x, y, z = jnp.arange(6.0).reshape(2, 3), jnp.arange(4.0).reshape(2, 2), jnp.ones(5)
    jax.make_jaxpr(function)(x, y, z)
    return x, y, z


def test_only_arrays_that_are_read_count():
    def check(x, y, z):
        source = source_of(made_of, x, y, z)
        assert [a.shape for a in source.arrays] == [(2, 3), (2, 2)]
        return source(*source.arrays)[0].x

    traced(check)


def test_the_structure_and_its_known_numbers():
    def check(x, y, z):
        source = source_of(made_of, x, y, z)
        vector, rest = source(*source.arrays)
        assert isinstance(vector, V3)
        assert vector.z == 2.0
        outline, _ = source.outline
        assert outline.z == 2.0
        assert np.isnan([outline.x, outline.y]).all()
        return vector.x, vector.y, rest["still"]

    x, y, z = traced(check)
    values = jax.jit(check)(x, y, z)
    for mine, theirs in zip(values, (x[:, 0], x[:, 1] * y[:, 0], y[:, 1]), strict=True):
        assert np.array_equal(mine, theirs)


def test_changes_are_known_zeros_where_nothing_moves():
    def check(x, y, z):
        source = source_of(made_of, x, y, z)
        vector, rest = source.changes(source.arrays, (jnp.ones_like(x), None))
        assert vector.z == 0.0
        assert rest["still"] == 0.0
        none, _ = source.changes(source.arrays, (None, None))
        assert (none.x, none.y, none.z) == (0.0, 0.0, 0.0)
        return vector.x, vector.y

    x, y, z = traced(check)
    dx, dy = jax.jit(check)(x, y, z)
    assert np.array_equal(dx, [1.0, 1.0])
    assert np.array_equal(dy, y[:, 0])


def test_what_the_function_computes_and_throws_away_is_not_read():
    def wasteful(x, y):
        column(y, 0) * 3.0
        return (column(x, 0),)

    def check(x, y, z):
        source = source_of(wasteful, x, y)
        assert len(source.arrays) == 1
        return source(*source.arrays)[0]

    traced(check)
