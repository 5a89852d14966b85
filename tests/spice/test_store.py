"""Tables on disk: exact round trip, damage found, nothing left half-written, no kernels needed."""

import json
import subprocess
import sys
import zipfile

import jax
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import TableError
from jaxframes.tables import store
from tests.spice import made


@pytest.fixture
def file(tmp_path, moon, itrf93):
    path = tmp_path / "tables.npz"
    jf.spice.save(path, {"moon": moon, "itrf93": itrf93})
    return path


def equal(a, b):
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert x.dtype == y.dtype
        assert np.asarray(x).tobytes() == np.asarray(y).tobytes()


def test_round_trip_is_bit_for_bit(file, moon, itrf93):
    loaded = jf.spice.load(file)
    assert list(loaded) == ["moon", "itrf93"]
    equal(loaded["moon"], moon)
    equal(loaded["itrf93"], itrf93)
    assert loaded["moon"].report() == moon.report()


def test_round_trip_of_unequal_records_and_type_3(tmp_path, rng):
    segments = [
        (2, -77, 399, "J2000", 0.0, 300.0, 0.0, 100.0, made.coefficients(rng, 3, 3, 7)),
        (3, -77, 399, "J2000", 300.0, 700.0, 300.0, 200.0, made.coefficients(rng, 2, 6, 6)),
    ]
    with jf.spice.Kernels(made.spk(tmp_path / "mixed.bsp", segments)) as kernels:
        edge = kernels.translation(target=-77, center=399)
    jf.spice.save(tmp_path / "mixed.npz", {"craft": edge})
    equal(jf.spice.load(tmp_path / "mixed.npz")["craft"], edge)


def test_same_tables_same_bytes_and_plain_numpy_reads_them(file, tmp_path, moon, itrf93):
    jf.spice.save(tmp_path / "again.npz", {"moon": moon, "itrf93": itrf93})
    assert (tmp_path / "again.npz").read_bytes() == file.read_bytes()
    with np.load(file, allow_pickle=False) as arrays:
        assert arrays["table0/records0/rows"].shape == moon.record_tables[0].rows.shape
    with zipfile.ZipFile(file) as archive:
        metadata = json.loads(archive.read("metadata.json"))
    assert (metadata["schema"], metadata["scale"], metadata["units"]["length"]) == (store.SCHEMA, "TDB", "m")
    info = metadata["tables"]["moon"]["info"]
    assert (info["of_id"], info["reference"], info["start"]) == (301, "820454400", "820497600")
    assert info["sources"][0]["name"] == "de440.bsp"
    assert len(info["sources"][0]["sha256"]) == 64


def test_loading_needs_no_spiceypy_and_no_process(file):
    probe = """
import subprocess, sys
import jaxframes as jf
def refuse(*a, **k): raise AssertionError("a process was started")
subprocess.Popen = refuse
sys.modules["spiceypy"] = None
table = jf.spice.load(sys.argv[1])["moon"]
print(table.evaluate(jf.Epoch.from_tdb("2026-05-05"), order=0)[0].shape)
"""
    done = subprocess.run([sys.executable, "-c", probe, str(file)], capture_output=True, text=True, check=False)
    assert done.stdout == "(3,)\n", done.stderr


def test_every_changed_byte_is_found(file, rng):
    content = file.read_bytes()
    places = {*range(0, 200, 7), *rng.integers(0, len(content), 150), *range(len(content) - 260, len(content), 3)}
    for place in places:
        changed = bytearray(content)
        changed[place] ^= 1 << int(rng.integers(8))
        file.write_bytes(changed)
        with pytest.raises(TableError, match=r"tables\.npz is"):
            jf.spice.load(file)


@pytest.mark.parametrize("keep", [0, 1, 100, 0.5, 0.99, -1])
def test_cut_off(file, keep):
    content = file.read_bytes()
    file.write_bytes(content[: int(keep * len(content)) if isinstance(keep, float) else keep])
    with pytest.raises(TableError, match=r"tables\.npz is"):
        jf.spice.load(file)


def test_not_a_table_file(tmp_path):
    with pytest.raises(TableError, match="There is no table file"):
        jf.spice.load(tmp_path / "none.npz")
    with pytest.raises(TableError, match="cannot be read"):
        jf.spice.load(tmp_path)
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(TableError, match="was not written by"):
        jf.spice.load(tmp_path / "other.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(TableError, match="is not a table file"):
        jf.spice.load(tmp_path / "text.npz")


def test_unknown_schema(tmp_path, moon, monkeypatch):
    monkeypatch.setattr(store, "SCHEMA", 99)
    jf.spice.save(tmp_path / "future.npz", {"moon": moon})
    monkeypatch.undo()
    with pytest.raises(TableError, match=r"has schema 99; .* reads schema 1 alone\. Make the tables again"):
        jf.spice.load(tmp_path / "future.npz")


def test_only_tables_are_saved(tmp_path):
    with pytest.raises(TableError, match="'mount' is a Fixed"):
        jf.spice.save(tmp_path / "x.npz", {"mount": jf.edges.Fixed()})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_failed_save_leaves_nothing_and_the_old_file_as_it_was(tmp_path, moon, monkeypatch, step):
    (tmp_path / "old.npz").write_bytes(b"old")

    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(f"os.{step}", full)
    for name in ("old.npz", "new.npz"):
        with pytest.raises(TableError, match="No space left"):
            jf.spice.save(tmp_path / name, {"moon": moon})
    assert [p.name for p in tmp_path.iterdir()] == ["old.npz"]
    assert (tmp_path / "old.npz").read_bytes() == b"old"


def test_save_into_a_folder_that_is_not_there(tmp_path, moon):
    with pytest.raises(TableError, match="cannot be written: No such file"):
        jf.spice.save(tmp_path / "no" / "x.npz", {"moon": moon})


def test_shipped_tables():
    from importlib.resources import files

    tables = jf.spice.load(str(files("jaxframes") / "data" / "tables_2026.npz"))
    assert set(tables) == {"sun", "emb", "earth", "moon", "mars", "itrf93"}
    t = jf.Epoch.from_tdb("2026-09-01")
    distance = float(np.linalg.norm(tables["moon"].evaluate(t, order=0)[0]))
    assert 3.5e8 < distance < 4.1e8
