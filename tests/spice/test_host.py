"""What the host computes exactly: instants, decimal text, reference days, the two-part split."""

from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.numerics.host_quaternions import from_matrices
from jaxframes.spice.extraction import joining
from jaxframes.tables.info import decimal
from jaxframes.tables.instants import exact_seconds, reference_day, split


@pytest.mark.parametrize("number", [0, 820497600, -14200747200, 0.1, -43135.816087188054, 853848069.1845125, 2.0**-30])
def test_decimal_text_is_exact(number):
    text = decimal(Fraction(number))
    assert "e" not in text
    assert Fraction(text) == Fraction(number)
    assert Fraction(decimal(Fraction(1, 3))) == Fraction(1, 3)


def test_two_pi():
    with mp.workdps(120):
        assert abs(mp.mpf(joining.TURN.numerator) / joining.TURN.denominator - 2 * mp.pi) < mp.mpf(10) ** -99


def test_reference_is_a_whole_day_before():
    for instant in (Fraction(0), Fraction(820497600), Fraction(-1, 3), Fraction(-14200747200)):
        day = reference_day(instant)
        assert day % 86400 == 0
        assert 0 <= instant - day < 86400


def test_reference_days_are_exact_in_one_float32_for_68_years():
    days = np.arange(-24855, 24855) * 86400
    assert np.array_equal(days.astype(np.float32).astype(np.int64), days)


def test_split_keeps_48_bits_in_float32(rng):
    exact = rng.integers(0, 2**40, 1000) / 2.0**10
    high, low = split(exact, np.zeros(1000), np.dtype(np.float32))
    assert high.dtype == low.dtype == np.float32
    assert np.array_equal(high.astype(float) + low.astype(float), exact)


def test_instants():
    assert exact_seconds("2000-01-01T12:00:00.1 TDB") == Fraction(1, 10)
    assert exact_seconds(0.1) == Fraction(0.1)
    assert exact_seconds(jf.Epoch.from_tdb("2026-01-01")) == 820497600


def test_quaternion_of_a_matrix(rng):
    for _ in range(20):
        q = rng.normal(size=4)
        q /= np.linalg.norm(q) * np.sign(q[np.argmax(np.abs(q))])
        w, x, y, z = q
        matrix = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        assert np.abs(from_matrices(matrix) - q).max() < 1e-15


def test_shipped_tables_agree_with_the_kernels(kernels, rng, dtype):
    from importlib.resources import files

    tables = jf.spice.load(str(files("jaxframes") / "data" / "tables_2026.npz"))
    times = rng.integers(820497600, 852033600, 200).astype(float)
    for name, table in tables.items():
        worst = jf.spice.compare(kernels, table, times)
        if dtype == np.float32:
            assert worst.value <= (3e-6 if name == "itrf93" else 1e-6 * worst.largest_value), name
        elif name == "itrf93":
            assert (worst.value <= 1e-12, worst.rate <= 1e-18) == (True, True)
        else:
            assert worst.value <= 3 * np.spacing(worst.largest_value), name
            assert worst.rate <= 8 * np.spacing(worst.largest_rate), name


def test_states_at_an_epoch_without_data_are_an_error(kernels):
    with pytest.raises(jf.FrameError, match="SPKINSUFFDATA"):
        kernels.states(target=499, center=399, times=[0.0])
