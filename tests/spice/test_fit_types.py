"""Fits of SPK types that have no exact conversion, and of those whose velocities are not the derivatives of their positions."""

import itertools

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import ToleranceError
from tests.spice import orbits

pytestmark = pytest.mark.float64
T = jf.spice.Tolerance
DAY = 86400.0
GM, J2, RADIUS = orbits.MU / 1e9, 1.08263e-3, 6378.137
TLE = (
    "1 25544U 98067A   26060.50000000  .00016717  00000-0  10270-3 0  9005",
    "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.49815365 00000",
)
GEOPHYSICAL = [1.082616e-3, -2.53881e-6, -1.65597e-6, 7.43669161e-2, 120.0, 78.0, 6378.135, 1.0]


def measured(edge, name):
    return next(value for key, value in edge.info.measured if key.startswith(name))


def conic(spice, path):
    """Type 15: a conic whose plane and apsides precess; the velocity leaves the precession out."""
    (position,), (velocity,), _ = (x / 1e3 for x in orbits.two_body((7.2e6, 0.02, 1.1), [0.0]))
    momentum = np.cross(position, velocity)
    eccentric = np.cross(velocity, momentum) / GM - position / np.linalg.norm(position)
    size = float(np.linalg.norm(eccentric))
    plane, apsis = momentum / np.linalg.norm(momentum), eccentric / size
    handle = spice.spkopn(path, "test", 0)
    shape = (float(momentum @ momentum) / GM, size)
    spice.spkw15(handle, -77, 399, "J2000", 0.0, DAY, "FIFTEEN", 0.0, plane, apsis, *shape, 0.0, [0.0, 0.0, 1.0], GM, J2, RADIUS)
    spice.spkcls(handle)


def equinoctial(spice, path):
    """Type 17."""
    handle = spice.spkopn(path, "test", 0)
    elements = [7200.0, 0.01, 0.02, 0.5, 0.1, 0.2, 1e-3, 1e-7, 2e-7]
    spice.spkw17(handle, -77, 399, "J2000", 0.0, DAY, "SEVENTEEN", 0.0, elements, 0.3, 1.2)
    spice.spkcls(handle)


def lagrange(spice, path):
    """Type 18, subtype 1: positions and velocities interpolated each by themselves."""
    times = np.arange(0.0, DAY + 1, 120.0)
    position, velocity, _ = orbits.two_body(orbits.LEO, times)
    handle = spice.spkopn(path, "test", 0)
    packets = np.concatenate([position, velocity], 1) / 1e3
    spice.spkw18(handle, 1, -77, 399, "J2000", 0.0, times[-1], "EIGHTEEN", 7, packets, times)
    spice.spkcls(handle)


def unequal(spice, path):
    """Type 14: Chebyshev records of unequal length, positions and velocities with series of their own."""
    edges = np.array([0.0, 1500.0, 2400.0, 4800.0])
    packets = []
    for a, b in itertools.pairwise(edges):
        middle, half = (a + b) / 2, (b - a) / 2
        at = middle + half * np.cos(np.pi * (np.arange(12) + 0.5) / 12)
        position, velocity, _ = (x / 1e3 for x in orbits.two_body(orbits.LEO, at))
        basis = np.polynomial.chebyshev.chebvander((at - middle) / half, 11)
        packets.append([middle, half, *np.linalg.solve(basis, np.concatenate([position, velocity], 1)).T.reshape(-1)])
    handle = spice.spkopn(path, "test", 0)
    spice.spk14b(handle, "FOURTEEN", -77, 399, "J2000", 0.0, edges[-1], 11)
    spice.spk14a(handle, len(packets), np.concatenate(packets), edges[:-1])
    spice.spk14e(handle)
    spice.spkcls(handle)


def two_line(spice, path):
    """Type 10: two-line elements."""
    leap = str(jf.spice.find_kernels("leapseconds")[0])
    spice.furnsh(leap)
    epoch, elements = spice.getelm(1957, list(TLE))
    handle = spice.spkopn(path, "test", 0)
    spice.spkw10(handle, -77, 399, "J2000", epoch - 7200, epoch + 7200, "TEN", GEOPHYSICAL, 1, elements, [epoch])
    spice.spkcls(handle)
    spice.unload(leap)


@pytest.mark.parametrize("write", [conic, equinoctial, lagrange, unequal, two_line], ids=lambda f: f.__name__)
@pytest.mark.parametrize("bound", [1.0, 1e-3])
def test_positions_within_a_metre_and_a_millimetre(cspice, tmp_path, rng, write, bound):
    path = str(tmp_path / "made.bsp")
    write(cspice, path)
    with jf.spice.Kernels([path, *jf.spice.find_kernels("leapseconds")]) as kernels:
        edge = kernels.translation(target=-77, center=399, tolerance=T(position=bound))
        start, stop = float(edge.info.start), float(edge.info.stop)
        worst = jf.spice.compare(kernels, edge, np.floor(rng.uniform(start, stop, 1000) * 64) / 64)
    assert worst.value <= bound
    assert worst.rate <= 1.5 * measured(edge, "velocity error")
    assert edge.record_tables[0].bytes < 400_000


@pytest.mark.parametrize(("write", "apart"), [(conic, 4.33), (lagrange, 0.46)], ids=["conic", "lagrange"])
def test_velocities_that_are_not_the_derivatives_are_reported(cspice, tmp_path, rng, write, apart):
    path = str(tmp_path / "made.bsp")
    write(cspice, path)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399, tolerance=T(position=1e-3))
        # Independently: differences of CSPICE's own positions against its velocities.
        at = np.floor(np.concatenate([rng.uniform(1, DAY - 1, 3000), rng.uniform(1, 600, 1000), rng.uniform(DAY - 600, DAY - 1, 1000)]))
        h = 0.125
        before, after = (kernels.states(target=-77, center=399, times=at + d)[0] for d in (-h, h))
        own = np.linalg.norm((after - before) / (2 * h) - kernels.states(target=-77, center=399, times=at)[1], axis=1).max()
        with pytest.raises(ToleranceError) as caught:
            kernels.translation(target=-77, center=399, tolerance=T(position=1e-3, velocity=1e-6))
    assert own == pytest.approx(apart, rel=0.15)
    assert measured(edge, "velocity error") == pytest.approx(own, rel=0.15)
    assert "fit of CSPICE's positions" in edge.report()
    assert "positions are fitted, not velocities, which do not lead to them: CSPICE's differ by up to" in edge.report()
    for part in ("CSPICE's velocities are not the derivatives of its positions here", "fitted to the positions, a table reaches", "m/s"):
        assert part in str(caught.value)


def test_coarse_nodes_of_type_9(tmp_path, rng):
    path = orbits.nodes(tmp_path / "9.bsp", 9, orbits.LEO, np.arange(0.0, DAY + 1, 60.0), 3)
    at = np.floor(rng.uniform(0, DAY, 2000) * 64) / 64
    with jf.spice.Kernels(path) as kernels:
        for bound in (1.0, 1e-6):
            edge = kernels.translation(target=-77, center=399, tolerance=T(position=bound))
            assert jf.spice.compare(kernels, edge, at).value <= bound
        exact = kernels.translation(target=-77, center=399)
        times = at[:300]
        assert np.abs(np.asarray(edge.evaluate(times, 0)[0]) - np.asarray(exact.evaluate(times, 0)[0])).max() < 1e-6
        with pytest.raises(ToleranceError, match=r"no table meets 1 m and 0.001 m/s. CSPICE's velocities are not the derivatives"):
            kernels.translation(target=-77, center=399, tolerance=T(position=1.0, velocity=1e-3))
        # Where the velocities go astray by less than is allowed, they are met.
        both = kernels.translation(target=-77, center=399, tolerance=T(position=100.0, velocity=1e-3))
        worst = jf.spice.compare(kernels, both, at)
        assert worst.value <= 100.0
        assert worst.rate <= 1e-3
        assert "fit of CSPICE's velocities" in both.report()


@pytest.mark.parametrize("write", [conic, lagrange], ids=["conic", "lagrange"])
def test_positions_stay_with_velocities_that_alone_are_bounded(cspice, tmp_path, rng, write):
    path = str(tmp_path / "made.bsp")
    write(cspice, path)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399, tolerance=T(velocity=1.0))
        at = np.floor(rng.uniform(0, DAY, 1000))
        worst = jf.spice.compare(kernels, edge, at)
    assert worst.rate <= 1.0
    assert worst.value <= 1.05 * 1.0 * worst.largest_value / worst.largest_rate
    assert "positions are held within" in edge.report()


def test_a_size_alone_gives_the_better_of_positions_and_velocities(cspice, tmp_path, rng):
    path = str(tmp_path / "15.bsp")
    conic(cspice, path)
    with jf.spice.Kernels(path) as kernels:
        for layout in ("uniform", "dyadic"):
            edge = kernels.translation(target=-77, center=399, size=40_000, layout=layout)
            assert jf.spice.compare(kernels, edge, np.floor(rng.uniform(0, DAY, 500))).value < 1e-5
            assert edge.record_tables[0].bytes <= 40_000
