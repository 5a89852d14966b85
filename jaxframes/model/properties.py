"""Properties: immutable facts kept with a frame, static and equal by value."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from jaxframes.errors import EdgeError

Properties = tuple[tuple[str, Any], ...]
"""Pairs of key and frozen value: hashable, so that properties can be part of a tree's static structure."""


class _Frozen(tuple):
    """A frozen mapping, told apart from a tuple that a user gave."""

    def __repr__(self) -> str:
        return f"mapping{super().__repr__()}"


def freeze(mapping: Mapping[str, Any], owner: str) -> Properties:
    """Return a mapping as hashable pairs.

    Raises:
        EdgeError: A key is no text, or a value is neither text, number, bool, None nor a sequence or mapping of these.
    """
    for key in mapping:
        if not isinstance(key, str):
            raise EdgeError(f"{owner}: property keys are text, found {key!r}")
    return _Frozen((key, _freeze_value(value, f"{owner}: property {key!r}")) for key, value in mapping.items())


def _freeze_value(value: Any, owner: str) -> Any:
    if value is None or isinstance(value, (str, bool, int, float, bytes)):
        return value
    if isinstance(value, Mapping):
        return freeze(value, owner)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (list, tuple)):
        return tuple(_freeze_value(v, owner) for v in value)
    if isinstance(value, np.ndarray):
        return _freeze_value(value.tolist(), owner)
    raise EdgeError(f"{owner} holds a {type(value).__name__}; properties are static: use text, numbers, or tuples and mappings of them")


def thaw(properties: Properties) -> Mapping[str, Any]:
    """Return frozen pairs as a read-only mapping."""
    return MappingProxyType({key: _thawed(value) for key, value in properties})


def _thawed(value: Any) -> Any:
    if isinstance(value, _Frozen):
        return thaw(value)
    return tuple(map(_thawed, value)) if isinstance(value, tuple) else value
