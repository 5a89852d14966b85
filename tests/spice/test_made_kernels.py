"""Kernels written here: type 3, several segments, unequal records, precedence, other axes; against live CSPICE on the same files."""

import jax
import numpy as np
import pytest

import jaxframes as jf
from tests.spice import made

pytestmark = pytest.mark.float64


def check(cspice, path, target, center, times, start=None, stop=None, frame="J2000", bounds=(4, 8), files=()):
    """Make a table, compare it with CSPICE at times, return it."""
    with jf.spice.Kernels([*files, path]) as kernels:
        edge = kernels.translation(target=target, center=center, frame=frame, start=start, stop=stop)
    for file in (*files, path):
        cspice.furnsh(file)
    got = np.concatenate([np.asarray(x) for x in edge.evaluate(times, order=1)], 1)
    reference = made.states(target, center, times, frame)
    for part, bound in zip((slice(0, 3), slice(3, 6)), bounds, strict=True):
        scale = np.linalg.norm(reference[:, part], axis=1).max()
        assert np.abs(got - reference)[:, part].max() <= bound * np.spacing(scale)
    return edge


def test_type_3_has_velocities_of_its_own(cspice, tmp_path, rng):
    path = made.spk(tmp_path / "3.bsp", [(3, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 6, 9))])
    times = np.concatenate([[0.0, 500.0], rng.uniform(0, 500, 200)])
    edge = check(cspice, path, -77, 399, times)
    _, velocity, acceleration = edge.evaluate(times)
    # The same series, but not always the same program: one rounding apart where the compiler fuses products and sums differently.
    same = {"rtol": 0, "atol": 2 * np.spacing(float(np.abs(velocity).max()))}
    assert np.allclose(jax.vmap(jax.jacfwd(lambda t: edge.evaluate(t, 0)[0]))(times), velocity, **same)
    assert np.allclose(jax.vmap(jax.jacfwd(lambda t: edge.evaluate(t, 1)[1]))(times), acceleration, **same)
    assert "velocities of their own" in edge.report()


def test_records_of_unequal_length(cspice, tmp_path, rng):
    segments, start = [], 0.0
    for kind, length, n, terms in [(2, 100.0, 3, 8), (2, 37.5, 4, 5), (2, 250.25, 2, 11), (2, 0.125, 1, 3), (2, 90.0, 3, 6)]:
        segments.append((kind, -77, 399, "J2000", start, start + n * length, start, length, made.coefficients(rng, n, 3, terms)))
        start += n * length
    path = made.spk(tmp_path / "unequal.bsp", segments)
    times = rng.uniform(0, start, 2000)
    edge = check(cspice, path, -77, 399, times)
    (leg,) = edge.record_tables
    assert leg.first is not None
    assert leg.compares >= 1
    inside = 300.0 + 4 * 37.5 + 2 * 250.25 + rng.uniform(0, 0.125, 50)  # the record that is an eighth of a second long
    check(cspice, path, -77, 399, inside)
    assert edge.evaluate(start)[0].shape == (3,)
    assert np.isfinite(edge.evaluate(start)[0]).all()


def test_later_segments_and_files_win(cspice, tmp_path, rng):
    series = [made.coefficients(rng, n, 3, 6) for n in (10, 3, 2)]
    first = made.spk(
        tmp_path / "a.bsp",
        [(2, -77, 399, "J2000", 0.0, 1000.0, 0.0, 100.0, series[0]), (2, -77, 399, "J2000", 310.0, 575.0, 300.0, 100.0, series[1])],
    )
    second = made.spk(tmp_path / "b.bsp", [(2, -77, 399, "J2000", 450.5, 620.0, 440.0, 90.0, series[2])])
    times = rng.uniform(0, 1000, 3000)
    edge = check(cspice, second, -77, 399, times, files=[first])
    assert len(edge.info.segments) == 2  # of the file a, whose two read alike, and of b
    cspice.kclear()
    check(cspice, first, -77, 399, times, files=[second])


def test_segments_that_join_on_one_grid_stay_uniform(cspice, tmp_path, rng):
    segments = [
        (2, -77, 399, "J2000", a, a + 500.0, a, 100.0, made.coefficients(rng, 5, 3, terms))
        for a, terms in ((0.0, 7), (500.0, 5), (1000.0, 9))
    ]
    path = made.spk(tmp_path / "joined.bsp", segments)
    edge = check(cspice, path, -77, 399, rng.uniform(0, 1500, 500))
    assert edge.record_tables[0].first is None
    assert edge.record_tables[0].rows.shape == (15, 30)
    cropped = check(cspice, path, -77, 399, rng.uniform(433, 1120, 500), start=433.0, stop=1120.0)
    assert cropped.record_tables[0].rows.shape[0] == 8


def test_types_2_and_3_in_one_span(cspice, tmp_path, rng):
    segments = [
        (2, -77, 399, "J2000", 0.0, 300.0, 0.0, 100.0, made.coefficients(rng, 3, 3, 7)),
        (3, -77, 399, "J2000", 300.0, 700.0, 300.0, 200.0, made.coefficients(rng, 2, 6, 6)),
    ]
    check(cspice, made.spk(tmp_path / "mixed.bsp", segments), -77, 399, rng.uniform(0, 700, 500))


def test_axes_of_a_segment_are_honoured(cspice, tmp_path, rng):
    path = made.spk(tmp_path / "ecl.bsp", [(2, -77, 399, "ECLIPJ2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 7))])
    times = rng.uniform(0, 500, 200)
    check(cspice, path, -77, 399, times, bounds=(6, 10))
    cspice.unload(path)
    check(cspice, path, -77, 399, times, frame="ECLIPJ2000")


def test_axes_that_turn_are_refused(tmp_path, rng):
    path = made.spk(tmp_path / "iau.bsp", [(2, -77, 399, "IAU_EARTH", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 7))])
    with jf.spice.Kernels([path]) as kernels, pytest.raises(jf.FrameError, match="IAU_EARTH, which turns"):
        kernels.translation(target=-77, center=399)


def test_legs_on_one_grid_are_combined_and_others_summed(cspice, tmp_path, rng):
    segments = [
        (2, -77, -70, "J2000", 0.0, 600.0, 0.0, 100.0, made.coefficients(rng, 6, 3, 7)),
        (2, -78, -70, "J2000", 0.0, 600.0, 0.0, 100.0, made.coefficients(rng, 6, 3, 9)),
        (2, -70, 399, "J2000", 0.0, 600.0, 0.0, 60.0, made.coefficients(rng, 10, 3, 8)),
    ]
    path = made.spk(tmp_path / "tree.bsp", segments)
    times = rng.uniform(0, 600, 300)
    edge = check(cspice, path, -77, -78, times)
    assert [leg.terms for leg in edge.record_tables] == [9]
    assert len(check(cspice, path, 399, -78, times).record_tables) == 2


def test_a_center_that_changes_is_refused(tmp_path, rng):
    segments = [
        (2, -77, 399, "J2000", 0.0, 300.0, 0.0, 100.0, made.coefficients(rng, 3, 3, 7)),
        (2, -77, 301, "J2000", 300.0, 600.0, 300.0, 100.0, made.coefficients(rng, 3, 3, 7)),
    ]
    path = made.spk(tmp_path / "centers.bsp", segments)
    with jf.spice.Kernels([path]) as kernels:
        with pytest.raises(jf.FrameError, match="several bodies"):
            kernels.translation(target=-77, center=399)
        assert kernels.translation(target=-77, center=301, start=310.0, stop=600.0).info.relative_id == 301


def test_without_a_span_the_whole_way_is_covered(tmp_path, rng):
    way = [(-77, 399, 0.0, 900.0), (399, 3, 100.0, 800.0), (3, 0, 200.0, 1000.0), (301, 3, 50.0, 500.0), (-78, 301, 600.0, 900.0)]
    segments = [(2, b, c, "J2000", t, u, t, 50.0, made.coefficients(rng, int((u - t) / 50), 3, 4)) for b, c, t, u in way]
    with jf.spice.Kernels(made.spk(tmp_path / "way.bsp", segments)) as kernels:
        for target, center, span in ((-77, 0, ("200", "800")), (-77, 399, ("0", "900")), (301, -77, ("100", "500"))):
            info = kernels.translation(target=target, center=center).info
            assert (info.start, info.stop) == span
        assert kernels.tree(bodies=[-77]).parent("GALILEO ORBITER") == "EARTH"
        with pytest.raises(jf.FrameError, match=r"no span in common[\s\S]*MOON: [\s\S]*ET 50.0 .. 500.0"):
            kernels.translation(target=-78, center=3)


def test_gaps_are_named(tmp_path, rng):
    segments = [(2, -77, 399, "J2000", a, a + 300.0, a, 100.0, made.coefficients(rng, 3, 3, 7)) for a in (0.0, 400.0)]
    path = made.spk(tmp_path / "gap.bsp", segments)
    with (
        jf.spice.Kernels([path]) as kernels,
        pytest.raises(jf.FrameError, match=r"missing: 2000-01-01T12:05:00.000 .. 2000-01-01T12:06:40"),
    ):
        kernels.translation(target=-77, center=399)


def test_a_long_span_of_short_records_finds_each_in_float64(cspice, tmp_path, rng):
    n = 4000
    segments = [(2, -77, 399, "J2000", 8e8, 8e8 + n * 86.4, 8e8, 86.4, made.coefficients(rng, n, 3, 4))]
    path = made.spk(tmp_path / "long.bsp", segments)
    check(cspice, path, -77, 399, 8e8 + rng.integers(0, int(n * 86.4), 1000).astype(float), bounds=(4, 16))


def test_a_sliver_of_a_record_costs_comparisons_not_cells(cspice, tmp_path, rng):
    segments = [(2, -77, 399, "J2000", 0.0, 1e6, 0.0, 1e4, made.coefficients(rng, 100, 3, 6))]
    segments += [(2, -77, 399, "J2000", 5000.0, 5000.0001, 5000.0, 50.0, made.coefficients(rng, 1, 3, 4))]
    segments += [(2, -77, 399, "J2000", 5000.001, 5000.002, 5000.0, 50.0, made.coefficients(rng, 1, 3, 4))]
    path = made.spk(tmp_path / "sliver.bsp", segments)
    edge = check(cspice, path, -77, 399, np.concatenate([rng.uniform(0, 1e6, 1000), rng.uniform(4999.999, 5000.003, 200)]))
    (leg,) = edge.record_tables
    assert leg.first.shape[0] < 2000
    assert leg.compares >= 4


def test_meta_kernel(tmp_path, rng, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made.spk(tmp_path / "a.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 7))])
    meta = "KPL/MK\n\\begindata\nKERNELS_TO_LOAD = ( {} )\n\\begintext\n"
    (tmp_path / "all.tm").write_text(meta.format("'a.bsp'"))
    with jf.spice.Kernels("all.tm") as kernels:
        edge = kernels.translation(target=-77, center=399)
    assert [source.name for source in edge.info.sources] == ["a.bsp", "all.tm"]
    (tmp_path / "some.tm").write_text(meta.format("'a.bsp', 'b.bsp'"))
    with pytest.raises(jf.FrameError, match=r"some\.tm cannot be loaded: .*b\.bsp"):
        jf.spice.Kernels("some.tm")
