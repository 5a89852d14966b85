"""What is looked up in kernels: other names of axes, constants of bodies, files loaded later, segments at the edge of what is read."""

import numpy as np
import pytest
import spiceypy

import jaxframes as jf
from jaxframes import errors
from tests.spice import made
from tests.spice.test_iau import PCK

SPAN = {"start": "2026-01-01", "stop": "2026-02-01"}
MEANT = [("TEME", "two-line elements"), ("eci", "not which"), ("ECEF", "'ITRF93'"), ("TOD", "of date")]


def text_kernel(*lines):
    return "\n".join(["KPL/PCK", "\\begindata", *lines, "\\begintext", ""])


@pytest.mark.parametrize("name", ["ICRF", "icrs", "GCRF", "GCRS", "EME2000", " J2000 "])
def test_other_names_of_j2000(kernels, moon, name):
    table = kernels.translation(target="MOON", center="EARTH", frame=name, **SPAN)
    assert table.info.axes == "J2000"
    builder = jf.TreeBuilder(root="EARTH")
    builder.add_spice(table, body="MOON", frame=name)
    assert builder.names == ("EARTH", "MOON")


@pytest.mark.parametrize(("name", "meaning"), MEANT)
def test_names_that_are_no_frames_say_what_they_mean(kernels, name, meaning):
    with pytest.raises(errors.UnknownAxesError, match=meaning):
        kernels.translation(target="MOON", center="EARTH", frame=name)


def test_constants_of_bodies_and_files_loaded_later(paths, tmp_path):
    text = tmp_path / "constants.tpc"
    text.write_text(
        text_kernel("BODY499_RADII = ( 3396.19 3396.19 3376.20 )", "BODY499_GM = ( 42828.375214 )", "BODY401_RADII = ( 13.0 11.4 )")
    )
    with jf.spice.Kernels([p for p in paths if p.endswith("de440.bsp")]) as kernels:
        with pytest.raises(errors.MissingKernelError, match=r"No kernel loaded gives BODY499_RADII: load a text PCK"):
            kernels.radii("MARS")
        before = kernels.translation(target="MOON", center="EARTH", **SPAN)
        kernels.load(text)
        assert kernels.radii("MARS") == kernels.radii(499) == (3396190.0, 3396190.0, 3376200.0)
        assert kernels.gm("MARS") == pytest.approx(42828.375214e9, rel=1e-15)
        with pytest.raises(errors.MissingKernelError, match=r"BODY401_RADII \(it holds 2 numbers, not 3\)"):
            kernels.radii("PHOBOS")
        with pytest.raises(errors.UnknownBodyError):
            kernels.gm("NOWHERE")
        # A segment that comes later wins, also for tables; those made before stay.
        now = 820497600.0
        line = np.array([[4e5, 0.0, 0.0, 0.0, 1.0, 0.0], [4e5, 1e6, 0.0, 0.0, 1.0, 0.0]])
        kernels.load([made.nodes(tmp_path / "moon.bsp", 9, 301, 399, [now, now + 1e6], line, 1)])
        after = kernels.translation(target="MOON", center="EARTH", start=now, stop=now + 1e6)
        assert np.abs(np.asarray(after.evaluate(now)[0]) - [4e8, 0, 0]).max() < 1.0
        assert np.abs(np.asarray(before.evaluate(now)[0]) - [4e8, 0, 0]).max() > 1e6
        with pytest.raises(errors.BadKernelError):
            kernels.load(made.__file__)
        assert len(kernels.bodies()) > 10


@pytest.mark.parametrize("kind", [12, 13])
def test_hermite_nodes_of_degree_one_are_lines_through_the_nearest(cspice, rng, tmp_path, kind):
    times = 820497600.0 + np.arange(8) * 100.0
    path = made.nodes(tmp_path / "line.bsp", kind, -77, 399, times, rng.normal(size=(8, 6)) * [7e3, 7e3, 7e3, 7, 7, 7], 1)
    cspice.furnsh(str(path))
    with jf.spice.Kernels([path]) as opened:
        table = opened.translation(target=-77, center=399)
    ask = rng.uniform(times[0], times[-1], 200)
    p, v, a = (np.asarray(x, np.float64) for x in table.evaluate(ask))
    known = np.array([cspice.spkgeo(-77, t, "J2000", 399)[0] for t in ask]) * 1e3
    eps = np.finfo(np.asarray(table.evaluate(0.0)[0]).dtype).eps
    assert np.abs(p - known[:, :3]).max() <= 8 * eps * 3e7
    assert np.abs(v - known[:, 3:]).max() <= 8 * eps * 3e7 / 50
    assert np.abs(a).max() <= 8 * eps * 3e7 / 2500


def test_a_frame_of_a_planet_whose_barycentre_alone_is_held(paths):
    with jf.spice.Kernels([*paths, PCK]) as kernels:
        with pytest.raises(errors.NoPathError, match=r"frames=\[\('MARS BARYCENTER', 'IAU_MARS'\)\]"):
            kernels.tree(bodies="EARTH", frames=["IAU_MARS"], **SPAN)
        tree = kernels.tree(frames=[("MARS BARYCENTER", "IAU_MARS")], **SPAN)
    assert tree.parent("IAU_MARS @ MARS BARYCENTER") == "MARS BARYCENTER"


def test_a_text_pck_beside_a_short_binary_one_is_named(tmp_path, rng):
    data = made.coefficients(rng, 5, 3, 4, 1e-3)
    binary = made.pck(tmp_path / "short.bpc", [(3000, "J2000", 820497600.0, 820498100.0, 820497600.0, 100.0, data)])
    text = tmp_path / "long.tpc"
    text.write_text(
        "KPL/PCK\n\\begindata\nBODY3000_PM = ( 10.0 360.0 0.0 )\nBODY3000_POLE_RA = ( 1.0 )\nBODY3000_POLE_DEC = ( 2.0 )\n\\begintext\n"
    )
    with jf.spice.Kernels([binary, text]) as kernels, pytest.raises(errors.CoverageError, match="A text PCK loaded orients ITRF93 too"):
        kernels.orientation(frame="ITRF93", start=820497600.0, stop=820499100.0)
    with jf.spice.Kernels([binary]) as kernels, pytest.raises(errors.CoverageError) as caught:
        kernels.orientation(frame="ITRF93", start=820497600.0, stop=820499100.0)
    assert "text PCK" not in str(caught.value)


def test_what_packages_do_not_ship_is_pointed_to():
    with pytest.raises(errors.MissingKernelError, match=r"pck00011\.tpc.*fetch them from https://naif"):
        jf.spice.find_kernels("pck00011")


def test_types_that_are_not_extracted_are_named_rightly(tmp_path, kernels):
    elements = tmp_path / "conic.bsp"
    handle = spiceypy.spkopn(str(elements), "conic", 0)
    states = np.array([[7000.0, 0.0, 0.0, 0.0, 7.5, 0.0], [7000.0, 0.0, 0.0, 0.0, 7.5, 0.0]])
    spiceypy.spkw05(handle, -77, 399, "J2000", 0.0, 100.0, "conic", 398600.0, 2, states, [0.0, 100.0])
    spiceypy.spkcls(handle)
    with jf.spice.Kernels([elements]) as opened, pytest.raises(errors.NoPathError, match="exact are SPK types 2, 3, 8, 9, 12, 13 and 20"):
        opened.translation(target=-77, center=399)


def test_trees_are_rooted_where_the_data_meet(paths, tmp_path, rng, cspice):
    """An orbiter about Mars alone, orientations alone, attitudes alone; and where a body is chosen."""
    spk = made.nodes(tmp_path / "orbiter.bsp", 13, -977, 499, 820497600.0 + np.arange(20) * 60.0, rng.normal(size=(20, 6)) * 1e3, 7)
    with jf.spice.Kernels([spk, PCK]) as kernels:
        tree = kernels.tree(bodies=[-977], frames=["IAU_MARS"])
        assert (tree.root, tree.names) == ("MARS", ("MARS", "-977", "IAU_MARS"))
        assert tree.properties["MARS"]["spice_body"] == 499
        state = tree.state(time=820498000.0)
        cspice.furnsh([str(spk), str(PCK)])
        known = cspice.spkpos("-977", 820498000.0, "IAU_MARS", "NONE", "MARS")[0] * 1e3
        found = tree.transform(state, of="-977", relative_to="IAU_MARS").translation
        # CSPICE rounds the prime meridian as degrees of many turns: 1e-10 rad. In float32 the model is good to 3e-6 rad.
        assert np.abs(np.asarray(found) - known).max() <= max(1e-10, 40 * np.finfo(np.asarray(found).dtype).eps) * np.abs(known).max()
        only = kernels.tree(frames="IAU_MARS")
        assert only.names == ("MARS", "IAU_MARS")
        with pytest.raises(errors.NoPathError, match="do not connect"):
            kernels.tree(bodies=[-977], frames=["IAU_EARTH"])
    with jf.spice.Kernels(paths) as kernels:
        assert kernels.tree(frames="ITRF93", **SPAN).names == ("SSB", "EARTH BARYCENTER", "EARTH", "ITRF93")
        chosen = kernels.tree(bodies=["MOON", "SUN"], frames="ITRF93", root="EARTH", **SPAN)
        assert chosen.root == "EARTH"
        assert chosen.parent("MOON") == chosen.parent("SUN") == chosen.parent("ITRF93") == "EARTH"
        with pytest.raises(errors.UnknownBodyError, match="root = 'NOWHERE'"):
            kernels.tree(bodies=["MOON"], root="NOWHERE")
    with jf.spice.Kernels([p for p in paths if not p.endswith(".bsp")]) as kernels:
        assert kernels.tree(frames="ITRF93", **SPAN).names == ("EARTH", "ITRF93")


def test_spacecraft_have_j2000_axes_whatever_frame_is_theirs(tmp_path, rng):
    """Their attitudes may have gaps, so the frame that an association kernel gives them is taken only by name."""
    spk = made.nodes(tmp_path / "craft.bsp", 13, -977, 499, 820497600.0 + np.arange(20) * 60.0, rng.normal(size=(20, 6)) * 1e3, 7)
    text = tmp_path / "association.tf"
    text.write_text(text_kernel("OBJECT_-977_FRAME = 'IAU_MARS'", "OBJECT_499_FRAME = 'IAU_MARS'"))
    with jf.spice.Kernels([spk, PCK, text]) as kernels:
        builder = jf.TreeBuilder(root="MARS")
        assert builder.add_spice(kernels, body=-977) == "-977"
        assert builder.names == ("MARS", "-977")
        assert builder.add_spice(kernels, body="MARS") == "IAU_MARS"
