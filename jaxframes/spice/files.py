"""Which files a user means: single kernels, and directories of them."""

import os
from collections.abc import Iterable
from pathlib import Path

from jaxframes.errors import MissingKernelError

SUFFIXES = (".bsp", ".bpc", ".bc", ".tls", ".tpc", ".tsc", ".tf", ".ti", ".tk", ".ker")
"""Endings of the names of files that are taken from a directory (meta-kernels, .tm, are not: they name files that may be there too)."""


def kernel_files(paths: Iterable[str | os.PathLike[str]] | str | os.PathLike[str]) -> list[Path]:
    """Return the files to load, in order: a directory stands for the kernels in it (not below it), sorted by name.

    Raises:
        MissingKernelError: If a file is missing, or a directory holds no kernel.
    """
    listed = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    files: list[Path] = []
    for path in (Path(p).absolute() for p in listed):
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
