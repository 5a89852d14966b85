"""Tables of one kind, each of another length, are one family: evaluated together, and the program does not grow with their number."""

from dataclasses import replace

import chex
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.tables.attitude import AttitudeTable, CayleyTable
from jaxframes.tables.evaluate import BLOCK
from jaxframes.tables.info import Info
from jaxframes.tables.orientation import OrientationTable
from jaxframes.tables.records import to_record_table
from jaxframes.tables.translation import TranslationTable
from tests.compilations import compilations
from tests.lowered import stages

SPAN = 4000.0
"""Seconds that every table covers, from the reference epoch on."""


def info(name):
    return Info("made", name, 1, "centre", 2, "J2000", "0", str(int(SPAN)), "0", (), (), "none")


def leg(rng, records, width, series, uneven, scale):
    """Records of equal length, or of lengths that alternate."""
    ends = SPAN * np.arange(1, records + 1) / records
    if uneven:
        ends[:-1:2] += 0.4 * SPAN / records
    starts = np.concatenate([[0.0], ends[:-1]])
    half = (ends - starts) / 2
    numbers = rng.normal(size=(records, width)) * scale
    rows = np.concatenate([numbers, np.stack([starts + half, 0 * half, half], 1)], 1)
    arrays = {"rows": rows, "grid": np.array([0.0, 0.0, SPAN / records])}
    if uneven:
        arrays["first"] = np.searchsorted(ends, SPAN / records * np.arange(records), side="right").astype(float)
        arrays["ends"] = np.stack([[*ends[:-1], np.inf], np.zeros(records)], 1)
    return to_record_table(arrays, series, 2 if uneven else 0)


def table(kind, rng, records, name):
    """A table of some kind, its numbers drawn at random."""
    common = {"reference": jnp.asarray([0.0, 0.0]), "span": jnp.asarray([0.0, 0.0, SPAN, 0.0]), "info": info(name)}
    falling = np.repeat(0.4 ** np.arange(8), 3)
    if kind == "attitude":
        axis = rng.normal(size=(records, 3))
        start = rng.normal(size=(records, 4))
        made = leg(rng, records, 14, 3, False, 0.1)
        rows = np.array(made.rows)
        rows[:, :4], rows[:, 4:7] = start / np.linalg.norm(start, axis=1)[:, None], axis / np.linalg.norm(axis, axis=1)[:, None]
        rows[:, -3] -= rows[:, -1]  # an interval is known by its start and its length
        rows[:, -1] *= 2
        return AttitudeTable(record_tables=(replace(made, rows=jnp.asarray(rows)),), mode="smooth", **common)
    if kind == "cayley":
        spins = rng.normal(size=(records, 8))
        for part in (slice(0, 4), slice(4, 7)):
            spins[:, part] /= np.linalg.norm(spins[:, part], axis=1)[:, None]
        spins[:, 7] *= 1e-3
        return CayleyTable(
            record_tables=(leg(rng, records, 24, 3, False, 0.1 * falling),), spins=jnp.asarray(spins, made_dtype()), **common
        )
    if kind == "orientation":
        placement = jf.Rotation.from_rpy(*rng.normal(size=3)).wxyz
        return OrientationTable(
            record_tables=(leg(rng, records, 24, 3, False, falling),), placement=jnp.asarray(placement, made_dtype()), **common
        )
    series = 6 if kind == "own rates" else 3
    legs = [leg(rng, records, 8 * series, series, kind == "uneven", np.repeat(0.4 ** np.arange(8), series))]
    if kind == "two runs":
        legs.append(leg(rng, records + 3, 24, 3, True, falling))
    return TranslationTable(record_tables=tuple(legs), **common)


def made_dtype():
    return jnp.zeros(()).dtype


KINDS = ("translation", "uneven", "own rates", "two runs", "orientation", "attitude", "cayley")


def many(kind, count, seed=0):
    """A tree of tables of one kind, each of another length, and the tables."""
    rng = np.random.default_rng(seed)
    tables = [table(kind, rng, 3 + i % 7, f"t{i}") for i in range(count)]
    b = jf.TreeBuilder("centre")
    for i, edge in enumerate(tables):
        b.add(f"t{i}", parent="centre", edge=edge)
    return b.build(), tables


CHOSEN = (0, 4, 8)
"""The tables that are also worked out by themselves, each of which is a program of its own."""


def alone(tables, et):
    """What the chosen tables say one by one, each as a tree of one frame, joined."""
    found = []
    for i in CHOSEN:
        b = jf.TreeBuilder("centre")
        b.add("t", parent="centre", edge=tables[i])
        tree = b.build()
        found.append(tree.motion(tree.state(time=jf.Epoch.from_et(et)), of="t", relative_to="centre"))
    return jax.tree.map(lambda *parts: jnp.stack(parts, -2), *found)


def chosen(motions):
    """The motions of the chosen tables."""
    return jax.tree.map(lambda a: a[..., np.array(CHOSEN), :], motions)


def below(tree, et):
    """Motions of all frames but the root."""
    return jax.tree.map(lambda a: a[..., 1:, :], tree.world_motions(tree.state(time=jf.Epoch.from_et(et))))


@pytest.mark.parametrize("kind", KINDS)
def test_tables_together_are_what_each_is_alone(kind, dtype):
    tree, tables = many(kind, 9)
    assert "tables" in tree.explain()
    tolerance = {"rtol": 1e-12, "atol": 1e-12} if dtype == np.float64 else {"rtol": 2e-4, "atol": 2e-4}
    et = np.array([[0.0, 1.0], [1234.5, SPAN / 2], [SPAN, SPAN / 3], [-1.0, SPAN + 1.0], [np.nan, 77.0]], dtype)
    whole = below(tree, et)
    chex.assert_trees_all_close(chosen(whole), alone(tables, et), **tolerance)
    single = below(tree, et[1, 0])
    chex.assert_trees_all_close(single, jax.tree.map(lambda a: a[1, 0], whole), **tolerance)
    is_turned = kind in ("orientation", "attitude", "cayley")
    values = whole.transform.rotation.wxyz if is_turned else whole.transform.translation
    assert np.isnan(values[3]).all()
    assert np.isnan(values[4, 0]).all()
    assert np.isfinite(values[:3]).all()


@pytest.mark.float64
@pytest.mark.parametrize("kind", ["uneven", "orientation", "cayley"])
def test_large_batches_by_blocks_vmap_and_jit_agree(kind):
    tree, tables = many(kind, 9)
    et = np.linspace(0.0, SPAN, BLOCK // 9 + 50)
    whole = jax.jit(lambda et: below(tree, et))(et)
    chex.assert_trees_all_close(chosen(whole), alone(tables, et), rtol=1e-12, atol=1e-12)
    chex.assert_trees_all_close(jax.vmap(lambda et: below(tree, et))(et), whole, rtol=1e-12, atol=1e-12)


@pytest.mark.float64
def test_gradients_by_time_and_by_coefficients():
    tree, _ = many("uneven", 9)
    et = jnp.asarray([100.0, 2222.0])
    tangent = jax.jvp(lambda et: below(tree, et).transform.translation, (et,), (jnp.ones(2),))[1]
    np.testing.assert_allclose(tangent, below(tree, et).velocity.linear, rtol=1e-12)
    loss = lambda tree: jnp.sum(below(tree, et).transform.translation[:, 3] ** 2)
    gradient = jax.jit(jax.grad(loss))(tree).get("t3.record_tables")[0].rows
    step = np.zeros(gradient.shape)
    step[tuple(np.argwhere(np.abs(gradient) > 0)[4])] = 1e-5
    legs = tree.get("t3.record_tables")
    moved = [loss(tree.with_values({"t3.record_tables": (replace(legs[0], rows=legs[0].rows + s * step),)})) for s in (1, -1)]
    np.testing.assert_allclose(np.sum(gradient * step), (moved[0] - moved[1]) / 2, rtol=1e-6)


@pytest.mark.float64
def test_the_program_does_not_grow_with_the_number_of_tables():
    def program(count):
        tree, _ = many("uneven", count)
        motions = lambda et: below(tree, et)
        return stages(motions, 5.0), len(jax.make_jaxpr(motions)(5.0).eqns)

    assert program(40) == program(9)


@pytest.mark.float64
def test_other_numbers_compile_nothing_anew():
    (tree, _), (other, others) = many("uneven", 9), many("uneven", 9, seed=1)
    below(tree, 5.0)
    assert compilations(below, other, 5.0) == 0
    chex.assert_trees_all_close(chosen(below(other, 5.0)), alone(others, 5.0), rtol=1e-12)


@pytest.mark.float64
def test_single_queries_and_named_numbers_of_tables_that_are_stored_together():
    tree, tables = many("two runs", 70)
    state = tree.state(time=jf.Epoch.from_et(321.0))
    pose = tree.transform(state, of="t3", relative_to="t65")
    np.testing.assert_allclose(pose.translation, tables[3].evaluate(321.0)[0] - tables[65].evaluate(321.0)[0], rtol=1e-12)
    assert tree.edge("t65").info.of == "t65"
    chex.assert_trees_all_equal(tree.get("t65.record_tables"), tree.edge("t65").record_tables)
