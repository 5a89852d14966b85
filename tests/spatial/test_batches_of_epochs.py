"""Epochs as batches: indexed, iterated, joined, reshaped, compared exactly, spread evenly."""

import copy
import datetime
import pickle
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf


def exact(epoch):
    return Fraction(float(epoch.hi)) + Fraction(float(epoch.lo))


@pytest.fixture
def epochs():
    return jf.Epoch.from_tdb("2026-03-01") + np.array([[0.0, 0.25, 1.0], [86400.5, 86401.0, 1e6]])


def test_iterating_ends(epochs):
    rows = list(epochs)
    assert [row.shape for row in rows] == [(3,), (3,)]
    assert [exact(e) - exact(rows[0][0]) for e in rows[0]] == [0, Fraction(1, 4), 1]
    assert len(epochs) == 2
    assert list(jf.Epoch.from_et([0.0, 1.0])[:0]) == []
    single = epochs[0, 0]
    for use in (list, len, iter):
        with pytest.raises(TypeError, match="an Epoch without batch axes"):
            use(single)
    assert single
    assert epochs[:0]


@pytest.mark.parametrize(
    "index",
    [7, 2, -3, (0, 3), (..., 3), (0, 0, 0), np.array([0, 7]), np.array([-3]), jnp.asarray(7), jnp.asarray([0, 2]), np.int64(2)],
)
def test_an_index_outside_is_refused(epochs, index):
    with pytest.raises(IndexError, match=r"is outside batch axis|indices for"):
        epochs[index]


def test_indices_of_every_kind(epochs):
    seconds = np.asarray(epochs.et)
    for index in (
        1,
        -1,
        (0, 2),
        slice(None, 1),
        (..., 0),
        None,
        np.array([1, 0]),
        jnp.asarray(1),
        seconds > 8.3e8,
        (slice(None), [0, 2][1]),
    ):
        assert np.array_equal(epochs[index].et, seconds[index])
    assert jax.jit(lambda e, i: e[i].et)(epochs, 1).tolist() == seconds[1].tolist()


def test_joined_and_reshaped(epochs, dtype):
    start = epochs[0, 0]
    pile = jf.stack([epochs[0], epochs[1]])
    assert pile.shape == (2, 3)
    assert bool((pile == epochs).all())
    assert jf.stack([start, epochs[1]], axis=-1).shape == (3, 2)
    line = jf.concatenate([epochs[0], epochs[1]])
    assert bool((line == epochs.reshape(6)).all())
    assert line.reshape(3, 2).shape == line.reshape((3, 2)).shape == (3, 2)
    assert line.reshape(2, -1).shape == (2, 3)
    assert start.broadcast_to((4, 2)).shape == (4, 2)
    assert (epochs.ndim, epochs.dtype) == (2, dtype)
    assert epochs.astype(np.float32).dtype == np.float32
    with pytest.raises(jf.FrameError, match="values of one type"):
        jf.stack([start, jf.Rotation.identity()])


def test_comparisons_see_both_parts(dtype):
    start = jf.Epoch.from_tdb("2026-03-01")
    tiny = 2.0**-60 if dtype == np.float64 else 2.0**-17
    later = start + tiny
    assert float(later.hi) == float(start.hi)
    assert bool(start < later)
    assert bool(later > start)
    assert bool(start <= later)
    assert not bool(start >= later)
    assert bool(start != later)
    assert not bool(start == later)
    batch = start + np.array([-1.0, 0.0, 1.0])
    assert np.asarray(batch < start).tolist() == [True, False, False]
    assert np.asarray(batch <= start).tolist() == [True, True, False]
    assert np.asarray(batch == start).tolist() == [False, True, False]
    assert np.asarray(batch != start).tolist() == [True, False, True]
    assert np.asarray(start > batch).tolist() == [True, False, False]
    assert jax.jit(lambda a, b: a < b)(start, later)


def test_one_instant_in_different_parts_is_equal(dtype):
    one = jnp.asarray(1.0, dtype)
    half = jnp.asarray(np.spacing(dtype.type(1)) / 2, dtype)
    up, down = jf.Epoch(one, half), jf.Epoch(one + 2 * half, -half)  # the same sum, tied between two high parts
    whole = jf.Epoch(jnp.asarray(820497600.0, dtype), jnp.asarray(640.0, dtype))
    for a, b in ((up, down), (whole, jf.Epoch.from_et(820498240))):
        assert bool(a == b)
        assert bool(a <= b)
        assert not bool(a < b)
        assert not bool(a != b)
        assert hash(a) == hash(b)
    assert {up: "x"}[down] == "x"
    with jax.numpy_dtype_promotion("standard"):
        assert bool(whole == whole.astype(np.float32))


def test_what_is_not_there_equals_nothing(dtype):
    nan, late = jf.Epoch.from_et(np.nan), jf.Epoch.from_et(np.inf)
    assert not bool(nan == nan)
    assert bool(nan != nan)
    assert not bool(nan < late)
    assert bool(late == late)
    assert bool(jf.Epoch.from_et(0) < late)
    assert bool(jf.Epoch.from_et(-np.inf) < late)
    assert (jf.Epoch.from_et(5) == 5) is False
    assert (jf.Epoch.from_et(5) != None) is True  # noqa: E711
    with pytest.raises(TypeError):
        jf.Epoch.from_et(5) < 5  # noqa: B015
    with pytest.raises(TypeError):
        np.arange(3.0) < jf.Epoch.from_et(5)  # noqa: B015


def test_comparing_changes_nothing_else_of_an_epoch(epochs):
    assert isinstance(hash(epochs), int)
    assert hash(epochs) == hash(epochs)
    for other in (copy.deepcopy(epochs), pickle.loads(pickle.dumps(epochs)), jax.tree.map(lambda x: x, epochs)):
        assert bool((other == epochs).all())
    assert jax.tree.structure(epochs) == jax.tree.structure(epochs[0])
    hashed = jax.jit(lambda e: (hash(e), e)[1])(epochs)
    assert hashed.shape == epochs.shape
    for leaf in (None, object(), 0, "x", jax.ShapeDtypeStruct((2,), np.float32)):
        assert isinstance(jax.tree.map(lambda _, leaf=leaf: leaf, epochs), jf.Epoch)
        repr(jax.tree.map(lambda _, leaf=leaf: leaf, epochs))
    assert jax.vmap(lambda e: e, in_axes=(jax.tree.map(lambda _: 0, epochs),))(epochs).shape == epochs.shape


def test_linspace_loses_nothing(dtype):
    start, stop = jf.Epoch.from_tdb("2026-01-01"), jf.Epoch.from_tdb("2026-01-02T00:00:00.7")
    made = jf.Epoch.linspace(start, stop, 8)
    assert made.shape == (8,)
    bound = Fraction(1, 10**5 if dtype == np.float32 else 10**21)
    for i in range(8):
        assert abs(exact(made[i]) - (exact(start) + (exact(stop) - exact(start)) * i / 7)) <= bound
    assert exact(made[7]) == exact(stop)
    assert exact(made[0]) == exact(start)
    half = jf.Epoch.linspace(start, stop, 4, endpoint=False)
    assert abs(exact(half[3]) - (exact(start) + (exact(stop) - exact(start)) * 3 / 4)) <= bound
    starts = start + np.array([0.0, 10.0])
    assert jf.Epoch.linspace(starts, stop, 5).shape == (5, 2)
    assert [jf.Epoch.linspace(start, stop, n).shape for n in (0, 1)] == [(0,), (1,)]
    assert exact(jf.Epoch.linspace(start, stop, 1)[0]) == exact(start)
    traced = jax.jit(lambda a, b: jf.Epoch.linspace(a, b, 8))(start, stop)
    assert np.asarray(traced == made).all()
    for bad in (-1, 2.5, True, "3", 10**10):
        with pytest.raises(jf.FrameError, match="num is how many epochs"):
            jf.Epoch.linspace(start, stop, bad)


def test_arange_adds_nothing_up(dtype):
    start = jf.Epoch.from_tdb("2026-01-01")
    made = jf.Epoch.arange(start, start + 1000, 0.1)
    assert made.shape == (10000,)
    bound = Fraction(1, 10**5 if dtype == np.float32 else 10**21)
    assert abs(exact(made[9999]) - exact(start) - 9999 * Fraction(0.1)) <= bound
    for step in (Fraction(1, 3), datetime.timedelta(milliseconds=250), np.timedelta64(90, "m")):
        made = jf.Epoch.arange(start, start + 7200, step)
        size = {Fraction: Fraction(1, 3), datetime.timedelta: Fraction(1, 4)}.get(type(step), Fraction(5400))
        assert made.shape == (-(-7200 // size),)
        assert abs(exact(made[-1]) - exact(start) - size * (made.shape[0] - 1)) <= bound
    assert jf.Epoch.arange(0, -3, -1).et.tolist() == [0, -1, -2]
    assert jf.Epoch.arange(start, start, 1).shape == jf.Epoch.arange(start, start - 1, 1).shape == (0,)
    for bad in (0, "1", None, [1.0], np.nan):
        with pytest.raises(jf.FrameError, match="a step is seconds"):
            jf.Epoch.arange(start, start + 10, bad)
    with pytest.raises(jf.FrameError, match="single epochs"):
        jf.Epoch.arange(start + np.arange(2.0), start + 10, 1)
    with pytest.raises(jf.FrameError, match="too small for the span"):
        jf.Epoch.arange(start, start + 1e6, 1e-9)
