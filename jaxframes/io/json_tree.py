"""Trees as JSON: lossless, versioned, and read without running anything that the text names."""

import base64
import dataclasses
import importlib
import json
from typing import Any

import jax
import numpy as np

from jaxframes.errors import FormatError, FrameError
from jaxframes.staging.arrays import default_float
from jaxframes.tree import FrameTree, TreeBuilder

SCHEMA = 1
_INLINE = 64  # arrays of up to so many numbers are written as numbers, larger ones as base64


def to_json(tree: FrameTree, indent: int | None = 1) -> str:
    """Return a tree as JSON text: frames, edges with every number exactly, joint names and properties.

    Args:
        tree: The tree; its numbers must be known (not traced).
        indent: Spaces for each level of nesting, or None for one line.
    """
    frames = []
    for i, name in enumerate(tree.names[1:], 1):
        entry: dict[str, Any] = {"name": name, "parent": tree.parent(name), "edge": _encode(tree.edge(name))}
        if tree.topology.edge_names[i] is not None:
            entry["joint"] = tree.topology.edge_names[i]
        if tree.properties[name]:
            entry["properties"] = _plain(tree.properties[name])
        frames.append(entry)
    whole = {"jaxframes_tree": SCHEMA, "root": tree.root, "root_properties": _plain(tree.properties[tree.root]), "frames": frames}
    if list(tree.topology.joint_frames) != sorted(tree.topology.joint_frames):
        whole["joint_order"] = list(tree.joint_names)
    return json.dumps(whole, indent=indent, allow_nan=False)


def from_json(text: str) -> FrameTree:
    """Return the tree that ``to_json`` wrote.

    Raises:
        FormatError: The text is no JSON, no tree, or of a schema this version does not know.
        FrameError: The frames do not form a tree.
    """
    try:
        whole = json.loads(text)
    except ValueError as error:
        raise FormatError(f"this is no JSON: {error}") from None
    schema = whole.get("jaxframes_tree") if isinstance(whole, dict) else None
    if schema != SCHEMA:
        raise FormatError(f"this is no tree of schema {SCHEMA}: its jaxframes_tree is {schema!r}; write it with to_json of this version")
    try:
        builder = TreeBuilder(root=whole["root"])
        builder.set_properties(whole["root"], whole["root_properties"])
        for entry in whole["frames"]:
            edge = _decode(entry["edge"]).astype(default_float())
            builder.add(entry["name"], parent=entry["parent"], edge=edge, joint=entry.get("joint"), properties=entry.get("properties"))
        builder.order_joints(whole.get("joint_order", ()))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"the tree's JSON is damaged: {type(error).__name__}: {error}") from error
    return builder.build()


def _plain(value: Any) -> Any:
    if hasattr(value, "items"):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    if isinstance(value, bytes):
        raise FrameError("a property holds bytes, which JSON cannot keep; use text or numbers")
    return value


def _encode(value: Any) -> Any:
    if value is None or isinstance(value, (bool, int, str)):
        return {"is": value}
    if isinstance(value, float):
        return {"float": value.hex()}
    if isinstance(value, tuple):
        return {"tuple": [_encode(v) for v in value]}
    if isinstance(value, (jax.Array, np.ndarray, np.generic)):
        return _encode_array(np.asarray(value))
    if dataclasses.is_dataclass(value):
        fields = {f.name: _encode(getattr(value, f.name)) for f in dataclasses.fields(value)}
        return {"type": f"{type(value).__module__}:{type(value).__qualname__}", "fields": fields}
    raise FrameError(f"a {type(value).__name__} cannot be written as JSON: {value!r}")


def _encode_array(array: np.ndarray) -> dict[str, Any]:
    head = {"dtype": array.dtype.name, "shape": list(array.shape)}
    if array.size > _INLINE:
        little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        return {**head, "base64": base64.b64encode(little.tobytes()).decode()}
    flat = array.reshape(-1).tolist()
    return {**head, "numbers": [n if isinstance(n, int) or np.isfinite(n) else repr(n) for n in flat]}


def _decode(entry: Any) -> Any:
    if "is" in entry:
        return entry["is"]
    if "float" in entry:
        return float.fromhex(entry["float"])
    if "tuple" in entry:
        return tuple(_decode(v) for v in entry["tuple"])
    if "dtype" in entry:
        return _decode_array(entry)
    cls = _class(entry["type"])
    made = object.__new__(cls)
    known = {f.name for f in dataclasses.fields(cls)}
    if known != set(entry["fields"]):
        raise FormatError(f"{entry['type']} has the fields {sorted(known)}, found {sorted(entry['fields'])}")
    for name, value in entry["fields"].items():
        object.__setattr__(made, name, _decode(value))
    return made


def _decode_array(entry: Any) -> Any:
    dtype = np.dtype(entry["dtype"])
    if "base64" in entry:
        flat = np.frombuffer(base64.b64decode(entry["base64"], validate=True), dtype.newbyteorder("<")).astype(dtype)
    else:
        flat = np.array([float(n) if isinstance(n, str) else n for n in entry["numbers"]], dtype)
    return flat.reshape(entry["shape"])


def _class(name: str) -> type:
    """Return a dataclass of this package by its written name; nothing outside the package is looked up."""
    module, _, qualname = name.partition(":")
    if not module.startswith("jaxframes.") or "." in qualname:
        raise FormatError(f"{name!r} is no edge or value of jaxframes; trees with other edges cannot be read")
    try:
        cls = getattr(importlib.import_module(module), qualname)
    except (ImportError, AttributeError):
        raise FormatError(f"{name!r} is not known to this version of jaxframes") from None
    if not (dataclasses.is_dataclass(cls) and isinstance(cls, type)):
        raise FormatError(f"{name!r} is no edge or value of jaxframes")
    return cls
