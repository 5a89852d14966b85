"""Attitudes of C-kernels written here, whose truth is known: against live CSPICE and against the truth; gaps, precedence, clocks."""

import dataclasses
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.numerics import host_quaternions
from jaxframes.spice.reading import ck_segments, segments
from tests.spice import orbits

ORIGIN = 820497600.0
PROFILES = {
    # name: (attitude, knot step, worst angle / rate / acceleration of "smooth", and of the angle of "spice") against the truth
    "slew-1": (orbits.slew, 1.0, (2e-15, 5e-15, 5e-14), 3.2e-8),
    "slew-10": (orbits.slew, 10.0, (8e-12, 2.5e-12, 2.5e-12), 3.2e-6),
    "slew-60": (orbits.slew, 60.0, (1e-8, 5e-10, 9e-11), 1.2e-4),
    "spinner": (lambda t: orbits.spinner(t, wobble=5e-5), 0.5, (1.5e-10, 9e-10, 2e-8), 1e-7),
}


def angle(a, b):
    return np.linalg.norm(
        host_quaternions.vector_of(host_quaternions.multiply(np.asarray(a, float), host_quaternions.conjugate(b))), axis=1
    ).max()


def largest(vectors):
    return np.linalg.norm(np.asarray(vectors, float), axis=1).max()


def from_spice(cspice, times, base="J2000", frame="TESTCRAFT"):
    found = [cspice.xf2rav(cspice.sxform(base, frame, float(t))) for t in times]
    return host_quaternions.from_matrices(np.array([m.T for m, _ in found])), np.array([w for _, w in found])


def made(folder, *paths, frame="TESTCRAFT", **options):
    with jf.spice.Kernels([*orbits.clock(folder, ORIGIN), *paths]) as kernels:
        return kernels.orientation(frame=frame, **options)


def load(cspice, folder, *paths):
    for path in (str(folder / "test.tsc"), str(folder / "test.tf"), *paths):
        cspice.furnsh(path)


@pytest.mark.float64
@pytest.mark.parametrize("name", PROFILES)
def test_modes_against_cspice_and_the_truth(cspice, tmp_path, rng, name):
    profile, step, smooth_bounds, spice_bound = PROFILES[name]
    knots = np.arange(0, 100 * step + step / 2, step)
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *profile(knots)[:2])
    past = np.concatenate([knots[:3], rng.integers(0, int(knots[-1] * 1024), 200) / 1024, knots[-2:]])
    q, w, alpha = profile(past)
    epochs = jf.Epoch(np.full(len(past), ORIGIN), past)
    exact, smooth = (made(tmp_path, path, ck=mode) for mode in ("spice", "smooth"))
    load(cspice, tmp_path, path)
    spice_q, spice_w = from_spice(cspice, ORIGIN + past)
    got = exact.evaluate(epochs)
    assert angle(got[0], spice_q) <= 1e-14
    assert largest(got[1] - spice_w) <= 1e-15
    assert angle(got[0], q) < spice_bound
    assert largest(np.asarray(got[2]) - (np.diff(profile(knots)[1], axis=0) / step)[np.clip((past / step).astype(int), 0, 99)]) < 1e-12
    got = smooth.evaluate(epochs)
    errors_met = (angle(got[0], q), largest(got[1] - w), largest(got[2] - alpha))
    assert all(e <= bound for e, bound in zip(errors_met, smooth_bounds, strict=True)), errors_met
    at_knots = smooth.evaluate(jf.Epoch(np.full(len(knots), ORIGIN), knots), 1)
    assert angle(at_knots[0], profile(knots)[0]) < 1e-14
    assert largest(at_knots[1] - profile(knots)[1]) < 1e-13
    assert smooth.record_tables[0].first is None  # even knots: no table of cells


def test_attitude_rate_and_acceleration_belong_together(tmp_path, rng, dtype):
    knots = np.array([0.0, 7.0, 30.0, 41.0, 80.0, 100.0])
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots, 3e-2)[:2])
    edge = made(tmp_path, path)
    past = jnp.asarray(np.append(rng.uniform(0.5, 99, 20), 41.0), dtype)
    tol = 1e-13 if dtype == np.float64 else 3e-6

    def attitude(t, order):
        return edge.evaluate(jf.Epoch(jnp.asarray(ORIGIN, dtype), t), order)[order]

    q, w, alpha = edge.evaluate(jf.Epoch(jnp.full(len(past), ORIGIN, dtype), past))
    rate = jax.vmap(jax.jacfwd(lambda t: attitude(t, 0)))(past)
    spin = 2 * host_quaternions.multiply(np.asarray(rate, float), host_quaternions.conjugate(np.asarray(q, float)))[:, 1:]
    assert np.abs(spin - w).max() < tol
    assert np.abs(jax.vmap(jax.jacrev(lambda t: attitude(t, 1)))(past) - alpha).max() < tol
    # The rate is continuous at every knot, to the step taken across it.
    h = 1e-6
    inner = knots[1:-1]
    sides = [np.asarray(edge.evaluate(jf.Epoch(np.full(4, ORIGIN), inner + d), 1)[1], float) for d in (-h, h)]
    assert np.abs(sides[1] - sides[0]).max() < (1e-8 if dtype == np.float64 else 1e-6)
    assert np.abs(np.asarray(q, float) @ np.asarray(q, float).T).diagonal() == pytest.approx(1.0, abs=tol)


def test_gaps_are_kept_named_and_nan(tmp_path, cspice, dtype):
    knots = np.concatenate([np.arange(0, 101, 10.0), np.arange(200, 301, 20.0)])
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots)[:2], starts=[0.0, 200.0])
    edge = made(tmp_path, path)
    past = np.array([-1.0, 0.0, 55.0, 100.0, 100.5, 150.0, 199.5, 200.0, 210.0, 300.0, 301.0])
    epochs = jf.Epoch(np.full(len(past), ORIGIN, dtype), past.astype(dtype))
    codes = np.asarray(edge.coverage_code(epochs))
    assert codes.tolist() == [-1, 0, 0, 0, 1, 1, 1, 0, 0, 0, 1]
    values = edge.evaluate(epochs)
    for value in values:
        assert np.array_equal(np.isnan(value).any(1), codes != 0)
        assert np.array_equal(np.isnan(value).all(1), codes != 0)
    slope = jax.vmap(jax.grad(lambda t: edge.evaluate(jf.Epoch(jnp.asarray(ORIGIN, dtype), t), 0)[0].sum()))(epochs.lo)
    assert np.array_equal(np.isnan(slope), codes != 0)
    assert "gap: 2026-01-01T00:01:40.000 .. 2026-01-01T00:03:20.000 TDB" in edge.report()
    b = jf.TreeBuilder(root="j2000")
    b.add("craft", parent="j2000", edge=edge)
    tree = b.build()
    state = tree.state(time=jf.Epoch(jnp.asarray(ORIGIN, dtype), jnp.asarray(55.0, dtype)))
    motion = tree.motion(state, of="craft", relative_to="j2000")
    np.testing.assert_allclose(motion.velocity.angular, values[1][2], rtol=1e-5)
    np.testing.assert_allclose(motion.acceleration.angular, values[2][2], rtol=1e-4, atol=1e-12)
    assert tree.check(state) == ()  # the marks of gaps and of the last record's open end are no errors
    (line,) = tree.check(state.replace(time=jf.Epoch(jnp.asarray(ORIGIN, dtype), jnp.asarray(150.0, dtype))))
    assert "frame 'craft': the time lies after (or in a gap of) the span" in line
    broken = edge.replace(
        record_tables=(dataclasses.replace(edge.record_tables[0], rows=edge.record_tables[0].rows.at[2, 3].set(jnp.nan)),)
    )
    assert any("record_tables[0].rows, is not finite" in line for line in tree.with_edge("craft", broken).check(state))


@pytest.mark.float64
def test_constant_spins_type_2(cspice, tmp_path, rng):
    # Counts of one second, spins that lead from one attitude to the next over several turns; two intervals apart at the end.
    edges = np.array([0.0, 600.0, 1200.0, 1800.0])
    w = rng.normal(size=(4, 3)) * 0.3
    q = [np.array([1.0, 0, 0, 0])]
    for i in range(3):
        q.append(host_quaternions.multiply(host_quaternions.from_rotation_vector(w[i] * 600.0), q[-1]))
    later = (np.array([2000.0, 2300.0]), np.array(q[:2]), w[:2], None)
    path = orbits.pointing(tmp_path / "2.bc", 2, edges, np.array(q), w, append=[later])
    edge, exact = made(tmp_path, path), made(tmp_path, path, ck="spice")
    load(cspice, tmp_path, path)
    past = np.concatenate([rng.integers(0, 1800 * 64, 200) / 64, rng.integers(2000 * 64, 2300 * 64, 50) / 64])
    reference = from_spice(cspice, ORIGIN + past)
    for table in (edge, exact):
        q_got, w_got, alpha = table.evaluate(jf.Epoch(np.full(len(past), ORIGIN), past))
        assert angle(q_got, reference[0]) < 1e-12  # three hundred radians an interval
        assert largest(w_got - reference[1]) < 1e-14
        assert largest(alpha) < 1e-14
    assert edge.coverage_code(ORIGIN + 1900.0) == 1
    assert edge.record_tables[0].rows.shape[0] == 5  # three spins, the gap, one spin


@pytest.mark.float64
def test_day_long_spins_of_a_clock_that_counts_terrestrial_time(tmp_path, paths, rng):
    spin, seconds = np.array([0.1, -0.2, 0.35]), np.array([0.0, 80000.0, 86400.0])
    q = host_quaternions.from_rotation_vector(spin * seconds[:, None])
    path = orbits.pointing(tmp_path / "2.bc", 2, seconds, q, np.tile(spin, (3, 1)))
    files = [p for p in paths if p.endswith(".tls")] + orbits.clock(tmp_path, ORIGIN, system=2)
    with jf.spice.Kernels([*files, path]) as kernels:
        edge, smooth = (kernels.orientation(frame="TESTCRAFT", ck=mode) for mode in ("spice", "smooth"))
    past = rng.integers(0, 86400 * 64, 1000) / 64
    mean = 6.239996 + 1.99096871e-7 * (ORIGIN + past)
    epochs = jf.Epoch(ORIGIN + past, 1.657e-3 * np.sin(mean + 1.671e-2 * np.sin(mean)))
    truth = host_quaternions.from_rotation_vector(spin * past[:, None])
    # TDB against TT bends by 6e-8 s over a day, 2e-8 rad of this spin.
    assert angle(edge.evaluate(epochs, 0)[0], truth) < 3e-11
    assert angle(smooth.evaluate(epochs, 0)[0], truth) < 3e-11
    assert largest(np.asarray(edge.evaluate(epochs, 1)[1]) - spin) < 1e-15
    assert largest(np.asarray(smooth.evaluate(epochs, 1)[1]) - spin) < 2e-10  # the derivative by TDB; the kernel's is by TT
    assert edge.record_tables[0].rows.shape[0] < 100


@pytest.mark.float64
def test_instants_type_1_are_joined_only_as_far_as_asked(cspice, tmp_path):
    knots = np.array([0.0, 10.0, 20.0, 50.0, 60.0])
    q, w, _ = orbits.slew(knots)
    path = orbits.pointing(tmp_path / "1.bc", 1, knots, q, w)
    with pytest.raises(errors.NoPathError, match=r"CK type 1.*attitudes at 5 instants only.*bridge="):
        made(tmp_path, path)
    edge = made(tmp_path, path, bridge=15.0)
    past = np.array([0.0, 5.0, 20.0, 35.0, 50.0, 60.0])
    assert np.asarray(edge.coverage_code(jf.Epoch(np.full(6, ORIGIN), past))).tolist() == [0, 0, 0, 1, 0, 0]
    at = [0, 1, 2, 4]
    got = edge.evaluate(jf.Epoch(np.full(4, ORIGIN), knots[at]), 1)
    load(cspice, tmp_path, path)
    reference = from_spice(cspice, ORIGIN + knots[at])
    assert angle(got[0], reference[0]) < 1e-14
    assert largest(got[1] - reference[1]) < 1e-14


@pytest.mark.float64
def test_later_segments_win_and_gaps_fall_through(cspice, tmp_path, rng):
    def other(t):
        q, w, a = orbits.slew(t, 1e-3)
        turn = host_quaternions.from_rotation_vector(np.array([0.3, 0.2, 0.1]))
        return host_quaternions.multiply(np.broadcast_to(turn, q.shape), q), host_quaternions.rotate(np.broadcast_to(turn, q.shape), w), a

    low, high = np.arange(0, 401, 20.0), np.concatenate([np.arange(95, 186, 10.0), np.arange(245, 306, 15.0)])
    first = orbits.pointing(tmp_path / "low.bc", 3, low, *orbits.slew(low)[:2])
    second = orbits.pointing(tmp_path / "high.bc", 3, high, *other(high)[:2], starts=[95.0, 245.0])
    edge = made(tmp_path, first, second, ck="spice")
    load(cspice, tmp_path, first, second)
    past = np.sort(rng.uniform(0, 400, 400))
    got = edge.evaluate(jf.Epoch(np.full(400, ORIGIN), past), 1)
    # CSPICE is asked at single doubles, 1.2e-7 s apart.
    reference = from_spice(cspice, ORIGIN + past)
    assert angle(got[0], reference[0]) < 1e-9
    assert largest(got[1] - reference[1]) < 1e-9
    assert len(edge.info.segments) == 2
    assert "gap" not in edge.report()


def test_thousands_of_segments_with_gaps_take_no_longer_each():
    def run(begin, end):
        one, nothing = np.ones(1), np.zeros((1, 3))
        segment = segments.CkSegment("x.bc", 1, -77000, 1, 3, True, begin, end, 1, 2, "ONE")
        return segment, ck_segments.Intervals(
            begin * one, end * one, np.array([[1.0, 0, 0, 0]]), nothing, nothing, nothing, one < 0, 0 * one
        )

    runs = [run(100.0 * i, 100.0 * i + 60.0) for i in range(5000)]
    started = time.perf_counter()
    intervals, used = ck_segments.layered([*runs, run(120.0, 130.0)], -np.inf, np.inf)
    assert time.perf_counter() - started < 10.0
    assert intervals.start[:4].tolist() == [0.0, 100.0, 120.0, 130.0]
    assert intervals.stop[:4].tolist() == [60.0, 120.0, 130.0, 160.0]
    assert len(used) == 5001


@pytest.mark.float64
@pytest.mark.parametrize("system", [1, 2])
def test_clocks_that_drift_and_count_terrestrial_time(cspice, tmp_path, paths, rng, system):
    knots = np.arange(0, 1001, 20.0)
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots, 1e-3)[:2])
    files = orbits.clock(tmp_path, ORIGIN, 1.001, system, later=[(305, ORIGIN + 305 * 1.001, 0.9995), (710, ORIGIN + 710.5, 1.0)])
    leap = next(p for p in paths if p.endswith(".tls"))
    with jf.spice.Kernels([leap, *files, path]) as kernels:
        edge = kernels.orientation(frame="TESTCRAFT", ck="spice")
    for file in (leap, *files, path):
        cspice.furnsh(file)
    # The clock's third piece starts 0.4 s late: until then the second one goes on counting, as in CSPICE.
    times = ORIGIN + np.concatenate([rng.uniform(1, 999, 300), rng.uniform(709.5, 711.0, 100)])
    got = edge.evaluate(times, 1)
    reference = from_spice(cspice, times)
    bound = 1e-9  # CSPICE rounds epochs and ticks to 1.2e-7 s; the slew turns 2e-3 rad/s
    assert angle(got[0], reference[0]) < bound
    assert largest(got[1] - reference[1]) < bound
    assert (
        edge.record_tables[0].rows.shape[0] == len(knots) - 1 + 2
    )  # knots at counts of twenty, and the two changes of the rate between them


@pytest.mark.float64
def test_segments_without_rates_and_in_other_axes(cspice, tmp_path, rng):
    knots = np.arange(0, 201, 5.0)
    q, w, _ = orbits.slew(knots)
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, q, w, rates=False, base="ECLIPJ2000")
    edge = made(tmp_path, path)
    load(cspice, tmp_path, path)
    past = rng.integers(0, 200 * 64, 100) / 64
    epochs = jf.Epoch(np.full(100, ORIGIN), past)
    turn = host_quaternions.from_matrices(np.array([cspice.pxform("ECLIPJ2000", "J2000", 0.0)]))
    truth, rate, _ = orbits.slew(past)
    got = edge.evaluate(epochs)
    inner = (past > 5) & (past < 195)  # at the ends there is a neighbour on one side only
    assert angle(np.asarray(got[0])[inner], host_quaternions.multiply(np.broadcast_to(turn, truth.shape), truth)[inner]) < 1e-8
    assert largest((np.asarray(got[1]) - host_quaternions.rotate(np.broadcast_to(turn, truth.shape), rate))[inner]) < 1e-8
    assert "no angular velocities: they are estimated" in edge.report()
    exact = made(tmp_path, path, ck="spice", relative_to="ECLIPJ2000")
    matrices = np.array([cspice.pxform("ECLIPJ2000", "TESTCRAFT", ORIGIN + t).T for t in past])
    assert angle(exact.evaluate(epochs, 0)[0], host_quaternions.from_matrices(matrices)) < 1e-14


def test_what_is_missing_is_named(tmp_path):
    knots = np.arange(0, 101, 10.0)
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots)[:2])
    clock, frame = orbits.clock(tmp_path, ORIGIN)
    with jf.spice.Kernels([frame, path]) as kernels, pytest.raises(errors.MissingKernelError, match=r"clock -77: load its .*\(SCLK\)"):
        kernels.orientation(frame="TESTCRAFT")
    with jf.spice.Kernels([clock, frame]) as kernels, pytest.raises(errors.NoPathError, match=r"No C-kernel segment for TESTCRAFT"):
        kernels.orientation(frame="TESTCRAFT")
    with jf.spice.Kernels([clock, frame, path]) as kernels:
        with pytest.raises(
            errors.CoverageError, match=r"orientation of TESTCRAFT[\s\S]*have:    2026-01-01T00:00:00[\s\S]*missing: 2027-01-01"
        ):
            kernels.orientation(frame="TESTCRAFT", start="2027-01-01", stop="2027-01-02")
        with pytest.raises(errors.NoPathError, match="ck='linear'"):
            kernels.orientation(frame="TESTCRAFT", ck="linear")
        for start, stop, missing in (
            (ORIGIN - 50.0, ORIGIN + 50.0, "2025-12-31T23:59:10.000 .. 2026-01-01T00:00:00.000"),
            (ORIGIN + 50.0, ORIGIN + 150.0, "2026-01-01T00:01:40.000 .. 2026-01-01T00:02:30.000"),
        ):
            with pytest.raises(errors.CoverageError, match=rf"orientation of TESTCRAFT[\s\S]*asked:[\s\S]*missing: {missing}"):
                kernels.orientation(frame="TESTCRAFT", start=start, stop=stop)
        edge = kernels.orientation(frame="TESTCRAFT", start=ORIGIN, stop=ORIGIN + 50.0)
    assert edge.record_tables[0].rows.shape[0] == 5


@pytest.mark.parametrize("fitted", [False, True])
def test_a_gap_at_an_end_of_the_span_is_refused_and_one_within_kept(tmp_path, fitted):
    knots = np.concatenate([np.arange(0, 101, 10.0), np.arange(200, 301, 10.0)])
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots)[:2], starts=[0.0, 200.0])
    how = {"tolerance": jf.spice.Tolerance(angle=1e-6)} if fitted else {}
    with jf.spice.Kernels([*orbits.clock(tmp_path, ORIGIN), path]) as kernels:
        for start, stop in ((-1.0, 250.0), (150.0, 250.0), (50.0, 150.0), (50.0, 301.0), (120.0, 180.0)):
            with pytest.raises(errors.CoverageError, match=r"orientation of TESTCRAFT[\s\S]*have:[\s\S]*missing:"):
                kernels.orientation(frame="TESTCRAFT", start=ORIGIN + start, stop=ORIGIN + stop, **how)
        edge = kernels.orientation(frame="TESTCRAFT", start=ORIGIN + 50.0, stop=ORIGIN + 250.0, **how)
    assert "gap: 2026-01-01T00:01:40" in edge.report()
    assert (edge.info.start, edge.info.stop) == ("820497650", "820497850")


@pytest.mark.parametrize("fitted", [False, True])
@pytest.mark.parametrize("rate", [1.0, 1.00001])
def test_the_first_and_the_last_instant_of_the_data_are_covered(tmp_path, cspice, dtype, fitted, rate):
    knots = np.concatenate([np.arange(0, 101, 10.0), np.arange(200, 301, 10.0)])
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots)[:2], starts=[0.0, 200.0])
    files = orbits.clock(tmp_path, ORIGIN + 0.123, rate)
    how = {"tolerance": jf.spice.Tolerance(angle=1e-6)} if fitted else {}
    with jf.spice.Kernels([*files, path]) as kernels:
        edge = kernels.orientation(frame="TESTCRAFT", **how)
        rows = kernels.coverage("TESTCRAFT").rows
        again = kernels.orientation(frame="TESTCRAFT", start=rows[0][2], stop=rows[-1][3], **how)
    for file in files:
        cspice.furnsh(file)
    ends = np.array([cspice.sct2e(-77, t * 65536.0) for t in (0.0, 100.0, 200.0, 300.0)])
    assert np.asarray([(float(a), float(b)) for _, _, a, b, _ in rows]).reshape(-1).tolist() == ends.tolist()
    for table in (edge, again):
        assert np.asarray(table.coverage_code(jf.Epoch.from_et(ends))).tolist() == [0, 0, 0, 0]
        turns = np.asarray(table.evaluate(jf.Epoch.from_et(ends), 0)[0], float)
        assert angle(turns, orbits.slew(np.array([0.0, 100, 200, 300]))[0]) < 2e-6
    outside = np.array([ends[0] - 1e-3, ends[1] + 1e-3, ends[2] - 1e-3, ends[3] + 1e-3])
    assert np.asarray(edge.coverage_code(jf.Epoch.from_et(outside))).tolist() == [-1, 1, 1, 1]


@pytest.mark.parametrize(("word", "value"), [(-1, 7.0), (-2, -1.0), (3, np.nan), (0, 50.0), (90, 1e12)])
def test_damaged_knots(tmp_path, word, value):
    knots = np.arange(0, 101, 10.0)
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots)[:2])
    words = np.fromfile(path)
    size, at = 8 * 11 + 3, 128 * 3
    assert words[at + size - 1] == 11
    words[at + (word % size if word >= 0 else size + word)] = value
    words.tofile(path)
    with pytest.raises(errors.BadKernelError, match="damaged or cut off"):
        made(tmp_path, path)


WRONG = {
    "zeros": lambda q, w: np.zeros_like(w),
    "body axes": lambda q, w: host_quaternions.rotate(host_quaternions.conjugate(q), w),
    "degrees": lambda q, w: np.rad2deg(w),
}


@pytest.mark.float64
@pytest.mark.parametrize("kind", [1, 3])
@pytest.mark.parametrize("wrong", WRONG)
def test_rates_that_are_none_of_the_attitudes_are_replaced(tmp_path, rng, kind, wrong):
    """A body that turns at 2e-3 rad/s and wanders: between knots it is where its attitudes say, whatever rates were recorded."""
    start = host_quaternions.from_rotation_vector(np.array([0.9, -0.4, 1.3]))
    spin = np.array([1.2e-3, -1.0e-3, 1.2e-3])

    def truth(t):
        q = orbits.slew(t, 1e-3)[0]
        turned = host_quaternions.from_rotation_vector(spin * t[:, None])
        return host_quaternions.multiply(host_quaternions.multiply(turned, q), np.broadcast_to(start, q.shape))

    knots = np.arange(0.0, 601.0, 10.0)
    h = 1e-3
    poses = truth(knots)
    between = host_quaternions.multiply(truth(knots + h), host_quaternions.conjugate(truth(knots - h)))
    rates = host_quaternions.vector_of(between) / (2 * h)
    path = orbits.pointing(tmp_path / "wrong.bc", kind, knots, poses, WRONG[wrong](poses, rates))
    options = {"bridge": 15.0} if kind == 1 else {}
    with pytest.warns(errors.FrameWarning, match=r"TESTCRAFT: segment .* its angular velocities are none of its attitudes"):
        table = made(tmp_path, path, **options)
    assert any("replaced by those of the attitudes" in note for note in table.info.notes)
    past = rng.integers(0, int(knots[-1] * 1024), 500) / 1024
    got = table.evaluate(jf.Epoch(np.full(len(past), ORIGIN), past), 0)[0]
    assert angle(got, truth(past)) < 2e-6  # 0.01 rad with rates of zero; the wandering alone bends 3e-5 rad between knots
    # As SPICE: no replacement, and no warning.
    assert made(tmp_path, path, ck="spice", **options).info.notes == ()
    # Right rates stay, silently: warnings are errors here.
    right = made(tmp_path, orbits.pointing(tmp_path / "right.bc", kind, knots, poses, rates), **options)
    assert not any("replaced" in note for note in right.info.notes)


@pytest.mark.float64
def test_noise_jumps_and_rests_are_no_contradiction(tmp_path, rng):
    """Star trackers jitter, estimators start anew, planned slews are at rest at both ends: recorded rates stay."""
    knots = np.arange(0.0, 401.0, 4.0)
    q, w, _ = orbits.slew(knots, 1e-3)
    noise = host_quaternions.from_rotation_vector(rng.normal(size=(len(knots), 3)) * 2e-5)
    jump = np.where(knots[:, None] > 200.0, host_quaternions.from_rotation_vector(np.array([3e-3, 0.0, 0.0])), [1.0, 0, 0, 0])
    steps = host_quaternions.from_rotation_vector(np.cumsum((np.arange(len(knots)) % 4 == 3)[:, None] * [0.0, 0.1, 0.2], 0))
    cases = {
        "noise": (host_quaternions.multiply(noise, q), w),
        "gyro": (q, w + rng.normal(size=w.shape) * 1e-5),
        "jump": (host_quaternions.multiply(jump, q), w),
        "rests": (steps, np.zeros_like(w)),
    }
    for name, (poses, rates) in cases.items():
        table = made(tmp_path, orbits.pointing(tmp_path / f"{name}.bc", 3, knots, poses, rates))
        assert not any("replaced" in note for note in table.info.notes), name
