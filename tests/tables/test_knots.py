"""Knots: the instants at which tables' polynomials meet, as epochs."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxframes.tables.info import Info
from jaxframes.tables.records import to_record_table
from jaxframes.tables.translation import TranslationTable
from jaxframes.time.epoch import Epoch

REFERENCE = 825552000.0


def table(uneven):
    ends = np.array([10.0, 30.0, 40.0]) if uneven else np.array([10.0, 20.0, 30.0, 40.0])
    starts = np.r_[0.0, ends[:-1]]
    rows = np.concatenate([np.ones((len(ends), 6)), np.stack([(starts + ends) / 2, 0 * ends, (ends - starts) / 2], 1)], 1)
    arrays = {"rows": rows, "grid": np.array([0.0, 0.0, 10.0])}
    if uneven:
        arrays |= {"first": np.array([0.0, 1.0, 1.0, 2.0]), "ends": np.stack([[10.0, 30.0, np.inf], np.zeros(3)], 1)}
    info = Info("made", "body", 1, "centre", 2, "J2000", "0", "40", "0", (), (), "none")
    span = jnp.asarray([0.0, 0.0, 35.0, 0.0])
    return TranslationTable((to_record_table(arrays, 3, 1 if uneven else 0),), jnp.asarray([REFERENCE, 0.0]), span, info)


@pytest.mark.parametrize(("uneven", "wanted"), [(False, [0.0, 10.0, 20.0, 30.0, 35.0]), (True, [0.0, 10.0, 30.0, 35.0])])
def test_knots_are_where_records_meet(uneven, wanted):
    made = table(uneven)
    past = made.knots - Epoch.from_et(REFERENCE)
    np.testing.assert_array_equal(past, wanted)
    before, after = (made.record_tables[0].serving(past + step, 0 * past) for step in (-1.0, 1.0))
    np.testing.assert_array_equal((after - before)[1:-1], 1)
