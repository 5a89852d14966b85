"""Which files a user means: single kernels, and directories of them."""

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from jaxframes.errors import BadKernelError, MissingKernelError

LONGEST = 255
"""Bytes that CSPICE takes of a file's name, folders included; beyond them it breaks down."""

SUFFIXES = (".bsp", ".bpc", ".bc", ".tls", ".tpc", ".tsc", ".tf", ".ti", ".tk", ".ker")
"""Endings of the names of files that are taken from a directory (meta-kernels, .tm, are not: they name files that may be there too)."""


def kernel_files(paths: Iterable[str | os.PathLike[str]] | str | os.PathLike[str]) -> list[Path]:
    """Return the files to load, in order: a directory stands for the kernels in it (not below it), sorted by name.

    Raises:
        MissingKernelError: If a file is missing, a directory holds no kernel, or what is given is no path.
    """
    one = isinstance(paths, (str, os.PathLike))
    if not one and (isinstance(paths, bytes) or not isinstance(paths, Iterable)):
        raise _no_path(paths)
    files: list[Path] = []
    for given in [paths] if one else paths:
        if not isinstance(given, (str, os.PathLike)) or os.fspath(given) in ("", b""):
            raise _no_path(given)
        path = Path(os.fsdecode(given)).absolute()
        if path.is_dir():
            held = sorted(f for f in path.iterdir() if f.suffix.lower() in SUFFIXES and f.is_file())
            if not held:
                raise MissingKernelError(f"There is no kernel file in {path}: names that end in {', '.join(SUFFIXES)} are looked for.")
            files += held
        elif path.is_file():
            files.append(path)
        else:
            raise MissingKernelError(
                f"There is no kernel file {path}. Check the path; jf.spice.find_kernels() finds those that packages ship."
            )
    return files


def _no_path(given: object) -> MissingKernelError:
    return MissingKernelError(
        f"{given!r} is no path of a kernel: give files or folders ('.' is the current one), or jf.spice.find_kernels() for those that "
        "packages ship."
    )


class ShortNames:
    """Names that CSPICE can take: those of files, and for longer ones links in a temporary folder, which goes with this object."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._count = 0

    def of(self, file: Path) -> str:
        """Return a name for a file.

        Raises:
            BadKernelError: If its name is too long and cannot be linked to.
        """
        if len(os.fsencode(file)) <= LONGEST:
            return str(file)
        try:
            self._folder = self._folder or tempfile.TemporaryDirectory(prefix="jaxframes-")
            link = Path(self._folder.name) / str(self._count) / file.name  # the name itself stays: reports and tables state it
            self._count += 1
            if len(os.fsencode(link)) > LONGEST:
                raise OSError("the link's name would be too long too")
            link.parent.mkdir()
            link.symlink_to(file)
        except OSError as error:
            raise BadKernelError(
                f"The name of {file} has {len(os.fsencode(file))} bytes, folders included; CSPICE takes {LONGEST}, and it cannot be linked "
                f"to from {tempfile.gettempdir()} ({error}). Move the file to where its name is shorter."
            ) from error
        return str(link)

    def close(self) -> None:
        """Remove the links."""
        if self._folder is not None:
            self._folder.cleanup()
