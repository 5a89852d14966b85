"""The one family of exceptions: each names the thing, what was found, and the remedy."""

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

Class = TypeVar("Class", bound=type)
Method = TypeVar("Method", bound=Callable[..., Any])


class FrameWarning(UserWarning):
    """Something that is probably not meant; the message names the frame and says how to tell that it is."""


class FrameError(Exception):
    """Base class of every error that jaxframes raises on purpose."""


class UnknownFrameError(FrameError):
    """A frame name is not in the tree."""


class UnknownJointError(FrameError):
    """A joint name is not in the tree."""


class DuplicateNameError(FrameError):
    """A frame or joint name is used twice."""


class TopologyError(FrameError):
    """The frames do not form one tree: a cycle, two parents, two roots, or not a descendant."""


class EdgeError(FrameError):
    """An edge cannot do what is asked of it, or was given bad numbers."""


class MissingInputError(FrameError):
    """A query needs a value that the state does not hold."""


class ShapeError(FrameError):
    """An array has the wrong shape or dtype."""


class NoAccelerationError(FrameError):
    """An acceleration was asked of a chain that has none."""


class FormatError(FrameError):
    """A text or file is not in the format it should be in."""


class MissingExtraError(FrameError):
    """An optional library is needed: the message names the extra to install."""


class SpiceError(FrameError):
    """Base class of the errors met while reading kernels or tables."""


class MissingKernelError(SpiceError):
    """A kernel file is missing, or a kind of kernel that the request needs is not loaded."""


class BadKernelError(SpiceError):
    """A file is no kernel, or a kernel is damaged."""


class UnknownBodyError(SpiceError):
    """A body name or id is not known to the loaded kernels."""


class UnknownAxesError(SpiceError):
    """A SPICE frame name or id is not known to the loaded kernels."""


class NoPathError(SpiceError):
    """The kernels hold no data that connects two bodies or two SPICE frames."""


class CoverageError(SpiceError):
    """The kernels or a table do not cover the span asked for."""


class ToleranceError(SpiceError):
    """A fitted table cannot be as good, or as small, as asked for."""


class TableError(SpiceError):
    """A table file is missing, damaged, altered, or of an unknown schema."""


def suggest(name: str, known: Iterable[str]) -> str:
    """Return a sentence with the closest known names, or one that lists a few of them.

    Args:
        name: What was asked for.
        known: The names that exist.

    Returns:
        Text that starts with a space, ready to append to a message; empty if nothing is known.
    """
    names = list(known)
    close = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    if close:
        return " Did you mean " + " or ".join(repr(c) for c in close) + "?"
    if not names:
        return ""
    shown = ", ".join(repr(n) for n in names[:8])
    return f" Known: {shown}{', ...' if len(names) > 8 else ''} ({len(names)} in all)."


def says_keywords(cls: Class) -> Class:
    """Return a class whose own methods with keywords say, where arguments come without one, which there are."""
    for name, method in list(vars(cls).items()):
        if inspect.isfunction(method) and not name.startswith("_") and any(map(_is_named, inspect.signature(method).parameters.values())):
            setattr(cls, name, by_keyword(method))
    return cls


def by_keyword(method: Method) -> Method:
    """Return a method whose TypeError for too many arguments without a name says which names there are."""
    parameters = list(inspect.signature(method).parameters.values())
    plain = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    named = list(filter(_is_named, parameters))
    needed = [p.name for p in named if p.default is p.empty] or [p.name for p in named]

    @functools.wraps(method)
    def call(*args: Any, **kwargs: Any) -> Any:
        if len(args) > len(plain):
            raise TypeError(_without_names(method.__name__, plain[1:], needed, args[len(plain) :]))
        return method(*args, **kwargs)

    return call  # pyright: ignore[reportReturnType]


def _is_named(parameter: inspect.Parameter) -> bool:
    return parameter.kind is parameter.KEYWORD_ONLY


def _without_names(function: str, plain: list[str], named: list[str], more: tuple[Any, ...]) -> str:
    found = ", ".join(repr(value) if isinstance(value, str) else f"a {type(value).__name__}" for value in more)
    remedy = f"name what follows: {', '.join(f'{name}=' for name in named)}" if named else "it takes nothing more"
    return f"{function}({', '.join([*plain, *(f'{name}=...' for name in named)])}) was given {found} without a name; {remedy}"
