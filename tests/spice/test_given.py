"""What a user gives that is no instant, path, time-out, name or number: refused at once, with what to give instead."""

import datetime
import re
from fractions import Fraction
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice.test_iau import PCK


@pytest.fixture(scope="module")
def turning():
    """A text PCK's model, which reads no span."""
    with jf.spice.Kernels(PCK) as kernels:
        return kernels.orientation(frame="IAU_MARS")


@pytest.mark.parametrize(
    ("bad", "remedy"),
    [
        ("2026-01-05", r"found '2026-01-05'; text is read by Epoch\.from_text"),
        (datetime.datetime(2026, 1, 5), r"found datetime.*Epoch\.from_datetime"),
        (np.datetime64("2026-01-05"), r"Epoch\.from_datetime"),
        (None, "seconds past J2000 TDB .*found None"),
        (True, "found True"),
    ],
)
def test_times_of_tables(moon, itrf93, turning, bad, remedy):
    calls = [table.evaluate for table in (moon, itrf93, turning)] + [moon.evaluate_two_part, moon.coverage_code, itrf93.coverage_code]
    for call in calls:
        with pytest.raises(errors.FrameError, match=remedy):
            call(bad)


def test_instants_that_never_come_lie_outside(moon, itrf93):
    # Warnings are errors here.
    for table in (moon, itrf93):
        for late in (np.inf, np.float32(np.inf), jnp.asarray(np.inf), jf.Epoch.from_et(np.inf)):
            assert int(table.coverage_code(late)) == 1
        for early in (-np.inf, jf.Epoch.from_et(-np.inf), np.nan, jf.Epoch.from_et(np.nan)):
            assert int(table.coverage_code(early)) == -1
        codes = table.coverage_code(np.array([-np.inf, 820497600.0 + 86400.0, np.inf, np.nan]))
        assert codes.tolist() == [-1, 0, 1, -1]
        for never in (np.inf, -np.inf, np.nan):
            assert all(np.isnan(value).all() for value in table.evaluate(never))


@pytest.mark.parametrize("empty", ["", "  "])
def test_empty_names(kernels, moon, empty):
    span, away = {"start": "2026-01-01", "stop": "2026-02-01"}, rf"= '{empty}' is empty: give the name or the id of a "
    for role, given in (("target", {"target": empty, "center": "EARTH"}), ("center", {"target": "MOON", "center": empty})):
        for call in (lambda given: kernels.translation(**given, **span), lambda given: kernels.states(**given, times=[0.0])):
            with pytest.raises(errors.UnknownBodyError, match=f"^{role} {away}body"):
                call(given)
    for role, given in (("frame", {"frame": empty}), ("relative_to", {"frame": "ITRF93", "relative_to": empty})):
        for call in (lambda given: kernels.orientation(**given, **span), lambda given: kernels.rotations(**given, times=[0.0])):
            with pytest.raises(errors.UnknownAxesError, match=f"^{role} {away}frame, such as 'J2000'"):
                call(given)
    with pytest.raises(errors.UnknownAxesError, match=f"^frame {away}frame"):
        kernels.translation(target="MOON", center="EARTH", frame=empty)
    with pytest.raises(errors.UnknownBodyError, match=f"^body {away}body"):
        kernels.tree(bodies=[empty])
    with pytest.raises(errors.UnknownAxesError, match=f"^frame {away}frame"):
        kernels.tree(frames=[empty])
    builder = jf.TreeBuilder(root="SSB")
    for source in (kernels, [moon]):
        with pytest.raises(errors.UnknownBodyError if source is kernels else errors.NoPathError, match=rf"'{empty}'"):
            builder.add_spice(source, body=empty)
        with pytest.raises(errors.UnknownAxesError if source is kernels else errors.NoPathError, match=rf"'{empty}'"):
            builder.add_spice(source, body="MOON", frame=empty)


@pytest.mark.parametrize("paths", [None, "", b"", 5, [None], ["", "."], [b""], [5]])
def test_paths_that_are_none(paths):
    with pytest.raises(errors.MissingKernelError, match=r"^(None|''|b''|5) is no path of a kernel: give files .*find_kernels"):
        jf.spice.Kernels(paths)


def test_the_current_directory_is_a_path(tmp_path, monkeypatch):
    (tmp_path / "names.tf").write_text("KPL/FK\n\\begindata\nNAIF_BODY_NAME += 'CRAFT'\nNAIF_BODY_CODE += -77\n\\begintext\n")
    monkeypatch.chdir(tmp_path)
    for here in (".", Path(), ["names.tf"], (p for p in ["names.tf"])):
        with jf.spice.Kernels(here) as kernels:
            assert kernels._pool.text == [tmp_path / "names.tf"]


@pytest.mark.parametrize("timeout", ["x", "5", -1, 0, 0.0, np.nan, np.inf, 1e300, 10**400, True, [5.0]])
def test_time_outs_that_are_none(timeout):
    with pytest.raises(errors.SpiceError, match=rf"^timeout={re.escape(repr(timeout))}: give the seconds .*, or None for any time"):
        jf.spice.Kernels(PCK, timeout=timeout)


@pytest.mark.parametrize("timeout", [None, 30, np.float32(30.0), Fraction(60, 2)])
def test_time_outs(timeout):
    with jf.spice.Kernels(PCK, timeout=timeout) as kernels:
        assert kernels._pool.process._timeout == (timeout if timeout is None else 30.0)


@pytest.mark.parametrize("bridge", [-5, np.nan, "15", True, [15.0]])
def test_bridges_that_are_none(kernels, bridge):
    builder = jf.TreeBuilder(root="SSB")
    for call in (
        lambda: kernels.orientation(frame="ITRF93", bridge=bridge),
        lambda: kernels.tree(frames=["ITRF93"], bridge=bridge),
        lambda: builder.add_spice(kernels, body="EARTH", bridge=bridge),
    ):
        with pytest.raises(errors.SpiceError, match=rf"^bridge={re.escape(repr(bridge))}: give the longest time in seconds"):
            call()
    assert builder.names == ("SSB",)


def test_what_kernels_are(kernels, paths):
    bodies = len({row[0] for row in kernels.bodies()})
    assert repr(kernels) == f"Kernels({len(paths)} files, {bodies} bodies)"
    with jf.spice.Kernels(PCK) as one:
        assert repr(one) == "Kernels(1 file, 0 bodies)"
    assert repr(one) == "Kernels(1 file, 0 bodies, closed)"


def test_a_span_that_ends_at_j2000_or_starts_there(kernels):
    """Zero seconds are an instant like any other, also where there are no data to take the other end from."""
    nothing = 987654
    for start, stop in ((None, 0.0), (0.0, None), (None, "2000-01-01T12:00:00 TDB"), (None, 5.0), (7.0, None)):
        low, high = kernels._pool.span(start, stop, "SPK", (nothing,))
        assert low < high
        assert start is None or low == start
        assert stop is None or high == (stop if isinstance(stop, float) else 0)
        with pytest.raises(errors.NoPathError):
            kernels.translation(target=nothing, center="EARTH", start=start, stop=stop)
    assert kernels.translation(target="MOON", center="EARTH", start="1999-12-01", stop=0.0).info.stop == "0"
