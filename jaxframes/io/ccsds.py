"""Text of CCSDS messages (KVN: keyword = value): lines read one after the other, numbers and instants of them."""

import os
from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from jaxframes.errors import FormatError, FrameError, suggest
from jaxframes.io.xml_nodes import NUMBER, TEXT, shown
from jaxframes.time.epoch import Epoch

MOST_BYTES = 500_000_000
"""Largest message that is read: some four million states."""
GPS = 19
"""Seconds by which GPS time is behind TAI."""
READERS: dict[str, Callable[[Sequence[str]], Epoch]] = {
    "UTC": Epoch.from_utc,
    "TAI": Epoch.from_tai,
    "TT": Epoch.from_tt,
    "TDB": Epoch.from_tdb,
    "GPS": lambda texts: Epoch.from_tai(texts) + float(GPS),
}
WRITERS: dict[str, Callable[[Epoch], str]] = {
    "UTC": lambda time: time.to_utc(9),
    "TAI": lambda time: time.to_tai(9),
    "TT": lambda time: time.to_tt(9),
    "TDB": lambda time: time.to_tdb(9),
    "GPS": lambda time: (time - float(GPS)).to_tai(9),
}


class Lines:
    """The lines of a message, read one after the other; blank ones are left out, and comments where they may stand are collected."""

    def __init__(self, source: Any, mark: str):
        """Read a file, or text (which has line breaks) that starts with a mark.

        Raises:
            FormatError: There is no such file, it cannot be read or is too large, or what is there does not start with the mark.
        """
        self.label, text = _read(source)
        self._lines = [(i, line.strip()) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
        self._next = 0
        if not self._lines or not self._lines[0][1].startswith(mark):
            self.fail(f"a message of this kind starts with {mark} = ...")

    def fail(self, what: str) -> NoReturn:
        """Raise an error that says where reading has come to."""
        line = self._lines[min(self._next, len(self._lines) - 1)][0] if self._lines else 1
        raise FormatError(f"{self.label}, line {line}: {what}")

    def more(self) -> bool:
        """Whether there is a line to come."""
        return self._next < len(self._lines)

    def at(self, word: str) -> bool:
        """Whether the next line is a word."""
        return self.more() and self._lines[self._next][1] == word

    def take(self, word: str) -> None:
        """Pass a line that must be a word."""
        if not self.at(word):
            self.fail(f"{word} is needed here, found {shown(self._lines[self._next][1]) if self.more() else 'the end'}")
        self._next += 1

    def keywords(self, known: Collection[str], until: Collection[str] | None) -> tuple[dict[str, str], tuple[str, ...]]:
        """Return lines of the form keyword = value by keyword, and comments, up to a line that is one of some words, or of another form.

        Args:
            known: Keywords that may stand here, each once.
            until: Words that end them; None: the first line that is not of the form.
        """
        found: dict[str, str] = {}
        remarks: list[str] = []
        while self.more():
            line = self._lines[self._next][1]
            if line.startswith("COMMENT"):
                remarks.append(line[len("COMMENT") :].strip())
            elif until is not None and line in until:
                break
            else:
                key, equals, value = (part.strip() for part in line.partition("="))
                if not equals and until is None:
                    break
                if key not in known:
                    self.fail(f"{shown(key)} is no keyword that may stand here.{suggest(key, known)}")
                if not value or key in found:
                    self.fail(f"{key} {'is given twice' if key in found else 'has no value'}")
                found[key] = value
            self._next += 1
        return found, tuple(remarks)

    def need(self, found: Collection[str], wanted: Sequence[str], where: str) -> None:
        """Refuse keywords without some that must be there."""
        missing = [key for key in wanted if key not in found]
        if missing:
            self.fail(f"{where} needs {', '.join(missing)}")

    def row(self) -> list[str]:
        """Return the words of the next line, which must be there."""
        if not self.more():
            self.fail("the message ends too early")
        self._next += 1
        return self._lines[self._next - 1][1].split()

    def rows(self, until: Collection[str]) -> tuple[list[list[str]], tuple[str, ...]]:
        """Return the words of lines up to one of some words or the end, and the comments between them."""
        found: list[list[str]] = []
        remarks: list[str] = []
        while self.more() and self._lines[self._next][1] not in until:
            line = self._lines[self._next][1]
            if line.startswith("COMMENT"):
                remarks.append(line[len("COMMENT") :].strip())
            else:
                found.append(line.split())
            self._next += 1
        return found, tuple(remarks)

    def numbers(self, words: Sequence[Sequence[str]]) -> np.ndarray:
        """Return words as finite numbers [rows, columns]."""
        for row in words:
            wrong = next((word for word in row if not NUMBER.fullmatch(word)), None)
            if wrong is not None:
                self.fail(f"{shown(wrong)} in {shown(' '.join(row))} is no number")
        found = np.array([[float(word) for word in row] for row in words], np.float64)
        if not np.isfinite(found).all():
            self.fail("a number is beyond what a float holds")
        return found


def epochs_of(texts: Sequence[str], scale: str, lines: Lines | None = None) -> Epoch:
    """Return instants [n] of a message, whose texts name no scale.

    Args:
        texts: The instants.
        scale: The message's ``TIME_SYSTEM``.
        lines: Where they come from, for messages.
    """
    try:
        if scale not in READERS:
            raise FormatError(
                f"the time system {scale!r} is not known.{suggest(scale, READERS)} Others depend on data that a message lacks"
            )
        return READERS[scale](list(texts))
    except FrameError as error:
        if lines is None:
            raise
        lines.fail(str(error))


def epoch_texts(times: Epoch, scale: str) -> list[str]:
    """Return instants [n] as the texts of a message, to the nanosecond."""
    if scale not in WRITERS:
        raise FrameError(f"the time system {scale!r} is not known.{suggest(scale, WRITERS)}")
    return [WRITERS[scale](times[i]).split(" ")[0] for i in range(times.shape[0])]


def exact(times: Epoch) -> list[Fraction]:
    """Return instants [n] as exact seconds past J2000 TDB."""
    return [Fraction(float(hi)) + Fraction(float(lo)) for hi, lo in zip(np.asarray(times.hi), np.asarray(times.lo), strict=True)]


def _read(source: Any) -> tuple[str, str]:
    """Return what to call a file or text in messages, and the text."""
    if isinstance(source, str) and "\n" in source:
        return TEXT, source
    if not isinstance(source, (str, os.PathLike)):
        raise FormatError(f"a path or text is needed, found {type(source).__name__}")
    try:
        size = Path(source).stat().st_size
        if size > MOST_BYTES:
            raise FormatError(f"{str(source)!r} has {size} bytes, more than the {MOST_BYTES} that are read; is it the right file?")
        return str(source), Path(source).read_text("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise FormatError(f"{str(source)!r} cannot be read: {reason}; give a path, or text with line breaks") from None
