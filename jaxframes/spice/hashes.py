"""SHA-256 of kernel files, remembered while a file stays as it is."""

import hashlib
import threading
from pathlib import Path

_known: dict[tuple[str, int, int], str] = {}
_lock = threading.Lock()


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file in hex; computed once for a path, size and time of change."""
    status = path.stat()
    key = (str(path.resolve()), status.st_size, status.st_mtime_ns)
    with _lock:
        if key in _known:
            return _known[key]
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    with _lock:
        _known[key] = digest
    return digest
