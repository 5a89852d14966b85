"""Time scales of an epoch against CSPICE: UTC, TAI, TT, TDB, as text, as datetimes and under jit."""

import datetime
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import spiceypy

import jaxframes as jf
from jaxframes import errors

LSK = jf.spice.find_kernels("leapseconds")[0]
TEXTS = ["1972-01-01T00:00:01", "1998-12-31T23:59:60.250", "2016-12-31T23:59:60.999", "2017-01-01T00:00:00", "2026-03-01T12:34:56.125"]


@pytest.fixture
def cspice():
    spiceypy.furnsh(str(LSK))
    yield spiceypy
    spiceypy.kclear()


def exact(epoch):
    return Fraction(float(epoch.hi)) + Fraction(float(epoch.lo))


def random_texts(rng, count):
    days = np.datetime64("1972-01-01") + rng.integers(0, 20000, count)
    return [f"{day}T{rng.integers(24):02d}:{rng.integers(60):02d}:{rng.integers(60):02d}.{rng.integers(1000):03d}" for day in days]


@pytest.mark.parametrize("scale", ["utc", "tdb", "tt", "tai"])
def test_text_reads_back(scale, rng, dtype):
    digits = 3 if dtype == np.float64 else 2  # two float32 resolve 4 microseconds, a quarter of a millisecond is safe
    for text in [t for t in (*TEXTS, *random_texts(rng, 50)) if scale == "utc" or ":60" not in t]:
        epoch = getattr(jf.Epoch, f"from_{scale}")(text)
        date, _, fraction = text.partition(".")
        wanted = f"{date}.{fraction.ljust(3, '0')}" if digits == 3 else None
        assert wanted in (None, getattr(epoch, f"to_{scale}")(3))
        again = getattr(jf.Epoch, f"from_{scale}")(getattr(epoch, f"to_{scale}")(6))
        assert abs(exact(again) - exact(epoch)) < 1e-5


@pytest.mark.float64
def test_scales_agree_with_cspice(cspice, rng):
    for text in (*TEXTS, *random_texts(rng, 50)):
        epoch = jf.Epoch.from_utc(text)
        assert abs(float(epoch.et) - cspice.str2et(text)) < 3e-7
        et = cspice.str2et(text)
        ours = jf.Epoch.from_et(et)
        assert ours.to_utc(6) == cspice.et2utc(et, "ISOC", 6)
        assert ours.to_tdb(6) == cspice.timout(et, "YYYY-MM-DDTHR:MN:SC.######::RND::TDB")
        assert ours.to_tt(6) == cspice.timout(et, "YYYY-MM-DDTHR:MN:SC.######::RND::TDT")
    for text in random_texts(rng, 50):
        assert abs(float(jf.Epoch.from_tt(text).et) - cspice.str2et(text.replace("T", " ") + " TDT")) < 3e-7
        tai = jf.Epoch.from_tai(text)
        assert abs(float(tai.et) - cspice.unitim(float(tai.tai[0] + tai.tai[1]), "TAI", "ET")) < 3e-7
        assert abs(float(sum(map(exact_one, tai.tai)) - exact(jf.Epoch.from_tdb(text)))) < 1e-9


def exact_one(number):
    return Fraction(float(number))


@pytest.mark.float64
def test_differences_of_scales_under_jit_agree_with_cspice(cspice, rng):
    times = rng.uniform(-8e8, 1e9, 200)
    epochs = jf.Epoch.from_et(times)
    tt, tai = jax.jit(lambda e: (e.tt, e.tai))(epochs)
    apart = jf.Epoch(*tt) - epochs
    np.testing.assert_allclose(apart, [cspice.unitim(t, "ET", "TDT") - t for t in times], atol=2.5e-7)
    # The offset itself, without the rounding of the epochs: K sin E of the kernel at the same TT.
    np.testing.assert_allclose(
        apart, [-1.657e-3 * np.sin((m := 6.239996 + 1.99096871e-7 * t) + 1.671e-2 * np.sin(m)) for t in times], atol=1e-9
    )
    np.testing.assert_allclose(jf.Epoch(*tt) - jf.Epoch(*tai), 32.184, rtol=1e-14)
    # deltet gives ET - UTC; leap seconds are whole.
    offset = [cspice.deltet(t, "ET") for t in times]
    ours = -(jf.Epoch(*tai) - epochs)
    np.testing.assert_allclose((np.array(offset) - ours + 0.5) % 1.0, 0.5, atol=3e-7)


def test_parts_there_and_back_under_jit(dtype):
    epochs = jf.Epoch.from_tdb("2026-03-01") + np.arange(5) * 1e6
    there = jax.jit(lambda e: (jf.Epoch.from_tt_parts(*e.tt) - e, jf.Epoch.from_tai_parts(*e.tai) - e))(epochs)
    for difference in there:
        np.testing.assert_allclose(difference, np.zeros(5), atol=1e-15 if dtype == np.float64 else 2e-5)
    slope = jax.grad(lambda s: jf.Epoch(*(epochs[0] + s).tt) - epochs[0])(jnp.asarray(0.0, dtype))
    assert abs(float(slope) - 1) < 1e-6
    assert float(slope) != 1 or dtype == np.float32


def test_datetimes(dtype):
    utc = datetime.datetime(2026, 3, 1, 12, 0, 0, 250000)
    epoch = jf.Epoch.from_datetime(utc)
    assert exact(epoch) == exact(jf.Epoch.from_utc("2026-03-01T12:00:00.25"))
    east = utc.replace(tzinfo=datetime.UTC).astimezone(datetime.timezone(datetime.timedelta(hours=5, minutes=30)))
    assert east.hour == 17
    assert exact(jf.Epoch.from_datetime(east)) == exact(epoch)
    back = epoch.to_datetime()
    assert back.tzinfo is datetime.UTC
    assert abs((back - utc.replace(tzinfo=datetime.UTC)).total_seconds()) <= (0 if dtype == np.float64 else 4e-6)
    with pytest.raises(jf.FrameError, match="takes a datetime"):
        jf.Epoch.from_datetime("2026-03-01")  # pyright: ignore[reportArgumentType]
    with pytest.raises(jf.FrameError, match=r"23:59:60.* is a leap second"):
        jf.Epoch.from_utc("2016-12-31T23:59:60.5").to_datetime()


def test_durations_of_every_kind(dtype):
    epoch = jf.Epoch.from_tdb("2026-03-01")
    later = epoch + datetime.timedelta(days=400, microseconds=250000)
    assert exact(later) - exact(epoch) == Fraction(400 * 86400) + Fraction(1, 4)
    assert exact(later - datetime.timedelta(days=400)) - exact(epoch) == Fraction(1, 4)
    assert exact(epoch + Fraction(1, 8)) - exact(epoch) == Fraction(1, 8)


def test_batches_of_text():
    epochs = jf.Epoch.from_utc([["2026-03-01", "2026-03-02"], ["2026-03-03", "2026-03-04"]])
    assert epochs.shape == (2, 2)
    assert float(epochs[1, 1] - epochs[0, 0]) == pytest.approx(3 * 86400, abs=1e-3)


def test_a_batch_reaches_the_device_at_once(rng, monkeypatch):
    texts = random_texts(rng, 60)
    alone = [jf.Epoch.from_utc(text) for text in texts]
    made = []
    original = jnp.asarray
    monkeypatch.setattr(jnp, "asarray", lambda *a, **k: made.append(1) or original(*a, **k))
    together = jf.Epoch.from_utc(np.array(texts).reshape(3, 20))
    assert len(made) == 2
    assert [exact(e) for e in together.reshape(60)] == [exact(e) for e in alone]


@pytest.mark.parametrize("digits", [-1, 2.5, "3", None, True, 31])
def test_decimals_that_cannot_be_written(digits):
    epoch = jf.Epoch.from_utc("2026-03-01")
    for write in (epoch.to_tdb, epoch.to_tt, epoch.to_tai, epoch.to_utc):
        with pytest.raises(jf.FrameError, match="digits is how many decimals"):
            write(digits)
    assert epoch.to_utc(12) == "2026-03-01T00:00:00.000000000000" or epoch.dtype == np.float32


def test_batches_that_are_none():
    assert jf.Epoch.from_utc([]).shape == (0,)
    assert jf.Epoch.from_tdb([[], []]).shape == (2, 0)
    for ragged in (["2026-03-01", ["2026-03-02"]], [["2026-03-01"], []], [["2026-03-01"], ["2026-03-01", "2026-03-02"]]):
        with pytest.raises(jf.FrameError, match="rows of a batch must be of one length"):
            jf.Epoch.from_utc(ragged)
    for bad in (["2026-03-01", None], [b"2026-03-01"], {"2026-03-01": 1}, 5):
        with pytest.raises(jf.FrameError, match="TDB is read from calendar text"):
            jf.Epoch.from_tdb(bad)
    with pytest.raises(jf.FrameError, match=r"datetimes by Epoch\.from_datetime"):
        jf.Epoch.from_utc(np.array(["2026-03-01"], "M8[s]"))


@pytest.mark.parametrize("digits", [0, 1, 3])
def test_rounding_over_the_end_of_a_day_and_of_a_leap_second(digits):
    last = jf.Epoch.from_utc("2016-12-31T23:59:60.9999")
    zeros = "." + "0" * digits if digits else ""
    assert last.to_utc(digits) == f"2017-01-01T00:00:00{zeros}"
    assert jf.Epoch.from_utc("2016-12-31T23:59:59.9999").to_utc(digits) == f"2016-12-31T23:59:60{zeros}"
    assert jf.Epoch.from_tdb("2025-12-31T23:59:59.9999").to_tdb(digits) == f"2026-01-01T00:00:00{zeros}"


def test_leap_seconds_from_a_kernel_are_those_shipped(tmp_path):
    with jf.spice.Kernels(LSK) as kernels:
        table = kernels.leap_seconds()
    shipped = jf.SHIPPED_LEAP_SECONDS
    assert table.starts == shipped.starts
    assert (table.tt_minus_tai, table.k, table.eb, table.m0, table.m1) == (
        shipped.tt_minus_tai,
        shipped.k,
        shipped.eb,
        shipped.m0,
        shipped.m1,
    )
    assert "last entry 2017-01-01" in table.as_of
    assert "2026-11" in shipped.as_of
    # A table with one more entry: the leap second of a day to come is read and written.
    text = LSK.read_text().replace("37,   @2017-JAN-1", "37,   @2017-JAN-1\n 38,   @2030-JUL-1")
    newer = tmp_path / "newer.tls"
    newer.write_text(text)
    with jf.spice.Kernels(newer) as kernels:
        table = kernels.leap_seconds()
    epoch = jf.Epoch.from_utc("2030-06-30T23:59:60.5", leap_seconds=table)
    assert epoch.to_utc(1, leap_seconds=table) == "2030-06-30T23:59:60.5"
    assert epoch.to_utc(1) == "2030-07-01T00:00:00.5"


def test_leap_seconds_without_a_kernel(tmp_path):
    file = tmp_path / "names.tk"
    file.write_text("KPL/MK\n\\begindata\nDELTET/K = 1.657D-3\n\\begintext\n")
    with jf.spice.Kernels(file) as kernels, pytest.raises(errors.BadKernelError, match="leap-seconds kernel loaded is damaged"):
        kernels.leap_seconds()
    file.write_text("KPL/MK\n\\begindata\nA = 1\n\\begintext\n")
    with (
        jf.spice.Kernels(file) as kernels,
        pytest.raises(errors.MissingKernelError, match=r"No leap-seconds kernel.*find_kernels\('leapseconds'\)"),
    ):
        kernels.leap_seconds()


def test_refusals():
    for read in (jf.Epoch.from_utc, jf.Epoch.from_tt, jf.Epoch.from_tai):
        with pytest.raises(jf.FrameError, match="calendar text"):
            read(5.0)
    with pytest.raises(jf.FrameError, match="skip or repeat leap seconds"):
        jf.Epoch.from_utc(820497600.0)  # pyright: ignore[reportArgumentType]
    with pytest.raises(jf.FrameError, match="only UTC has leap seconds"):
        jf.Epoch.from_tt("2016-12-31T23:59:60")
    with pytest.raises(jf.FrameError, match="no TT date"):
        jf.Epoch.from_tt("2016-12-31 UTC")
    with pytest.raises(jf.FrameError, match="before 1972-01-01"):
        jf.Epoch.from_tdb("1970-01-01").to_utc()
    with pytest.raises(jf.FrameError, match="index a batch"):
        (jf.Epoch.from_et(0) + np.arange(2.0)).to_utc()
    with pytest.raises(jf.FrameError, match="outside jit"):
        jax.jit(lambda e: e.to_utc())(jf.Epoch.from_et(0))


@pytest.mark.float64
def test_text_that_names_its_scale(cspice):
    """As CSPICE reads it; a date alone is a day of TDB, and a time of day without a scale is refused: UTC and TDB are 69 s apart."""
    for scale in ("UTC", "TDB", "TT", "TAI"):
        epoch = jf.Epoch.from_text(f"2026-03-01T00:00:00.5 {scale}")
        assert exact(epoch) == exact(getattr(jf.Epoch, f"from_{scale.lower()}")("2026-03-01T00:00:00.5"))
        known = f"2026-03-01 00:00:00.5 {scale.replace('TT', 'TDT')}"
        et = cspice.unitim(825595200.5, "TAI", "ET") if scale == "TAI" else cspice.str2et(known)
        assert abs(float(epoch.et) - et) < 1e-6
    assert exact(jf.Epoch.from_text("2026-03-01")) == exact(jf.Epoch.from_tdb("2026-03-01"))
    batch = jf.Epoch.from_text([["2026-03-01T00:00:00Z", "2026-03-01 TT"], ["2026-03-01T00:00:00+00:00", "2026-03-02"]])
    assert batch.shape == (2, 2)
    assert exact(batch[0, 0]) == exact(batch[1, 0]) == exact(jf.Epoch.from_utc("2026-03-01"))
    for bad, remedy in (
        ("2026-03-01T00:00:00", "write '2026-03-01T00:00:00 TDB' or '2026-03-01T00:00:00 UTC'"),
        ("2026-03-01T00:00:00 GPS", "after a date may stand TDB, TT, TDT, TAI, UTC"),
        ("tomorrow", "is no date; write it as"),
    ):
        with pytest.raises(errors.FrameError, match=remedy):
            jf.Epoch.from_text(bad)
    with pytest.raises(errors.SpiceError, match="start: '2026-03-01T00:00:00' names no time scale"):
        jf.spice.crop(jf.spice.example_tables()["moon"], start="2026-03-01T00:00:00", stop="2026-03-02")
    cut = jf.spice.crop(jf.spice.example_tables()["moon"], start="2026-03-01T00:00:00 UTC", stop="2026-03-02")
    assert abs(Fraction(cut.info.start) - exact(jf.Epoch.from_utc("2026-03-01"))) < 1e-20


@pytest.mark.float64
def test_days_of_the_year_julian_dates_and_offsets(cspice, rng):
    """As CSPICE reads them (its Julian dates have a double's 4e-5 s), and back again by every form of writing."""
    for text in random_texts(rng, 20):
        epoch = jf.Epoch.from_utc(text)
        ordinal, julian = epoch.to_utc(3, form="ordinal"), epoch.to_utc(9, form="julian")
        assert abs(cspice.utc2et(ordinal) - float(epoch.et)) < 1e-6
        assert exact(jf.Epoch.from_utc(ordinal)) == exact(jf.Epoch.from_utc(epoch.to_utc(3)))
        assert abs(cspice.utc2et(julian) - float(epoch.et)) < 1e-4
        assert abs(exact(jf.Epoch.from_utc(julian)) - exact(epoch)) < Fraction(86400, 10**15)
        for offset in ("+02:00", "-05:30", "+23:59", "-00:00"):
            local = epoch.to_utc(3, offset=offset)
            assert local.endswith(offset)
            assert datetime.datetime.fromisoformat(local) == datetime.datetime.fromisoformat(epoch.to_utc(3)).replace(tzinfo=datetime.UTC)
            assert exact(jf.Epoch.from_utc(local)) == exact(jf.Epoch.from_utc(epoch.to_utc(3)))
    for scale in ("tdb", "tt", "tai"):
        epoch = getattr(jf.Epoch, f"from_{scale}")("2024-366T23:59:59.5")
        assert getattr(epoch, f"to_{scale}")(1) == "2024-12-31T23:59:59.5"
        assert getattr(epoch, f"to_{scale}")(1, form="ordinal") == "2024-366T23:59:59.5"
        read = getattr(jf.Epoch, f"from_{scale}")
        assert exact(read("JD 2451545.25")) == exact(read("JD2451545.25")) == exact(read("2000-01-01T18:00"))
    assert exact(jf.Epoch.from_tdb("JD 2451545.0")) == 0


@pytest.mark.float64
def test_leap_seconds_in_every_form(cspice):
    leap = jf.Epoch.from_utc("2016-12-31T23:59:60.25")
    assert abs(cspice.utc2et("2016-366T23:59:60.25") - float(leap.et)) < 1e-6
    for text in ("2016-366T23:59:60.25", "2017-01-01T01:59:60.25+02:00", "2016-12-31T18:29:60.25-05:30"):
        assert exact(jf.Epoch.from_utc(text)) == exact(leap)
    assert leap.to_utc(2) == "2016-12-31T23:59:60.25"
    assert leap.to_utc(2, form="ordinal") == "2016-366T23:59:60.25"
    assert leap.to_utc(2, offset="+02:00") == "2017-01-01T01:59:60.25+02:00"
    assert leap.to_utc(2, offset="-05:30", form="ordinal") == "2016-366T18:29:60.25-05:30"
    with pytest.raises(errors.FrameError, match="a Julian date cannot say a leap second"):
        leap.to_utc(form="julian")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("2026-366", "2026 has no day 366"),
        ("2026-000", "2026 has no day 0"),
        ("2026-060T24:00", "there is no 24:00:00"),
        ("JD 1e9", "or JD 2461101.0, optionally with UTC or Z or"),
        ("2026-03-01T12:00:00+25:00", r"an offset from UTC is written as \+02:00"),
        ("2026-03-01T12:00:60+02:00", "does not exist on that day"),
        ("2026-03-01T00:00:00." + "1" * 200_000, r"\(200020 characters\)"),
    ],
)
def test_dates_that_are_none(text, why):
    with pytest.raises(errors.FrameError, match=why) as caught:
        jf.Epoch.from_utc(text)
    assert len(str(caught.value)) < 400
    with pytest.raises(errors.FrameError, match="is no TDB date"):
        jf.Epoch.from_tdb("2026-03-01T12:00:00+02:00")
    with pytest.raises(errors.FrameError, match="form is one of 'calendar', 'ordinal', 'julian'; found 'iso'"):
        jf.Epoch.from_tdb("2026-03-01").to_tdb(form="iso")
