"""Positions in two parts: the lowest Chebyshev terms in double-single arithmetic, so that float32 keeps what one number cannot hold."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
from jax import lax

from jaxframes.numerics import two_part
from jaxframes.numerics.two_part import Pair, two_sum
from jaxframes.staging.columns import assemble
from jaxframes.staging.sharding import rows_at
from jaxframes.staging.stages import stage
from jaxframes.tables import evaluate
from jaxframes.tables.evaluate import Run
from jaxframes.tables.records import LOW_TERMS, RecordTable


@jax.jit
def position(run: Run, hi: Any, lo: Any) -> Pair:
    """Return a table's value at epochs (hi, lo) as arrays hi and lo [..., 3]; NaN outside the coverage."""
    hi, lo = evaluate.recast(hi, lo, run.record_tables[0].rows.dtype)

    def work(run: Run, hi: jax.Array, lo: jax.Array) -> Pair:
        dt = evaluate.since_reference(run, hi, lo)
        totals = [
            functools.reduce(two_part.add, parts) for parts in zip(*(_values(records, *dt) for records in run.record_tables), strict=True)
        ]
        high, low = (assemble(tuple(t[k] for t in totals)) for k in (0, 1))
        return high, low

    high, low = stage(work)(*lax.stop_gradient((run, hi, lo)))
    # The plain value carries the derivative and the NaN outside; its own number cancels.
    (plain,) = evaluate.evaluate(run, hi, lo, 0, vectors=True)
    return high + (plain - lax.stop_gradient(plain)), low


def _values(records: RecordTable, dt_hi: jax.Array, dt_lo: jax.Array) -> list[Pair]:
    index = records.serving(dt_hi, dt_lo)
    row = jnp.moveaxis(rows_at(records.rows, index), -1, 0)
    terms, count = records.terms, min(LOW_TERMS, records.terms)
    zero = jnp.zeros_like(dt_hi)
    low = None if records.low is None else jnp.moveaxis(rows_at(records.low, index), -1, 0)
    past = two_part.add(two_sum(dt_hi, -row[-3]), two_sum(dt_lo, -row[-2]))
    s = two_part.divide(past, (row[-1], zero if low is None else low[-1]))
    twice = (s[0] * 2, s[1] * 2)
    out = []
    for axis in range(3):
        column = [row[k * records.series + axis] for k in range(terms)]
        last, before = zero, zero
        for k in range(terms - 1, count - 1, -1):
            last, before = column[k] + (twice[0] * last - before), last
        wide, wider = (last, zero), (before, zero)
        for k in range(count - 1, -1, -1):
            c = (column[k], zero if low is None else low[k * records.series + axis])
            factor = s if k == 0 else twice
            wide, wider = two_part.add(c, two_part.add(two_part.multiply(factor, wide), (-wider[0], -wider[1]))), wide
        out.append(wide)
    return out
