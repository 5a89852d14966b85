"""Threads of pages end before the interpreter does: one that is inside of JAX's compiler at that moment would abort the process."""

import atexit
import threading
import weakref
from typing import Protocol

LONGEST = 20.0
"""Seconds that the end of the program waits for a thread: as long as one compilation may take."""


class Closes(Protocol):
    """Something with threads that end once it is closed."""

    def close(self) -> None:
        """End it; twice is fine."""


def close_with_program(page: Closes, thread: threading.Thread) -> None:
    """Close a page when the program ends, and wait for its thread.

    Args:
        page: The page; it is not kept alive by this.
        thread: A daemon thread that ends once the page is closed.
    """
    known = weakref.ref(page)

    def end() -> None:
        open_page = known()
        if open_page is not None:
            open_page.close()
        thread.join(LONGEST)

    atexit.register(end)
