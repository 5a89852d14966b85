"""Positions, velocities and accelerations of DE440 against live CSPICE and against the polynomials at 40 digits."""

import jax
import mpmath as mp
import numpy as np
import pytest

import jaxframes as jf

BEGIN, END = -14200747200, 20514081600
EDGES = [(body, 0) for body in range(1, 11)] + [(301, 3), (399, 3), (199, 1), (299, 2), (301, 399), (399, 0)]


def ulps(difference, reference):
    """Length of a difference in units of the spacing of doubles at the length of the reference."""
    return np.linalg.norm(difference, axis=-1) / np.spacing(np.maximum(np.linalg.norm(reference, axis=-1), 1e-300))


@pytest.mark.float64
@pytest.mark.parametrize(("target", "center"), EDGES)
def test_de440_over_its_whole_span(kernels, cspice, rng, target, center):
    edge = kernels.translation(target=target, center=center)
    times = np.concatenate([[BEGIN, END], rng.integers(BEGIN, END, 400)]).astype(float)
    position, velocity, acceleration = (np.asarray(x) for x in edge.evaluate(times))
    reference = np.array([cspice.spkez(target, t, "J2000", "NONE", center)[0] for t in times]) * 1e3
    if target in (199, 299):  # these segments say zero
        assert not position.any()
        assert not velocity.any()
        assert not reference.any()
        return
    assert ulps(position - reference[:, :3], reference[:, :3]).max() <= 3
    assert ulps(velocity - reference[:, 3:], reference[:, 3:]).max() <= 8
    step, inside = 64.0, times[2:]
    sides = [np.array([cspice.spkez(target, t + h, "J2000", "NONE", center)[0][3:] for t in inside]) for h in (-step, step)]
    change = (sides[1] - sides[0]) * 1e3 / (2 * step)
    assert (np.linalg.norm(acceleration[2:] - change, axis=1) / np.linalg.norm(change, axis=1)).max() < 1e-6


@pytest.mark.float64
def test_chain_with_three_legs_stays_within_the_rounding_of_its_largest(kernels, cspice, rng):
    edge = kernels.translation(target="MOON", center="MARS BARYCENTER")
    assert len(edge.record_tables) == 3
    times = rng.integers(BEGIN, END, 300).astype(float)
    position, velocity = (np.asarray(x) for x in edge.evaluate(times, order=1))
    reference = np.array([cspice.spkezr("MOON", t, "J2000", "NONE", "4")[0] for t in times]) * 1e3
    longest = max(np.abs(cspice.spkezr("4", t, "J2000", "NONE", "0")[0][:3]).max() for t in times) * 1e3
    assert np.linalg.norm(position - reference[:, :3], axis=1).max() <= 4 * np.spacing(longest)
    assert np.linalg.norm(velocity - reference[:, 3:], axis=1).max() <= 8 * np.spacing(3e4)


def second_derivative(coefficients, s):
    """Sum of c_n T_n''(s) at 40 digits, by the recurrence of T differentiated twice."""
    t, d, e = [mp.mpf(1), s], [mp.mpf(0), mp.mpf(1)], [mp.mpf(0), mp.mpf(0)]
    for _ in range(2, len(coefficients)):
        t, d, e = [*t, 2 * s * t[-1] - t[-2]], [*d, 2 * t[-1] + 2 * s * d[-1] - d[-2]], [*e, 4 * d[-1] + 2 * s * e[-1] - e[-2]]
    return mp.fsum(mp.mpf(float(c)) * x for c, x in zip(coefficients, e, strict=False))


@pytest.mark.float64
@pytest.mark.parametrize(
    ("target", "init", "length", "first", "size"),
    [(301, -14200747200.0, 345600.0, 6738121, 41), (3, -14200747200.0, 1382400.0, 3021513, 41)],
)
def test_accelerations_are_the_second_derivative_of_the_record(kernels, cspice, paths, rng, target, init, length, first, size):
    edge = kernels.translation(target=target, center=3 if target == 301 else 0, start="2026-01-01", stop="2027-01-01")
    times = rng.integers(820497600, 852033600, 40).astype(float)
    acceleration = np.asarray(edge.evaluate(times)[2])
    handle = cspice.dafopr(paths[0])
    with mp.workdps(40):
        for t, mine in zip(times, acceleration, strict=True):
            record = int((t - init) // length)
            words = cspice.dafgda(handle, first + record * size, first + (record + 1) * size - 1)
            s = (mp.mpf(t) - mp.mpf(words[0])) / mp.mpf(words[1])
            exact = [second_derivative(words[2 + 13 * i : 15 + 13 * i], s) / mp.mpf(words[1]) ** 2 * 1000 for i in range(3)]
            error = mp.sqrt(mp.fsum((mp.mpf(float(m)) - e) ** 2 for m, e in zip(mine, exact, strict=True)))
            assert error <= mp.mpf("1e-14") * mp.sqrt(mp.fsum(e**2 for e in exact))
    cspice.dafcls(handle)


@pytest.mark.float64
def test_derivative_of_position_is_velocity_exactly(moon, rng):
    times = rng.uniform(820497600, 852033600, 50)
    _, velocity, acceleration = moon.evaluate(times)
    position = lambda t: moon.evaluate(t, order=0)[0]
    assert np.array_equal(jax.vmap(jax.jacfwd(position))(times), velocity)
    assert np.array_equal(jax.vmap(jax.jacrev(position))(times), velocity)
    assert np.array_equal(jax.vmap(jax.jacfwd(jax.jacfwd(position)))(times), acceleration)
    assert np.allclose(jax.vmap(jax.jacfwd(jax.jacrev(position)))(times), acceleration, rtol=1e-15, atol=0)


@pytest.mark.float64
def test_gradient_of_an_acceleration_is_the_jerk(moon):
    t, h = 830000000.0, 64.0
    jerk = jax.jacfwd(lambda t: moon.evaluate(t)[2])(t)
    a = [np.asarray(moon.evaluate(t + k * h)[2]) for k in (-2, -1, 1, 2)]
    central = (a[0] - 8 * a[1] + 8 * a[2] - a[3]) / (12 * h)
    assert np.linalg.norm(jerk - central) <= 1e-9 * np.linalg.norm(central)


@pytest.mark.float64
def test_two_part_time_resolves_what_one_number_cannot(moon):
    t = jf.Epoch.from_parts(np.float64(830000000), np.float64(0))
    position, velocity = moon.evaluate(t, order=1)
    later = moon.evaluate(jf.Epoch(t.hi, t.lo + 1e-8), order=0)[0]  # a twelfth of the spacing of one double
    assert 830000000 + 1e-8 == 830000000
    assert np.allclose(later - position, velocity * 1e-8, atol=1.2e-7)
    assert np.linalg.norm(later - position) > 5e-6


def test_moon_is_where_spice_says_in_either_precision(moon, cspice, dtype):
    times = 820497600.0 + 86400.0 * np.arange(0, 365, 7)
    got = np.concatenate([np.asarray(x, float) for x in moon.evaluate(times, order=1)], 1)
    reference = np.array([cspice.spkezr("MOON", t, "J2000", "NONE", "EARTH")[0] for t in times]) * 1e3
    bounds = (1e-6, 1e-11) if dtype == np.float64 else (130.0, 1e-3)
    assert np.abs(got - reference)[:, :3].max() < bounds[0]
    assert np.abs(got - reference)[:, 3:].max() < bounds[1]


def test_frame_of_the_axes(kernels, cspice, dtype):
    edge = kernels.translation(target="MOON", center="EARTH", frame="ECLIPJ2000", start="2026-01-01", stop="2026-02-01")
    got = np.concatenate([np.asarray(x, float) for x in edge.evaluate(821000000.0, order=1)])
    reference = cspice.spkezr("MOON", 821000000.0, "ECLIPJ2000", "NONE", "EARTH")[0] * 1e3
    assert np.linalg.norm(got - reference) <= (1e-6 if dtype == np.float64 else 100)


def test_table_is_cropped_to_the_records_that_cover_it(moon):
    (leg,) = moon.record_tables
    assert leg.rows.shape == (92, 42)
    text = moon.report()
    for part in (
        "MOON (301) relative to EARTH (399)",
        "92 records",
        "degree 12",
        "2026-01-01T00:00:00",
        "de440.bsp sha256 a4ce9b",
        "jumps",
    ):
        assert part in text
    assert moon.describe() in repr(moon)
