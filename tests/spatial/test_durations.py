"""What may be added to an epoch or become one: NumPy's and Python's durations and dates exactly; text, None and dates refused."""

import datetime
from decimal import Decimal
from fractions import Fraction

import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf

START = "2026-03-01"


def exact(epoch):
    return Fraction(float(epoch.hi)) + Fraction(float(epoch.lo))


@pytest.mark.parametrize(
    ("count", "unit", "seconds"),
    [
        (1, "h", 3600),
        (-3, "D", -259200),
        (2, "W", 1209600),
        (90, "m", 5400),
        (250, "ms", Fraction(1, 4)),
        (987_654_321_123, "us", Fraction(987_654_321_123, 10**6)),
        (86_400_123_456_789, "ns", Fraction(86_400_123_456_789, 10**9)),
        (5, "ps", Fraction(5, 10**12)),
        (-7_000_000_000_001, "fs", Fraction(-7_000_000_000_001, 10**15)),
    ],
)
def test_numpy_durations_are_exact(count, unit, seconds, dtype):
    epoch = jf.Epoch.from_tdb(START)
    duration = np.timedelta64(count, unit)
    bound = Fraction(1, 10**5 if dtype == np.float32 else 10**22)
    for later, wanted in ((epoch + duration, seconds), (duration + epoch, seconds), (epoch - duration, -seconds)):
        assert abs(exact(later) - exact(epoch) - wanted) <= bound
    batch = epoch + np.array([count, 0], f"m8[{unit}]")
    assert batch.shape == (2,)
    assert (exact(batch[0]), exact(batch[1])) == (exact(epoch + duration), exact(epoch))
    assert isinstance(np.array([duration, duration]) + epoch, jf.Epoch)
    assert abs(exact(jf.Epoch.from_et(duration)) - seconds) <= bound


def test_durations_of_several_units_at_a_time():
    epoch = jf.Epoch.from_tdb("2000-01-01T12:00:00")
    assert exact(epoch + np.array(3, "m8[10ms]")) == exact(epoch + Fraction(3, 100))
    mixed = epoch + np.array([datetime.timedelta(seconds=1), Fraction(1, 4), Decimal("0.5"), 2], object)
    assert np.asarray(mixed.et).tolist() == [1.0, 0.25, 0.5, 2.0]
    assert exact(jf.Epoch.from_et(Decimal("820497600.5"))) == Fraction(1640995201, 2)


@pytest.mark.parametrize("kind", [np.uint8, np.uint64, np.int16, np.int64])
def test_integers_of_numpy_are_subtracted_as_numbers(kind):
    epoch = jf.Epoch.from_tdb(START)
    assert exact(epoch - kind(5)) - exact(epoch) == -5
    assert exact((epoch - np.array([1, 5], kind))[1]) - exact(epoch) == -5


def test_large_integers_keep_all_their_digits(dtype):
    if dtype == np.float64:
        wanted = 2**60 + 12345
        assert exact(jf.Epoch.from_et(np.array([wanted]))[0]) == wanted
    assert exact(jf.Epoch.from_et(np.array([825638469]))[0]) == 825638469


NO_SECONDS = [
    "1",
    None,
    True,
    ["1", "2"],
    np.array(["1"]),
    b"1",
    [True, False],
    1j,
    Ellipsis,
    [[1.0, 2.0], [3.0]],
    [1.0, None],
    np.timedelta64("NaT", "s"),
    np.timedelta64(1, "M"),
    np.timedelta64(1, "Y"),
    np.datetime64("2026-01-01"),
    np.array(["2026-01-01"], "M8[s]"),
    datetime.datetime(2026, 1, 1),
    datetime.date(2026, 1, 1),
    10**400,
]


@pytest.mark.parametrize("bad", NO_SECONDS, ids=repr)
def test_what_is_no_number_of_seconds_is_refused(bad):
    epoch = jf.Epoch.from_tdb(START)
    for add in (lambda: epoch + bad, lambda: bad + epoch, lambda: epoch - bad):
        with pytest.raises(jf.FrameError, match="a duration is seconds, a timedelta or a timedelta64, found"):
            add()
    with pytest.raises(jf.FrameError, match=r"an epoch is seconds past J2000 TDB \(for a date use Epoch\.from_tdb.*found"):
        jf.Epoch.from_et(bad)


def test_dates_are_pointed_to_their_reader():
    for date in (np.datetime64("2026-01-01"), np.array(["2026-01-01"], "M8[s]"), datetime.datetime(2026, 1, 1)):
        with pytest.raises(jf.FrameError, match=r"a date becomes an epoch by Epoch\.from_datetime \(UTC\)"):
            jf.Epoch.from_et(date)
    with pytest.raises(jf.FrameError, match="years and months, which have no length"):
        jf.Epoch.from_et(0) + np.timedelta64(1, "M")


@pytest.mark.parametrize("text", ["2016-12-31T23:59:59.999", "2017-01-01T00:00:00", "1972-01-01T00:00:00", "2026-03-01T12:34:56.123456789"])
def test_numpy_dates_are_utc(text, dtype):
    wanted = exact(jf.Epoch.from_utc(text))
    made = jf.Epoch.from_datetime(np.datetime64(text))
    bound = Fraction(1, 10**5 if dtype == np.float32 else 10**18)
    assert abs(exact(made) - wanted) <= bound
    batch = jf.Epoch.from_datetime(np.array([[text, "2026-01-01"]], "M8[ns]"))
    assert batch.shape == (1, 2)
    assert abs(exact(batch[0, 0]) - wanted) <= bound
    assert abs(exact(batch[0, 1]) - exact(jf.Epoch.from_utc("2026-01-01"))) <= bound


@pytest.mark.parametrize("unit", ["Y", "M", "W", "D", "h", "m", "s", "7s", "ms", "us", "ns"])
def test_numpy_dates_of_every_unit(unit, dtype):
    date = np.datetime64("2026-03-05T01:02:03", unit)
    bound = Fraction(1, 10**5 if dtype == np.float32 else 10**18)
    assert abs(exact(jf.Epoch.from_datetime(date)) - exact(jf.Epoch.from_utc(str(date.astype("M8[s]"))))) <= bound


def test_batches_of_python_dates():
    first = datetime.datetime(2026, 3, 1, 12)
    found = jf.Epoch.from_datetime([first, first.replace(tzinfo=datetime.UTC), np.datetime64("2026-03-01T13:00")])
    assert found.shape == (3,)
    np.testing.assert_allclose(found - jf.Epoch.from_utc("2026-03-01T12:00:00"), [0.0, 0.0, 3600.0], atol=1e-5)


def test_dates_that_are_none():
    with pytest.raises(jf.FrameError, match="NaT"):
        jf.Epoch.from_datetime(np.datetime64("NaT", "s"))
    with pytest.raises(jf.FrameError, match="1960-01-01 lies before 1972-01-01"):
        jf.Epoch.from_datetime(np.array(["2026-01-01", "1960-01-01"], "M8[D]"))
    for bad in ("2026-03-01", 5.0, None, ["2026-03-01"]):
        with pytest.raises(jf.FrameError, match=r"takes a datetime\.datetime or a datetime64, found"):
            jf.Epoch.from_datetime(bad)
    with pytest.raises(jf.FrameError, match="of one length"):
        jf.Epoch.from_datetime([[datetime.datetime(2026, 1, 1)], []])


def test_arrays_on_the_left_give_epochs(dtype):
    epoch = jf.Epoch.from_tdb(START)
    for left in (np.arange(3.0), np.arange(3), np.float64(1.0), np.int64(1), np.timedelta64(1, "s"), jnp.arange(3, dtype=dtype)):
        later = left + epoch
        assert isinstance(later, jf.Epoch)
        assert later.shape == np.shape(left)
    assert np.asarray((np.arange(3.0) + epoch) - epoch).tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(TypeError):
        np.arange(3.0) - epoch  # pyright: ignore[reportOperatorIssue]
