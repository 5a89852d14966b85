"""Bodies whose positions are given in turning axes: stations, landers and rovers hang on the frame that has these axes, exactly."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice import made
from tests.spice.test_iau import PCK

START = 820497600.0
SITE = np.array([-2353.621, -4641.341, 3677.052])
TOPOCENTRIC = """KPL/FK
\\begindata
NAIF_BODY_NAME += 'DSS-14'
NAIF_BODY_CODE += 399014
FRAME_DSS-14_TOPO = 1399014
FRAME_1399014_NAME = 'DSS-14_TOPO'
FRAME_1399014_CLASS = 4
FRAME_1399014_CLASS_ID = 1399014
FRAME_1399014_CENTER = 399014
TKFRAME_1399014_RELATIVE = '{relative}'
TKFRAME_1399014_SPEC = 'ANGLES'
TKFRAME_1399014_UNITS = 'DEGREES'
TKFRAME_1399014_AXES = ( 3, 2, 3 )
TKFRAME_1399014_ANGLES = ( -243.1104618, -54.5742435, 180.0 )
TKFRAME_EARTH_FIXED_RELATIVE = 'ITRF93'
TKFRAME_EARTH_FIXED_SPEC = 'MATRIX'
TKFRAME_EARTH_FIXED_MATRIX = ( 1 0 0 0 1 0 0 0 1 )
\\begintext
"""


def station(folder, frame, relative):
    ends = np.array([-1.5e9, 1.5e9])
    spk = made.nodes(folder / "station.bsp", 8, 399014, 399, ends, np.tile(np.append(SITE, [0.0, 0.0, 0.0]), (2, 1)), 1, frame=frame)
    fk = folder / "station.tf"
    fk.write_text(TOPOCENTRIC.format(relative=relative))
    return [spk, str(fk)]


@pytest.mark.parametrize(("frame", "relative"), [("ITRF93", "EARTH_FIXED"), ("EARTH_FIXED", "ITRF93"), ("ITRF93", "ITRF93")])
def test_a_station_hangs_on_the_earth_by_a_fixed_edge(paths, cspice, tmp_path, rng, frame, relative):
    files = station(tmp_path, frame, relative)
    with jf.spice.Kernels([*paths, *files]) as kernels:
        tree = kernels.tree(bodies=["DSS-14", "MOON"], frames=["DSS-14_TOPO"], start="2026-01-01", stop="2026-02-01")
        builder = jf.TreeBuilder(root="SSB")
        assert builder.add_spice(kernels, body=399014, start="2026-01-01", stop="2026-02-01") == "DSS-14"
        with pytest.raises(errors.NoPathError, match="which turns against J2000"):
            builder.add_spice(kernels, body=399014, frame="J2000", start="2026-01-01", stop="2026-02-01")
    assert tree.parent("DSS-14") == "ITRF93"
    assert isinstance(tree.edge("DSS-14"), jf.edges.Fixed)
    place = np.asarray(tree.edge("DSS-14").transform.translation)
    assert np.array_equal(place, (SITE * 1e3).astype(place.dtype))
    assert builder.names[-2:] == ("ITRF93", "DSS-14")
    cspice.furnsh(files)
    times = rng.integers(START, START + 30 * 86400, 20).astype(float)
    state = tree.state(time=jf.Epoch.from_et(times))
    seen = tree.motion(state, of="MOON", relative_to="DSS-14_TOPO")
    known = np.array([cspice.spkezr("MOON", t, "DSS-14_TOPO", "NONE", "DSS-14")[0] for t in times]) * 1e3
    eps = np.finfo(np.asarray(seen.transform.translation).dtype).eps
    assert np.abs(np.asarray(seen.transform.translation, float) - known[:, :3]).max() <= 64 * eps * 4e8
    assert np.abs(np.asarray(seen.velocity.linear, float) - known[:, 3:]).max() <= 64 * eps * 3e4


def test_a_rover_drives_in_the_axes_of_its_planet(cspice, tmp_path, rng):
    """In the analytic frame of a text PCK: a table in these axes, not a fixed edge, and the tree needs no barycentre."""
    times = START + np.arange(12) * 3600.0
    places = np.array([3396.0, 10.0, -5.0]) + np.cumsum(rng.normal(size=(12, 3)) * 1e-3, 0)
    states = np.concatenate([places, rng.normal(size=(12, 3)) * 1e-7], 1)
    spk = made.nodes(tmp_path / "rover.bsp", 13, -976, 499, times, states, 3, frame="IAU_MARS")
    with jf.spice.Kernels([spk, PCK]) as kernels:
        tree = kernels.tree(bodies=[-976])
        assert tree.names == ("MARS", "IAU_MARS", "-976")
        table = kernels.translation(of=-976, relative_to="MARS", frame="IAU_MARS")
        assert table.info.axes == "IAU_MARS"
        with pytest.raises(errors.NoPathError, match="which turns"):
            kernels.translation(of=-976, relative_to="MARS")
        again = jf.TreeBuilder(root="MARS")
        assert again.add_spice([table, kernels.orientation(frame="IAU_MARS")], body=-976) == "-976"
        assert again.names == tree.names
    cspice.furnsh([spk, str(PCK)])
    ask = rng.uniform(times[0], times[-1], 50)
    found = tree.motion(tree.state(time=ask), of="-976", relative_to="IAU_MARS")
    known = np.array([cspice.spkezr("-976", t, "IAU_MARS", "NONE", "MARS")[0] for t in ask]) * 1e3
    eps = np.finfo(np.asarray(found.transform.translation).dtype).eps
    assert np.abs(np.asarray(found.transform.translation, float) - known[:, :3]).max() <= 64 * eps * 3.4e6
    assert np.abs(np.asarray(found.velocity.linear, float) - known[:, 3:]).max() <= 64 * eps * 1e3
