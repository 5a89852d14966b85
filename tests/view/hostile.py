"""Texts that try to be something else: markup, ends of scripts, templates, marks that turn text round, and very long ones."""

NAMES = (
    "<img src=x onerror=window.stung=1>",
    "<script>window.stung=1</script>",
    "</script><script>window.stung=1</script>",
    "<!--<script>",
    '"><svg onload=window.stung=1>',
    "' onmouseover='window.stung=1",
    "javascript:window.stung=1",
    "{{constructor.constructor('window.stung=1')()}}",
    "${window.stung=1}",
    "__proto__",
    "n" * 300,
)
"""Those that may be names of frames and joints."""
LINES, TURNED = "line\u2028separator\u2029and\nnewline]", "\u202egnirts desrever\u202c"
TEXTS = (*NAMES, LINES, TURNED)
"""Those that may be labels, titles and buttons: names are printable, labels need not be."""
