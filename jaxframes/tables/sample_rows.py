"""Records of samples: the Chebyshev coefficients of every interpolant as linear functions of the samples, made under jit."""

from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from numpy.polynomial import chebyshev

from jaxframes.errors import EdgeError
from jaxframes.numerics.components import Quat, quat_conj, quat_mul
from jaxframes.spatial import rotation_ops
from jaxframes.staging.arrays import default_float, on_device
from jaxframes.staging.columns import assemble, take_apart
from jaxframes.tables.instants import split
from jaxframes.tables.records import RecordTable, to_record_table
from jaxframes.tables.sample_times import SampleTimes, lagrange_weights, spline_bands


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class SampleGrid:
    """What depends on the times of samples only; whole numbers are kept as floats, so that a tree can be differentiated.

    Attributes:
        times: ``[n, 2]``: times of the samples in two parts, seconds past the edge's reference.
        left: ``[n_records, 1]``: the sample where each record starts.
        bands: ``[n, 7]``: for splines the equations of the rates; else None.
        window: ``[n_records, 1]``: for Lagrange's polynomials the first sample of each; else None.
        weights: ``[n_records, points * points]``: their weights; else None.
        index: Middle, half length and look-up of the records: a record table without coefficients.
    """

    times: jax.Array
    left: jax.Array
    bands: jax.Array | None
    window: jax.Array | None
    weights: jax.Array | None
    index: RecordTable


def grid_of(times: SampleTimes, method: str, points: int, ends: str) -> SampleGrid:
    """Return what follows from the times of samples as arrays.

    Args:
        times: The times.
        method: ``"linear"``, ``"lagrange"``, ``"hermite"`` or ``"spline"``.
        points: Samples that a polynomial of Lagrange goes through.
        ends: What a spline does at its ends.

    Raises:
        EdgeError: Too few samples, or more than a float counts.
    """
    dtype = np.dtype(default_float())
    if len(times.past[0]) > 2 ** (np.finfo(dtype).nmant + 1):
        raise EdgeError(f"Sampled: {len(times.past[0])} samples are more than {dtype.name} counts; give several shorter trajectories")
    column = lambda numbers: on_device(numbers.astype(dtype)[:, None])  # noqa: E731
    bands = window = weights = None
    if method == "spline":
        bands = on_device(np.concatenate(spline_bands(times, ends), 1).astype(dtype))
    elif method == "lagrange":
        found, first = lagrange_weights(times, points)
        weights, window = on_device(found.astype(dtype)), column(first)
    index = to_record_table({"rows": times.rows, **times.index}, 3, times.compares)
    pairs = on_device(np.stack(split(*times.past, dtype), 1))
    return SampleGrid(pairs, column(times.left), bands, window, weights, index)


def _hermite(highest: int) -> np.ndarray:
    """Return the matrix from values and derivatives at -1 and at 1, up to a highest one, to Chebyshev coefficients.

    Conditions come in the order value at -1, value at 1, first derivative at -1, at 1, and so on.
    """
    terms = np.eye(2 * highest + 2)
    rows = [
        [chebyshev.chebval(s, chebyshev.chebder(row, d) if d else row) for row in terms] for d in range(highest + 1) for s in (-1.0, 1.0)
    ]
    return np.round(np.linalg.inv(np.array(rows)) * 2.0**12) / 2.0**12  # whole multiples of 1/128


HERMITE = {count: _hermite(count - 1) for count in (1, 2, 3)}
"""By how many of value, first and second derivative are known at both ends: linear, cubic, quintic."""


def hermite_rows(grid: SampleGrid, *samples: jax.Array) -> jax.Array:
    """Return the rows of Hermite interpolants.

    Args:
        grid: Times of the samples, and what follows from them.
        samples: Values, and first and second derivatives by time as far as there are any, [n, k] each.

    Returns:
        ``[n_records, terms * k + 3]``. The first sample of a record is taken off its values and added at the end, so that a large constant
        costs no digits.
    """
    grid = lax.stop_gradient(grid)
    left, half = grid.left[:, 0].astype(jnp.int32), grid.index.rows[:, 2:3]
    base, power = samples[0][left], jnp.ones_like(half)
    conditions: list[jax.Array | None] = []
    for order, values in enumerate(samples):
        ends = values[left], values[left + 1]
        conditions += [None, ends[1] - base] if order == 0 else [end * power for end in ends]
        power = power * half
    terms = [_weighted(row, conditions) for row in HERMITE[len(samples)]]
    return jnp.concatenate([terms[0] + base, *terms[1:], grid.index.rows], -1)


def _weighted(row: np.ndarray, conditions: list[Any]) -> jax.Array:
    parts = [float(weight) * values for weight, values in zip(row, conditions, strict=True) if weight and values is not None]
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def spline_rates(grid: SampleGrid, samples: jax.Array) -> jax.Array:
    """Return the rates [n, k] of the C2 cubic spline through samples [n, k], by one tridiagonal solve: linear in the samples."""
    bands = lax.stop_gradient(grid.bands)
    assert bands is not None
    count = samples.shape[0]
    steps = jnp.pad(samples[1:] - samples[:-1], ((2, 2), (0, 0)))
    right = bands[:, 3:4] * steps[:count]
    for j in range(1, 4):
        right = right + bands[:, 3 + j : 4 + j] * steps[j : j + count]
    return lax.linalg.tridiagonal_solve(bands[:, 0], bands[:, 1], bands[:, 2], right)


def lagrange_rows(grid: SampleGrid, samples: jax.Array, points: int) -> jax.Array:
    """Return the rows [n_records, points * k + 3] of Lagrange's polynomials through so many neighbouring samples [n, k]."""
    grid = lax.stop_gradient(grid)
    assert grid.window is not None
    assert grid.weights is not None
    base, window = samples[grid.left[:, 0].astype(jnp.int32)], grid.window[:, 0].astype(jnp.int32)
    parts = [samples[window + j] - base for j in range(points)]
    terms = []
    for m in range(points):
        weights = grid.weights[:, m * points : (m + 1) * points]
        total = weights[:, 0:1] * parts[0]
        for j in range(1, points):
            total = total + weights[:, j : j + 1] * parts[j]
        terms.append(total)
    return jnp.concatenate([terms[0] + base, *terms[1:], grid.index.rows], -1)


def slerp_rows(grid: SampleGrid, wxyz: jax.Array) -> jax.Array:
    """Return the rows [n_records, 7 + 3] of slerp between quaternions [n, 4]: that at the start, and the rotation vector to the end."""
    grid = lax.stop_gradient(grid)
    left = grid.left[:, 0].astype(jnp.int32)
    start, end = wxyz[left], wxyz[left + 1]
    step = assemble(tuple(quat_mul(Quat(*take_apart(end)), quat_conj(Quat(*take_apart(start))))))
    return jnp.concatenate([start, rotation_ops.log(step), grid.index.rows], -1)


def of_near_signs(wxyz: jax.Array) -> jax.Array:
    """Return quaternions [n, 4] of such signs that each is near the one before it: the shorter way from each to the next."""
    dots = jnp.sum(wxyz[1:] * wxyz[:-1], -1)
    signs = jnp.cumprod(jnp.where(dots < 0, -1.0, 1.0).astype(wxyz.dtype))
    return wxyz * lax.stop_gradient(jnp.concatenate([jnp.ones_like(signs[:1]), signs]))[:, None]


def quaternion_rates(wxyz: jax.Array, angular: jax.Array) -> jax.Array:
    """Return the derivatives q' = w q / 2 of quaternions [n, 4] for angular velocities [n, 3] in the outer axes."""
    w = Quat(0.0, *take_apart(angular * 0.5))
    return assemble(tuple(quat_mul(w, Quat(*take_apart(wxyz)))))


def with_rows(index: RecordTable, rows: jax.Array, series: int) -> RecordTable:
    """Return a record table of rows that are found as an index finds its own."""
    return replace(index, rows=rows, series=series)
