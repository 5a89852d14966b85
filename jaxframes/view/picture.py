"""A tree as a picture file: the layout of the graph page, drawn by matplotlib (the extra ``plot``)."""

import warnings
from os import PathLike, fspath
from typing import Any

from jaxframes.errors import FrameError, MissingExtraError
from jaxframes.model.state import State
from jaxframes.tree import FrameTree
from jaxframes.view.arrangement import STEP, Arrangement, arranged
from jaxframes.view.looks import Chains, LabelMap, chains_of, colours, labels_of, one_instant, parents_of, printable

DOTS = 100
"""Page pixels an inch: text is as large as on the page."""
SHARPNESS = 1.6
"""Pixels of the file a pixel of the page."""
PILL, TEXT, MARGIN, HEAD = 21.0, 9.4, 24.0, 64.0
INK = "#4a5568"
WIDEST = 1500.0
MOST = 30_000.0
"""Longest side in page pixels: matplotlib takes 65 536 of the file's."""


def save_png(
    tree: FrameTree,
    path: str | PathLike[str],
    *,
    state: State | None = None,
    label_map: LabelMap | None = None,
    title: str = "",
    coloring: str = "type",
    chains: Chains = False,
) -> None:
    """Write a tree as a PNG picture with the layout of the graph page; the picture grows with the tree, its text does not shrink.

    Args:
        tree: The tree.
        path: The file.
        state: Where attachable frames hang. Default: where they were declared.
        label_map: Labels to show in place of frame names, by a frame's name or number.
        title: A line at the top.
        coloring: ``"type"`` or ``"valency"``, as in ``jf.to_dot``.
        chains: What dashed lines connect, as in ``jf.to_dot``.

    Raises:
        MissingExtraError: The extra ``plot`` is not installed.
        FrameError: The tree is too large for a picture, or there is no such colouring.
        UnknownFrameError: A label or a chain names no frame.
    """
    figure_class, patches, paths = _matplotlib()
    if state is not None:
        state = one_instant(tree, state)
    labels = [_cut(printable(label)) for label in labels_of(tree, label_map)]
    grounds, legend = colours(tree, coloring, state)
    dashed = chains_of(tree, chains, state)
    parents = parents_of(tree, state)[0]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")  # such a character becomes a box; the label is right in the page
        widths = _widths(figure_class, labels)
        layout = arranged(parents, widths.__getitem__, WIDEST)
        if max(layout.width, layout.height) > MOST:
            raise FrameError(
                f"{len(labels)} frames make a picture of {layout.width:.0f} by {layout.height:.0f} pixels; draw a part, "
                f"tree.extract(frame), or use jf.to_html, which folds"
            )
        figure, axes = _canvas(figure_class, layout, max(layout.width, min(1100.0, sum(_entry(word) for word, _ in legend))))
        _draw_edges(axes, paths, patches, layout, parents, widths)
        _draw_chains(axes, paths, patches, layout, dashed, widths)
        for (x, y), width, ground, label in zip(layout.places, widths, grounds, labels, strict=True):
            box = patches.FancyBboxPatch(
                (x, y - PILL / 2), width, PILL, boxstyle="round,pad=0,rounding_size=6", fc=ground, ec="#4a5568", lw=0.9
            )
            axes.add_patch(box)
            axes.text(x + 9, y, label, size=TEXT, va="center_baseline", color="#1c2330", parse_math=False)
        _draw_head(axes, patches, printable(title), legend)
        figure.savefig(fspath(path), format="png", dpi=DOTS * SHARPNESS)


def _matplotlib() -> tuple[Any, Any, Any]:
    try:
        from matplotlib import patches
        from matplotlib import path as paths
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("pictures need the package 'matplotlib': pip install 'jaxframes[plot]'") from error
    return Figure, patches, paths


def _cut(label: str) -> str:
    return label if len(label) <= 32 else label[:31] + "\u2026"


def _widths(figure_class: Any, labels: list[str]) -> list[float]:
    """Return the width of each pill, by measuring each different label once."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = figure_class(dpi=DOTS)
    renderer: Any = FigureCanvasAgg(figure).get_renderer()
    text = figure.text(0, 0, "", size=TEXT, parse_math=False)
    found: dict[str, float] = {}
    for label in labels:
        if label not in found:
            text.set_text(label)
            found[label] = text.get_window_extent(renderer).width + 18
    return [found[label] for label in labels]


def _entry(word: str) -> float:
    """Return the width of an entry of the legend."""
    return 30 + 7.0 * len(word)


def _canvas(figure_class: Any, layout: Arrangement, width: float) -> tuple[Any, Any]:
    """Return a figure of the layout's size and axes whose unit is a page pixel, y downwards."""
    width, height = max(width, 420.0) + 2 * MARGIN, layout.height + HEAD + MARGIN
    figure = figure_class(figsize=(width / DOTS, height / DOTS), dpi=DOTS, facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(-MARGIN, width - MARGIN)
    axes.set_ylim(layout.height + MARGIN, -HEAD)
    axes.axis("off")
    return figure, axes


def _draw_edges(axes: Any, paths: Any, patches: Any, layout: Arrangement, parents: list[int], widths: list[float]) -> None:
    for frame, parent in enumerate(parents):
        if parent < 0:
            continue
        (ax, ay), (bx, by) = layout.places[parent], layout.places[frame]
        if abs(ax - bx) < 1:
            axes.annotate(
                "", (bx + 18, by - PILL / 2), (ax + 18, ay + PILL / 2), arrowprops={"arrowstyle": "->", "color": "#4a5568", "lw": 0.9}
            )
            continue
        start = ax + widths[parent]
        middle = (start + bx) / 2
        _curve(axes, paths, patches, [(start, ay), (middle, ay), (middle, by), (bx, by)], lw=1.0, ec="#7a8699")


def _draw_chains(axes: Any, paths: Any, patches: Any, layout: Arrangement, chains: list[tuple[int, int]], widths: list[float]) -> None:
    for a, b in chains:
        (ax, ay), (bx, by) = layout.places[a], layout.places[b]
        x = (ax + widths[a] / 2, bx + widths[b] / 2)
        rise = min(ay, by) - STEP - abs(x[1] - x[0]) / 8
        points = [(x[0], ay), (x[0], rise), (x[1], rise), (x[1], by)]
        if abs(x[0] - x[1]) < 60:
            aside = min(ax, bx) - STEP - abs(by - ay) / 6
            points = [(ax, ay), (aside, ay), (aside, by), (bx, by)]
        _curve(axes, paths, patches, points, lw=1.0, ec="#68758a", ls=(0, (5, 4)))


def _curve(axes: Any, paths: Any, patches: Any, points: list[tuple[float, float]], **style: Any) -> None:
    path = paths.Path(points, [paths.Path.MOVETO, *[paths.Path.CURVE4] * 3])
    axes.add_patch(patches.PathPatch(path, fc="none", **style))


def _draw_head(axes: Any, patches: Any, title: str, legend: list[tuple[str, str]]) -> None:
    """Draw the title and what colours mean."""
    axes.text(0, -HEAD + 20, title, size=12, weight="bold", color="#1c2330", va="center", parse_math=False)
    right, x = axes.get_xlim()[1], 0.0
    for word, ground in legend:
        word = printable(word)
        if x + _entry(word) > right:
            break
        axes.add_patch(patches.Rectangle((x, -HEAD + 36), 14, 10, fc=ground, ec=INK, lw=0.7))
        axes.text(x + 19, -HEAD + 41, word, size=8.5, color=INK, va="center_baseline", parse_math=False)
        x += _entry(word)
