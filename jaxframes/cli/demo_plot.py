"""The demonstration's plot: range, range rate and elevation of the antenna over time."""

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from jaxframes.cli.demo_scene import DAYS, START


def draw(path: Path, offsets: Any, samples: Any) -> None:
    """Save the plot as PNG.

    Args:
        path: The file to write; its folder is made.
        offsets: Seconds past the start [n].
        samples: What ``demo_scene.evaluate`` returned, as NumPy arrays.
    """
    days, elevation = offsets / 86400.0, np.rad2deg(samples.elevation)
    rows = (
        (samples.range / 1e3, "range (km)", "#1b6ca8"),
        (samples.range_rate / 1e3, "range rate (km/s)", "#b5482a"),
        (elevation, "elevation (deg)", "#3a7d44"),
    )
    figure, axes = plt.subplots(3, 2, figsize=(11, 7), sharex="col", gridspec_kw={"width_ratios": (2, 1), "wspace": 0.22, "hspace": 0.12})
    for (values, label, colour), (whole, detail) in zip(rows, axes, strict=True):
        first_days = days <= 2.0
        whole.plot(days, values, color=colour, linewidth=0.5)
        detail.plot(days[first_days], values[first_days], color=colour, linewidth=1.0)
        whole.set_ylabel(label)
        for axis in (whole, detail):
            axis.grid(alpha=0.3, linewidth=0.5)
            axis.margins(x=0.01)
    for axis in axes[2]:
        axis.axhspan(-90, 0, color="0.92", zorder=0)
        axis.set_ylim(elevation.min() - 5, elevation.max() + 5)
    axes[2, 0].set_xlabel(f"days from {START} TDB")
    axes[2, 1].set_xlabel("the first two days")
    axes[0, 0].set_title(
        f"Lunar orbiter's antenna relative to a ground station, {DAYS:g} days on DE440 and ITRF93", loc="left", fontsize=10
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)
