"""Tables fitted to what CSPICE computes, at epochs that the fit has not seen; against truth where it is known."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import CoverageError, NoPathError, ToleranceError
from jaxframes.spice.fitting.rotation_model import RotationModel
from jaxframes.spice.fitting.translation_model import TranslationModel
from tests.spice import orbits

T = jf.spice.Tolerance
SPAN = {"start": "2026-01-01", "stop": "2027-01-01"}


def measured(edge, name):
    return next(value for key, value in edge.info.measured if key.startswith(name))


def seconds(rng, count=1000, start=820497600, stop=852033600):
    return rng.integers(start, stop, count).astype(float)


@pytest.mark.float64
@pytest.mark.parametrize(
    ("target", "center", "position", "velocity", "bytes_a_day"),
    [("MOON", "EARTH", 1.0, 1e-3, 60), ("MOON", "EARTH", 1e-3, 1e-7, 90), ("MARS BARYCENTER", "SUN", 1e-2, 1e-6, 14)],
)
def test_tolerances_are_met_within_few_bytes(kernels, rng, target, center, position, velocity, bytes_a_day):
    edge = kernels.translation(target=target, center=center, tolerance=T(position=position, velocity=velocity), **SPAN)
    worst = jf.spice.compare(kernels, edge, seconds(rng))
    assert worst.value <= position
    assert worst.rate <= velocity
    assert edge.record_tables[0].rows.nbytes < bytes_a_day * 365
    assert measured(edge, "position error") <= position
    exact = kernels.translation(target=target, center=center, **SPAN)
    times = seconds(rng, 300)
    error = np.linalg.norm(np.asarray(edge.evaluate(times)[2]) - np.asarray(exact.evaluate(times)[2]), axis=1).max()
    assert error <= 3 * measured(edge, "acceleration error") + 1e-14
    jumps = [measured(edge, f"kernel's own jumps in {what}") for what in ("position", "velocity", "acceleration")]
    assert all(jump > 0 for jump in jumps)
    for part in (
        "fit of CSPICE's velocities",
        "records",
        "degree",
        "bytes",
        "position error, m",
        "velocity error",
        "acceleration error",
        "de440",
    ):
        assert part in edge.report()


@pytest.mark.float64
def test_records_lie_on_the_kernels_own(kernels, rng):
    edge = kernels.translation(target="MOON", center="EARTH", tolerance=T(position=1e-5, velocity=1e-9), **SPAN)
    assert (820454400 + float(edge.record_tables[0].grid[0]) + 14200747200) % 345600 == 0
    assert float(edge.record_tables[0].grid[2]) <= 345600
    worst = jf.spice.compare(kernels, edge, seconds(rng))
    assert worst.value < 1e-6  # the rounding of epochs alone would be 6e-5 m
    assert worst.rate < 1e-11


@pytest.mark.float64
def test_a_size_is_kept_and_used(kernels, rng):
    small, large = (kernels.translation(target="MOON", center="EARTH", size=size, **SPAN) for size in (8_000, 20_000))
    for edge, size in ((small, 8_000), (large, 20_000)):
        assert 0.6 * size < edge.record_tables[0].rows.nbytes <= size
    errors = [jf.spice.compare(kernels, edge, seconds(rng, 200)).value for edge in (small, large)]
    assert errors[1] < errors[0] / 100
    with pytest.raises(ToleranceError, match=r"\d+ bytes are needed .* more than size=8000"):
        kernels.translation(target="MOON", center="EARTH", size=8_000, tolerance=T(position=1e-3), **SPAN)


@pytest.mark.float64
@pytest.mark.parametrize("layout", ["uniform", "dyadic"])
@pytest.mark.parametrize("size", [4_000, 20_000, 60_000])
def test_a_size_is_kept_in_both_layouts(kernels, rng, layout, size):
    edge = kernels.translation(target="MOON", center="EARTH", size=size, layout=layout, **SPAN)
    assert 0.5 * size < edge.record_tables[0].bytes <= size
    even = kernels.translation(target="MOON", center="EARTH", size=size, **SPAN)
    worst = jf.spice.compare(kernels, edge, seconds(rng, 500)).value
    assert worst <= 1.5 * measured(edge, "position error")
    assert measured(edge, "position error") <= measured(even, "position error")
    with pytest.raises(ToleranceError, match=r"MOON .*: \d+ bytes are needed, more than size=100"):
        kernels.translation(target="MOON", center="EARTH", size=100, layout=layout, **SPAN)


@pytest.mark.float64
def test_dyadic_records_of_a_size_go_where_the_motion_is_fast(cspice, tmp_path, rng):
    times = np.arange(0.0, 172800.1, 60.0)
    path = orbits.nodes(tmp_path / "13.bsp", 13, orbits.MOLNIYA, times, 11)
    with jf.spice.Kernels(path) as kernels:
        even, uneven = (kernels.translation(target=-77, center=399, size=30_000, layout=layout) for layout in ("uniform", "dyadic"))
        at = rng.integers(0, 172800 * 64, 1000) / 64
        worst = [jf.spice.compare(kernels, edge, at).value for edge in (even, uneven)]
    assert uneven.record_tables[0].bytes <= 30_000
    assert worst[1] < worst[0] / 20


@pytest.mark.float64
def test_light_time_corrected_states(kernels, rng):
    edge = kernels.translation(
        target="MARS BARYCENTER", center="EARTH", correction="CN+S", tolerance=T(position=1e-2, velocity=1e-6), **SPAN
    )
    worst = jf.spice.compare(kernels, edge, seconds(rng, 300))
    assert worst.value <= 1e-2
    assert worst.rate <= 1e-6
    assert "corrected: CN+S" in edge.report()
    with pytest.raises(ToleranceError, match=r"no table meets 0.0001 m. The best reached is 0.00\d+ m and"):
        kernels.translation(target="MARS BARYCENTER", center="EARTH", correction="CN", tolerance=T(position=1e-4), **SPAN)
    once = kernels.translation(target="MARS BARYCENTER", center="EARTH", correction="LT", tolerance=T(position=2e-2), **SPAN)
    assert "fit of CSPICE's positions, LT" in once.report()
    assert 1e-5 < measured(once, "velocity error") < 1e-3  # SPICE's LT velocities are not the derivatives of its positions


@pytest.mark.float64
def test_types_that_are_not_polynomials_and_dyadic_records(cspice, tmp_path, rng):
    times = np.arange(0.0, 86400.1, 300.0)
    position, velocity, _ = orbits.two_body(orbits.MOLNIYA, times)
    path = str(tmp_path / "5.bsp")
    handle = cspice.spkopn(path, "test", 0)
    states = np.concatenate([position, velocity], 1) / 1e3
    cspice.spkw05(handle, -77, 399, "J2000", 0.0, 86400.0, "CONICS", orbits.MU / 1e9, len(times), states, times)
    cspice.spkcls(handle)
    with jf.spice.Kernels(path) as kernels:
        edges = [kernels.translation(target=-77, center=399, tolerance=T(position=1e-2), layout=layout) for layout in ("uniform", "dyadic")]
        at = rng.integers(0, 86400 * 64, 1000) / 64
        worst = [jf.spice.compare(kernels, edge, at).value for edge in edges]
        with pytest.raises(ToleranceError, match="layout='square'"):
            kernels.translation(target=-77, center=399, tolerance=T(position=1e-2), layout="square")
    assert max(worst) <= 1e-2
    assert edges[1].record_tables[0].bytes < edges[0].record_tables[0].bytes / 2  # the perigee alone needs short records
    assert edges[0].record_tables[0].first is None
    for edge in edges:
        truth = orbits.two_body(orbits.MOLNIYA, at)
        assert np.linalg.norm(np.asarray(edge.evaluate(at, 0)[0]) - truth[0], axis=1).max() <= 1.1e-2
        assert measured(edge, "acceleration error") < 1e-4


@pytest.mark.float64
def test_what_cannot_be_fitted_says_so(kernels):
    with pytest.raises(CoverageError):
        kernels.translation(target="MOON", center="EARTH", tolerance=T(position=1.0), start="2649-01-01", stop="2651-01-01")
    with pytest.raises(NoPathError, match="only the barycentre 4"):
        kernels.translation(target=499, center="EARTH", tolerance=T(position=1.0), **SPAN)
    with pytest.raises(NoPathError, match="correction='CN' needs a fit"):
        kernels.translation(target="MOON", center="EARTH", correction="cn", **SPAN)
    with pytest.raises(NoPathError, match=r"correction='CB' is none of SPICE's.*'CN'"):
        kernels.translation(target="MOON", center="EARTH", correction="CB", **SPAN)
    with pytest.raises(ToleranceError, match="says nothing about a translation"):
        kernels.translation(target="MOON", center="EARTH", tolerance=T(angle=1e-6), **SPAN)
    with pytest.raises(ToleranceError, match="greater than zero"):
        T(position=-1.0)
    with pytest.raises(ToleranceError, match="at least one"):
        T()


@pytest.mark.float64
def test_why_cspice_has_no_orientation_is_passed_on(paths, tmp_path):
    (tmp_path / "frames.tf").write_text(FRAMES)
    leap = next(p for p in paths if p.endswith(".tls"))
    with (
        jf.spice.Kernels([leap, str(tmp_path / "frames.tf")]) as kernels,
        pytest.raises(CoverageError, match=r"orientation of TESTGSE[\s\S]*reason:  CSPICE signalled SPICE\(NOLOADEDFILES\)"),
    ):
        kernels.orientation(frame="TESTGSE", tolerance=T(angle=1e-9), **JANUARY)


@pytest.fixture
def asked(monkeypatch):
    """How many epochs CSPICE was asked about by fits: their cost, whatever the machine."""
    counts = []
    for model in (TranslationModel, RotationModel):
        original = model.sample

        def sample(self, times, original=original):
            counts.append(len(times))
            return original(self, times)

        monkeypatch.setattr(model, "sample", sample)
    return counts


@pytest.mark.float64
@pytest.mark.parametrize("layout", ["uniform", "dyadic"])
def test_what_is_impossible_is_found_out_at_little_cost(kernels, asked, layout):
    ten = {"start": "2026-01-01", "stop": "2036-01-01"}
    with pytest.raises(ToleranceError, match=r"no table meets 1e-09 m and 1e-13 m/s. The best reached is .*e-07 m and .*e-13 m/s: what"):
        kernels.translation(target="MOON", center="EARTH", tolerance=T(position=1e-9, velocity=1e-13), layout=layout, **ten)
    assert sum(asked) < 60_000
    asked.clear()
    year = {"start": "2026-01-01", "stop": "2026-12-31"}
    with pytest.raises(ToleranceError, match=r"no table meets 1e-15 rad and 1e-19 rad/s. The best reached is .*e-15 rad and .*e-18 rad/s"):
        kernels.orientation(frame="ITRF93", tolerance=T(angle=1e-15, rate=1e-19), layout=layout, **year)
    assert sum(asked) < 60_000


@pytest.mark.parametrize("bad", [1.0, "1", (1.0, 1e-3), {"position": 1.0}])
def test_what_is_no_tolerance(kernels, bad):
    for make in (
        lambda: kernels.translation(target="MOON", center="EARTH", tolerance=bad, **SPAN),
        lambda: kernels.orientation(frame="ITRF93", tolerance=bad, **SPAN),
    ):
        with pytest.raises(ToleranceError, match=r"tolerance=.*: give jf\.spice\.Tolerance\(position="):
            make()
    for number in (True, "1", np.nan, np.inf, 0, -1, [1.0]):
        with pytest.raises(ToleranceError, match="at least one"):
            T(position=number)


def test_layouts_and_sizes_that_mean_nothing(kernels):
    for make in (
        lambda layout: kernels.translation(target="MOON", center="EARTH", layout=layout, **SPAN),
        lambda layout: kernels.orientation(frame="ITRF93", layout=layout, **SPAN),
    ):
        with pytest.raises(ToleranceError, match="layout='dyadic' is for fitted tables: give tolerance="):
            make("dyadic")
        with pytest.raises(ToleranceError, match="layout='square': records are 'uniform' or 'dyadic'"):
            make("square")
    for size in (0, -5, 1.5, "1000", True):
        with pytest.raises(ToleranceError, match="give the most bytes"):
            kernels.translation(target="MOON", center="EARTH", size=size, **SPAN)


def test_two_parts_hold_the_moon_in_float32(kernels, cspice, rng, dtype):
    bounds = {"MOON": ("EARTH", 1e-4), "MARS BARYCENTER": ("SSB", 1e-2)}
    for target, (center, bound) in bounds.items():
        edge = kernels.translation(target=target, center=center, **SPAN)
        times = seconds(rng, 700)
        hi, lo = edge.evaluate_two_part(times)
        assert hi.dtype == lo.dtype == dtype
        names = {"EARTH": 399, "SSB": 0, "MOON": 301, "MARS BARYCENTER": 4}
        reference = np.array([cspice.spkez(names[target], t, "J2000", "NONE", names[center])[0][:3] for t in times]) * 1e3
        error = np.linalg.norm(np.asarray(hi, float) + np.asarray(lo, float) - reference, axis=1).max()
        assert error <= bound
        assert (np.abs(np.asarray(lo, float)) <= np.spacing(np.abs(np.asarray(hi)))).all()
        assert np.isnan(np.asarray(edge.evaluate_two_part(np.array([0.0]))[0])).all()
    if dtype == np.float32:
        assert edge.record_tables[0].low is not None
        wide = edge.astype(np.float32)
        np.testing.assert_array_equal(wide.evaluate_two_part(times)[1], lo)


FRAMES = """KPL/FK
\\begindata
FRAME_TESTGSE = 1500000
FRAME_1500000_NAME = 'TESTGSE'
FRAME_1500000_CLASS = 5
FRAME_1500000_CLASS_ID = 1500000
FRAME_1500000_CENTER = 399
FRAME_1500000_RELATIVE = 'J2000'
FRAME_1500000_DEF_STYLE = 'PARAMETERIZED'
FRAME_1500000_FAMILY = 'TWO-VECTOR'
FRAME_1500000_PRI_AXIS = 'X'
FRAME_1500000_PRI_VECTOR_DEF = 'OBSERVER_TARGET_POSITION'
FRAME_1500000_PRI_OBSERVER = 'EARTH'
FRAME_1500000_PRI_TARGET = 'SUN'
FRAME_1500000_PRI_ABCORR = 'NONE'
FRAME_1500000_SEC_AXIS = 'Y'
FRAME_1500000_SEC_VECTOR_DEF = 'OBSERVER_TARGET_VELOCITY'
FRAME_1500000_SEC_OBSERVER = 'EARTH'
FRAME_1500000_SEC_TARGET = 'SUN'
FRAME_1500000_SEC_ABCORR = 'NONE'
FRAME_1500000_SEC_FRAME = 'J2000'
FRAME_TESTSWITCH = 1500001
FRAME_1500001_NAME = 'TESTSWITCH'
FRAME_1500001_CLASS = 6
FRAME_1500001_CLASS_ID = 1500001
FRAME_1500001_CENTER = 399
FRAME_1500001_ALIGNED_WITH = ( 'ECLIPJ2000', 'ITRF93', 'TESTGSE' )
FRAME_1500001_START = ( '2026-01-02-00:00:00 TDB', '2026-01-05-00:00:00 TDB', '2026-01-08-12:00:00 TDB' )
FRAME_1500001_STOP = ( '2026-01-05-00:00:00 TDB', '2026-01-07-00:00:00 TDB', '2026-01-20-00:00:00 TDB' )
FRAME_TESTYEAR = 1500002
FRAME_1500002_NAME = 'TESTYEAR'
FRAME_1500002_CLASS = 5
FRAME_1500002_CLASS_ID = 1500002
FRAME_1500002_CENTER = 399
FRAME_1500002_RELATIVE = 'J2000'
FRAME_1500002_DEF_STYLE = 'PARAMETERIZED'
FRAME_1500002_FAMILY = 'TWO-VECTOR'
FRAME_1500002_PRI_AXIS = 'X'
FRAME_1500002_PRI_VECTOR_DEF = 'OBSERVER_TARGET_POSITION'
FRAME_1500002_PRI_OBSERVER = 'SUN'
FRAME_1500002_PRI_TARGET = 'EARTH MOON BARYCENTER'
FRAME_1500002_PRI_ABCORR = 'NONE'
FRAME_1500002_SEC_AXIS = 'Z'
FRAME_1500002_SEC_VECTOR_DEF = 'CONSTANT'
FRAME_1500002_SEC_FRAME = 'ECLIPJ2000'
FRAME_1500002_SEC_SPEC = 'RECTANGULAR'
FRAME_1500002_SEC_VECTOR = ( 0, 0, 1 )
FRAME_TESTDATE = 1500003
FRAME_1500003_NAME = 'TESTDATE'
FRAME_1500003_CLASS = 5
FRAME_1500003_CLASS_ID = 1500003
FRAME_1500003_CENTER = 399
FRAME_1500003_RELATIVE = 'J2000'
FRAME_1500003_DEF_STYLE = 'PARAMETERIZED'
FRAME_1500003_FAMILY = 'MEAN_EQUATOR_AND_EQUINOX_OF_DATE'
FRAME_1500003_PREC_MODEL = 'EARTH_IAU_1976'
FRAME_1500003_ROTATION_STATE = 'INERTIAL'
FRAME_TESTCAMERA = 1500004
FRAME_1500004_NAME = 'TESTCAMERA'
FRAME_1500004_CLASS = 4
FRAME_1500004_CLASS_ID = 1500004
FRAME_1500004_CENTER = -77
TKFRAME_1500004_RELATIVE = 'TESTCRAFT'
TKFRAME_1500004_SPEC = 'ANGLES'
TKFRAME_1500004_UNITS = 'DEGREES'
TKFRAME_1500004_ANGLES = ( 0, 90, 10 )
TKFRAME_1500004_AXES = ( 1, 2, 3 )
\\begintext
"""
JANUARY = {"start": "2026-01-01", "stop": "2026-01-20"}
SWITCHED = {"start": "2026-01-02", "stop": "2026-01-20"}  # from where on TESTSWITCH has data


@pytest.fixture(scope="module")
def framed(paths, tmp_path_factory):
    """Kernels with a dynamic and a switch frame, and a spacecraft's attitude of CK type 5."""
    import spiceypy

    folder = tmp_path_factory.mktemp("frames")
    (folder / "frames.tf").write_text(FRAMES)
    times = np.arange(0, 3000.0, 10.0)
    ticks, spice = times * 65536, orbits.slew(times)[0] * np.array([1.0, -1, -1, -1])
    files = [*orbits.clock(folder, 820497600.0), str(folder / "5.bc")]
    handle = spiceypy.ckopn(files[-1], "test", 0)
    starts = np.array([ticks[0], ticks[150]])
    spiceypy.ckw05(handle, 1, 7, ticks[0], ticks[-1], -77000, "J2000", True, "FIVE", ticks, spice, 1 / 65536, 2, starts)
    spiceypy.ckcls(handle)
    with jf.spice.Kernels([*paths, str(folder / "frames.tf"), *files]) as kernels:
        yield kernels


@pytest.mark.float64
@pytest.mark.parametrize(
    ("frame", "span", "angle", "rate", "layout"),
    [
        ("ITRF93", JANUARY, 1e-9, 1e-12, "uniform"),
        ("TESTGSE", JANUARY, 1e-10, 1e-14, "uniform"),
        ("TESTSWITCH", SWITCHED, 1e-9, 1e-12, "dyadic"),
        ("TESTCRAFT", {}, 1e-9, 1e-10, "uniform"),
    ],
)
def test_orientations_of_every_class(framed, rng, frame, span, angle, rate, layout):
    edge = framed.orientation(frame=frame, tolerance=T(angle=angle, rate=rate), layout=layout, **span)
    begin, end = float(edge.info.start), float(edge.info.stop)
    times = rng.uniform(begin, end, 1000)
    times = times[np.asarray(edge.coverage_code(times)) == 0]
    worst = jf.spice.compare(framed, edge, times)
    assert worst.value <= angle
    assert worst.rate <= rate
    assert measured(edge, "angle error") <= angle
    largest = np.linalg.norm(edge.evaluate(times[:50])[2], axis=1).max()
    assert measured(edge, "angular acceleration error") < max(1e-3 * largest, 1e-14)
    assert "Cayley" in edge.report()
    if frame == "TESTSWITCH":
        day = np.array([0.5, 3.9999, 4.0, 5.9999, 6.5, 7.4999, 7.5, 18.9])
        assert np.asarray(edge.coverage_code(820497600 + 86400 * day)).tolist() == [-1, 0, 0, 0, 1, 1, 0, 0]
        assert "gap: 2026-01-07T00:00:00" in edge.report()
        assert "1 gaps in all" in edge.report()
    if frame == "TESTCRAFT":
        assert np.asarray(edge.coverage_code(820497600 + np.array([1489.0, 1495.0, 1501.0]))).tolist() == [0, 1, 0]


@pytest.mark.float64
def test_fitted_orientations_have_exact_derivatives(framed):
    import jax

    edge = framed.orientation(frame="ITRF93", tolerance=T(angle=1e-9, rate=1e-12), **JANUARY)
    t = 820600000.0
    alpha = jax.jacfwd(lambda t: edge.evaluate(t, 1)[1])(t)
    np.testing.assert_allclose(alpha, edge.evaluate(t)[2], rtol=1e-9)
    q, w, _ = edge.evaluate(t)
    rate = jax.jacrev(lambda t: edge.evaluate(t, 0)[0])(t)
    x, y, z = w
    spin = np.array([[0, -x, -y, -z], [x, 0, -z, y], [y, z, 0, -x], [z, -y, x, 0]]) @ q / 2
    np.testing.assert_allclose(rate, spin, rtol=1e-11, atol=1e-19)


@pytest.mark.float64
def test_orientations_that_cannot_be_fitted_say_so(framed):
    with pytest.raises(NoPathError, match=r"TESTGSE is a dynamic frame: give tolerance="):
        framed.orientation(frame="TESTGSE", **JANUARY)
    with pytest.raises(NoPathError, match=r"'FIVE' \(CK type 5.*give tolerance="):
        framed.orientation(frame="TESTCRAFT")
    with pytest.raises(CoverageError, match="TESTGSE has no coverage of its own"):
        framed.orientation(frame="TESTGSE", tolerance=T(angle=1e-9))
    with pytest.raises(CoverageError, match=r"orientation of TESTSWITCH[\s\S]*have:    nothing[\s\S]*reason:  CSPICE.*NOFRAMECONNECT"):
        framed.orientation(frame="TESTSWITCH", start="2027-01-01", stop="2027-01-02", tolerance=T(angle=1e-9))
    with pytest.raises(CoverageError, match=r"have:    2026-01-02[\s\S]*missing: 2026-01-01T00:00:00.000 .. 2026-01-02"):
        framed.orientation(frame="TESTSWITCH", tolerance=T(angle=1e-9), **JANUARY)
    with pytest.raises(ToleranceError, match=r"ITRF93 .*no table meets 1e-16"):
        framed.orientation(frame="ITRF93", tolerance=T(angle=1e-16), start="2026-01-01", stop="2026-01-03")
    # CSPICE gives no rate to a frame of date that is declared inertial, while its axes precess.
    with pytest.raises(ToleranceError, match=r"gives as rate is not the derivative of its angle.*Give angle= alone"):
        framed.orientation(frame="TESTDATE", tolerance=T(angle=1e-9, rate=1e-13), **JANUARY)
    edge = framed.orientation(frame="TESTDATE", tolerance=T(angle=1e-9), **JANUARY)
    assert 7e-12 < measured(edge, "rate error") < 9e-12


@pytest.mark.float64
def test_records_that_fail_where_they_were_not_probed_are_made_shorter(framed, rng):
    # Half a year in one record meets the tolerance at the few epochs probed, and not elsewhere.
    span = {"start": "2025-06-01", "stop": "2025-12-01"}
    for angle in (2e-9, 1e-9, 6e-10, 3e-10):
        edge = framed.orientation(frame="TESTYEAR", tolerance=T(angle=angle, rate=1e-13), **span)
        worst = jf.spice.compare(framed, edge, rng.uniform(802008000, 817819200, 1000))
        assert worst.value <= angle
        assert edge.record_tables[0].rows.shape[0] <= 4


@pytest.mark.float64
def test_gaps_are_known_behind_fixed_offsets_and_on_both_sides(framed, rng):
    stretch = 820497600 + np.array([0.0, 1490.0, 1500.0, 2990.0])
    for frame, base in (("TESTCAMERA", "J2000"), ("TESTGSE", "TESTCRAFT")):
        edge = framed.orientation(frame=frame, relative_to=base, tolerance=T(angle=1e-9, rate=1e-10))
        assert np.abs(np.array([float(edge.info.start), float(edge.info.stop)]) - stretch[[0, 3]]).max() < 1e-3
        assert np.asarray(edge.coverage_code(820497600 + np.array([1489.0, 1495.0, 1501.0]))).tolist() == [0, 1, 0]
        times = np.concatenate([rng.uniform(*stretch[:2], 200), rng.uniform(*stretch[2:], 200)])
        worst = jf.spice.compare(framed, edge, times)
        assert worst.value <= 1e-9
        assert worst.rate <= 1e-10
    with pytest.raises(CoverageError, match=r"do not cover the orientation of TESTCAMERA[\s\S]*have:    2026-01-01T00:00:00"):
        framed.orientation(frame="TESTCAMERA", tolerance=T(angle=1e-9), start="2027-01-01", stop="2027-01-02")


@pytest.mark.float64
@pytest.mark.parametrize("layout", ["uniform", "dyadic"])
def test_a_small_nutation_of_a_fast_spinner_is_followed(tmp_path, cspice, layout):
    # Records as long as many turns are all equally wrong by the nutation: shorter ones are not for nothing.
    times = np.arange(0, 3600.0, 0.5)
    ticks, spice = times * 65536, orbits.spinner(times, wobble=1e-5)[0] * np.array([1.0, -1, -1, -1])
    handle = cspice.ckopn(str(tmp_path / "5.bc"), "test", 0)
    cspice.ckw05(handle, 1, 7, ticks[0], ticks[-1], -77000, "J2000", True, "FIVE", ticks, spice, 1 / 65536, 1, ticks[:1])
    cspice.ckcls(handle)
    with jf.spice.Kernels([*orbits.clock(tmp_path), tmp_path / "5.bc"]) as kernels:
        edge = kernels.orientation(frame="TESTCRAFT", tolerance=T(angle=1e-6), layout=layout)
    assert measured(edge, "angle error") <= 1e-6
    assert 32 <= edge.record_tables[0].rows.shape[0] <= 128


def test_attitudes_without_rates_need_no_fit(tmp_path):
    knots = np.arange(0, 101, 10.0)
    path = orbits.pointing(tmp_path / "3.bc", 3, knots, *orbits.slew(knots)[:2], rates=False)
    with jf.spice.Kernels([*orbits.clock(tmp_path), path]) as kernels:
        with pytest.raises(NoPathError, match=r"TESTCRAFT hold no angular velocities.*leave tolerance= out"):
            kernels.orientation(frame="TESTCRAFT", tolerance=T(angle=1e-6))
        assert kernels.orientation(frame="TESTCRAFT").record_tables[0].rows.shape[0] == 10
