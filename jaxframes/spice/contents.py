"""What a table file holds, without loading its tables."""

import os
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jaxframes.spice.info import Info
from jaxframes.spice.store import opened


@dataclass(frozen=True)
class Entry:
    """A table in a file.

    Attributes:
        info: What the table knows about itself.
        records: How many records each leg has; none for a model.
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
    with opened(Path(path)) as (archive, entries):
        for number, (name, entry) in enumerate(entries.items()):
            shapes = {file: _shape(archive, file) for file in archive.namelist() if file.startswith(f"table{number}/")}
            records = tuple(shapes[leg["arrays"]["rows"]][0] for leg in entry.get("legs", ()))
            size = sum(8 * int(np.prod(shape)) for shape in shapes.values())
            found[name] = Entry(Info.from_json(entry["info"]), records, size)
    return found


def _shape(archive: zipfile.ZipFile, file: str) -> tuple[int, ...]:
    """Return the shape of an array by the head of its file alone."""
    with archive.open(file) as stream:
        np.lib.format.read_magic(stream)
        return np.lib.format.read_array_header_1_0(stream)[0]
