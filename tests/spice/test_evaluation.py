"""Evaluating on the device: batches, blocks, transformations, coverage, gradients."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.tables import evaluate

START, STOP = 820497600, 852033600


@pytest.fixture
def times(rng, dtype):
    """More epochs than a block holds, whole seconds past a day of 2026."""
    count = 4 * evaluate.BLOCK + 77
    return jf.Epoch(jnp.asarray(rng.integers(START // 64, STOP // 64, count) * 64, dtype), jnp.asarray(rng.uniform(0, 64, count), dtype))


def table(request):
    return request.getfixturevalue(request.param)


edge = pytest.fixture(params=["moon", "itrf93"])(table)


def same(a, b):
    for x, y in zip(a, b, strict=True):
        # Angular accelerations are what is left of products of rates: they keep fewer digits.
        x, y = np.asarray(x), np.asarray(y)
        assert np.abs(x - y).max() <= np.finfo(y.dtype).eps * max(8 * np.abs(y).max(), 1e-13)


def test_batch_vmap_loop_and_jit_agree(edge, times):
    batch = edge.evaluate(times)
    same(jax.vmap(edge.evaluate)(times), batch)
    same(jax.jit(jax.vmap(edge.evaluate))(times), batch)
    same(jax.jit(edge.evaluate)(times), batch)
    few = [edge.evaluate(times[i]) for i in range(0, 2000, 400)]
    same([jnp.stack(x) for x in zip(*few, strict=True)], [x[0:2000:400] for x in batch])
    square = jax.tree.map(lambda x: x[:2000].reshape(20, 100), times)
    same([x.reshape(2000, -1) for x in edge.evaluate(square)], [x[:2000] for x in batch])
    same([x.reshape(2000, -1) for x in jax.vmap(jax.vmap(edge.evaluate))(square)], [x[:2000] for x in batch])
    outer = jax.vmap(lambda t: edge.evaluate(t), in_axes=1, out_axes=1)(square)
    same([x.reshape(2000, -1) for x in outer], [x[:2000] for x in batch])


def test_table_is_a_pytree_that_jit_takes_as_an_argument(edge, times):
    same(jax.jit(lambda e, t: e.evaluate(t))(edge, times), edge.evaluate(times))
    leaves, structure = jax.tree.flatten(edge)
    assert all(jnp.issubdtype(leaf.dtype, jnp.floating) for leaf in leaves)
    assert hash(structure) == hash(jax.tree.flatten(jax.tree.map(lambda x: x, edge))[1])


def test_order_says_how_much_is_computed(edge):
    t = jf.Epoch.from_tdb("2026-05-05")
    everything = edge.evaluate(t)
    for order in (0, 1):
        assert len(edge.evaluate(t, order)) == order + 1
        same(edge.evaluate(t, order), everything[: order + 1])
    with pytest.raises(jf.FrameError, match="order=3"):
        edge.evaluate(t, order=3)


def test_scan_and_grad_in_a_loop(moon):
    def step(t, _):
        return t + 60.0, moon.evaluate(t, order=0)[0]

    _, inside = jax.lax.scan(step, jf.Epoch.from_tdb("2026-02-01"), None, length=5)
    start = jf.Epoch.from_tdb("2026-02-01")
    same([inside], [jnp.stack([moon.evaluate(start + 60.0 * i, order=0)[0] for i in range(5)])])


def test_outside_the_coverage_everything_is_nan(edge, dtype):
    before, start, inside, stop, after = (
        jf.Epoch.from_tdb(text) for text in ("2025-12-31T23:59:56", "2026-01-01", "2026-07-01", "2027-01-01", "2027-01-01T00:00:04")
    )
    for epoch, code in ((before, -1), (start, 0), (inside, 0), (stop, 0), (after, 1)):
        assert int(edge.coverage_code(epoch)) == code
        slope = jax.jacfwd(lambda dt, e=epoch: edge.evaluate(e + dt, order=2))(jnp.zeros((), dtype))
        back = jax.grad(lambda dt, e=epoch: edge.evaluate(e + dt, order=0)[0][0])(jnp.zeros((), dtype))
        for value in (*edge.evaluate(epoch), *slope, back):
            assert np.isfinite(value).all() if code == 0 else np.isnan(value).all()
    codes = edge.coverage_code(jf.Epoch(jnp.stack([before.hi, inside.hi, after.hi]), jnp.stack([before.lo, inside.lo, after.lo])))
    assert codes.dtype == jnp.int32
    assert codes.tolist() == [-1, 0, 1]


@pytest.mark.parametrize("bad", [-1e300, 1e30, np.nan, np.inf, -np.inf, 0.0])
def test_one_bad_epoch_spoils_no_other(edge, times, dtype, bad):
    with np.errstate(over="ignore"):
        spoilt = times.replace(hi=times.hi.at[5].set(np.asarray(bad).astype(dtype)))
    for size in (20, len(times.hi)):
        good, mixed = (jax.tree.map(lambda x, n=size: x[:n], t) for t in (times, spoilt))
        keep = np.arange(size) != 5
        for a, b in zip(edge.evaluate(mixed), edge.evaluate(good), strict=True):
            assert np.isnan(a[5]).all()
            same([a[keep]], [b[keep]])
        slope = jax.jacfwd(lambda dt, t=mixed: edge.evaluate(t + dt, order=0)[0])(jnp.zeros((), dtype))
        assert np.isnan(slope[5]).all()
        assert np.isfinite(slope[keep]).all()
        back = jax.grad(lambda t: jnp.sum(edge.evaluate(t, order=0)[0]))(mixed)
        assert np.isnan(back.hi[5])
        assert np.isfinite(back.hi[keep]).all()


@pytest.mark.float64
def test_gradient_by_the_coefficients(moon):
    t = jnp.asarray([830000000.0, 830500000.0])
    weights = jnp.asarray([1.0, -2.0, 3.0])

    def loss(table):
        p, v, a = table.evaluate(t)
        return jnp.sum(p @ weights) + 1e3 * jnp.sum(v @ weights) + 1e6 * jnp.sum(a @ weights)

    gradient = jax.grad(loss)(moon)
    rows = gradient.record_tables[0].rows
    assert not rows[:, -3:].any()  # the records' place in time counts as constant
    assert int((np.abs(rows).max(1) > 0).sum()) == 2
    rng = np.random.default_rng(0)
    change = jax.tree.map(jnp.zeros_like, moon)
    delta = jnp.asarray(rng.normal(size=rows.shape)).at[:, -3:].set(0.0)
    change = change.replace(
        record_tables=(
            jax.tree.unflatten(jax.tree.structure(change.record_tables[0]), [delta, *jax.tree.leaves(change.record_tables[0])[1:]]),
        )
    )
    forward = jax.jvp(loss, (moon,), (change,))[1]
    moved = moon.replace(record_tables=jax.tree.map(lambda a, b: a + b, moon.record_tables, change.record_tables))
    assert np.isclose(forward, jnp.sum(rows * delta), rtol=1e-12)
    assert np.isclose(forward, loss(moved) - loss(moon), rtol=1e-4)  # linear: what is left is rounding of the losses


@pytest.mark.float64
def test_vmap_over_tables(moon):
    t = jnp.asarray([830000000.0, 830500000.0])
    twice = jax.tree.map(lambda x: jnp.stack([x, x]), moon)
    for got, one in zip(jax.vmap(lambda e, t: e.evaluate(t))(twice, t), moon.evaluate(t), strict=True):
        assert np.allclose(got, one, rtol=1e-14)


@pytest.mark.float64
def test_large_batches_run_in_blocks_and_small_ones_do_not(moon):
    text = lambda n: jax.jit(lambda t: moon.evaluate(t)).lower(jax.ShapeDtypeStruct((n,), jnp.float64)).compile().as_text()
    assert "while" in text(5000)
    assert "while" not in text(evaluate.BLOCK)


@pytest.mark.float64
def test_batched_gradient_by_time_is_one_evaluation(moon):
    slope = jax.vmap(jax.grad(lambda t: jnp.linalg.norm(moon.evaluate(t, 0)[0])))
    text = jax.jit(slope).lower(jax.ShapeDtypeStruct((5000,), jnp.float64)).compile().as_text()
    assert text.count(" while(") == 1
    t = jnp.linspace(START, STOP, 5000)
    p, v = moon.evaluate(t, 1)
    assert np.allclose(jax.jit(slope)(t), jnp.sum(p * v, 1) / jnp.linalg.norm(p, axis=1), rtol=1e-12, atol=1e-9)
