"""The peers of the SPICE benchmarks, those that are installed; and how the ratios to them are printed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from _timing import compiled, interleaved, nanoseconds


@dataclass(frozen=True)
class Peer:
    """One contender.

    Attributes:
        run: What is timed.
        states: How many states a run gives.
        target: The ratio that we are to reach against it, None for none.
    """

    run: Callable[[], Any]
    states: int
    target: float | None = None


def cyice() -> Any:
    """Return spiceypy's compiled interface, which takes arrays of epochs, or None with a line that says so."""
    try:
        import spiceypy.cyice as module
    except ImportError:
        print("  without spiceypy.cyice: this spiceypy has none, install one of version 7 or later")
        return None
    return module


def anise(path: Any, start: float, stop: float, count: int, target: str, observer: str) -> Callable[[], Any] | None:
    """Return ANISE's ``transform_many`` over evenly spaced epochs (it takes no others), or None with a line that names the package."""
    try:
        from anise import Almanac  # pyright: ignore[reportMissingImports]
        from anise.constants import Frames  # pyright: ignore[reportMissingImports]
        from anise.time import Epoch, TimeSeries, Unit  # pyright: ignore[reportMissingImports]
    except ImportError:
        print("  without ANISE: pip install anise to have it in the table")
        return None
    almanac = Almanac(str(path))
    series = TimeSeries(Epoch.from_et_seconds(start), Epoch.from_et_seconds(stop), Unit.Second * ((stop - start) / count), False)
    frames = getattr(Frames, target), getattr(Frames, observer)
    return lambda: almanac.transform_many(*frames, series, None)


def loop(call: Callable[[float], Any], seconds: np.ndarray) -> Callable[[], Any]:
    """Return a Python loop of a call over epochs."""
    times = seconds.tolist()
    return lambda: [call(t) for t in times]


def table(
    title: str,
    ours: Mapping[str, Callable[[Any], Any]],
    epochs: np.ndarray,
    peers: Mapping[str, Peer],
    judged: str,
    rounds: int,
    bounded: Sequence[tuple[str, str]] = (),
) -> None:
    """Time our functions of a batch of epochs against peers and print nanoseconds a state and ratios.

    Args:
        title: What is computed.
        ours: Functions of an array of epochs by name, compiled first.
        epochs: The epochs, seconds past J2000 TDB.
        peers: The contenders by name.
        judged: Which of ours is held to the peers' targets, by the minimum of both.
        rounds: How many times each runs, all in turn.
        bounded: Pairs of ours of which the first is to cost at most as much as the second.
    """
    print(title)
    times, contenders = jnp.asarray(epochs), {name: peer.run for name, peer in peers.items()}
    for name, function in ours.items():
        run, seconds = compiled(function, times)
        contenders[name] = lambda run=run: run(times)
        print(f"  compile {name}: {seconds:.2f} s")
    taken = interleaved(contenders, rounds)
    ns = {name: nanoseconds(taken[name], peers[name].states if name in peers else len(epochs)) for name in contenders}
    for name, (least, median) in ns.items():
        ratios = "".join(f"  {ns[p][0] / least:8.1f} x {p}" for p in peers) if name in ours else ""
        print(f"  {name:38s} {least:9.1f} ns minimum {median:9.1f} median{ratios}")
    for one, other in bounded:
        ratio = ns[one][0] / ns[other][0]
        print(f"  {one} costs {ratio:.2f} times {other}, target 1{'' if ratio <= 1 else ': MISSED'}")
    for name, peer in peers.items():
        if peer.target is not None:
            ratio = ns[name][0] / ns[judged][0]
            print(
                f"  {judged} against {name}: {ratio:.1f} times as fast, target {peer.target:g}{'' if ratio >= peer.target else ': MISSED'}"
            )
