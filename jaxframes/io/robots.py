"""Real robots by name: the URDF files of installed packages, found without importing the packages."""

import functools
import importlib.metadata
from pathlib import Path

from jaxframes.errors import FrameError, MissingExtraError, suggest

PLACES = {"example-robot-data": "cmeel.prefix/share/example-robot-data/robots", "rtb-data": "rtbdata/xacro"}
"""Distribution -> folder of its robots, beside its other files."""


def example_robot(name: str) -> Path:
    """Return the path of a robot's URDF in the installed packages ``example-robot-data`` and ``rtb-data``.

    Args:
        name: The file's name without its ending, such as ``"panda"``. Where several files share it, the folder's name goes before
            it: ``"anymal_c_simple/anymal"``. ``example_robots()`` lists all names.

    Raises:
        MissingExtraError: Neither package is installed.
        FrameError: There is no such robot (close names are suggested).
    """
    known = _robots()
    if not known:
        raise MissingExtraError("no package of example robots is installed: pip install 'jaxframes[robots]' (or example-robot-data)")
    if name in known:
        return known[name]
    several = [other for other in known if other.endswith(f"/{name}")]
    if several:
        raise FrameError(f"several robots are called {name!r}: {', '.join(map(repr, several))}; use one of these names")
    raise FrameError(f"there is no example robot {name!r}.{suggest(name, known)}")


def example_robots() -> tuple[str, ...]:
    """Return the names that ``example_robot`` knows, sorted; empty where no package of robots is installed."""
    return tuple(sorted(_robots()))


@functools.cache
def _robots() -> dict[str, Path]:
    files: dict[str, list[tuple[str, Path]]] = {}
    for package, place in PLACES.items():
        try:
            folder = Path(str(importlib.metadata.distribution(package).locate_file(place)))
        except importlib.metadata.PackageNotFoundError:
            continue
        for path in sorted(folder.rglob("*.urdf")):
            family = path.relative_to(folder).parts[0].removesuffix("_description")
            files.setdefault(path.stem, []).append((family, path))
    found = {}
    for stem, places in files.items():
        for family, path in places:
            found[stem if len(places) == 1 else f"{family}/{stem}"] = path
    return found
