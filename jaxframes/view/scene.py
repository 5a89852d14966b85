"""What a 3-D page shows of a tree: axes, links, labels, trails, bodies and meshes, at one instant and in one scaling."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxframes.view.distances import WIDE, Scaling, merged
from jaxframes.view.meshes import Shape
from jaxframes.view.poses import Poses

INKS = ((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (184, 134, 11), (86, 180, 233))
"""Colours of trails and bodies."""
LINK = (110, 120, 135)


@dataclass(frozen=True)
class Contents:
    """What is drawn beside the frames.

    Attributes:
        labels: What frames are called.
        trails: Frames whose way over time is drawn.
        bodies: Radius in metres of the see-through sphere around each of some frames.
        shapes: Meshes that move with frames.
    """

    labels: Sequence[str]
    trails: Sequence[int]
    bodies: Mapping[int, float]
    shapes: Sequence[Shape]


class Scene:
    """Nodes of a viser scene, one of each kind for all frames; names of nodes are numbers, so that no name can nest them."""

    def __init__(self, api: Any, contents: Contents, count: int):
        self._api, self._contents, self._count = api, contents, count
        self._axes: Any = None
        self._axes_key: float = 0.0
        self._links: Any = None
        self._labels: list[Any] = []
        self._texts: list[str] = []
        self._trails: dict[int, Any] = {}
        self._bodies: dict[int, tuple[float, Any]] = {}
        self._shapes: list[tuple[Shape, Any]] = []
        self._drawn_trails: Any = None
        self.opacity = 0.5
        self.with_labels = True

    def show(self, parents: Sequence[int], poses: Poses, scaling: Scaling, ways: np.ndarray) -> None:
        """Show one instant.

        Args:
            parents: Parent of each frame.
            poses: Poses in the focus.
            scaling: How metres become units of the scene.
            ways: Positions of the frames with trails over time [n_times, n_trails, 3] in the focus, metres.
        """
        rotations, positions = poses
        places, shown = scaling.places(positions)
        turned = np.where(np.isfinite(rotations).all(1, keepdims=True), rotations, [1.0, 0.0, 0.0, 0.0])
        size = self._axis_length(parents, places, shown)
        self._show_axes(turned.astype(np.float32), places.astype(np.float32), np.where(shown, 1.0, 1e-6).astype(np.float32), size)
        self._show_links(parents, places, np.asarray(np.isfinite(positions).all(1)))
        self._show_labels(places, shown, size)
        self._show_trails(ways, scaling)
        self._show_bodies(places, positions, shown, scaling)
        self._show_shapes(turned, places, shown, scaling)

    def _axis_length(self, parents: Sequence[int], places: np.ndarray, shown: np.ndarray) -> float:
        """Return a length of axes that fits the links."""
        if self._axes_key:
            return self._axes_key
        own = np.array([i for i, parent in enumerate(parents) if parent >= 0 and shown[i] and shown[parent]], int)
        lengths = np.linalg.norm(places[own] - places[np.array(parents)[own]], axis=1) if len(own) else np.zeros(0)
        lengths = lengths[lengths > 0.01 * WIDE]
        self._axes_key = float(np.clip(0.35 * np.median(lengths), 0.03 * WIDE, 0.12 * WIDE)) if len(lengths) else 0.1 * WIDE
        return self._axes_key

    def _show_axes(self, rotations: np.ndarray, places: np.ndarray, scales: np.ndarray, size: float) -> None:
        if self._axes is None:
            self._axes = self._api.add_batched_axes("/axes", rotations, places, scales, axes_length=size, axes_radius=0.045 * size)
        else:
            self._axes.batched_wxyzs, self._axes.batched_positions, self._axes.batched_scales = rotations, places, scales

    def _show_links(self, parents: Sequence[int], places: np.ndarray, known: np.ndarray) -> None:
        """Draw a line from each frame to its parent; where one is unknown, a line of no length."""
        below = np.arange(1, self._count)
        above = np.array(parents)[1:]
        above = np.where(known[below] & known[above], above, below)
        points = np.stack([places[above], places[below]], 1).astype(np.float32)
        if not len(points):
            return
        if self._links is None:
            self._links = self._api.add_line_segments("/links", points, LINK, thickness=2.0, thickness_units="screen")
        else:
            self._links.points = points

    def _show_labels(self, places: np.ndarray, shown: np.ndarray, size: float) -> None:
        """Write one label for all frames at one place."""
        found = merged(places, shown, self._contents.labels) if self.with_labels else []
        for i, (frame, text) in enumerate(found):
            place = places[frame] + np.array([0.0, 0.0, 0.25 * size])
            if i < len(self._labels) and self._texts[i] == text:
                self._labels[i].position = place
                continue
            handle = self._api.add_label(f"/labels/{i}", text, position=place, font_screen_scale=0.85, anchor="bottom-left")
            self._labels[i : i + 1], self._texts[i : i + 1] = [handle], [text]
        for handle in self._labels[len(found) :]:
            handle.remove()
        del self._labels[len(found) :], self._texts[len(found) :]

    def _show_trails(self, ways: np.ndarray, scaling: Scaling) -> None:
        """Draw the ways of frames over time, once for each focus and scaling."""
        if self._drawn_trails is not None and self._drawn_trails[1] == scaling and self._drawn_trails[0] is ways:
            return
        self._drawn_trails = ways, scaling
        for k, frame in enumerate(self._contents.trails):
            points = scaling.places(ways[:, k])[0]
            segments = np.stack([points[:-1], points[1:]], 1).astype(np.float32)
            if len(segments):
                ink = INKS[k % len(INKS)]
                node = self._api.add_line_segments(f"/trails/{k}", segments, ink, thickness=2.5, thickness_units="screen")
                self._trails[frame] = node

    def _show_bodies(self, places: np.ndarray, positions: np.ndarray, shown: np.ndarray, scaling: Scaling) -> None:
        for k, (frame, metres) in enumerate(self._contents.bodies.items()):
            here = np.linalg.norm(positions[frame])
            # Half the difference of the lengths of its far and near sides; around the focus itself, its radius.
            span = scaling.length(np.array([here + metres, max(here - metres, 0.0)]))
            radius = float(span[0]) if here < metres else float(span[0] - span[1]) / 2
            if not np.isfinite(radius):
                radius = 1e-6
            if frame not in self._bodies or abs(self._bodies[frame][0] - radius) > 1e-3 * radius:
                ink = INKS[k % len(INKS)]
                node = self._api.add_icosphere(f"/bodies/{k}", radius, ink, opacity=0.28, cast_shadow=False, receive_shadow=False)
                self._bodies[frame] = radius, node
            node = self._bodies[frame][1]
            node.position, node.visible = places[frame], bool(shown[frame])

    def _show_shapes(self, rotations: np.ndarray, places: np.ndarray, shown: np.ndarray, scaling: Scaling) -> None:
        """Move meshes with their frames; they have true proportions, so a logarithmic scene hides them."""
        if not self._shapes and self._contents.shapes:
            for k, shape in enumerate(self._contents.shapes):
                node = self._api.add_mesh_simple(f"/meshes/{k}", shape.vertices, shape.faces, color=(190, 198, 210), opacity=self.opacity)
                self._shapes.append((shape, node))
        factor = WIDE / scaling.metres
        for shape, node in self._shapes:
            node.wxyz, node.position, node.scale = rotations[shape.frame], places[shape.frame], factor
            node.visible = bool(shown[shape.frame]) and scaling.unit is None

    def set_opacity(self, opacity: float) -> None:
        """Let axes be seen through meshes, more or less."""
        self.opacity = opacity
        for _, node in self._shapes:
            node.opacity = opacity


def ways_of(all_poses: Sequence[Poses], frames: Sequence[int]) -> np.ndarray:
    """Return the positions of some frames over time [n_times, n_frames, 3]."""
    return np.stack([positions[list(frames)] for _, positions in all_poses]) if frames else np.zeros((len(all_poses), 0, 3))
