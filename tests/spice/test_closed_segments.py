"""Segments closed at both ends: of two that meet, the one that wins keeps the instant at which they do, as in SPICE."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.numerics import host_quaternions
from tests.spice import made, orbits

ORIGIN = 820497600.0
ORDERS = {"later first": (300.0, 0.0), "earlier first": (0.0, 300.0)}
EDGES = np.array([299.0, 299.999, 300.0, 300.001, 301.0])


def tolerances(dtype, size):
    return (8 if dtype == np.float64 else 16) * np.spacing(dtype.type(size))


@pytest.mark.parametrize("origin", [0.0, ORIGIN])
@pytest.mark.parametrize("order", ORDERS)
def test_positions(cspice, tmp_path, rng, dtype, origin, order):
    segments = [
        (2, -77, 399, "J2000", origin + a, origin + a + 300.0, origin + a, 100.0, made.coefficients(rng, 3, 3, 6)) for a in ORDERS[order]
    ]
    path = made.spk(tmp_path / "two.bsp", segments)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399)
    cspice.furnsh(path)
    times = origin + EDGES
    epochs = jf.Epoch.from_et(times)
    reference = made.states(-77, 399, times)[:, :3]
    jump = np.linalg.norm(reference[2] - reference[3 if order == "earlier first" else 1])
    assert jump < 1e4 < np.linalg.norm(reference[1] - reference[3])
    for table in (edge, jf.spice.merge(jf.spice.crop(edge, stop=origin + 450.0), jf.spice.crop(edge, start=origin + 450.0))):
        found = np.asarray(table.evaluate(epochs, 0)[0], float)
        assert np.abs(found - reference).max() <= tolerances(dtype, np.abs(reference).max())
    assert (edge.record_tables[0].first is None) == (order == "earlier first")  # the usual order stays on its even grid
    if dtype == np.float64:  # two parts that are not rounded to each other are the same instant
        split = jf.Epoch(np.full(3, origin), EDGES[::2])
        assert np.abs(np.asarray(edge.evaluate(split, 0)[0]) - reference[::2]).max() <= tolerances(dtype, np.abs(reference).max())


def test_a_segment_within_another(cspice, tmp_path, rng, dtype):
    segments = [
        (2, -77, 399, "J2000", a, b, a, 100.0, made.coefficients(rng, int((b - a) / 100), 3, 6)) for a, b in ((0.0, 600.0), (200.0, 400.0))
    ]
    path = made.spk(tmp_path / "within.bsp", segments)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399)
    cspice.furnsh(path)
    times = np.array([199.0, 200.0, 201.0, 399.0, 400.0, 400.001, 401.0])
    reference = made.states(-77, 399, times)[:, :3]
    found = np.asarray(edge.evaluate(times, 0)[0], float)
    assert np.abs(found - reference).max() <= tolerances(dtype, np.abs(reference).max())


def test_saved_tables_keep_the_instant(tmp_path, rng):
    segments = [(2, -77, 399, "J2000", a, a + 300.0, a, 100.0, made.coefficients(rng, 3, 3, 6)) for a in (300.0, 0.0)]
    with jf.spice.Kernels(made.spk(tmp_path / "two.bsp", segments)) as kernels:
        edge = kernels.translation(target=-77, center=399)
    jf.spice.save(tmp_path / "two.npz", {"craft": edge})
    loaded = jf.spice.load(tmp_path / "two.npz")["craft"]
    np.testing.assert_array_equal(loaded.evaluate(EDGES)[0], edge.evaluate(EDGES)[0])


@pytest.mark.float64
def test_fitted_tables(cspice, tmp_path, rng):
    segments = [(2, -77, 399, "J2000", a, a + 300.0, a, 100.0, made.coefficients(rng, 3, 3, 6)) for a in (300.0, 0.0)]
    path = made.spk(tmp_path / "two.bsp", segments)
    with jf.spice.Kernels(path) as kernels:
        for layout in ("uniform", "dyadic"):
            edge = kernels.translation(target=-77, center=399, tolerance=jf.spice.Tolerance(position=1e-3), layout=layout)
            assert jf.spice.compare(kernels, edge, EDGES).value <= 1e-3


@pytest.mark.float64
@pytest.mark.parametrize("order", ORDERS)
def test_binary_pck(cspice, tmp_path, rng, order):
    segments = [
        (3000, "ECLIPJ2000", ORIGIN + a, ORIGIN + a + 300.0, ORIGIN + a, 100.0, made.coefficients(rng, 3, 3, 6, 0.3)) for a in ORDERS[order]
    ]
    path = made.pck(tmp_path / "two.bpc", segments)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.orientation(frame="ITRF93")
        worst = jf.spice.compare(kernels, edge, ORIGIN + EDGES)
    assert worst.value < 1e-13


@pytest.mark.float64
@pytest.mark.parametrize("order", ORDERS)
def test_attitudes(cspice, tmp_path, order):
    def other(t):
        q, w, _ = orbits.slew(t)
        turn = np.broadcast_to(host_quaternions.from_rotation_vector(np.array([0.3, 0.2, 0.1])), q.shape)
        return host_quaternions.multiply(turn, q), host_quaternions.rotate(turn, w)

    pieces = []
    for start in ORDERS[order]:
        knots = start + np.arange(0, 301, 20.0)
        pieces.append((knots, *((orbits.slew(knots)[:2]) if start else other(knots)), None))
    path = orbits.pointing(tmp_path / "two.bc", 3, *pieces[0], append=pieces[1:])
    with jf.spice.Kernels([*orbits.clock(tmp_path, 0.0), path]) as kernels:
        edge = kernels.orientation(frame="TESTCRAFT", ck="spice")
        worst = jf.spice.compare(kernels, edge, EDGES)
        assert edge.record_tables[0].rows.shape[0] == 30
    assert worst.value < 1e-14
    assert worst.rate < 1e-15
