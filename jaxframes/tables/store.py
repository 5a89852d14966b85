"""Saving and loading tables: one ``.npz`` without pickle, with a schema version and a checksum over the whole file.

The file is an ordinary zip archive of ``.npy`` arrays and a JSON text. The SHA-256 of everything before it is the last 64 characters, as
part of the archive's comment: no byte can change unnoticed, and NumPy alone can still read the arrays.
"""

import contextlib
import hashlib
import io
import json
import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError, TableError
from jaxframes.staging.arrays import default_float
from jaxframes.tables.attitude import AttitudeTable, CayleyTable
from jaxframes.tables.base import Table
from jaxframes.tables.fixed import FixedFrame
from jaxframes.tables.iau_model import IauOrientation
from jaxframes.tables.info import Info
from jaxframes.tables.instants import pairs
from jaxframes.tables.orientation import OrientationTable
from jaxframes.tables.records import host_arrays, to_record_table
from jaxframes.tables.stored_shapes import Form, check_records, check_shapes
from jaxframes.tables.translation import TranslationTable
from jaxframes.tables.whole_file import write_whole

Storable: TypeAlias = Table | IauOrientation | FixedFrame
SCHEMA = 1
"""Version of what is in the file; no other is read."""
USUAL_BYTES, USUAL_RATIO = 64 << 20, 20
"""What a file may be unpacked: so much, and so many times its size. Records hardly shrink; constant ones do, and are few."""
MARK = b"jaxframes tables, sha256 of all before this: "


@dataclass(frozen=True)
class Kind:
    """How tables of a kind are stored, beside their record tables and facts: further arrays with their forms, and static fields."""

    table: type[Any]
    arrays: Mapping[str, Form] = field(default_factory=dict)
    static: tuple[str, ...] = ()


IAU: dict[str, Form] = {
    "polynomials": (3, "powers", 2),
    "phases": ("angles", "degrees", 2),
    "reference": (2,),
    "amplitudes": ("angles", 3),
    "placement": (4,),
}
KINDS = {
    "translation": Kind(TranslationTable),
    "orientation": Kind(OrientationTable, {"placement": (4,)}),
    "knots": Kind(AttitudeTable, static=("mode",)),
    "cayley": Kind(CayleyTable, {"spins": ("n", 8)}),
    "iau": Kind(IauOrientation, IAU),
    "fixed": Kind(FixedFrame, {"rotation": (4,)}),
}
STORABLE = tuple(kind.table for kind in KINDS.values())
"""Everything that a table file can hold."""
MODELS = (IauOrientation, FixedFrame)
"""Edges that hold at every instant and store themselves."""
STAMP = (1980, 1, 1, 0, 0, 0)
HEADER = {"format": "jaxframes tables", "scale": "TDB", "units": {"length": "m", "angle": "rad", "time": "s"}}


def save(path: str | os.PathLike[str], tables: Mapping[str, Storable]) -> None:
    """Write tables to one file: whole or not at all, the same bytes for the same tables.

    A file that is replaced keeps its permissions, a symbolic link stays one; a new file has those that the umask leaves.

    Args:
        path: The file to write, replaced if it exists.
        tables: Tables by name.

    Raises:
        TableError: If something is no table, or the file cannot be written or is no regular file.
    """
    write_whole(Path(path), to_bytes(tables))


def load(path: str | os.PathLike[str], *, most_bytes: int | None = None) -> dict[str, Any]:
    """Read tables written by ``save``. No kernel is needed, and spiceypy is not imported.

    Arrays are of the default float dtype of JAX; times keep in two parts what one float32 cannot hold.

    Args:
        path: The file.
        most_bytes: How large it may be unpacked; default: 64 MiB and 20 times the file.

    Raises:
        TableError: If the file is missing, is no table file, is truncated or altered, has an unknown schema, or unpacks to too much.
    """
    with open_archive(Path(path), most_bytes) as (archive, entries):
        return {name: _table(archive, name, entry) for name, entry in entries.items()}


def from_bytes(content: bytes, label: str) -> dict[str, Any]:
    """Read tables from the content of a table file, which messages call by a label; otherwise as ``load``."""
    with _entries(content, label) as (archive, entries):
        return {name: _table(archive, name, entry) for name, entry in entries.items()}


@contextlib.contextmanager
def open_archive(target: Path, most_bytes: int | None = None) -> Iterator[tuple[zipfile.ZipFile, dict[str, Any]]]:
    """Open a table file for reading: its archive, and what its metadata say of each table.

    Raises:
        TableError: If the file is missing, is no table file, is truncated or altered, has an unknown schema, or what is read from it
            is not what that schema says.
    """
    with _entries(_content_of(target), str(target), most_bytes) as found:
        yield found


@contextlib.contextmanager
def _entries(content: bytes, label: str, most_bytes: int | None = None) -> Iterator[tuple[zipfile.ZipFile, dict[str, Any]]]:
    """Open the content of a table file, as ``open_archive`` does."""
    _check(label, content)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            most = USUAL_BYTES + USUAL_RATIO * len(content) if most_bytes is None else most_bytes
            unpacked = sum(entry.file_size for entry in archive.infolist())  # what a reader gives at most, whatever follows
            if unpacked > most:
                raise TableError(
                    f"{label} has {len(content)} bytes and unpacks to {unpacked}, more than the {most} that are read of it. If it is to be "
                    "trusted, jf.spice.load(path, most_bytes=...) reads more."
                )
            yield archive, _read_metadata(label, archive)["tables"]
    except FrameError:
        raise
    except Exception as error:
        raise TableError(f"{label} does not hold what its schema says ({type(error).__name__}: {error}). Make the tables again.") from error


def _content_of(target: Path) -> bytes:
    """Return the bytes of a file (TableError if it cannot be read)."""
    try:
        return target.read_bytes()
    except FileNotFoundError as error:
        raise TableError(f"There is no table file {target}.") from error
    except (OSError, ValueError) as error:  # ValueError: a path with a NUL
        raise TableError(f"{str(target)!r} cannot be read: {error.strerror if isinstance(error, OSError) else error}.") from error


def _read_metadata(label: str, archive: zipfile.ZipFile) -> dict[str, Any]:
    """Return the JSON part of a table file.

    Raises:
        TableError: If its schema is unknown.
    """
    metadata = json.loads(archive.read("metadata.json"))
    if metadata.get("schema") != SCHEMA:
        raise TableError(
            f"{label} has schema {metadata.get('schema')!r}; this version of jaxframes reads schema {SCHEMA} alone. "
            "Make the tables again with this version, or use the one that wrote them."
        )
    return metadata


def _check(label: str, content: bytes) -> None:
    if not content.startswith(b"PK"):
        raise TableError(f"{label} is not a table file: it does not start as a .npz file does. Write tables with jf.spice.save.")
    body, digest = content[:-64], content[-64:]
    if not body.endswith(MARK) or hashlib.sha256(body).hexdigest().encode() != digest:
        raise TableError(
            f"{label} is truncated, was altered, or was not written by jf.spice.save: its checksum does not match. Make the tables again."
        )


def to_bytes(tables: Mapping[str, Storable]) -> bytes:
    """Return the content of a table file (TableError if something is no table)."""
    metadata: dict[str, Any] = {**HEADER, "schema": SCHEMA, "tables": {}}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, (name, table) in enumerate(tables.items()):
            if not isinstance(table, STORABLE):
                raise TableError(f"{name!r} is a {type(table).__name__}, not a table of jf.spice.Kernels: only tables are saved.")
            metadata["tables"][str(name)] = _write_table(archive, f"table{number}", table)
        archive.writestr(zipfile.ZipInfo("metadata.json", STAMP), json.dumps(metadata, indent=1), zipfile.ZIP_DEFLATED)
        archive.comment = MARK + b"0" * 64
    body = buffer.getvalue()[:-64]
    return body + hashlib.sha256(body).hexdigest().encode()


def _write_table(archive: zipfile.ZipFile, folder: str, table: Storable) -> dict[str, Any]:
    if isinstance(table, MODELS):
        arrays = table.to_arrays()
        for name, array in arrays.items():
            _write_array(archive, f"{folder}/{name}.npy", array)
        return {"info": table.info.to_json(), "arrays": {name: f"{folder}/{name}.npy" for name in arrays}}
    record_tables = []
    for i, records in enumerate(table.record_tables):
        arrays = host_arrays(records)
        record_tables.append(
            {"series": records.series, "compares": records.compares, "arrays": {n: f"{folder}/records{i}/{n}.npy" for n in arrays}}
        )
        for name, array in arrays.items():
            _write_array(archive, f"{folder}/records{i}/{name}.npy", array)
    entry: dict[str, Any] = {"info": table.info.to_json(), "record_tables": record_tables}
    kind = KINDS[table.info.kind]
    for name in kind.arrays:
        entry[name] = f"{folder}/{name}.npy"
        _write_array(archive, entry[name], np.array(getattr(table, name), np.float64))
    return entry | {name: getattr(table, name) for name in kind.static}


def _write_array(archive: zipfile.ZipFile, name: str, array: np.ndarray) -> None:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array, "<f8"), allow_pickle=False)
    archive.writestr(zipfile.ZipInfo(name, STAMP), buffer.getvalue(), zipfile.ZIP_DEFLATED)


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    content = io.BytesIO(archive.read(name))
    if np.lib.format.read_magic(content) != (1, 0):
        raise TableError(f"{name} is of another version of NumPy's format")
    shape, by_columns, dtype = np.lib.format.read_array_header_1_0(content)
    held = content.getbuffer()[content.tell() :]
    if dtype != np.dtype("<f8") or by_columns or 8 * math.prod(shape) != len(held):
        raise TableError(f"{name} says that it holds {shape} numbers of {dtype}, and has {len(held)} bytes")
    return np.frombuffer(held, "<f8").reshape(shape).copy()


def _table(archive: zipfile.ZipFile, name: str, entry: dict[str, Any]) -> Storable:
    info = Info.from_json(entry["info"])
    if info.kind not in KINDS:
        raise TableError(f"table {name!r} is of the unknown kind {info.kind!r}")
    kind = KINDS[info.kind]
    what = f"table {name!r}"
    if kind.table in MODELS:
        arrays = {n: _read_array(archive, file) for n, file in entry["arrays"].items()}
        check_shapes(arrays, kind.arrays, {}, what)
        return kind.table.from_arrays(arrays, info)
    record_tables, records = [], 0
    for held in entry["record_tables"]:
        arrays = {n: _read_array(archive, file) for n, file in held["arrays"].items()}
        records = check_records(arrays, held["series"], held["compares"], what)
        record_tables.append(to_record_table(arrays, held["series"], held["compares"], low=has_low(info.kind)))
    further = {n: _read_array(archive, entry[n]) for n in kind.arrays}
    check_shapes(further, kind.arrays, {"n": records}, what)
    reference, start, stop = (Fraction(x) for x in (info.reference, info.start, info.stop))
    fields: dict[str, Any] = {
        "record_tables": tuple(record_tables),
        "reference": pairs(reference),
        "span": pairs(start - reference, stop - reference),
        "info": info,
    }
    fields |= {n: jnp.asarray(array, default_float()) for n, array in further.items()}
    return kind.table(**fields, **{static: entry[static] for static in kind.static})


def has_low(kind: str) -> bool:
    """Whether float32 tables of a kind keep low parts of their coefficients."""
    return kind == "translation"


@dataclass(frozen=True)
class Entry:
    """A table in a file.

    Attributes:
        info: What the table knows about itself.
        records: How many records each record table has; none for a model.
        bytes: Size of its arrays in float64.
    """

    info: Info
    records: tuple[int, ...]
    bytes: int

    def __str__(self) -> str:
        """Return one line."""
        info = self.info
        held = f"{info.coverage}, {' + '.join(str(n) for n in self.records)} records" if self.records else "at every instant"
        return f"{info.kind}: {info.of} from {info.relative_to} in {info.axes}, {held}, {self.bytes} bytes"


def contents(path: str | os.PathLike[str]) -> dict[str, Entry]:
    """Return what a file written by ``save`` holds, by name; the numbers of the tables stay on the disk.

    Raises:
        TableError: If the file is missing, is no table file, is truncated or altered, or has an unknown schema.
    """
    found = {}
    with open_archive(Path(path)) as (archive, entries):
        for number, (name, entry) in enumerate(entries.items()):
            shapes = {file: _shape(archive, file) for file in archive.namelist() if file.startswith(f"table{number}/")}
            records = tuple(shapes[held["arrays"]["rows"]][0] for held in entry.get("record_tables", ()))
            size = sum(8 * int(np.prod(shape)) for shape in shapes.values())
            found[name] = Entry(Info.from_json(entry["info"]), records, size)
    return found


def _shape(archive: zipfile.ZipFile, file: str) -> tuple[int, ...]:
    """Return the shape of an array by the head of its file alone."""
    with archive.open(file) as stream:
        np.lib.format.read_magic(stream)
        return np.lib.format.read_array_header_1_0(stream)[0]


SHIPPED = Path(__file__).resolve().parent.parent / "data" / "tables_2026.npz"


def example_tables() -> dict[str, Any]:
    """Return tables of 2026 from DE440 and ITRF93, by name.

    ``sun``, ``mars`` (barycentre) and ``emb`` are relative to the Solar System barycentre, ``earth`` to ``emb`` and ``moon`` to
    ``earth``, all in J2000 axes; ``itrf93`` orients the Earth-fixed frame in J2000. ``edge.report()`` says more.
    """
    return load(SHIPPED)
