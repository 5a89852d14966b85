"""Options of the 3-D page: what is asked for by name, and the reach of a joint's slider."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from jaxframes.errors import FrameError, MissingExtraError
from jaxframes.tree import FrameTree


def reach_of(edge: Any, value: float) -> tuple[float, float]:
    """Return the ends of a joint's slider: its limits where it has some, and always where it is now."""
    limits = edge.limits_of()
    wide = math.pi if edge.angles() and edge.angles()[0] else 1.0
    low, high = (float(bound[0]) for bound in limits) if limits is not None else (-math.inf, math.inf)
    low, high = (low if math.isfinite(low) else -wide), (high if math.isfinite(high) else wide)
    low, high = min(low, value), max(high, value)
    return (low, high) if high > low else (low, low + 1e-3)


def require_viser() -> None:
    """Raise MissingExtraError where viser is not installed."""
    try:
        import viser  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("a 3-D page needs the package 'viser': pip install 'jaxframes[view]'") from error


def frames_of(tree: FrameTree, names: Iterable[str], option: str) -> list[int]:
    """Return the numbers of frames given by name."""
    if isinstance(names, str):
        raise FrameError(f"{option} takes a sequence of frame names, found the text {names!r}; write ({names!r},)")
    return [tree.topology.index(name) for name in names]


def bodies_of(tree: FrameTree, bodies: Mapping[str, float] | None) -> dict[int, float]:
    """Return radii in metres by the number of the frame that they are around."""
    found = {}
    for name, radius in (bodies or {}).items():
        if not (isinstance(radius, int | float) and math.isfinite(radius) and radius > 0):
            raise FrameError(f"bodies={{{name!r}: {radius!r}}}: a radius is a positive number of metres")
        found[tree.topology.index(name)] = float(radius)
    return found
