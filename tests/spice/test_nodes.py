"""SPK types 8, 9, 12, 13 and 20 from orbits whose accelerations are known, against live CSPICE and the truth."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice import made, orbits

pytestmark = pytest.mark.float64
ORIGIN = 820497600.0


def lengths(vectors):
    return np.linalg.norm(vectors, axis=1).max()


def table_of(cspice, path, times):
    """The table of a kernel, and its differences from CSPICE in position and velocity."""
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399)
    cspice.furnsh(path)
    reference = made.states(-77, 399, times)
    position, velocity, acceleration = (np.asarray(x) for x in edge.evaluate(times))
    return edge, lengths(position - reference[:, :3]), lengths(velocity - reference[:, 3:]), acceleration


def epochs(rng, start, stop):
    """Random ones, and more near both ends, where the windows lie to one side."""
    return np.concatenate([rng.uniform(start, stop, 600), start + rng.uniform(0, 400, 150), stop - rng.uniform(0, 400, 150), [start, stop]])


@pytest.mark.parametrize("orbit", [orbits.LEO, orbits.MOLNIYA], ids=["leo", "molniya"])
@pytest.mark.parametrize(("kind", "degree"), [(13, 7), (13, 5), (9, 7), (9, 8), (8, 7), (8, 8), (12, 7), (12, 9)])
def test_nodes_become_records_exactly(cspice, tmp_path, rng, kind, degree, orbit):
    times = np.arange(0, 7200.1, 60.0)
    start, stop = ORIGIN + 17, ORIGIN + 7200 - 33  # the segment starts and ends between nodes
    path = orbits.nodes(tmp_path / "n.bsp", kind, orbit, times, degree, origin=ORIGIN, begin=start, end=stop)
    at = epochs(rng, start, stop)
    edge, position, velocity, acceleration = table_of(cspice, path, at)
    assert position < 5e-8
    window = degree + 1 if kind in (8, 9) else (degree + 1) // 2
    assert edge.record_tables[0].terms == degree + 1
    assert (edge.record_tables[0].first is None) == (window % 2 == 0)  # between nodes: uniform; half way between them: not at the ends
    if kind in (12, 13):
        assert velocity < 1e-9
        truth = orbits.two_body(orbit, at - ORIGIN)[2]
        if degree == 7:
            assert lengths(acceleration - truth) < {orbits.LEO: 2e-9, orbits.MOLNIYA: 1e-6}[orbit]
    else:
        # SPICE interpolates velocities by themselves; ours are derivatives of positions, and the report says how far they are apart.
        stated = float(edge.info.notes[0].split("up to ")[1].split(" m/s")[0])
        assert 1e-9 < velocity <= stated * 1.05
        assert "SPICE's own velocities differ" in edge.report()


@pytest.mark.parametrize(("kind", "degree", "bounds"), [(13, 7, (3e-7, 3e-8)), (9, 8, (3e-7, np.inf))])
def test_irregular_nodes_over_directories(cspice, tmp_path, rng, kind, degree, bounds):
    times = np.cumsum(rng.integers(30 * 64, 75 * 64, 350)) / 64
    path = orbits.nodes(tmp_path / "n.bsp", kind, orbits.LEO, times, degree, origin=ORIGIN)
    edge, position, velocity, _ = table_of(cspice, path, epochs(rng, ORIGIN + times[0], ORIGIN + times[-1]))
    assert position < bounds[0]
    assert velocity < bounds[1]
    assert edge.record_tables[0].first is not None
    assert edge.record_tables[0].compares <= 2


def test_part_of_a_segment_reads_only_what_serves_it(cspice, tmp_path, rng):
    path = orbits.nodes(tmp_path / "n.bsp", 13, orbits.LEO, np.arange(0, 7200.1, 60.0), 7)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399, start=1000.0, stop=1500.0)
    assert edge.record_tables[0].rows.shape[0] == 9
    cspice.furnsh(path)
    times = rng.uniform(1000, 1500, 100)
    assert lengths(np.asarray(edge.evaluate(times, 0)[0]) - made.states(-77, 399, times)[:, :3]) < 2e-8


def test_coarse_nodes_say_how_they_jump(cspice, tmp_path):
    path = orbits.nodes(tmp_path / "n.bsp", 13, orbits.LEO, np.arange(0, 7200.1, 180.0), 7)
    at = np.arange(1000.0, 6200.0, 7.3)
    edge, _, _, acceleration = table_of(cspice, path, at)
    worst = lengths(acceleration - orbits.two_body(orbits.LEO, at)[2])
    assert 5e-8 < worst < 3e-7  # poor at the source
    jump = float(edge.report().split("largest jumps between records:")[1].split(",")[2].split("m/s2")[0])
    assert 0.1 * worst < jump < 4 * worst


def test_velocities_as_series_type_20(cspice, tmp_path, rng):
    terms, count, days = 9, 6, 0.25
    cdata = rng.normal(size=(count, 3, terms)) / 4.0 ** np.arange(terms)
    cdata[:, :, -1] = rng.normal(size=(count, 3)) * 1e4  # positions at the middles
    path = str(tmp_path / "20.bsp")
    handle = cspice.spkopn(path, "test", 0)
    first = (2451545.0 + 9000 - 2451545.0) * 86400
    cspice.spkw20(
        handle,
        -77,
        399,
        "J2000",
        first,
        first + count * days * 86400,
        "VELOCITIES",
        days,
        count,
        terms - 2,
        cdata.reshape(-1),
        2.0,
        0.5,
        2460545.0,
        0.0,
    )
    cspice.spkcls(handle)
    at = first + np.concatenate([rng.uniform(0, count * days * 86400, 300), [0.0, count * days * 86400]])
    edge, position, velocity, _ = table_of(cspice, path, at)
    assert edge.record_tables[0].rows.shape == (count, 3 * terms + 3)
    scale = np.abs(made.states(-77, 399, at)).max(0)
    assert position <= 8 * np.spacing(scale[:3].max())
    assert velocity <= 8 * np.spacing(scale[3:].max())


def test_chains_composed_on_one_grid(kernels, cspice, rng):
    whole = kernels.translation(target="MOON", center="SSB", start="2026-01-01", stop="2028-01-01", compose=True)
    assert len(whole.record_tables) == 1
    assert whole.record_tables[0].first is None
    assert whole.record_tables[0].rows.nbytes < 65_000
    assert "composed in double-double" in whole.report()
    times = rng.integers(820497600, 883569600, 600).astype(float)
    reference = np.array([cspice.spkez(301, t, "J2000", "NONE", 0)[0] for t in times]) * 1e3
    position, velocity, acceleration = (np.asarray(x) for x in whole.evaluate(times))
    assert lengths(position - reference[:, :3]) <= 2e-4
    assert lengths(velocity - reference[:, 3:]) <= 1e-10
    exact = kernels.translation(target="MOON", center="SSB", start="2026-01-01", stop="2028-01-01").evaluate(times)[2]
    assert lengths(acceleration - np.asarray(exact)) <= 1e-13 * lengths(acceleration)


def test_unequal_records_composed(cspice, tmp_path, rng):
    segments = [
        (2, -77, -70, "J2000", 0.0, 700.0, 0.0, 70.0, made.coefficients(rng, 10, 3, 7)),
        (2, -70, 399, "J2000", 0.0, 300.0, 0.0, 60.0, made.coefficients(rng, 5, 3, 9)),
        (2, -70, 399, "J2000", 300.0, 700.0, 300.0, 133.0, made.coefficients(rng, 4, 3, 5)),
    ]
    path = made.spk(tmp_path / "tree.bsp", segments)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399, start=13.0, stop=690.0, compose=True)
    cspice.furnsh(path)
    times = rng.uniform(13, 690, 500)
    reference = made.states(-77, 399, times)
    position, velocity = (np.asarray(x) for x in edge.evaluate(times, 1))
    assert np.abs(position - reference[:, :3]).max() <= 8 * np.spacing(np.abs(reference[:, :3]).max())
    assert np.abs(velocity - reference[:, 3:]).max() <= 16 * np.spacing(np.abs(reference[:, 3:]).max())


@pytest.mark.parametrize(("word", "value"), [(-1, 1e9), (-1, 3.5), (-2, -4.0), (-5, np.nan), (-20, 1e9), (5, np.inf)])
def test_damaged_nodes(tmp_path, word, value):
    path = orbits.nodes(tmp_path / "n.bsp", 13, orbits.LEO, np.arange(0, 1800.1, 60.0), 7)
    words = np.fromfile(path)
    at = 128 * 3
    size = 7 * 31 + 2
    assert words[at + size - 1] == 31
    words[at + (word if word >= 0 else size + word)] = value
    words.tofile(path)
    with jf.spice.Kernels(path) as kernels, pytest.raises(errors.BadKernelError, match="damaged or cut off"):
        kernels.translation(target=-77, center=399)
