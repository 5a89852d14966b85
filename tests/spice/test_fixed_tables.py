"""Fixed frames as tables: named, saved, listed, merged, and placed by their ids."""

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice.test_fixed_frames import FRAMES
from tests.spice.test_orientation import angles, matrices
from tests.spice.test_store import equal

SPAN = {"start": "2026-01-01", "stop": "2026-02-01"}
TIME = 820497600.0 + 86400.0


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("fk") / "test.tf"
    path.write_text(FRAMES)
    return path


@pytest.fixture(scope="module")
def tables(paths, file):
    with jf.spice.Kernels([*paths, file]) as kernels:
        return {
            "earth": kernels.translation(target="EARTH", center="SSB", **SPAN),
            "itrf93": kernels.orientation(frame="ITRF93", **SPAN),
            "ecliptic": kernels.orientation(frame="ECLIPJ2000"),
            "pa": kernels.orientation(frame="MOON_TEST_PA", relative_to="ITRF93"),
            "me": kernels.orientation(frame="MOON_TEST_ME", relative_to="MOON_TEST_PA"),
        }


def test_they_know_what_they_are(tables):
    edge = tables["me"]
    assert isinstance(edge, jf.tables.FixedFrame)
    assert isinstance(edge, jf.edges.Fixed)
    info = edge.info
    assert (info.kind, info.of, info.of_id, info.relative_to, info.relative_id, info.center) == (
        "fixed",
        "MOON_TEST_ME",
        1400302,
        "MOON_TEST_PA",
        1400301,
        301,
    )
    for part in (
        "orientation of MOON_TEST_ME (1400302) relative to MOON_TEST_PA",
        "constant rotation",
        "every instant",
        "kernel:   test.tf",
    ):
        assert part in edge.report()
    assert repr(edge) == "<fixed: MOON_TEST_ME from MOON_TEST_PA>"


def test_they_come_back_from_a_file_bit_for_bit_and_are_listed(tables, tmp_path):
    jf.spice.save(tmp_path / "t.npz", tables)
    loaded = jf.spice.load(tmp_path / "t.npz")
    for name, table in tables.items():
        equal(loaded[name], table)
        assert loaded[name].report() == table.report()
    listed = jf.spice.contents(tmp_path / "t.npz")
    assert str(listed["pa"]) == "fixed: MOON_TEST_PA from ITRF93 in ITRF93, at every instant, 32 bytes"
    assert listed["ecliptic"].info == tables["ecliptic"].info
    assert jf.spice.merge(tables, loaded)["me"] is tables["me"]
    with pytest.raises(errors.TableError, match="it holds at every instant"):
        jf.spice.crop(tables["me"], stop="2026-01-05")


def test_plain_mounts_have_no_names_to_be_saved_under(tmp_path):
    with pytest.raises(errors.TableError, match="'mount' is a Fixed, not a table"):
        jf.spice.save(tmp_path / "x.npz", {"mount": jf.edges.Fixed()})


def test_they_agree_with_cspice_and_evaluate_as_tables_do(tables, file, cspice, dtype):
    cspice.furnsh(str(file))
    for name in ("ecliptic", "pa", "me"):
        edge = tables[name]
        q, w, a = edge.evaluate(np.array([TIME, TIME + 1]))
        reference = cspice.pxform(edge.info.of, edge.info.relative_to, TIME)
        assert angles(matrices(q), np.array([reference, reference])).max() <= (1e-15 if dtype == np.float64 else 3e-7)
        assert (w.shape, a.shape) == ((2, 3), (2, 3))
        assert not np.asarray(w).any()
        assert edge.evaluate(jf.Epoch.from_et(TIME), 0)[0].shape == (4,)


def test_they_are_placed_from_tables_alone(tables, file, paths, cspice, dtype):
    builder = jf.TreeBuilder(root="SSB")
    assert builder.add_spice(tables, body="EARTH", frame="ECLIPJ2000") == "ECLIPJ2000 @ EARTH"
    assert builder.add_spice(tables, body="EARTH", frame="MOON_TEST_ME") == "MOON_TEST_ME @ EARTH"
    tree = builder.build()
    assert tree.parent("MOON_TEST_ME @ EARTH") == "MOON_TEST_PA @ EARTH"
    cspice.furnsh(str(file))
    found = tree.transform(tree.state(time=TIME), of="MOON_TEST_ME @ EARTH", relative_to="ECLIPJ2000 @ EARTH").rotation.wxyz
    reference = cspice.pxform("MOON_TEST_ME", "ECLIPJ2000", TIME)
    assert angles(matrices(found[None]), reference[None]).max() <= (1e-12 if dtype == np.float64 else 2e-6)
    again = jf.from_json(jf.to_json(tree))
    for x, y in zip(jax.tree.leaves(again), jax.tree.leaves(tree), strict=True):
        np.testing.assert_array_equal(x, y)


def test_a_fixed_frame_is_turned_round_where_the_root_asks_for_it(tables, cspice, dtype):
    builder = jf.TreeBuilder(root="plane")
    builder.set_properties("plane", {"spice_body": 0, "spice_frame": 17})
    assert builder.add_spice(tables, body="EARTH", frame="J2000") == "EARTH"
    tree = builder.build()
    found = tree.transform(tree.state(time=TIME), of="EARTH", relative_to="plane").translation
    reference = np.array(cspice.spkezr("EARTH", TIME, "ECLIPJ2000", "NONE", "SSB")[0][:3]) * 1e3
    assert np.linalg.norm(np.asarray(found, float) - reference) <= (1e-3 if dtype == np.float64 else 5e4)
