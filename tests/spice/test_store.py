"""Tables on disk: exact round trip, damage found, nothing left half-written, no kernels needed."""

import hashlib
import io
import json
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

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


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
def test_saving_keeps_permissions_and_links_and_follows_the_umask(tmp_path, moon):
    private, public, link = tmp_path / "private.npz", tmp_path / "public.npz", tmp_path / "link.npz"
    private.write_bytes(b"old")
    private.chmod(0o600)
    link.symlink_to(private.name)
    jf.spice.save(link, {"moon": moon})
    assert link.is_symlink()
    assert private.stat().st_mode & 0o777 == 0o600
    equal(jf.spice.load(private)["moon"], moon)
    before = os.umask(0o027)
    try:
        jf.spice.save(public, {"moon": moon})
    finally:
        os.umask(before)
    assert public.stat().st_mode & 0o777 == 0o640


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX")
def test_what_is_no_regular_file_is_not_replaced(tmp_path, moon):
    os.mkfifo(tmp_path / "pipe")
    for target in (tmp_path / "pipe", tmp_path, Path("/dev/null")):
        with pytest.raises(TableError, match="is no regular file"):
            jf.spice.save(target, {"moon": moon})
    assert (tmp_path / "pipe").is_fifo()
    assert [p.name for p in tmp_path.iterdir()] == ["pipe"]
    (tmp_path / "ring").symlink_to("ring")
    for target in (tmp_path / "ring", "a\0b.npz"):
        with pytest.raises(TableError, match="cannot be written"):
            jf.spice.save(target, {"moon": moon})
        with pytest.raises(TableError, match="cannot be read"):
            jf.spice.load(target)


def test_what_a_killed_save_left_is_removed_after_an_hour(tmp_path, moon):
    old, fresh, other = (tmp_path / name for name in (".x[1].npz.aa.part", ".x[1].npz.bb.part", ".y.npz.cc.part"))
    for left in (old, fresh, other):
        left.write_bytes(b"half")
    for left in (old, other):
        os.utime(left, (time.time() - 4000,) * 2)
    jf.spice.save(tmp_path / "x[1].npz", {"moon": moon})
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([fresh.name, other.name, "x[1].npz"])


def resealed(path, name, change, compress=zipfile.ZIP_DEFLATED):
    """Write a table file again with one of its members changed and a checksum that fits."""
    with zipfile.ZipFile(path) as archive:
        members = {item.filename: archive.read(item) for item in archive.infolist()}
    members[name] = change(members[name])
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compress) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
        archive.comment = store.MARK + b"0" * 64
    body = buffer.getvalue()[:-64]
    path.write_bytes(body + hashlib.sha256(body).hexdigest().encode())


def array(change):
    def changed(content):
        buffer = io.BytesIO()
        np.save(buffer, change(np.load(io.BytesIO(content))))
        return buffer.getvalue()

    return changed


def test_what_unpacks_to_too_much_is_not_unpacked(file, monkeypatch):
    with zipfile.ZipFile(file) as archive:
        real = sum(item.file_size for item in archive.infolist())
    with pytest.raises(TableError, match=rf"unpacks to {real}, more than the 1000 that are read of it.*most_bytes"):
        jf.spice.load(file, most_bytes=1000)
    monkeypatch.setattr(store, "USUAL_BYTES", 0)
    resealed(file, "table0/records0/rows.npy", lambda content: content + bytes(30 * file.stat().st_size))
    with pytest.raises(TableError, match=r"has \d+ bytes and unpacks to \d+"):
        jf.spice.load(file)
    with pytest.raises(TableError, match="says that it holds"):
        jf.spice.load(file, most_bytes=10**9)


@pytest.mark.parametrize(
    ("member", "change", "words"),
    {
        "rows of a vector": ("rows", lambda a: a[0], "rows has the shape"),
        "no whole terms": ("rows", lambda a: a[:, 1:], "hold no whole terms of 3 series"),
        "no records": ("rows", lambda a: a[:0], "it needs a record"),
        "whole numbers": ("rows", lambda a: a.astype(np.int64), "numbers of int64"),
        "a grid too long": ("grid", lambda a: np.append(a, 1.0), r"grid has the shape \[3\], found \[4\]"),
        "no width": ("grid", lambda a: a * [1, 1, 0], "cells of a positive width"),
        "not a number": ("grid", lambda a: a * np.nan, "cells of a positive width"),
    }.values(),
)
def test_arrays_that_do_not_fit_are_found_when_read(file, member, change, words):
    resealed(file, f"table0/records0/{member}.npy", array(change))
    with pytest.raises(TableError, match=words):
        jf.spice.load(file)


def test_shipped_tables():
    from importlib.resources import files

    tables = jf.spice.load(str(files("jaxframes") / "data" / "tables_2026.npz"))
    assert set(tables) == {"sun", "emb", "earth", "moon", "mars", "itrf93"}
    t = jf.Epoch.from_tdb("2026-09-01")
    distance = float(np.linalg.norm(tables["moon"].evaluate(t, order=0)[0]))
    assert 3.5e8 < distance < 4.1e8
