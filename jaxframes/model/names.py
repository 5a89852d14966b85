"""Names of frames and joints: text that prints on one line as it is."""

from typing import Any

from jaxframes.errors import EdgeError

LONGEST = 1000
"""Characters of the longest name that is taken."""


def checked_name(name: Any, what: str = "a frame's name") -> str:
    """Return a name, refusing what no page, file or terminal shows as it is.

    Args:
        name: Text of 1 to ``LONGEST`` printable characters: letters of any script, digits, signs, plain spaces.
        what: What it is the name of, for messages.

    Raises:
        EdgeError: It is no text, empty, too long, or holds a character that does not print: a control character, a line break, a mark
            that turns the direction of writing, half of a surrogate pair.
    """
    if not isinstance(name, str) or not name:
        raise EdgeError(f"{what} must be text that is not empty, found {name!r}")
    if len(name) > LONGEST:
        raise EdgeError(f"{what} has at most {LONGEST} characters, found {len(name)}: {name[:60]!r}...")
    if not name.isprintable():
        wrong = next(c for c in name if not c.isprintable())
        raise EdgeError(f"{what} must be printable, found {name!a} with the character U+{ord(wrong):04X}; leave it out")
    return name
