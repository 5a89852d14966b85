"""The ``jaxframes`` command: parses the arguments and hands over to one command."""

import argparse
import sys
from collections.abc import Sequence

from jaxframes._version import __version__
from jaxframes.errors import FrameError


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands; each command's file adds its own."""
    from jaxframes.cli import demo

    top = argparse.ArgumentParser(prog="jaxframes", description="Reference frames for JAX: the command line.")
    top.add_argument("--version", action="version", version=f"jaxframes {__version__}")
    commands = top.add_subparsers(dest="command", required=True, metavar="command")
    demo.add_parser(commands)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; 0 when all went well, 1 when it reports a failure, 2 when the input is wrong."""
    options = parser().parse_args(arguments)
    try:
        return options.run(options)
    except FrameError as error:
        print(f"jaxframes {options.command}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"jaxframes {options.command}: interrupted", file=sys.stderr)
        return 130
