"""The formulas of tables, each once for device and host: on components, JAX's or NumPy's, with sine, root and the like handed in."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from jaxframes.numerics.components import V3, Component, Quat, add, add_all, cross, dot, mul, neg, quat_mul, rotate
from jaxframes.numerics.steps import Coordinate, RotationStep, Step

CENTURY = 36525 * 86400.0
"""Seconds of a Julian century."""
TURN = 6.283185307179586
"""Radians."""


class Functions(NamedTuple):
    """What sums and products alone do not give, of one array library.

    Attributes:
        sin_cos: Sine and cosine of an angle, rad.
        sqrt: Square root.
        turns: Product of a rate and a time, each in two parts, modulo two turns.
    """

    sin_cos: Callable[[Any], tuple[Any, Any]]
    sqrt: Callable[[Any], Any]
    turns: Callable[[Any, Any, Any, Any], Any]


def chebyshev(terms: Sequence[Any], s: Any, order: int) -> tuple[Any, ...]:
    """Return a Chebyshev series and its first derivatives with respect to s, by Clenshaw's recurrence.

    The value and the first derivative take the same operations in the same order as SPICE's CHBINT, so that they agree to
    rounding. Differentiating the recurrence k times gives one more recurrence for each derivative:
    w_j = c_j + 2 s w_{j+1} - w_{j+2}, and with D^k: D^k w_j = 2 k D^{k-1} w_{j+1} + 2 s D^k w_{j+1} - D^k w_{j+2}.

    Args:
        terms: Coefficients c_0, c_1, ..., each [...].
        s: Argument in [-1, 1], [...].
        order: Highest derivative.

    Returns:
        The value and ``order`` derivatives, each [...].
    """
    zero = s * 0  # not zeros_like: a NaN in s must reach series of any length
    twice = s + s
    last, before = [zero] * (order + 1), [zero] * (order + 1)
    for term in reversed(terms[1:]):
        new = [term + (twice * last[0] - before[0])]
        new += [2 * k * last[k - 1] + twice * last[k] - before[k] for k in range(1, order + 1)]
        last, before = new, last
    value = terms[0] + (s * last[0] - before[0])
    return (value, *(k * last[k - 1] + s * last[k] - before[k] for k in range(1, order + 1)))


def record(coefficients: Sequence[Sequence[Any]], s: Any, radius: Any, order: int) -> list[Any]:
    """Return three or four components of the value of a Chebyshev record, then as many of each derivative by time.

    Args:
        coefficients: Terms of the three or four components; or of six, those of the rates last, which then are series of their own.
        s: Argument in [-1, 1], [...].
        radius: Half the length of the record, s.
        order: Highest derivative.
    """
    out: list[list[Any]] = [[] for _ in range(order + 1)]
    for axis in range(3 if len(coefficients) == 6 else len(coefficients)):
        if len(coefficients) < 6:
            parts = _by_time(chebyshev(coefficients[axis], s, order), radius)
        else:
            parts = [chebyshev(coefficients[axis], s, 0)[0]]
            if order > 0:
                parts += _by_time(chebyshev(coefficients[axis + 3], s, order - 1), radius)
        for k, part in enumerate(parts):
            out[k].append(part)
    return [component for components in out for component in components]


def _by_time(derivatives: tuple[Any, ...], radius: Any) -> list[Any]:
    """Return derivatives with respect to time from those with respect to the argument in [-1, 1]."""
    out, power = [derivatives[0]], radius
    for derivative in derivatives[1:]:
        out.append(derivative / power)
        power = power * radius
    return out


def euler_steps(placement: Quat, angles: tuple[V3, ...]) -> tuple[Step, ...]:
    """Return the three rotations that Euler angles (phi, theta, psi) with their derivatives stand for: about z, x and z."""
    phi, theta, psi = (Coordinate(*parts) for parts in zip(*angles, strict=True))
    x, z = V3(1.0, 0.0, 0.0), V3(0.0, 0.0, 1.0)
    return RotationStep(z, phi, rotation=placement), RotationStep(x, theta), RotationStep(z, psi)


def knot_motion(row: Any, u: Any, mode: str, given: Functions) -> list[Any]:
    """Return attitude, angular velocity and acceleration between two knots of a C-kernel; ``AttitudeTable`` says how.

    Args:
        row: Components of a record: quaternion at the start, axis, half angle, two vectors that the mode gives a meaning; its length last.
        u: Where between the knots, 0 to 1; NaN outside the coverage.
        mode: ``"smooth"`` or ``"spice"``.
        given: Functions of the array library.
    """
    start, axis, half, length = Quat(*row[:4]), V3(*row[4:7]), row[7], row[-1]
    first, second = V3(*row[8:11]), V3(*row[11:14])
    slerp = quat_mul(rotation_about(axis, half * u, given), start)
    if mode == "spice":
        return [slerp, first + (second - first) * u, (second - first) * (1 / length)]
    return cayley(*_bubble(first, second, u, length), slerp, axis * (half * 2 / length), given)


def rotation_about(axis: V3, half: Component, given: Functions) -> Quat:
    """Return the rotation about a unit axis by twice an angle."""
    s, c = given.sin_cos(half)
    return Quat(c, *(axis * s))


def _bubble(g0: V3, g1: V3, u: Any, length: Any) -> tuple[V3, V3, V3]:
    """Return g and its two derivatives by time: g0 u (1-u)^2 - g1 u^2 (1-u)."""
    v, per = 1 - u, 1 / length
    value = g0 * (u * v * v) - g1 * (u * u * v)
    rate = (g0 * (v * (1 - 3 * u)) - g1 * (u * (2 - 3 * u))) * per
    rate2 = (g0 * (6 * u - 4) - g1 * (2 - 6 * u)) * (per * per)
    return value, rate, rate2


def cayley(g: V3, rate: V3, rate2: V3, reference: Quat, spin: V3, given: Functions) -> list[Any]:
    """Return attitude, angular velocity and acceleration of Cayley(g) before a reference that spins uniformly.

    With p = (1, g): w_g = 2 vec(p' p*) / |p|^2, alpha_g = 2 vec(p'' p*) / |p|^2 - 2 w_g (p . p') / |p|^2; the reference adds R_g spin and
    w_g x R_g spin.

    Args:
        g: Cayley vector.
        rate: Its derivative by time.
        rate2: Its second derivative.
        reference: Attitude of the reference.
        spin: Angular velocity of the reference, rad/s.
        given: Functions of the array library.
    """
    inverse = 1 / (dot(g, g) + 1.0)
    root = given.sqrt(inverse)
    rotation = Quat(root, *(g * root))
    own = (rate + cross(g, rate)) * (2 * inverse)
    own2 = (rate2 + cross(g, rate2)) * (2 * inverse) - own * (2 * dot(g, rate) * inverse)
    carried = rotate(rotation, spin)
    return [quat_mul(rotation, reference), own + carried, own2 + cross(own, carried)]


Polynomial = Sequence[tuple[Component, Component]]
"""Pairs of constant, rate and higher coefficients of an angle: turns, turns/s, turns per century to the power; each in two parts."""


def model_angles(
    polynomials: Sequence[Polynomial],
    phases: Sequence[Polynomial],
    amplitudes: Sequence[Sequence[Component]],
    time: tuple[Any, Any],
    order: int,
    given: Functions,
) -> list[Component]:
    """Return the Euler angles (ra + 90 deg, 90 deg - dec, w) of a text PCK's model, then their derivatives; ``IauOrientation`` says how.

    Args:
        polynomials: Of right ascension, declination and prime meridian.
        phases: Of the phase angles.
        amplitudes: Of each phase angle in the three, rad.
        time: Seconds past the model's epoch, in two parts [...].
        order: Highest derivative, up to 2.
        given: Functions of the array library.
    """
    sums: list[list[Component]] = [list(_polynomial(row, time, order, given)) for row in polynomials]
    for phase, row in zip(phases, amplitudes, strict=True):
        angle = _polynomial(phase, time, order, given)
        s, c = given.sin_cos(angle[0])
        sines, cosines = _wave(s, c, angle), _wave(c, neg(s), angle)
        for total, amplitude, wave in zip(sums, row, (sines, cosines, sines), strict=True):
            for k, part in enumerate(wave):
                total[k] = add(total[k], mul(amplitude, part))
    ra, dec, w = sums
    first = [add(ra[0], TURN / 4), add(neg(dec[0]), TURN / 4), w[0]]
    return [*first, *(x for k in range(1, order + 1) for x in (ra[k], neg(dec[k]), w[k]))]


def _polynomial(terms: Polynomial, time: tuple[Any, Any], order: int, given: Functions) -> tuple[Component, ...]:
    """Return an angle in rad and its derivatives."""
    hi, lo = time
    out: list[Component] = [add_all(given.turns(*terms[1], hi, lo), *terms[0]), add(*terms[1]), 0.0]
    centuries = (hi + lo) * (1 / CENTURY)
    for power, (coefficient, _) in enumerate(terms[2:], 2):
        scale = coefficient
        for k in range(3):
            # The k-th derivative of c x^n, x = t / century: c n (n-1) ... x^(n-k) / century^k.
            moved = mul(scale, centuries ** (power - k)) if power > k else scale
            out[k] = add(out[k], moved)
            scale = mul(scale, (power - k) / CENTURY)
    return tuple(mul(x, TURN) for x in out[: order + 1])


def _wave(value: Component, slope: Component, angle: tuple[Component, ...]) -> list[Component]:
    """Return a sine or cosine of an angle (its value and slope) and its time derivatives."""
    out = [value]
    if len(angle) > 1:
        out.append(mul(slope, angle[1]))
    if len(angle) > 2:
        out.append(add(mul(slope, angle[2]), neg(mul(value, mul(angle[1], angle[1])))))
    return out
