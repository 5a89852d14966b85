"""How far away things are shown: one range in true proportion, or all of them with logarithmic distances."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

WIDE = 2.0
"""What the range is in units of the scene."""
APART = 30.0
"""A factor between neighbouring distances that makes a new range."""
CLOSE = 0.025 * WIDE
"""Frames nearer to each other than this share a label."""
MOST_LABELS = 300
BEYOND = 1.5
"""Frames further than this many ranges are shown at that distance, without axes."""


@dataclass(frozen=True)
class Range:
    """A distance up to which everything is shown in true proportion.

    Attributes:
        metres: The distance.
        text: The distance and the frame that lies there.
    """

    metres: float
    text: str


def ranges_of(positions: np.ndarray, labels: Sequence[str]) -> list[Range]:
    """Return the ranges that the gaps in the distances from the focus make, the nearest first; at least one.

    Args:
        positions: Positions of all frames [n, 3] in the focus, metres.
        labels: What frames are called.
    """
    distances = np.linalg.norm(positions, axis=1)
    order = [i for i in np.argsort(distances, kind="stable").tolist() if np.isfinite(distances[i]) and distances[i] > 0]
    if not order:
        return [Range(1.0, "1 m")]
    ends = [a for a, b in itertools.pairwise(order) if distances[b] > APART * distances[a]] + order[-1:]
    return [Range(float(distances[i]), f"{distances[i]:.2g} m: out to {labels[i]}") for i in ends]


def default_range(ranges: Sequence[Range]) -> Range:
    """Return the range to open with: the last but one, where the farthest frame would make one dot of all others."""
    return ranges[max(0, len(ranges) - 2)]


@dataclass(frozen=True)
class Scaling:
    """How metres become units of the scene.

    Attributes:
        metres: The range.
        unit: For logarithmic distances the distance below which they are nearly true; None for true proportions.
    """

    metres: float
    unit: float | None = None

    def length(self, metres: np.ndarray) -> np.ndarray:
        """Return distances from the focus in units of the scene."""
        if self.unit is None:
            return metres * (WIDE / self.metres)
        return np.log10(1 + metres / self.unit) * (WIDE / np.log10(1 + self.metres / self.unit))

    def places(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return positions [n, 3] in units of the scene, float64, and which of them are shown where they are."""
        distances = np.asarray(np.linalg.norm(positions, axis=1))
        lengths = self.length(distances)
        kept = np.minimum(lengths, BEYOND * WIDE)
        with np.errstate(invalid="ignore", divide="ignore"):
            factors = np.where(distances > 0, kept / distances, 0.0)
            scaled = positions * factors.reshape(-1, 1)
        known = np.asarray(np.isfinite(scaled).all(1))
        return np.where(known[:, None], scaled, 0.0), known & (lengths <= BEYOND * WIDE)


def logarithmic(positions: np.ndarray) -> Scaling:
    """Return the scaling that shows all distances at once."""
    distances = np.linalg.norm(positions, axis=1)
    distances = distances[np.isfinite(distances) & (distances > 0)]
    if not len(distances):
        return Scaling(1.0, 1.0)
    return Scaling(float(distances.max()), float(distances.min()))


def merged(places: np.ndarray, shown: np.ndarray, labels: Sequence[str], most: int = 3) -> list[tuple[int, str]]:
    """Return one label for all frames at one place: which frame it stands at, and up to so many names and how many more."""
    heads, groups = np.zeros((0, 3)), list[list[int]]()
    for i in np.flatnonzero(shown).tolist():
        near = np.flatnonzero(np.abs(heads - places[i]).max(1) < CLOSE)
        if len(near):
            groups[near[0]].append(i)
        elif len(groups) < MOST_LABELS:
            heads = np.concatenate([heads, places[i][None]])
            groups.append([i])
    found = []
    for members in groups:
        names = [labels[i] for i in members[:most]]
        found.append((members[0], ", ".join(names) + (f" +{len(members) - most}" if len(members) > most else "")))
    return found
