"""A progress bar on standard error, silent where that is no terminal."""

import sys
import time
from collections.abc import Iterable, Iterator, Sized
from typing import Protocol, TypeVar

Item = TypeVar("Item", covariant=True)


class SizedIterable(Sized, Iterable[Item], Protocol[Item]):
    """What can be counted before it is walked through."""


def progress(items: SizedIterable[Item], label: str, width: int = 32) -> Iterator[Item]:
    """Yield the items and draw a bar with the share done and the time left."""
    shown, total, start = sys.stderr.isatty(), len(items), time.perf_counter()
    for done, item in enumerate(items, 1):
        yield item
        if shown:
            filled = width * done // max(total, 1)
            left = (time.perf_counter() - start) / done * (total - done)
            bar = "█" * filled + "·" * (width - filled)
            print(f"\r{label} {bar} {100 * done // max(total, 1):3d} %  {left:4.1f} s left ", end="", file=sys.stderr, flush=True)
    if shown:
        print(file=sys.stderr)
