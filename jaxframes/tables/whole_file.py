"""Writing a file whole or not at all: beside the old one, then in its place."""

import contextlib
import os
import secrets
import stat
import time
from pathlib import Path

from jaxframes.errors import TableError

STALE = 3600.0
"""Seconds after which a half-written file beside the target is what a killed program left behind."""


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that a reader, or a crash at any instant, finds the old content or the new one.

    A file that exists keeps its permissions, and a symbolic link its target, whose content changes. What a killed program has left half
    written beside the target is removed after an hour.

    Args:
        path: The file.
        content: All that it shall hold.

    Raises:
        TableError: It cannot be written, or is no regular file, as a device, a pipe or a folder.
    """
    try:
        target = path.resolve()
        held = _regular(target)
        mark = f".{target.name}."
        _remove_stale(target.parent, mark)
        temporary = target.with_name(f"{mark}{secrets.token_hex(8)}.part")
        descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)  # less what the umask takes
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links is a RuntimeError, a NUL a ValueError
        raise _refusal(path, error) from error
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            if held is not None:
                os.chmod(temporary, stat.S_IMODE(held.st_mode))
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError):
            raise _refusal(path, error) from error
        raise


def _refusal(path: Path, error: Exception) -> TableError:
    return TableError(f"{str(path)!r} cannot be written: {(error.strerror if isinstance(error, OSError) else None) or error}.")


def _regular(target: Path) -> os.stat_result | None:
    """Return what is known of a file that exists, None where there is none; what is no regular file is refused."""
    try:
        held = target.stat()
    except FileNotFoundError:
        return None
    if not stat.S_ISREG(held.st_mode):
        raise TableError(f"{str(target)!r} is no regular file; give the path of a file to write")
    return held


def _remove_stale(folder: Path, mark: str) -> None:
    for left in folder.glob(f"{_literal(mark)}*.part"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > STALE:
                left.unlink()


def _literal(text: str) -> str:
    """Return a pattern of ``glob`` that matches a text alone."""
    return "".join(f"[{c}]" if c in "*?[" else c for c in text)
