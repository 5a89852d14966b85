"""``jaxframes demo``: a lunar orbiter's antenna seen from a ground station, on tables that ship with the package."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

BLOCK = 10_000


def add_parser(commands: Any) -> None:
    """Add the command's arguments."""
    this = commands.add_parser(
        "demo",
        help="evaluate a spacecraft antenna relative to a ground station on real ephemerides",
        description="Evaluate position, velocity and acceleration of a lunar orbiter's antenna relative to a ground station, "
        "on DE440 and ITRF93 tables that ship with the package; print a few epochs and draw range, range rate and elevation.",
    )
    this.add_argument("--samples", type=_positive, default=100_000, metavar="N", help="number of epochs over 28 days (default: 100000)")
    this.add_argument(
        "--plot", type=Path, default=Path("output/demo.png"), metavar="FILE", help="where the plot goes (default: %(default)s)"
    )
    this.add_argument("--verify", action="store_true", help="compare every SPICE edge with spiceypy on the real kernels instead")
    this.set_defaults(run=run)


def _positive(text: str) -> int:
    number = int(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"{number} is too few: give at least 2")
    return number


def run(options: argparse.Namespace) -> int:
    """Run the demonstration."""
    import jax

    jax.config.update("jax_enable_x64", True)  # an application's choice: metres at lunar distance need 64 bits
    if options.verify:
        from jaxframes.cli.demo_verify import verify

        return verify()

    import jax.numpy as jnp
    import numpy as np

    from jaxframes.cli.demo_scene import DAYS, START, build_tree, evaluate
    from jaxframes.cli.progress import progress
    from jaxframes.spatial import Epoch
    from jaxframes.spice import example_tables

    tree = build_tree(example_tables())
    print(tree)
    count = options.samples
    offsets = np.linspace(0.0, DAYS * 86400.0, count)
    block = min(BLOCK, count)
    starts = list(range(0, count, block))
    blocks = [np.resize(offsets[i : i + block], block) for i in starts]  # the last one is filled up, so that nothing retraces
    begin = Epoch.from_tdb(START)
    clock = time.perf_counter()
    jax.block_until_ready(evaluate(tree, begin + jnp.asarray(blocks[0])))
    compiled = time.perf_counter() - clock
    clock = time.perf_counter()
    parts = [jax.device_get(evaluate(tree, begin + jnp.asarray(part))) for part in progress(blocks, "evaluating")]
    elapsed = time.perf_counter() - clock
    samples = jax.tree.map(lambda *leaves: np.concatenate(leaves)[:count], *parts)
    print(f"\nantenna relative to station: position, velocity and acceleration at {count} epochs over {DAYS:g} days from {START} TDB")
    print(f"compiled in {compiled:.1f} s; evaluated in {elapsed:.3f} s: {count / elapsed:,.0f} samples a second\n")
    _print_table(begin, offsets, samples)
    return _draw(options.plot, offsets, samples)


def _print_table(begin: Any, offsets: Any, samples: Any) -> None:
    import numpy as np

    print(f"{'TDB':>19s} {'range km':>13s} {'range rate m/s':>15s} {'elevation deg':>14s} {'speed m/s':>10s} {'acceleration m/s2':>18s}")
    for i in np.linspace(0, len(offsets) - 1, min(6, len(offsets))).astype(int):
        speed = np.linalg.norm(samples.motion.velocity.linear[i])
        acceleration = np.linalg.norm(samples.motion.acceleration.linear[i])
        print(
            f"{(begin + offsets[i]).to_tdb(0):>19s} {samples.range[i] / 1e3:13.3f} {samples.range_rate[i]:15.4f} "
            f"{np.rad2deg(samples.elevation[i]):14.4f} {speed:10.2f} {acceleration:18.6f}"
        )


def _draw(path: Path, offsets: Any, samples: Any) -> int:
    try:
        from jaxframes.cli.demo_plot import draw
    except ImportError:
        print("\nno plot: matplotlib is not installed (pip install 'jaxframes[plot]')", file=sys.stderr)
        return 0
    draw(path, offsets, samples)
    print(f"\nplot: {path}")
    return 0
