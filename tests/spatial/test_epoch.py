"""Epochs: nothing is lost in two parts, in both precisions; dates in TDB and UTC against CSPICE."""

from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import spiceypy

import jaxframes as jf
from jaxframes.time.scales import SHIPPED_LEAP_SECONDS


def exact(epoch):
    return Fraction(float(epoch.hi)) + Fraction(float(epoch.lo))


@pytest.mark.parametrize("seconds", [0.0, 31557601.0, 86400.123456, -100000001.5, 825638469.25])
@pytest.mark.parametrize("start", ["2026-03-01", "1999-12-31T23:59:59.5", "2000-01-01T12:00:00"])
def test_sums_keep_what_two_parts_can_hold(start, seconds, dtype):
    epoch = jf.Epoch.from_tdb(start)
    later = epoch + seconds
    eps = Fraction(float(np.finfo(dtype).eps)) ** 2
    wanted = exact(epoch) + Fraction(seconds)
    assert abs(exact(later) - wanted) <= 4 * eps * max(abs(wanted), abs(exact(epoch)), abs(Fraction(seconds)), 1)
    assert abs(exact(later - seconds) - exact(epoch)) <= 8 * eps * max(abs(wanted), abs(Fraction(seconds)), 1)
    np.testing.assert_allclose(float(later - epoch), seconds, rtol=2 * np.finfo(dtype).eps)


def test_dates_are_exact_and_read_back(dtype):
    assert exact(jf.Epoch.from_tdb("2000-01-01T12:00:00")) == 0
    assert exact(jf.Epoch.from_tdb("2026-01-01")) == 820497600
    assert jf.Epoch.from_tdb("2026-03-01T12:34:56.125 TDB").to_tdb() == "2026-03-01T12:34:56.125"
    assert jf.Epoch.from_tdb("1969-07-20").to_tdb(0) == "1969-07-20T00:00:00"
    assert repr(jf.Epoch.from_et(5)) == "Epoch(2000-01-01T12:00:05.000000 TDB)"


def test_integers_and_fractions_are_kept(dtype):
    assert exact(jf.Epoch.from_et(825638469)) == 825638469
    assert exact(jf.Epoch.from_et(jnp.asarray(825638469, jnp.int32))) == 825638469
    third = exact(jf.Epoch.from_et(Fraction(825638469, 3)))
    assert abs(third - Fraction(825638469, 3)) < Fraction(1, 10**5 if dtype == np.float32 else 10**20)


@pytest.mark.parametrize("hi", [820497601, 820497601.0, np.int64(820497601), np.float64(820497601.0), np.array(820497601.0)])
def test_both_parts_given_are_kept(hi, dtype):
    epoch = jf.Epoch.from_parts(hi, 0.5)
    assert exact(epoch) == Fraction(1640995203, 2)
    assert epoch.to_tdb() == "2026-01-01T00:00:01.500"
    for made, text in (
        (jf.Epoch.from_tt_parts(hi, 0.5), epoch.from_tt("2026-01-01T00:00:01.5")),
        (jf.Epoch.from_tai_parts(hi, 0.5), epoch.from_tai("2026-01-01T00:00:01.5")),
    ):
        assert abs(exact(made) - exact(text)) < (1e-15 if dtype == np.float64 else 1e-5)
    batch = jf.Epoch.from_tt_parts(np.array([820497601.0, 820497602.0]), np.array([[0.25], [0.5]]))
    assert batch.shape == (2, 2)
    assert abs(exact(batch[1, 1]) - exact(jf.Epoch.from_tt("2026-01-01T00:00:02.5"))) < 1e-5


def test_parts_that_are_traced_are_summed(dtype):
    hi, lo = jnp.asarray(2.0**25, dtype), jnp.asarray(0.25, dtype)
    assert exact(jax.jit(jf.Epoch.from_parts)(hi, lo)) == 2**25 + Fraction(1, 4)
    slopes = jax.grad(lambda a, b: jf.Epoch.from_parts(a, b) - jf.Epoch.from_et(0), (0, 1))(hi, lo)
    assert [float(s) for s in slopes] == [1.0, 1.0]


def test_batches_broadcast_and_index(dtype):
    epochs = jf.Epoch.from_tdb("2026-03-01") + np.arange(3.0)
    assert epochs.shape == (3,)
    assert float(epochs[2] - epochs[0]) == 2.0
    grid = epochs[:, None] + jnp.asarray([[0.0, 10.0]], dtype)
    assert grid.shape == (3, 2)
    np.testing.assert_array_equal(grid - jf.Epoch.from_tdb("2026-03-01"), [[0, 10], [1, 11], [2, 12]])


def test_sums_under_jit_vmap_and_grad(dtype):
    start = jf.Epoch.from_tdb("2026-03-01")
    offsets = jnp.asarray([0.25, 1.5], dtype)
    eager = start + offsets
    for made in (jax.jit(lambda t: start + t)(offsets), jax.vmap(lambda t: start + t)(offsets)):
        np.testing.assert_array_equal(made.hi, eager.hi)
        np.testing.assert_array_equal(made.lo, eager.lo)
    assert float(jax.grad(lambda t: (start + t) - start)(jnp.asarray(2.0, dtype))) == 1.0


@pytest.mark.parametrize("bad", ["2026-02-30", "noon", "2026-01-01T25:00", ""])
def test_bad_dates_are_refused_by_name(bad):
    for read in (jf.Epoch.from_tdb, jf.Epoch.from_utc):
        with pytest.raises(jf.FrameError, match=r"no (TDB|UTC) date"):
            read(bad)


def test_other_refusals():
    epoch = jf.Epoch.from_et(0)
    with pytest.raises(jf.FrameError, match="duration"):
        epoch + epoch
    with pytest.raises(jf.FrameError, match="1972"):
        jf.Epoch.from_utc("1971-12-31")
    with pytest.raises(jf.FrameError, match="does not exist"):
        jf.Epoch.from_utc("2026-06-30T23:59:60")
    for bad in ("2026-01-01", None, True):
        with pytest.raises(jf.FrameError, match="from_tdb"):
            jf.Epoch.from_et(bad)


def test_utc_agrees_with_cspice(rng):
    kernel = str(jf.spice.find_kernels("leapseconds")[0])
    texts = ["1972-01-01", "2016-12-31T23:59:60.5", "2017-01-01T00:00:00", "2026-03-01T00:00:00.125", "1998-12-31T23:59:60"]
    for _ in range(200):
        day = np.datetime64("1972-01-01") + np.timedelta64(int(rng.integers(0, 20000)), "D")
        texts.append(f"{day}T{rng.integers(24):02d}:{rng.integers(60):02d}:{rng.integers(60):02d}.{rng.integers(1000):03d}")
    spiceypy.furnsh(kernel)
    try:
        for text in texts:
            assert abs(float(SHIPPED_LEAP_SECONDS.tdb_of_utc(text)) - spiceypy.str2et(text)) < 3e-7, (
                text
            )  # the spacing of one float64 in these years
    finally:
        spiceypy.unload(kernel)
    assert (
        SHIPPED_LEAP_SECONDS.tdb_of_utc("2026-03-01T00:00:00Z")
        == SHIPPED_LEAP_SECONDS.tdb_of_utc("2026-03-01T00:00:00+00:00")
        == SHIPPED_LEAP_SECONDS.tdb_of_utc("2026-03-01")
    )


@pytest.mark.parametrize("number", [float, np.float32, np.float64, np.longdouble])
def test_infinities_have_no_second_part_and_nan_stays_nan(number, dtype):
    # Warnings are errors here.
    for sign in (1.0, -1.0):
        for given in (number(sign * np.inf), np.array([number(sign * np.inf), 1.0])):
            epoch = jf.Epoch.from_et(given)
            assert np.ravel(epoch.hi)[0] == sign * np.inf
            assert not np.any(epoch.lo)
    assert np.isnan(jf.Epoch.from_et(number(np.nan)).et)
    third = jf.Epoch.from_et(np.longdouble(1) / 3)
    assert abs(exact(third) - Fraction(1, 3)) <= max(np.finfo(dtype).eps ** 2, float(np.finfo(np.longdouble).eps))
