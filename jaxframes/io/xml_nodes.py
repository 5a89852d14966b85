"""XML read safely: elements with their line numbers; no document types, no entities, nothing fetched, a size limit."""

import contextlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn
from xml.parsers import expat

from jaxframes.errors import FormatError, FrameError

MOST_BYTES = 20_000_000
"""Largest file or text that is read: a hundred times the largest robot known to us."""
DEEPEST = 200
"""Deepest nesting of elements that is read."""
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")  # each digit can match in one place only: linear in the text
TEXT = "the text given"
"""What text without a file is called in messages."""
LONGEST_SHOWN = 60
"""How many characters of a file's own text stand in a message at most."""


@dataclass
class Node:
    """One element: what it is, its attributes, its elements, and the line that it starts on."""

    tag: str
    attributes: dict[str, str]
    line: int
    source: str
    children: list["Node"] = field(default_factory=list)

    def __iter__(self) -> Iterator["Node"]:
        return iter(self.children)

    def fail(self, what: str, kind: type[FrameError] = FormatError) -> NoReturn:
        """Raise an error that says where this element is."""
        name = self.attributes.get("name")
        element = f"<{self.tag}>" if name is None else f"<{self.tag} name={shown(name)}>"
        raise kind(f"{self.source}, line {self.line}, {element}: {what}")

    def all(self, tag: str) -> list["Node"]:
        """Return the elements with a tag."""
        return [child for child in self.children if child.tag == tag]

    def one(self, tag: str) -> "Node | None":
        """Return the element with a tag, or None; two of them are refused."""
        found = self.all(tag)
        if len(found) > 1:
            found[1].fail(f"a second <{tag}> in this <{self.tag}>; keep one")
        return found[0] if found else None

    def text(self, name: str) -> str:
        """Return an attribute that must be there and not be empty."""
        value = self.attributes.get(name)
        if not value:
            self.fail(f"the attribute {name!r} is {'empty' if value == '' else 'missing'}; give it")
        return value

    def numbers(self, name: str, count: int, default: tuple[float, ...]) -> tuple[float, ...]:
        """Return an attribute as so many finite numbers, or a default where it is not given."""
        value = self.attributes.get(name)
        if value is None:
            return default
        words = value.split()
        wrong = [word for word in words if not NUMBER.fullmatch(word) or abs(float(word)) == float("inf")]
        if wrong:
            hint = "expand it with xacro first" if "$" in value else "write plain decimal numbers"
            self.fail(f"{name}={shown(value)}: {shown(wrong[0])} is no finite number; {hint}")
        if len(words) != count:
            self.fail(f"{name}={shown(value)}: {len(words)} numbers where {count} {'is' if count == 1 else 'are'} needed")
        return tuple(float(word) for word in words)

    def number(self, name: str, default: float) -> float:
        """Return an attribute as one finite number."""
        return self.numbers(name, 1, (default,))[0]


def shown(text: str) -> str:
    """Return a file's own text as a message shows it: quoted, and not much of it."""
    return repr(text) if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]!r}... ({len(text)} characters)"


def read(source: Any, kinds: str = "a path or text") -> tuple[bytes, str]:
    """Return the bytes of a file or of text, and what to call it in messages: text is ``TEXT``.

    Text is told from a path by its first character, ``<``.

    Args:
        source: The path or text.
        kinds: What may be given, for messages.

    Raises:
        FormatError: There is no such file, or it is too large, empty or binary.
    """
    if isinstance(source, (bytes, bytearray)) or (
        isinstance(source, str) and (not source.strip() or source.lstrip("\ufeff \t\r\n").startswith("<"))
    ):
        data, label = (source.encode("utf-8", "surrogatepass") if isinstance(source, str) else bytes(source)), TEXT
        size = len(data)
    elif isinstance(source, (str, os.PathLike)):
        path, label = Path(source), str(source)
        try:
            size = path.stat().st_size if path.is_file() else -1
            data = path.read_bytes() if 0 <= size <= MOST_BYTES else b""
        except (OSError, ValueError) as error:
            raise FormatError(f"{label!r} cannot be read: {error}; give a path, or text that starts with '<'") from None
        if size < 0:
            kind = "a folder" if path.is_dir() else "no file"
            raise FormatError(f"{label!r} is {kind}; give the path of a file, or text that starts with '<'")
    else:
        raise FormatError(f"{kinds} is needed, found {type(source).__name__}: {source!r}")
    if size > MOST_BYTES:
        raise FormatError(f"{label} has {size} bytes, more than the {MOST_BYTES} that are read; is it the right file?")
    if not data.strip():
        raise FormatError(f"{label} is empty; a robot description starts with <robot name=...> or <mujoco>")
    if b"\0" in data[:4096] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise FormatError(f"{label} is binary data, not XML; give the text form of the description")
    return data, label


def parse(data: bytes, source: str) -> Node:
    """Return the outermost element.

    Raises:
        FormatError: The data is no well-formed XML, holds a document type or an entity, or is nested too deeply.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    outermost: list[Node] = []
    open_nodes: list[Node] = []

    def refuse(*_: Any) -> NoReturn:
        raise FormatError(
            f"{source}, line {parser.CurrentLineNumber}: a document type (<!DOCTYPE>) or entity is not accepted, because it can "
            f"make a small file enormous or fetch others; remove it"
        )

    def start(tag: str, attributes: dict[str, str]) -> None:
        node = Node(tag, attributes, parser.CurrentLineNumber, source)
        if len(open_nodes) >= DEEPEST:
            node.fail(f"elements are nested more than {DEEPEST} deep; is this the right file?")
        (open_nodes[-1].children if open_nodes else outermost).append(node)
        open_nodes.append(node)

    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse  # pyright: ignore[reportAttributeAccessIssue]
    parser.ExternalEntityRefHandler = parser.SkippedEntityHandler = refuse  # pyright: ignore[reportAttributeAccessIssue]
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: open_nodes.pop() and None
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        words = expat.ErrorString(error.code)
        inside = f" inside <{open_nodes[-1].tag}> of line {open_nodes[-1].line}" if open_nodes else ""
        ends = parser.CurrentByteIndex >= len(data.rstrip()) or "unclosed" in words
        remedy = "the file ends too soon: get it whole" if ends else "mend it there, or check that the file is XML"
        raise FormatError(f"{source}, line {error.lineno}: this is no well-formed XML ({words}){inside}; {remedy}") from None
    except (LookupError, UnicodeError, ValueError) as error:
        raise FormatError(f"{source}: its encoding cannot be read ({error}); save it as UTF-8") from None
    return outermost[0]


def element_names(data: bytes) -> list[str]:
    """Return what the elements are called, in order, as far as they can be read; the first is the outermost."""
    parser = expat.ParserCreate()
    met: list[str] = []
    parser.StartElementHandler = lambda tag, attributes: met.append(tag)
    with contextlib.suppress(expat.ExpatError, LookupError, UnicodeError, ValueError):  # others say what is wrong with it
        parser.Parse(data.lstrip(), True)
    return met


def facts(node: Node) -> dict[str, Any]:
    """Return an element as a mapping: attributes as numbers where they are such, elements by tag (a tuple where several)."""
    found: dict[str, Any] = {name: _value(name, text) for name, text in node.attributes.items()}
    for tag in dict.fromkeys(child.tag for child in node):
        inner = [facts(child) for child in node.all(tag)]
        found[tag] = inner[0] if len(inner) == 1 else tuple(inner)
    return found


def _value(name: str, text: str) -> Any:
    words = text.split()
    if name in ("name", "filename", "type", "joint", "link") or not words or not all(NUMBER.fullmatch(word) for word in words):
        return text
    numbers = tuple(float(word) for word in words)
    return numbers[0] if len(numbers) == 1 else numbers
