"""Evaluating tables on the device: any batch of epochs to components, in blocks on CPU, with exact time derivatives.

Why this shape. XLA:CPU keeps every step of a recurrence over a large batch in memory; blocks of some hundred epochs stay in cache
(measured: four times faster). One gather takes a record's whole row; the block is then turned over so that each coefficient is
contiguous. Derivatives with respect to time are the further recurrences themselves (``custom_jvp``), so the derivative of a position
is the velocity, exactly, to any order.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.custom_batching import custom_vmap
from jax.custom_derivatives import SymbolicZero

from jaxframes.numerics.boundary import assemble, take_apart
from jaxframes.numerics.eft import two_sum
from jaxframes.spice.chebyshev import series
from jaxframes.spice.legs import Leg

BLOCK = 512
"""Epochs a block on CPU."""

Values: TypeAlias = tuple[jax.Array, ...]
"""Three components of the value, then three of each derivative: 3 (order + 1) arrays of the batch's shape; or, as vectors, order + 1
arrays [..., 3]."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Run:
    """What an evaluation reads.

    Attributes:
        legs: Chebyshev runs whose sum is the table's value.
        reference: ``[2]``: the table's reference epoch in two parts, seconds past J2000 TDB.
        span: ``[4]``: start and stop of the coverage, each in two parts, seconds past the reference.
    """

    legs: tuple[Leg, ...]
    reference: jax.Array
    span: jax.Array


def evaluate(run: Run, hi: Any, lo: Any, order: int, vectors: bool = False) -> Values:
    """Return a table's value and its first ``order`` time derivatives at epochs (hi, lo).

    Args:
        run: The table.
        hi: High parts of the epochs, seconds past J2000 TDB, [...].
        lo: Low parts, broadcast against them.
        order: Highest derivative: 0, 1 or 2; more where gradients are taken.
        vectors: Whether to return arrays [..., 3], put together block by block, and not components.

    Returns:
        3 (order + 1) components [...] or order + 1 arrays [..., 3], that nothing later is fused with. NaN outside the coverage, in
        derivatives too.
        Differentiable in time (exact, any order) and in the coefficients (linear); the records' grid counts as constant.
    """
    dtype = run.legs[0].rows.dtype
    hi, lo = jnp.broadcast_arrays(jnp.asarray(hi, dtype), jnp.asarray(lo, dtype))
    return _differentiable(order, vectors)(run, hi, lo)


def coverage_code(run: Run, hi: jax.Array, lo: jax.Array) -> jax.Array:
    """Return -1 before the coverage, 0 inside and +1 after it (int32 [...]); -1 for an epoch that is NaN."""
    since, until = _margins(run, *_local(run, jnp.asarray(hi), jnp.asarray(lo)))
    return jnp.where(until < 0, 1, jnp.where(since >= 0, 0, -1)).astype(jnp.int32)


@functools.cache
def _differentiable(order: int, vectors: bool) -> Callable[..., Values]:
    """Return the evaluation to an order, with its rule: each derivative's tangent is the next derivative times dt."""
    width = 1 if vectors else 3

    @jax.custom_jvp
    def values(run: Run, hi: jax.Array, lo: jax.Array) -> Values:
        return _batched(order, vectors)(run, hi, lo)

    def rule(primals: tuple[Run, jax.Array, jax.Array], tangents: Any) -> tuple[Values, Values]:
        run, hi, lo = primals
        d_run, d_hi, d_lo = tangents
        further = _differentiable(order + 1, vectors)(run, hi, lo)
        steps = [d for d in (d_hi, d_lo) if not isinstance(d, SymbolicZero)]
        out = further[:-width]
        moved = [jnp.zeros_like(v) for v in out]
        if steps:
            dt: jax.Array = functools.reduce(lambda a, b: a + b, steps)
            moved = [v * (dt[..., None] if vectors else dt) for v in further[width:]]
        if any(not isinstance(leg.rows, SymbolicZero) for leg in d_run.legs):
            moved = [m + v for m, v in zip(moved, _by_coefficients(order, vectors, run, d_run, hi, lo), strict=True)]
        return out, tuple(moved)

    values.defjvp(rule, symbolic_zeros=True)
    return values


def _by_coefficients(order: int, vectors: bool, run: Run, d_run: Run, hi: jax.Array, lo: jax.Array) -> Values:
    """Return the change of the values with the coefficients: the same sums with the coefficients' tangents in their place."""
    tangents = [None if isinstance(leg.rows, SymbolicZero) else leg.rows for leg in d_run.legs]
    values = _components(order, run, hi, lo, tangents)
    return _vectors(values) if vectors else values


@functools.cache
def _batched(order: int, vectors: bool) -> Callable[..., Values]:
    """Return the evaluation to an order, which takes a vmapped axis of epochs as a larger batch and not element by element."""

    @custom_vmap
    def values(run: Run, hi: jax.Array, lo: jax.Array) -> Values:
        return _any_shape(order, vectors, run, hi, lo)

    @values.def_vmap
    def rule(axis_size: int, in_batched: Any, run: Run, hi: jax.Array, lo: jax.Array) -> tuple[Values, tuple[bool, ...]]:
        run_batched, hi_batched, lo_batched = in_batched
        batched = (True,) * ((1 if vectors else 3) * (order + 1))
        if any(jax.tree.leaves(run_batched)):
            axes = jax.tree.map(lambda b: 0 if b else None, (run_batched, hi_batched, lo_batched))
            return jax.vmap(functools.partial(_plain, order, vectors), in_axes=axes, axis_size=axis_size)(run, hi, lo), batched
        hi, lo = (x if b else jnp.broadcast_to(x, (axis_size, *x.shape)) for x, b in ((hi, hi_batched), (lo, lo_batched)))
        return values(run, hi, lo), batched

    return values


def _any_shape(order: int, vectors: bool, run: Run, hi: jax.Array, lo: jax.Array) -> Values:
    """Return the values for epochs of any shape: as one flat batch, in blocks on CPU where it is large."""
    shape = hi.shape
    flat = (run, hi.reshape(-1), lo.reshape(-1))
    if hi.size <= BLOCK:
        values = take_apart(assemble(_components(order, *flat)))
        values = _vectors(values) if vectors else values
    else:
        ways = (functools.partial(way, order, vectors) for way in (_in_blocks, _plain))
        values = lax.platform_dependent(*flat, **dict(zip(("cpu", "default"), ways, strict=True)))
    return tuple(v.reshape(shape + v.shape[1:]) for v in values)


def _plain(order: int, vectors: bool, run: Run, hi: jax.Array, lo: jax.Array) -> Values:
    values = _components(order, run, hi, lo)
    return _vectors(values) if vectors else values


def _vectors(components: Values) -> Values:
    """Return arrays [..., 3] of components, by selects alone: what they are made of, or become, is fenced already."""
    index = lax.broadcasted_iota(jnp.int32, (*components[0].shape, 3), components[0].ndim)
    columns = [c[..., None] for c in components]
    triples = [columns[i : i + 3] for i in range(0, len(columns), 3)]
    return tuple(jnp.where(index == 0, x, jnp.where(index == 1, y, z)) for x, y, z in triples)


def _in_blocks(order: int, vectors: bool, run: Run, hi: jax.Array, lo: jax.Array) -> Values:
    """Return the values of a flat batch, block after block. A loop's results are in memory: nothing is fused across.

    The last block starts early enough to be whole, so nothing is padded, cut or copied.
    """
    count = hi.shape[0]

    def block(i: jax.Array, out: Values) -> Values:
        at = jnp.minimum(i * BLOCK, count - BLOCK)
        values = _components(order, run, lax.dynamic_slice(hi, (at,), (BLOCK,)), lax.dynamic_slice(lo, (at,), (BLOCK,)))
        if not vectors:
            return tuple(lax.dynamic_update_slice_in_dim(o, v, at, 0) for o, v in zip(out, values, strict=True))
        # Column by column: putting vectors together first computes each component three times (measured: 1.3 times the whole).
        return tuple(_with_columns(o, values[3 * k : 3 * k + 3], at) for k, o in enumerate(out))

    empty = jnp.empty((count, 3) if vectors else (count,), hi.dtype)
    return lax.fori_loop(0, -(-count // BLOCK), block, (empty,) * ((1 if vectors else 3) * (order + 1)))


def _with_columns(out: jax.Array, columns: Sequence[jax.Array], at: jax.Array) -> jax.Array:
    for j, column in enumerate(columns):
        out = lax.dynamic_update_slice(out, column[:, None], (at, jnp.asarray(j, at.dtype)))
    return out


def _local(run: Run, hi: jax.Array, lo: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the time past the reference epoch in two parts; nothing is lost."""
    dt_hi, error = two_sum(hi, -run.reference[0])
    return dt_hi, error + (lo - run.reference[1])


def _margins(run: Run, dt_hi: jax.Array, dt_lo: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the time since the start and until the stop; their signs are right to the last bit."""
    start_hi, start_lo, stop_hi, stop_lo = (run.span[i] for i in range(4))
    return (dt_hi - start_hi) + (dt_lo - start_lo), (stop_hi - dt_hi) + (stop_lo - dt_lo)


def _components(order: int, run: Run, hi: jax.Array, lo: jax.Array, tangents: Sequence[jax.Array | None] | None = None) -> Values:
    """Return the values of a batch (any shape) straight away: no blocks, no fence, no rules.

    With tangents of the legs' rows, the values are linear in these: they take the coefficients' place, None counting as zero.
    """
    dt_hi, dt_lo = _local(run, hi, lo)
    since, until = _margins(run, dt_hi, dt_lo)
    # Added to the argument, not selected afterwards: so the NaN is in every derivative too.
    outside = jnp.where((since >= 0) & (until >= 0), np.zeros((), hi.dtype), np.array(np.nan, hi.dtype))
    used = [(leg, leg.rows) for leg in run.legs] if tangents is None else zip(run.legs, tangents, strict=True)
    parts = [_leg(order, leg, rows, dt_hi, dt_lo, outside) for leg, rows in used if rows is not None]
    return tuple(functools.reduce(lambda a, b: a + b, terms) for terms in zip(*parts, strict=True))


def _leg(order: int, leg: Leg, rows: jax.Array, dt_hi: jax.Array, dt_lo: jax.Array, outside: jax.Array) -> list[jax.Array]:
    index = leg.record(dt_hi, dt_lo)
    place = jnp.moveaxis(leg.rows.at[index].get(mode="promise_in_bounds"), -1, 0)
    row = place if rows is leg.rows else jnp.moveaxis(rows.at[index].get(mode="promise_in_bounds"), -1, 0)
    middle_hi, middle_lo, radius = place[-3], place[-2], place[-1]
    s = (((dt_hi - middle_hi) + (dt_lo - middle_lo)) + outside) / radius
    out: list[list[jax.Array]] = [[] for _ in range(order + 1)]
    for axis in range(3):
        if leg.series == 3:
            parts = _scaled(series(_terms(leg, row, axis), s, order), radius)
        else:
            parts = [series(_terms(leg, row, axis), s, 0)[0]]
            if order > 0:
                parts += _scaled(series(_terms(leg, row, axis + 3), s, order - 1), radius)
        for k, part in enumerate(parts):
            out[k].append(part)
    return [component for components in out for component in components]


def _terms(leg: Leg, row: jax.Array, which: int) -> list[jax.Array]:
    return [row[j * leg.series + which] for j in range(leg.terms)]


def _scaled(derivatives: tuple[jax.Array, ...], radius: jax.Array) -> list[jax.Array]:
    """Return derivatives with respect to time from those with respect to the argument in [-1, 1]."""
    out, power = [derivatives[0]], radius
    for derivative in derivatives[1:]:
        out.append(derivative / power)
        power = power * radius
    return out
