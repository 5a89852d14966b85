"""The border between arrays and components: shapes, dtypes, errors, derivatives without pads, and one compilation."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes.errors import ShapeError
from jaxframes.numerics.components import V3, Quat, cross, dot, rotate
from jaxframes.numerics.lift import lift
from jaxframes.staging.columns import assemble, take_apart

turn = lift(Quat, V3, out=V3)(rotate)


def test_leading_axes_broadcast(dtype):
    for q_shape, v_shape, out in (((), (), ()), ((5,), (), (5,)), ((3, 1), (2,), (3, 2)), ((2,), (4, 1), (4, 2))):
        q, v = jnp.ones((*q_shape, 4)), jnp.ones((*v_shape, 3))
        result = turn(q, v)
        assert result.shape == (*out, 3)
        assert result.dtype == dtype
    with pytest.raises(ShapeError, match=r"rotate: batch shapes \(2,\) and \(3,\) do not broadcast"):
        turn(jnp.ones((2, 4)), jnp.ones((3, 3)))


@pytest.mark.parametrize("shape", [(), (3,), (1, 5)])
def test_wrong_last_axis(shape):
    with pytest.raises(ShapeError, match=r"rotate: an array of shape \[..., 4\]"):
        turn(jnp.ones(shape), jnp.ones(3))


def test_take_apart_and_assemble_are_inverse():
    x = jnp.arange(12.0).reshape(2, 2, 3)
    assert np.array_equal(assemble(take_apart(x)), x)
    assert np.array_equal(assemble((1.0, 0.0, 2.0), (2,)), np.array([[1, 0, 2]] * 2))
    gradient = jax.grad(lambda y: jnp.sum(assemble(take_apart(y)) * x))(x)
    assert np.array_equal(gradient, x)
    text = jax.jit(jax.grad(lambda y: take_apart(y)[1].sum())).lower(x).as_text()
    assert "stablehlo.pad" not in text
    assert "stablehlo.concatenate" not in text


def test_known_numbers_disappear_from_the_program():
    def program(angle):
        axis = V3(0.0, 0.0, 1.0)
        return cross(axis, V3(angle, 0.0, 0.0)).y, dot(axis, V3(angle, angle, 0.0))

    assert program(jnp.ones(()))[1] == 0.0
    text = jax.jit(lambda a: program(a)[0]).lower(1.0).as_text()
    assert "multiply" not in text


def test_one_trace_for_one_set_of_shapes():
    traces = []

    def counted(v):
        traces.append(1)
        return v * 2.0

    double = lift(V3, out=V3)(counted)
    double(np.ones(3))
    first = len(traces)
    for _ in range(3):
        double(np.ones(3))
        double([1.0, 2.0, 3.0])
        double(jnp.ones(3))
    assert len(traces) == first
