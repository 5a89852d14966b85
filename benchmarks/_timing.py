"""Timing shared by the benchmarks: both sides interleaved in one process, compile time apart, minimum and median."""

import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

import jax


def compiled(function: Callable[..., Any], *arguments: Any) -> tuple[Callable[..., Any], float]:
    """Return a function compiled for its arguments, and the seconds that took."""
    start = time.perf_counter()
    made = jax.jit(function).lower(*arguments).compile()
    return made, time.perf_counter() - start


def interleaved(contenders: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, list[float]]:
    """Return the seconds of each contender in each round; they take turns, so that a busy machine slows all of them.

    Each is run once before the clock starts, and what it returns is waited for.
    """
    for run in contenders.values():
        jax.block_until_ready(run())
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for _ in range(rounds):
        for name, run in contenders.items():
            start = time.perf_counter()
            jax.block_until_ready(run())
            seconds[name].append(time.perf_counter() - start)
    return seconds


def nanoseconds(seconds: list[float], samples: int) -> tuple[float, float]:
    """Return the minimum and the median of runs, in nanoseconds a sample."""
    return min(seconds) / samples * 1e9, statistics.median(seconds) / samples * 1e9
