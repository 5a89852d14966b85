"""What orientations that hold at every instant know about themselves."""

from pathlib import Path
from typing import TYPE_CHECKING

from jaxframes.spice.reading.kernel_files import sha256
from jaxframes.tables.info import Info, Source

if TYPE_CHECKING:
    from jaxframes.spice.extraction.orientation import Request
    from jaxframes.spice.kernels import Kernels


def timeless_info(kernels: "Kernels", request: "Request", kind: str, method: str) -> Info:
    """Return the facts of an orientation that text kernels, or SPICE itself, define."""
    of, base = request.of, request.base
    return Info(
        kind,
        *(of["name"], of["id"], base["name"], base["id"], base["name"]),
        *("", "", ""),
        sources=tuple(Source(Path(f).name, sha256(Path(f))) for f in kernels._text),
        segments=(),
        toolkit=kernels._process.call("version", doing="asking for the version"),
        method=method,
        center=of["center"],
    )
