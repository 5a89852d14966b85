"""Readers of a live page: each has a thread that sends what it has not seen yet; one that is slow gets the newest and nothing between."""

import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from websockets.exceptions import ConnectionClosed

from jaxframes.view.page_text import safe_json

WHOLE = -1.0
"""First number of a message that holds the numbers of all frames; else it holds 20 for each frame that changed, its place first."""

quiet = logging.getLogger("jaxframes.view")
quiet.addHandler(logging.NullHandler())
quiet.propagate = False


class Shown:
    """What a page shows now, under one lock; every part has a count that grows when it changes."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.parts: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        self.closed = False

    def put(self, **parts: Any) -> None:
        """Change parts of what is shown, all at once."""
        with self.changed:
            for name, value in parts.items():
                self.parts[name] = value
                self.counts[name] = self.counts.get(name, 0) + 1
            self.changed.notify_all()

    def close(self) -> None:
        """Let all senders end."""
        with self.changed:
            self.closed = True
            self.changed.notify_all()


class Client:
    """One open page."""

    def __init__(self, connection: Any, shown: Shown):
        self._connection, self._shown = connection, shown
        self._seen: dict[str, int] = {}
        self._numbers: np.ndarray | None = None
        self._gone = False
        self._thread = threading.Thread(target=self._send_on, name="jaxframes page sender", daemon=True)

    def serve(self, hear: Callable[[str | bytes, "Client"], None]) -> None:
        """Send what is shown and hear what the reader does, until the page is closed."""
        self._thread.start()
        try:
            with contextlib.suppress(ConnectionClosed):
                for message in self._connection:
                    hear(message, self)
        finally:
            with self._shown.changed:
                self._gone = True
                self._shown.changed.notify_all()

    def tell(self, **message: Any) -> None:
        """Send a message to this reader alone."""
        with contextlib.suppress(ConnectionClosed):  # the loop that hears it ends by itself
            self._connection.send(safe_json(message))

    def _send_on(self) -> None:
        shown = self._shown
        while True:
            with shown.changed:
                shown.changed.wait_for(lambda: self._gone or shown.closed or shown.counts != self._seen)
                if self._gone or shown.closed:
                    return
                fresh = {name: value for name, value in shown.parts.items() if shown.counts[name] != self._seen.get(name)}
                self._seen = dict(shown.counts)
            try:
                self._send(fresh)
            except ConnectionClosed:
                return

    def _send(self, fresh: dict[str, Any]) -> None:
        """Send the parts that are new, the tree before its numbers."""
        if fresh.get("tree") is not None:
            self._numbers = None
            self._connection.send(fresh["tree"])
        if fresh.get("numbers") is not None:
            self._connection.send(self._packed(fresh["numbers"]))
            self._numbers = fresh["numbers"]
        for name in ("health", "times", "said"):
            if fresh.get(name) is not None:
                self._connection.send(safe_json(fresh[name]))

    def _packed(self, numbers: np.ndarray) -> bytes:
        """Return the numbers as a message: all of them, or only the rows that changed where these are few."""
        last = self._numbers
        if last is not None and last.shape == numbers.shape:
            rows = np.flatnonzero((last.view(np.int64) != numbers.view(np.int64)).any(1))
            if 2 * len(rows) < len(numbers):
                return np.concatenate([rows[:, None].astype("<f8"), numbers[rows]], 1).astype("<f8").tobytes()
        return np.concatenate([[WHOLE], numbers.reshape(-1)]).astype("<f8").tobytes()
