"""Trees of what has no exact table: spacecraft of SPK type 5, attitudes of CK type 5, centres that change; against live CSPICE."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import NoPathError, ToleranceError
from tests.spice import made, orbits

ORIGIN = 820497600.0
T = jf.spice.Tolerance
FIT = T(position=1.0, velocity=1e-3, angle=1e-6, rate=1e-6)
SPAN = {"start": ORIGIN, "stop": ORIGIN + 2900.0}


@pytest.fixture(scope="module")
def files(paths, tmp_path_factory):
    """Kernels of a spacecraft: states of type 5, attitudes of type 5."""
    import spiceypy

    folder = tmp_path_factory.mktemp("craft")
    times = np.arange(0, 3001.0, 100.0)
    position, velocity, _ = orbits.two_body(orbits.LEO, times)
    spk = str(folder / "5.bsp")
    handle = spiceypy.spkopn(spk, "test", 0)
    states = np.concatenate([position, velocity], 1) / 1e3
    spiceypy.spkw05(handle, -77, 399, "J2000", ORIGIN, ORIGIN + 3000, "FIVE", orbits.MU / 1e9, len(times), states, ORIGIN + times)
    spiceypy.spkcls(handle)
    times = np.arange(0, 3000.0, 10.0)
    ticks, spice = times * 65536, orbits.slew(times)[0] * np.array([1.0, -1, -1, -1])
    ck = str(folder / "5.bc")
    handle = spiceypy.ckopn(ck, "test", 0)
    spiceypy.ckw05(handle, 1, 7, ticks[0], ticks[-1], -77000, "J2000", True, "FIVE", ticks, spice, 1 / 65536, 1, ticks[:1])
    spiceypy.ckcls(handle)
    return [*paths, *orbits.clock(folder, ORIGIN), spk, ck]


def seen(cspice, files, of, frame, observer, times):
    for file in files:
        cspice.furnsh(file)
    return np.array([cspice.spkezr(of, t, frame, "NONE", observer)[0] for t in times]) * 1e3


@pytest.mark.float64
def test_a_tree_of_a_spacecraft_that_has_to_be_fitted(cspice, files):
    with jf.spice.Kernels(files) as kernels:
        tree = kernels.tree(bodies=[-77, "MOON"], frames=["TESTCRAFT"], tolerance=FIT, **SPAN)
        exact = kernels.translation(target="MOON", center="EARTH BARYCENTER", **SPAN)
    craft = tree.parent("TESTCRAFT")
    assert tree.parent(craft) == "EARTH"
    assert tree.edge(craft).info.method == "uniform fit of CSPICE's velocities"
    assert tree.edge("TESTCRAFT").info.kind == "cayley"
    np.testing.assert_array_equal(tree.edge("MOON").record_tables[0].rows, exact.record_tables[0].rows)  # what is exact stays so
    times = ORIGIN + np.array([1.0, 777.0, 2890.0])
    reference = seen(cspice, files, "MOON", "TESTCRAFT", "-77", times)
    for t, wanted in zip(times, reference, strict=True):
        motion = tree.motion(tree.state(time=t), of="MOON", relative_to="TESTCRAFT")
        distance, speed = (np.linalg.norm(part) for part in (wanted[:3], wanted[3:]))
        assert np.linalg.norm(motion.transform.translation - wanted[:3]) <= 1.0 + 1e-6 * distance
        assert np.linalg.norm(motion.velocity.linear - wanted[3:]) <= 1e-3 + 1e-6 * distance + 1e-6 * speed


def test_a_frame_placed_by_id_is_fitted_too(files):
    builder = jf.TreeBuilder(root="SSB")
    with jf.spice.Kernels(files) as kernels:
        assert builder.add_spice(kernels, body=-77, frame="TESTCRAFT", tolerance=FIT, **SPAN) == "TESTCRAFT"
    assert "TESTCRAFT" in builder.build().names


def test_what_the_tolerance_leaves_out_is_named(files):
    with jf.spice.Kernels(files) as kernels:
        with pytest.raises(
            ToleranceError, match=r"type 5[\s\S]*It has to be fitted, and .*says nothing about a translation: give position="
        ):
            kernels.tree(bodies=[-77], tolerance=T(angle=1e-6, rate=1e-6), **SPAN)
        with pytest.raises(
            ToleranceError, match=r"CK type 5[\s\S]*It has to be fitted, and .*says nothing about an orientation: give angle="
        ):
            kernels.tree(frames=["TESTCRAFT"], tolerance=T(position=1.0), **SPAN)
        with pytest.raises(NoPathError, match="give tolerance="):
            kernels.tree(bodies=[-77], **SPAN)


@pytest.mark.float64
def test_a_spacecraft_that_changes_its_centre(cspice, paths, tmp_path, rng):
    segments = [
        (2, -77, 399, "J2000", ORIGIN, ORIGIN + 3000.0, ORIGIN, 1000.0, made.coefficients(rng, 3, 3, 7)),
        (2, -77, 301, "J2000", ORIGIN + 3000.0, ORIGIN + 6000.0, ORIGIN + 3000.0, 1000.0, made.coefficients(rng, 3, 3, 7)),
    ]
    files = [*paths, made.spk(tmp_path / "craft.bsp", segments)]
    span = {"start": ORIGIN, "stop": ORIGIN + 6000.0}
    with jf.spice.Kernels(files) as kernels:
        with pytest.raises(NoPathError, match=r"several bodies \(EARTH, MOON\).*give tolerance="):
            kernels.tree(bodies=[-77], **span)
        tree = kernels.tree(bodies=[-77, "MOON"], tolerance=T(position=1.0, velocity=1e-2), **span)
    (craft,) = (name for name in tree.names if tree.properties[name]["spice_body"] == -77)
    assert tree.parent(craft) == "EARTH BARYCENTER"  # which both centres hang on
    times = ORIGIN + np.array([10.0, 2999.0, 3000.5, 5999.0])
    reference = seen(cspice, files, "-77", "J2000", "MOON", times)
    for t, wanted in zip(times, reference, strict=True):
        motion = tree.motion(tree.state(time=t), of=craft, relative_to="MOON")
        assert np.linalg.norm(motion.transform.translation - wanted[:3]) <= 1.0
        assert np.linalg.norm(motion.velocity.linear - wanted[3:]) <= 1e-2
