"""Sources: structures of components as functions of whole arrays; what is known of them without these, and how they change."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.numerics.components import V3
from jaxframes.staging.columns import column
from jaxframes.staging.traced_inputs import Known, Operands, changes, outline


@dataclass(frozen=True)
class Made:
    """Two columns of the first array, one of the second, and numbers; the third is not read."""

    scale: float = 2.0

    def __call__(self, x, y, z):
        return V3(column(x, 0), column(x, 1) * column(y, 0), self.scale), {"still": column(y, 1)}


ARRAYS = jnp.arange(6.0).reshape(2, 3), jnp.arange(4.0).reshape(2, 2), jnp.ones(5)


def test_the_structure_and_its_known_numbers():
    vector, rest = outline(Made(), ARRAYS)
    assert isinstance(vector, V3)
    assert vector.z == 2.0
    assert outline(Made(3.0), ARRAYS)[0].z == 3.0
    assert np.isnan([vector.x, vector.y, rest["still"]]).all()


def test_changes_are_known_zeros_where_nothing_moves():
    x, y, _ = ARRAYS
    vector, rest = changes(Made(), ARRAYS, (jnp.ones_like(x), None, None))
    assert vector.z == 0.0
    assert rest["still"] == 0.0
    assert np.array_equal(vector.x, [1.0, 1.0])
    assert np.array_equal(vector.y, y[:, 0])
    none, _ = changes(Made(), ARRAYS, (None, None, None))
    assert (none.x, none.y, none.z) == (0.0, 0.0, 0.0)


def test_known_numbers_fold_into_the_structure_and_arrays_are_taken_once():
    def check(x):
        operands = Operands()
        first = operands.parts({"axis": np.asarray([0.0, 0.0, 1.0], x.dtype), "place": x})
        second = operands.parts((x, np.ones((2, 3))))
        assert first.leaves == (Known((0.0, 0.0, 1.0), str(x.dtype)), 0)
        assert second.leaves == (0, 1)
        assert [a.shape for a in operands.arrays] == [(3,), (2, 3)]
        back = first.of(operands.arrays)
        assert isinstance(back["axis"], np.ndarray)
        assert back["place"] is x
        assert first.places == {0}
        assert first.moved({0: 4}).leaves[1] == 4
        assert operands.components((0.5, x)).of(operands.arrays) == (0.5, x)
        return x

    jax.make_jaxpr(check)(jnp.ones(3))
