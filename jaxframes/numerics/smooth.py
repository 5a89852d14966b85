"""Functions that are smooth in truth but 0/0 as written: norms, and the analytic coefficients of rotations.

Each coefficient is a power series near zero and a closed form elsewhere. The choice between the two is never differentiated:
every function knows its own derivative as another function of the same family (``custom_jvp``), so values and derivatives of any
order are right everywhere, in forward and reverse mode. Differentiating a ``where`` is not safe here: a compiler may compute
the number that decides twice, in two loops that round it differently, and reverse mode would then count both branches or
neither (seen on XLA:CPU, which contracts products and sums). For the same reason the guards of the two forms overlap.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.numerics.components import select
from jaxframes.numerics.trig import sin_cos

Entry: TypeAlias = Any
"""A component that is an array: inside a lifted function all of them are."""


def rounding(x: Entry) -> float:
    """Return the spacing of numbers just above 1 in the dtype of an array."""
    return float(jnp.finfo(x.dtype).eps)


def series(coefficients: Sequence[float], x: Entry) -> Entry:
    """Return the sum of coefficients[n] x^n (Horner)."""
    total = jnp.full_like(x, coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * x + coefficient
    return total


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def stumpff(order: int, square: Entry) -> Entry:
    """Return c_k(a^2) = sum of (-a^2)^n / (k + 2n)!: cos a, sin(a)/a, (1 - cos a)/a^2, (a - sin a)/a^3, ... (Stumpff 1947)."""
    # from order 2 on the closed forms are differences, of more terms with each order: harmless where a > 2, from order 5 a > 4
    limit, terms = (0.0625, 9) if order < 2 else (4.0, 15) if order < 5 else (16.0, 20)
    coefficients = [(-1.0) ** n / math.factorial(order + 2 * n) for n in range(terms)]
    near = series(coefficients, select(square < 1.5 * limit, square, 0.0))
    far = select(square > 0.5 * limit, square, 1.0)
    return select(square < limit, near, _stumpff_closed(order, far))


def _stumpff_closed(order: int, square: Entry) -> Entry:
    angle = jnp.sqrt(square)
    if order == 2:
        s, _ = sin_cos(angle * 0.5)
        return 2.0 * s * s / square
    s, c = sin_cos(angle)
    value = s / angle if order % 2 else c
    for k in range(order % 2, order, 2):
        value = (1.0 / math.factorial(k) - value) / square
    return value


@stumpff.defjvp
def _stumpff_jvp(order: int, primals: tuple[Entry], tangents: tuple[Entry]) -> tuple[Entry, Entry]:
    (square,), (tangent,) = primals, tangents
    rate = -0.5 * stumpff(order + 1, square)
    if order:
        rate = rate + 0.5 * order * stumpff(order + 2, square)
    return stumpff(order, square), rate * tangent


def cos_sinc(square: Entry) -> tuple[Entry, Entry]:
    """Return (cos a, sin(a) / a) for a^2."""
    return stumpff(0, square), stumpff(1, square)


def versine(square: Entry) -> Entry:
    """Return (1 - cos a) / a^2 for a^2."""
    return stumpff(2, square)


def cubic_remainder(square: Entry) -> Entry:
    """Return (a - sin a) / a^3 for a^2."""
    return stumpff(3, square)


def half_cotangent_remainder(square: Entry) -> Entry:
    """Return (1 - (a/2) cot(a/2)) / a^2 for a^2, as (c3 - 2 c4) / (2 c2); its pole is at a = 2 pi."""
    return (stumpff(3, square) - 2.0 * stumpff(4, square)) / (2.0 * stumpff(2, square))


def arc(square: Entry, w: Entry) -> Entry:
    """Return atan2(s, w) / s for s^2 and w: half the angle of a quaternion over the length of its vector part.

    Smooth for w > 0 through s = 0, and for s > 0 through w = 0; at s = 0 with w < 0 the angle is pi and there is no limit.
    """
    return _arc(0, square, w)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _arc(order: int, square: Entry, w: Entry) -> Entry:
    """Return G_m = (-1)^m / m! times the m-th derivative of G = atan2(s, w) / s with respect to s^2.

    G_m = ((2m - 1) G_(m-1) - w / n^m) / (2 m s^2) with n = s^2 + w^2; for small s a power series in s^2 / w^2.
    """
    limit = 0.0625 * w * w
    coefficients = [(-1.0) ** n * math.comb(order + n, n) / (2 * order + 2 * n + 1) for n in range(16)]
    possible = (square < 1.5 * limit) & (w > 0)
    safe = select(possible, w, 1.0)
    small = select(possible, square, 0.0) / (safe * safe)
    near = series(coefficients, small) / safe ** (2 * order + 1)
    far = select((square > 0.5 * limit) | (w <= 0), square, 1.0)
    root = jnp.sqrt(far)
    value = atan2(root, w) / root
    for m in range(1, order + 1):
        value = ((2 * m - 1) * value - w / (far + w * w) ** m) / (2 * m * far)
    return select((square < limit) & (w > 0), near, value)


@_arc.defjvp
def _arc_jvp(order: int, primals: tuple[Entry, Entry], tangents: tuple[Entry, Entry]) -> tuple[Any, Any]:
    (square, w), (d_square, d_w) = primals, tangents
    along_w = -1.0 / (square + w * w) ** (order + 1)
    return _arc(order, square, w), along_w * d_w - (order + 1) * _arc(order + 1, square, w) * d_square


def atan2(y: Entry, x: Entry) -> Entry:
    """Return the angle of the point (x, y)."""
    return jnp.arctan2(y, x)


def binary_scale(components: Sequence[Entry]) -> Entry:
    """Return the power of two just below the largest magnitude: dividing by it is exact and prevents overflow. 1 for zero and infinity."""
    largest = lax.stop_gradient(jnp.abs(components[0]))
    for component in components[1:]:
        largest = jnp.maximum(largest, lax.stop_gradient(jnp.abs(component)))
    dtype = np.dtype(largest.dtype)
    if dtype.name not in ("float32", "float64"):
        return select((largest > 0) & (largest < jnp.inf), largest, jnp.ones_like(largest))
    mask, number = (0x7F800000, np.int32) if dtype.name == "float32" else (0x7FF0000000000000, np.int64)
    power = lax.bitcast_convert_type(lax.bitcast_convert_type(largest, number) & number(mask), dtype)
    return select((power > 0) & (power < jnp.inf), power, jnp.ones_like(power))


def norm(components: Sequence[Entry]) -> Entry:
    """Return the Euclidean norm: no overflow or underflow; at zero the value and all derivatives are 0."""
    scale = binary_scale(components)
    scaled = [c / scale for c in components]
    square = scaled[0] * scaled[0]
    for c in scaled[1:]:
        square = square + c * c
    nothing = square == 0.0
    return select(nothing, 0.0, jnp.sqrt(select(nothing, 1.0, square)) * scale)


def normalize(components: Sequence[Entry]) -> tuple[list[Entry], jax.Array]:
    """Return (components over their norm, norm); components that are all zero give NaN."""
    scale = binary_scale(components)
    scaled = [c / scale for c in components]
    length = norm(scaled)
    return [c / length for c in scaled], length * scale
