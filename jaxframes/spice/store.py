"""Tables on disk: one ``.npz`` without pickle, with a schema version and a checksum over the whole file.

The file is an ordinary zip archive of ``.npy`` arrays and a JSON text. The SHA-256 of everything before it is the last 64 characters, as
part of the archive's comment: no byte can change unnoticed, and NumPy alone can still read the arrays.
"""

import contextlib
import hashlib
import io
import json
import os
import tempfile
import zipfile
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias

import jax.numpy as jnp
import numpy as np

from jaxframes.errors import FrameError, TableError
from jaxframes.numerics.boundary import default_float
from jaxframes.spice.iau import IauOrientation
from jaxframes.spice.info import Info
from jaxframes.spice.legs import from_leg, to_leg
from jaxframes.spice.tables import OrientationTable, TranslationTable
from jaxframes.spice.times import pairs

Table: TypeAlias = TranslationTable | OrientationTable | IauOrientation
SCHEMA = 1
MARK = b"jaxframes tables, sha256 of all before this: "
KINDS = {"translation": TranslationTable, "orientation": OrientationTable, "iau": IauOrientation}
STAMP = (1980, 1, 1, 0, 0, 0)
HEADER = {"format": "jaxframes tables", "scale": "TDB", "units": {"length": "m", "angle": "rad", "time": "s"}}


def save(path: str | os.PathLike[str], tables: Mapping[str, Table]) -> None:
    """Write tables to one file: whole or not at all, the same bytes for the same tables.

    Args:
        path: The file to write, replaced if it exists.
        tables: Tables by name.

    Raises:
        TableError: If something is no table, or the file cannot be written.
    """
    content = _archive(tables)
    target = Path(path)
    try:
        descriptor, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
    except OSError as error:
        raise TableError(f"{target} cannot be written: {error.strerror}.") from error
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError):
            raise TableError(f"{target} cannot be written: {error.strerror}.") from error
        raise


def load(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read tables written by ``save``. No kernel is needed, and spiceypy is not imported.

    Arrays are of the default float dtype of JAX; times keep in two parts what one float32 cannot hold.

    Raises:
        TableError: If the file is missing, is no table file, is truncated or altered, or has an unknown schema.
    """
    target = Path(path)
    try:
        content = target.read_bytes()
    except FileNotFoundError as error:
        raise TableError(f"There is no table file {target}.") from error
    except OSError as error:
        raise TableError(f"{target} cannot be read: {error.strerror}.") from error
    _check(target, content)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            metadata = json.loads(archive.read("metadata.json"))
            if metadata.get("schema") != SCHEMA:
                raise TableError(
                    f"{target} has schema {metadata.get('schema')!r}; this version of jaxframes reads {SCHEMA}. Make the tables again."
                )
            return {name: _table(archive, name, entry) for name, entry in metadata["tables"].items()}
    except FrameError:
        raise
    except Exception as error:
        raise TableError(
            f"{target} does not hold what its schema says ({type(error).__name__}: {error}). Make the tables again."
        ) from error


def _check(target: Path, content: bytes) -> None:
    if not content.startswith(b"PK"):
        raise TableError(f"{target} is not a table file: it does not start as a .npz file does. Write tables with jf.spice.save.")
    body, digest = content[:-64], content[-64:]
    if not body.endswith(MARK) or hashlib.sha256(body).hexdigest().encode() != digest:
        raise TableError(
            f"{target} is truncated, was altered, or was not written by jf.spice.save: its checksum does not match. Make the tables again."
        )


def _archive(tables: Mapping[str, Table]) -> bytes:
    metadata: dict[str, Any] = {**HEADER, "schema": SCHEMA, "tables": {}}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, (name, table) in enumerate(tables.items()):
            if not isinstance(table, tuple(KINDS.values())):
                raise TableError(f"{name!r} is a {type(table).__name__}, not a table of jf.spice.Kernels: only tables are saved.")
            metadata["tables"][str(name)] = _write_table(archive, f"table{number}", table)
        archive.writestr(zipfile.ZipInfo("metadata.json", STAMP), json.dumps(metadata, indent=1), zipfile.ZIP_DEFLATED)
        archive.comment = MARK + b"0" * 64
    body = buffer.getvalue()[:-64]
    return body + hashlib.sha256(body).hexdigest().encode()


def _write_table(archive: zipfile.ZipFile, folder: str, table: Table) -> dict[str, Any]:
    if isinstance(table, IauOrientation):
        arrays = table.to_arrays()
        for name, array in arrays.items():
            _write_array(archive, f"{folder}/{name}.npy", array)
        return {"info": table.info.to_json(), "arrays": {name: f"{folder}/{name}.npy" for name in arrays}}
    legs = []
    for i, leg in enumerate(table.legs):
        arrays = from_leg(leg)
        legs.append({"series": leg.series, "compares": leg.compares, "arrays": {n: f"{folder}/leg{i}/{n}.npy" for n in arrays}})
        for name, array in arrays.items():
            _write_array(archive, f"{folder}/leg{i}/{name}.npy", array)
    entry = {"info": table.info.to_json(), "legs": legs}
    if isinstance(table, OrientationTable):
        entry["placement"] = f"{folder}/placement.npy"
        _write_array(archive, entry["placement"], np.array(table.placement, np.float64))
    return entry


def _write_array(archive: zipfile.ZipFile, name: str, array: np.ndarray) -> None:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array, "<f8"), allow_pickle=False)
    archive.writestr(zipfile.ZipInfo(name, STAMP), buffer.getvalue(), zipfile.ZIP_DEFLATED)


def _read_array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(name) as file:
        return np.lib.format.read_array(io.BytesIO(file.read()), allow_pickle=False)


def _table(archive: zipfile.ZipFile, name: str, entry: dict[str, Any]) -> Table:
    info = Info.from_json(entry["info"])
    if info.kind == "iau":
        return IauOrientation.from_arrays({n: _read_array(archive, file) for n, file in entry["arrays"].items()}, info)
    legs = tuple(
        to_leg({n: _read_array(archive, file) for n, file in leg["arrays"].items()}, leg["series"], leg["compares"])
        for leg in entry["legs"]
    )
    reference, start, stop = (Fraction(x) for x in (info.reference, info.start, info.stop))
    fields = {"legs": legs, "reference": pairs(reference), "span": pairs(start - reference, stop - reference), "info": info}
    if info.kind not in KINDS:
        raise TableError(f"table {name!r} is of the unknown kind {info.kind!r}")
    if info.kind == "orientation":
        fields["placement"] = jnp.asarray(_read_array(archive, entry["placement"]), default_float())
    return KINDS[info.kind](**fields)
