"""The process that holds a kernel pool, from the caller's side: start it, ask it, end it."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jaxframes.errors import BadKernelError, MissingKernelError, SpiceError
from jaxframes.spice.reading.worker import receive, send

TIMEOUT = 600.0
"""Seconds that one answer may take."""
FROM_OUTSIDE = {signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGXCPU} if os.name == "posix" else set()
"""Signals that end a process from outside; a process that breaks down gets others."""
WORKER = Path(__file__).with_name("worker.py")


class CspiceError(SpiceError):
    """An error that CSPICE signalled, with its short name."""

    def __init__(self, short: str, text: str):
        super().__init__(f"CSPICE signalled {short}: {text}")
        self.short = short


class KernelProcess:
    """A process with a kernel pool of its own. Calls from several threads take turns."""

    def __init__(self, timeout: float | None = TIMEOUT) -> None:
        """Start the process.

        Args:
            timeout: Longest time in seconds that an answer may take, None for any: the process is then ended.

        Raises:
            MissingKernelError: If spiceypy cannot be imported there.
        """
        # -P: the folder of the worker's file holds modules that must not shadow others. By path, not -m: jax stays out of it.
        self._popen = subprocess.Popen(
            [sys.executable, "-P", str(WORKER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C in a terminal goes to all of a session: it is the caller's business
        )
        self._lock, self._number, self._owner = threading.Lock(), 0, os.getpid()
        # Starting reads no kernel, and takes as long as the machine is busy: the caller's time-out is for requests.
        self._timeout, self._late, self._closed_by_another = TIMEOUT, False, False
        self._finalizer = weakref.finalize(self, _shut, self._popen)
        self._doing, self._why_closed = "starting", "use them inside their `with` block."
        try:
            with self._watched(), self._whole():
                self._answer()
        except CspiceError as error:
            self.close()
            raise MissingKernelError(f"Kernels are read by spiceypy, which cannot be imported: {error}. Install spiceypy.") from error
        self._timeout = timeout

    def call(self, method: str, *arguments: Any, doing: str) -> Any:
        """Return the worker's answer to a request.

        Args:
            method: A method of ``worker.Reader``.
            arguments: What it takes.
            doing: What this is for, named if the process dies over it.

        Raises:
            CspiceError: If CSPICE signals an error.
            BadKernelError: If the process dies, or does not answer in time.
            SpiceError: If it was closed before, or while it worked; or if this is a fork of the program that opened it.
        """
        if os.getpid() != self._owner:  # the pipes are the parent's too: each would take the other's answers
            raise SpiceError(
                "These kernels belong to the program that this one was forked from. Open them again here, or start processes by 'spawn': "
                "multiprocessing.get_context('spawn')."
            )
        with self._lock:
            if not self._finalizer.alive:
                raise SpiceError(f"These kernels are closed: {self._why_closed}")
            self._doing = doing
            self._number += 1
            with self._watched(), self._whole():
                try:
                    send(self._popen.stdin, (self._number, method, arguments))  # pyright: ignore[reportArgumentType]
                except (OSError, ValueError) as error:  # the worker is gone, or another thread has closed the pipe
                    raise self._death() from error
                return self._answer()

    @contextlib.contextmanager
    def _watched(self) -> Iterator[None]:
        """End the process if what is done in the block takes too long: a damaged kernel can send CSPICE round in circles."""
        if self._timeout is None:
            yield
            return
        timer = threading.Timer(self._timeout, self._give_up)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    @contextlib.contextmanager
    def _whole(self) -> Iterator[None]:
        """End the process if a request is broken off: what it still answers would be taken for the answer to the next request."""
        try:
            yield
        except CspiceError:  # is an answer
            raise
        except BaseException as error:
            self._popen.kill()
            self._finalizer()
            if not isinstance(error, SpiceError):
                broken = f"a request was broken off while {self._doing} ({type(error).__name__}), which ended the process that reads them."
                self._why_closed = f"{broken} Open them again."
            raise

    def _give_up(self) -> None:
        self._late = True
        self._popen.kill()

    def _answer(self) -> Any:
        try:
            number, status, *content = receive(self._popen.stdout)  # pyright: ignore[reportArgumentType]
        except (EOFError, OSError, ValueError) as error:
            raise self._death() from error
        if number != self._number:
            self._why_closed = "their process gave the answer to another request. Open them again."
            raise SpiceError(f"The process that reads kernels answered request {number}, not {self._number}, while {self._doing}.")
        if status == "failed":
            raise CspiceError(*content)
        return content[0]

    def _death(self) -> SpiceError:
        """End the process for good and return the error to raise."""
        self._finalizer()
        if self._closed_by_another:
            return SpiceError(f"These kernels were closed by another thread while {self._doing}.")
        if self._late:
            return BadKernelError(
                f"CSPICE did not answer within {self._timeout:g} s while {self._doing}, and was ended: a kernel is damaged, or the work is "
                "long. Kernels(..., timeout=seconds) allows more time, timeout=None any."
            )
        if -self._popen.returncode in FROM_OUTSIDE:
            name = signal.Signals(-self._popen.returncode).name
            self._why_closed = f"the process that reads them was ended from outside by {name}. Open them again."
            return SpiceError(
                f"The process that reads kernels was ended from outside by {name} while {self._doing}: by somebody, or by the system for "
                "want of memory. Open the kernels again."
            )
        return BadKernelError(
            f"CSPICE broke down while {self._doing} (exit code {self._popen.returncode}): a kernel is damaged. "
            "Compare the file's checksum with its source's, or fetch it again."
        )

    @property
    def closed(self) -> bool:
        """Whether the process has ended."""
        return not self._finalizer.alive

    def close(self) -> None:
        """End the process; more than once does nothing. A request of another thread is broken off, and fails there."""
        if os.getpid() != self._owner:
            return  # a fork has no process of its own to end
        if self._lock.acquire(blocking=False):
            try:
                self._finalizer()
            finally:
                self._lock.release()
        else:
            self._closed_by_another = True
            self._popen.kill()  # first: the pipe cannot be closed while a thread reads from it
            self._finalizer()


def _shut(popen: subprocess.Popen[bytes]) -> None:
    """Close the pipes, which ends the worker, and wait for it."""
    for stream in (popen.stdin, popen.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):  # what was still unsent to a dead worker
                stream.close()
    try:
        popen.wait(timeout=5)
    except subprocess.TimeoutExpired:
        popen.kill()
        popen.wait()
