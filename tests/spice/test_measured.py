"""What reports state as measured, for every kind of table; ``compare`` with accelerations."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import TableError
from jaxframes.spice.extraction import read_records
from tests.spice import made, orbits
from tests.spice.test_iau import PCK

pytestmark = pytest.mark.float64
SPAN = {"start": "2026-01-01", "stop": "2027-01-01"}


def measured(edge, name):
    return next(value for key, value in edge.info.measured if key.startswith(name))


def seconds(rng, count=300):
    return rng.integers(820497600 + 86400, 852033600 - 86400, count).astype(float)


@pytest.mark.parametrize(
    ("options", "position", "velocity"),
    [
        ({"target": "MOON", "center": "EARTH"}, 2e-7, 1e-12),
        ({"target": "MOON", "center": "SSB"}, 1e-4, 2e-11),
        ({"target": "MOON", "center": "SSB", "compose": True}, 2e-4, 1e-10),
    ],
    ids=["one leg", "two legs", "composed"],
)
def test_positions(kernels, rng, options, position, velocity):
    edge = kernels.translation(**options, **SPAN)
    own = jf.spice.compare(kernels, edge, seconds(rng))
    for name, found, bound in (("position error, m", own.value, position), ("velocity error, m/s", own.rate, velocity)):
        assert 0 < measured(edge, name) <= bound
        assert found <= 2 * measured(edge, name)
        assert f"measured: {name}: " in edge.report()
    assert 0 < measured(edge, "acceleration error, m/s2 (differences of CSPICE's velocities") < 1e-10
    assert own.acceleration < 1e-10
    assert own.largest_acceleration == pytest.approx(np.linalg.norm(edge.evaluate(seconds(rng))[2], axis=1).max(), rel=0.2)
    assert "largest jumps between records" in edge.report()


def test_what_a_table_gets_wrong_is_measured(kernels, rng, monkeypatch):
    """Numbers spoiled on the way from the kernel show in the report: it is measured, not copied."""
    original = read_records.read_chebyshev

    def spoiled(pool, piece):
        records = original(pool, piece)
        records.coefficients[:, 0, 3] += 1e-3  # a metre in x, of the third degree
        return records

    monkeypatch.setattr(read_records, "read_chebyshev", spoiled)
    edge = kernels.translation(target="MOON", center="EARTH BARYCENTER", **SPAN)
    assert measured(edge, "position error") == pytest.approx(1.0, rel=0.05)
    assert measured(edge, "velocity error") == pytest.approx(9 / 172800, rel=0.3)


def test_velocities_that_are_not_the_derivatives(cspice, tmp_path):
    path = orbits.nodes(tmp_path / "9.bsp", 9, orbits.LEO, np.arange(0.0, 6001, 60.0), 3)
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399)
    assert measured(edge, "position error") < 1e-6
    assert measured(edge, "velocity error") > 0.01
    assert measured(edge, "acceleration error") > 1e-3


def test_binary_pck(kernels, itrf93, rng):
    assert 0 < measured(itrf93, "angle error, rad") < 1e-12
    assert measured(itrf93, "rate error, rad/s") < 1e-18
    assert measured(itrf93, "angular acceleration error, rad/s2 (differences of CSPICE's rates") < 1e-18
    worst = jf.spice.compare(kernels, itrf93, seconds(rng))
    assert worst.acceleration < 2e-16  # some differences reach over the edges of records, where the kernel's own rates jump by 1e-13
    assert worst.step == 1024.0


@pytest.mark.parametrize("frame", ["IAU_MARS", "IAU_MOON", "IAU_JUPITER"])
def test_text_pck(paths, frame, rng):
    with jf.spice.Kernels([*paths, PCK]) as kernels:
        edge = kernels.orientation(frame=frame, relative_to="ECLIPJ2000")
        worst = jf.spice.compare(kernels, edge, seconds(rng))
    assert 0 < measured(edge, "angle error, rad, 1950 .. 2050") < 1e-10
    assert measured(edge, "rate error, rad/s") < 1e-17
    assert worst.value < 1e-10
    assert worst.acceleration < 1e-19
    for line in ("coverage: every instant", "measured: angle error, rad, 1950 .. 2050: ", "measured: angular acceleration error"):
        assert line in edge.report()


def test_knots(tmp_path, rng):
    at = np.concatenate([np.arange(0, 601, 20.0), np.arange(700, 901, 20.0)])
    path = orbits.pointing(tmp_path / "3.bc", 3, at, *orbits.slew(at)[:2], starts=[0.0, 700.0])
    with jf.spice.Kernels([*orbits.clock(tmp_path, 0.0), path]) as kernels:
        exact, smooth = (kernels.orientation(frame="TESTCRAFT", ck=mode) for mode in ("spice", "smooth"))
        worst = jf.spice.compare(kernels, smooth, np.arange(10.0, 590.0, 7.0))
    assert 0 < measured(exact, "angle error, rad") < 1e-14
    assert measured(exact, "rate error, rad/s") < 1e-15
    assert measured(exact, "angular acceleration error") < 1e-12
    # The smooth attitude is nearer to the truth than SPICE's chord, by what its report says.
    assert measured(smooth, "angle error, rad") == pytest.approx(worst.value, rel=0.3)
    assert 1e-6 < worst.value < 2e-5


def test_attitudes_without_rates_and_at_instants(tmp_path):
    at = np.arange(0, 101, 10.0)
    clock = orbits.clock(tmp_path, 0.0)
    bare = orbits.pointing(tmp_path / "bare.bc", 3, at, *orbits.slew(at)[:2], rates=False)
    points = orbits.pointing(tmp_path / "1.bc", 1, at, *orbits.slew(at)[:2])
    with jf.spice.Kernels([*clock, bare]) as kernels:
        edge = kernels.orientation(frame="TESTCRAFT", ck="spice")
    assert measured(edge, "angle error, rad") < 1e-14
    assert not any(name.startswith("rate error") for name, _ in edge.info.measured)  # CSPICE has none
    with jf.spice.Kernels([*clock, points]) as kernels:
        edge = kernels.orientation(frame="TESTCRAFT", bridge=15.0)
    assert measured(edge, "angle error, rad") < 1e-14


def test_measuring_costs_some_hundred_calls(kernels, monkeypatch):
    asked = []
    original = type(kernels._pool.process).call

    def call(self, method, *arguments, doing):
        if method in ("states", "attitudes_or_nan", "rotations"):
            asked.append(len(arguments[3 if method == "states" else 2]))
        return original(self, method, *arguments, doing=doing)

    monkeypatch.setattr(type(kernels._pool.process), "call", call)
    kernels.translation(target="MOON", center="EARTH")
    assert 200 <= sum(asked) < 600


def test_what_cannot_be_compared(kernels, moon):
    with pytest.raises(TableError, match="there are no epochs to compare at"):
        jf.spice.compare(kernels, moon, [])
    with pytest.raises(TableError, match="no table"):
        jf.spice.compare(kernels, jf.edges.Fixed(), [0.0])


def test_no_room_for_differences_is_no_error(tmp_path, rng):
    path = made.spk(tmp_path / "one.bsp", [(2, -77, 399, "J2000", 0.0, 100.0, 0.0, 100.0, made.coefficients(rng, 1, 3, 5))])
    with jf.spice.Kernels(path) as kernels:
        edge = kernels.translation(target=-77, center=399)
        assert np.isnan(jf.spice.compare(kernels, edge, [0.0, 100.0]).acceleration)
        assert jf.spice.compare(kernels, edge, [50.0]).acceleration < 1e-5
