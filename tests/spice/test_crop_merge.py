"""Tables cut, merged, listed."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import CoverageError, TableError
from tests.spice import orbits
from tests.spice.test_store import equal


@pytest.fixture(scope="module")
def craft(tmp_path_factory):
    """Tables with irregular records, knots with a gap, and a fitted attitude, made from kernels written here."""
    folder = tmp_path_factory.mktemp("craft")
    rng = np.random.default_rng(5)
    times = np.cumsum(rng.integers(20, 90, 60)).astype(float)
    files = [*orbits.clock(folder), orbits.nodes(folder / "9.bsp", 9, orbits.LEO, times, 7)]
    seconds = np.concatenate([np.arange(0, 600, 20.0), np.arange(900, 1500, 20.0)])
    q, w, _ = orbits.slew(seconds)
    files.append(orbits.pointing(folder / "3.bc", 3, seconds, q, w, starts=[0.0, 900.0]))
    with jf.spice.Kernels(files) as kernels:
        yield {
            "orbit": kernels.translation(target=-77, center=399),
            "knots": kernels.orientation(frame="TESTCRAFT"),
            "spice": kernels.orientation(frame="TESTCRAFT", ck="spice"),
            "fitted": kernels.orientation(frame="TESTCRAFT", tolerance=jf.spice.Tolerance(angle=1e-5, rate=1e-5)),
        }


def values(table, times):
    return [np.asarray(x) for x in table.evaluate(times)]


def test_all_kinds_of_tables_come_back_bit_for_bit(craft, tmp_path):
    jf.spice.save(tmp_path / "all.npz", craft)
    loaded = jf.spice.load(tmp_path / "all.npz")
    for name, table in craft.items():
        equal(loaded[name], table)
        assert loaded[name].report() == table.report()
    listed = jf.spice.contents(tmp_path / "all.npz")
    assert [(name, entry.info.kind) for name, entry in listed.items()] == [
        ("orbit", "translation"),
        ("knots", "knots"),
        ("spice", "knots"),
        ("fitted", "cayley"),
    ]
    for name, entry in listed.items():
        assert entry.info == craft[name].info
        assert entry.records == tuple(leg.rows.shape[0] for leg in craft[name].record_tables)
    assert str(listed["knots"]).startswith("knots: TESTCRAFT from J2000 in J2000, 2000-01-01T12:00:00.000 ..")


def test_contents_finds_damage(craft, tmp_path):
    path = tmp_path / "all.npz"
    jf.spice.save(path, craft)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(TableError, match="truncated"):
        jf.spice.contents(path)


@pytest.mark.parametrize("name", ["orbit", "knots", "fitted"])
def test_cropped_tables_have_the_same_values_and_fewer_records(craft, name):
    whole = craft[name]
    part = jf.spice.crop(whole, 320.0, 1150.0)
    times = np.array([320.0, 321.5, 470.0, 580.0, 905.0, 1000.0, 1150.0])
    for a, b in zip(values(part, times), values(whole, times), strict=True):
        np.testing.assert_array_equal(a, b)
    assert part.record_tables[0].rows.shape[0] < whole.record_tables[0].rows.shape[0] or name == "fitted"  # whose few records all serve
    outside = np.array([319.0, 1151.0])
    assert np.asarray(part.coverage_code(outside)).tolist() == [-1, 1]
    assert np.isnan(values(part, outside)[0]).all()
    assert (part.info.start, part.info.stop) == ("320", "1150")
    assert part.record_tables[0].rows.dtype == whole.record_tables[0].rows.dtype


@pytest.mark.parametrize("name", ["orbit", "knots", "spice", "fitted"])
def test_cut_and_merged_tables_are_what_they_were(craft, name):
    whole = craft[name]
    middle = 470.0
    ends = (whole.info.start, whole.info.stop)
    parts = [jf.spice.crop(whole, stop=middle), jf.spice.crop(whole, start=middle)]
    again = jf.spice.merge(*parts[::-1])
    times = np.sort(np.append(np.random.default_rng(1).uniform(130, 1450, 40), middle))
    for a, b in zip(values(again, times), values(whole, times), strict=True):
        np.testing.assert_array_equal(a, b)
    assert again.record_tables[0].rows.shape == whole.record_tables[0].rows.shape
    assert (again.info.start, again.info.stop) == ends


@pytest.mark.parametrize("name", ["orbit", "knots", "spice", "fitted"])
def test_parts_that_lie_within_one_record_merge(craft, name):
    whole = craft[name]
    cuts = [None, 301.0, 302.0, 302.5, 303.0, 470.0, 471.0, None]
    parts = [jf.spice.crop(whole, a, b) for a, b in itertools.pairwise(cuts)]
    again = jf.spice.merge(*parts)
    times = np.sort(np.concatenate([np.random.default_rng(1).uniform(130, 1450, 40), cuts[1:-1], [302.2, 302.7, 470.5]]))
    for a, b in zip(values(again, times), values(whole, times), strict=True):
        np.testing.assert_array_equal(a, b)
    assert again.record_tables[0].rows.shape == whole.record_tables[0].rows.shape
    assert (again.info.start, again.info.stop) == (whole.info.start, whole.info.stop)


@pytest.mark.parametrize("name", ["moon", "itrf93"])
def test_a_part_within_one_record_of_an_even_grid_merges(request, name):
    whole = request.getfixturevalue(name)
    a, b = 820497600 + 864100.0, 820497600 + 864200.0
    parts = [jf.spice.crop(whole, stop=a), jf.spice.crop(whole, a, b), jf.spice.crop(whole, start=b)]
    assert [leg.rows.shape[0] for leg in parts[1].record_tables] == [1] * len(whole.record_tables)
    again = jf.spice.merge(*parts)
    equal(again.record_tables, whole.record_tables)
    times = np.array([a - 864000, a - 1, a, a + 50, b, b + 1, b + 1e6])
    for x, y in zip(values(again, times), values(whole, times), strict=True):
        np.testing.assert_array_equal(x, y)


def test_uniform_records_stay_uniform_and_references_may_differ(kernels, dtype):
    months = [("2026-01-01", "2026-02-03"), ("2026-02-03", "2026-02-20"), ("2026-02-20", "2026-04-01")]
    made_tables = [kernels.translation(target="MOON", center="EARTH", start=a, stop=b) for a, b in months]
    whole = kernels.translation(target="MOON", center="EARTH", start="2026-01-01", stop="2026-04-01")
    merged = jf.spice.merge(*({"moon": t} for t in made_tables))["moon"]
    assert merged.record_tables[0].first is None
    assert merged.record_tables[0].rows.shape == whole.record_tables[0].rows.shape
    times = 820497600.0 + np.random.default_rng(2).integers(0, 7_700_000, 60)
    for a, b in zip(values(merged, times), values(whole, times), strict=True):
        np.testing.assert_array_equal(a, b)
    bundle = jf.spice.merge({"moon": whole}, {"again": whole})
    assert list(bundle) == ["moon", "again"]


def test_what_cannot_be_cropped_or_merged(craft, moon, itrf93):
    with pytest.raises(CoverageError, match="cannot be cropped"):
        jf.spice.crop(moon, "2025-01-01")
    with pytest.raises(CoverageError, match="nothing covers 2026-02-01"):
        jf.spice.merge(jf.spice.crop(moon, stop="2026-02-01"), jf.spice.crop(moon, start="2026-03-01"))
    with pytest.raises(TableError, match="kind is 'translation' of one and 'orientation'"):
        jf.spice.merge(moon, itrf93)
    with pytest.raises(TableError, match="differ in mode"):
        jf.spice.merge(craft["knots"], craft["spice"])
    with pytest.raises(TableError, match="lies within"):
        jf.spice.merge(moon, jf.spice.crop(moon, "2026-03-01", "2026-04-01"))
    with pytest.raises(TableError, match="not Fixed"):
        jf.spice.merge(jf.edges.Fixed())
    with pytest.raises(TableError, match="at least one"):
        jf.spice.merge()


def test_attitudes_go_through_json_and_float32(craft, dtype):
    b = jf.TreeBuilder(root="j2000")
    b.add("craft", parent="j2000", edge=craft["knots"])
    b.add("fitted", parent="j2000", edge=craft["fitted"])
    tree = b.build()
    again = jf.from_json(jf.to_json(tree, indent=None))
    for x, y in zip(jax.tree.leaves(again), jax.tree.leaves(tree), strict=True):
        np.testing.assert_array_equal(x, y)
    state = tree.state(time=jf.Epoch.from_et(jnp.asarray(333.5, dtype)))
    wide = tree.motion(state, of="craft", relative_to="fitted")
    assert float(jnp.abs(wide.transform.rotation.wxyz[1:]).max()) < 1e-5
    small = craft["knots"].astype(np.float32)
    q = np.asarray(small.evaluate(np.float32(333.5), 0)[0])
    assert np.abs(q - np.asarray(craft["knots"].evaluate(333.5, 0)[0])).max() < 3e-7
