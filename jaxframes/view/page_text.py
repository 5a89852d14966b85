"""The page as text: its files put together, without comments and indentation, with a policy that names its script and style by hash.

The page is one constant string but for its data. Data stand in it as JSON in which nothing can end the element or start a comment.
"""

import base64
import functools
import hashlib
import html
import json
import re
from importlib import resources
from typing import Any

import numpy as np

SCRIPTS = ("motions", "tree", "drawing", "layout", "panel", "controls", "main")
"""The parts of the script, in order; all are in one scope."""
TOKENS = re.compile(
    r"""(?P<kept>"(?:\\.|[^"\\])*"|`(?:\\.|[^`\\])*`|/(?![ */])(?:\\.|\[(?:\\.|[^\]\\])*\]|[^/\\\n])+/[a-z]*)"""
    r"""|(?P<dropped>//[^\n]*|/\*.*?\*/)|(?P<line>\s*\n\s*)|(?P<space>[ \t]+)|(?P<word>[\w$]+)|(?P<sign>.)""",
    re.DOTALL,
)

UNSAFE = re.compile("[<>\u2028\u2029\ud800-\udfff]")
"""What ends or starts an element, ends a line of a script, or cannot be written."""


class GraphHtml(str):
    """A page as text: notebooks show it, a terminal only says what it is."""

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own, which may run its script and nothing else."""
        return f'<iframe sandbox="allow-scripts" srcdoc="{html.escape(self)}" style="width:100%;height:560px;border:0"></iframe>'

    def __repr__(self) -> str:
        return f"<page of {len(self.encode())} bytes; write it to a file, or show it in a notebook>"


def squeezed(script: str) -> str:
    """Return a script without comments, needless white space and parentheses; strings, templates, regular expressions stay as they are.

    A division is written with spaces around it, a regular expression has none after its first slash: so the two are told apart.
    """
    out: list[str] = []
    pending = ""
    for token in TOKENS.finditer(script):
        kind, text = token.lastgroup, token.group()
        if kind == "dropped":
            continue
        if kind in ("line", "space"):
            pending = "\n" if kind == "line" or pending == "\n" else " "
            continue
        if pending and out:
            before, after = out[-1][-1], text[0]
            words = (before.isalnum() or before in "_$") and (after.isalnum() or after in "_$")
            if words or (before in "+-" and after in "+-") or (kind == "kept" and after == "/"):
                out.append(" ")
            elif pending == "\n" and before not in "{[(,;=>&|?:}" and after not in ")]}.,;?:&|":
                out.append("\n")
        if text == "}" and out[-1] == ";":
            out.pop()
        out.append(text)
        pending = ""
    return re.sub(r"(?<![\w$])\((\w+)\)=>", r"\1=>", "".join(out))


@functools.cache
def parts() -> tuple[str, str, str]:
    """Return the page without data, the policy for its script and style, and the script (for tests)."""
    folder = resources.files("jaxframes.view") / "page"
    read = lambda name: (folder / name).read_text(encoding="utf-8")  # noqa: E731
    script = "\n".join(squeezed(read(f"{name}.js")) for name in SCRIPTS)
    style = re.sub(r"\s*([{};:,])\s*", r"\1", read("page.css")).strip().replace(";}", "}")
    page = re.sub(r">\n<", "><", read("page.html")).replace("/*STYLE*/", style).replace("/*SCRIPT*/", script)
    policy = f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; base-uri 'none'; form-action 'none'"
    return page, policy, script


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def safe_json(data: Any) -> str:
    """Return JSON that may stand inside a page and inside a script: nothing in it ends an element, and no number is not one."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return UNSAFE.sub(lambda found: f"\\u{ord(found.group()):04x}", text)


def encoded(numbers: np.ndarray) -> str:
    """Return float64 numbers as base64 text."""
    return base64.b64encode(np.ascontiguousarray(numbers, "<f8").tobytes()).decode()


def live_page() -> str:
    """Return the page that asks its server for data."""
    return parts()[0].replace("/*DATA*/", "null")


def static_page(data: Any) -> GraphHtml:
    """Return the page with its data inside."""
    page, policy, _ = parts()
    meta = f'<head><meta http-equiv="Content-Security-Policy" content="{policy}">'
    return GraphHtml(page.replace("<head>", meta, 1).replace("/*DATA*/", safe_json(data), 1))
