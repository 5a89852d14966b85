"""Trees as JSON: lossless, of one schema, read without importing anything and checked as what a user gives is checked.

An edge is written under the name of its family (``jf.edges.family(name=...)``), as what its constructor takes; a table as a table file.
Numbers, texts, null, true and false stand for themselves, a list for a tuple. What an object stands for its keys say: ``dtype``, ``shape``
and ``numbers`` or ``base64`` an array, ``value`` and ``fields`` a value such as a ``Transform``, ``family`` and ``arguments`` an edge,
``table`` a table, ``float`` an infinity or NaN.
"""

import base64
import functools
import inspect
import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.edges.family import family_named, family_names, file_name
from jaxframes.errors import EdgeError, FormatError, FrameError, suggest
from jaxframes.model.families import float_dtype
from jaxframes.spatial import Epoch, Motion, Rotation, SpatialAcceleration, SpatialVelocity, Transform, Twist, Wrench
from jaxframes.staging.arrays import default_float, is_concrete
from jaxframes.tables.store import STORABLE, from_bytes, to_bytes
from jaxframes.tree import FrameTree, TreeBuilder

SCHEMA = 1
"""Version of what is in the text; no other is read."""
MOST_NESTED = 100
"""Levels of lists and objects in the text."""
DTYPES = ("float16", "bfloat16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "bool")
VALUES: dict[type, dict[str, int | type]] = {
    Rotation: {"wxyz": 4},
    Transform: {"rotation": Rotation, "translation": 3},
    SpatialVelocity: {"angular": 3, "linear": 3},
    SpatialAcceleration: {"angular": 3, "linear": 3},
    Motion: {"transform": Transform, "velocity": SpatialVelocity, "acceleration": SpatialAcceleration},
    Twist: {"linear": 3, "angular": 3},
    Wrench: {"force": 3, "torque": 3},
    Epoch: {"hi": 0, "lo": 0},
}
"""Values that an edge may hold: for each field the length of its arrays' last axis, 0 for any, or the value that it is."""
INFINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}
_INLINE = 64  # arrays of up to so many numbers are written as numbers, larger ones as base64


def to_json(tree: FrameTree, indent: int | None = 1) -> str:
    """Return a tree as JSON text: frames, edges with every number exactly, joint names and properties.

    Args:
        tree: The tree; its numbers must be known (not traced).
        indent: Spaces for each level of nesting, or None for one line.

    Raises:
        FrameError: An edge is of a family without a name for files, or something cannot be written; the frame is named.
    """
    held, frames = tree.properties, []
    for i, name in enumerate(tree.names[1:], 1):
        entry: dict[str, Any] = {"name": name, "parent": tree.parent(name), "edge": _named(name, _encode, tree.edge(name))}
        if held[name]:
            entry["properties"] = _named(name, _plain, held[name])
        if tree.topology.edge_names[i] is not None:
            entry["joint"] = tree.topology.edge_names[i]
        frames.append(entry)
    whole = {"jaxframes_tree": SCHEMA, "root": tree.root, "root_properties": _named(tree.root, _plain, held[tree.root]), "frames": frames}
    if list(tree.topology.joint_frames) != sorted(tree.topology.joint_frames):
        whole["joint_order"] = list(tree.joint_names)
    return json.dumps(whole, indent=indent, allow_nan=False)


def from_json(text: str) -> FrameTree:
    """Return the tree that ``to_json`` wrote.

    Nothing is imported and nothing run that the text names: families are those of ``jf.edges`` and those that have been defined with a
    name by then. Every edge passes through the constructor of its family; then its parameters take the numbers of the text.

    Raises:
        FormatError: The text is no JSON, no tree, of another schema, damaged, or names a family that is not known.
        FrameError: What an edge is made of is refused by its family, or the frames do not form a tree.
    """
    try:
        whole = json.loads(text, parse_constant=_refuse)
    except (TypeError, ValueError, RecursionError) as error:
        raise FormatError(f"this is no JSON: {error}") from None
    schema = whole.get("jaxframes_tree") if isinstance(whole, dict) else None
    if schema != SCHEMA or isinstance(schema, bool):
        raise FormatError(
            f"this is no tree of schema {SCHEMA}, the only one that is read: its jaxframes_tree is {schema!r}; "
            "write it again with jf.to_json of this version"
        )
    _check_depth(whole)
    try:
        return _tree(whole)
    except FrameError:
        raise
    except Exception as error:  # whatever a damaged text leads to
        raise FormatError(f"the tree's JSON is damaged: {type(error).__name__}: {error}") from error


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is none of JSON's numbers")


def _check_depth(whole: Any) -> None:
    """Refuse a text whose lists and objects lie in each other too deeply; without recursion."""
    ahead = [(whole, 1)]
    while ahead:
        value, depth = ahead.pop()
        if depth > MOST_NESTED:
            raise FormatError(f"the tree's JSON is damaged: more than {MOST_NESTED} lists and objects lie in one another")
        inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        ahead += [(item, depth + 1) for item in inside if isinstance(item, (dict, list))]


def _tree(whole: dict[str, Any]) -> FrameTree:
    _check_keys(whole, {"jaxframes_tree", "root", "root_properties", "frames"}, {"joint_order"}, "a tree")
    builder = TreeBuilder(root=whole["root"])
    builder.set_properties(whole["root"], whole["root_properties"])
    for name in ("frames", "joint_order"):
        if not isinstance(whole.get(name, []), list):
            raise FormatError(f"the tree's JSON is damaged: {name} is a list, found {whole[name]!r}")
    for entry in whole["frames"]:
        _check_keys(entry, {"name", "parent", "edge"}, {"joint", "properties"}, "a frame")
        edge = _named(entry["name"], _edge, entry["edge"])
        builder.add(entry["name"], parent=entry["parent"], edge=edge, joint=entry.get("joint"), properties=entry.get("properties"))
    builder.order_joints(whole.get("joint_order", ()))
    return builder.build()


def _check_keys(entry: Any, needed: set[str], more: set[str], what: str) -> None:
    """Refuse an object without the keys that it needs, or with others than these and some more."""
    if not isinstance(entry, dict) or not needed <= set(entry) <= needed | more:
        found = sorted(entry) if isinstance(entry, dict) else entry
        raise FormatError(f"the tree's JSON is damaged: {what} has the keys {sorted(needed)} and maybe {sorted(more)}, found {found!r}")


def _named(frame: Any, function: Callable[[Any], Any], value: Any) -> Any:
    """Return what a function makes of a value; its errors name the frame."""
    try:
        return function(value)
    except FrameError as error:
        raise type(error)(f"frame {frame!r}: {error}") from error
    except Exception as error:
        raise FormatError(f"frame {frame!r}: its JSON is damaged: {type(error).__name__}: {error}") from error


# ---------------------------------------------------------------------- writing
def _plain(value: Any, depth: int = 4) -> Any:
    """Return a property as lists, objects, text and numbers; ``depth`` counts what it lies in."""
    if depth > MOST_NESTED:
        raise FrameError(f"a property holds more than {MOST_NESTED} sequences and mappings in one another, which JSON does not keep here")
    if isinstance(value, Mapping):
        return {key: _plain(v, depth + 1) for key, v in value.items()}
    if isinstance(value, tuple):
        return [_plain(v, depth + 1) for v in value]
    if isinstance(value, bytes) or (isinstance(value, float) and not math.isfinite(value)):
        raise FrameError(f"a property holds {value!r}, which JSON cannot keep; use text or finite numbers")
    return value


def _encode(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": repr(float(value))}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, tuple):
        return [_encode(v) for v in value]
    if isinstance(value, (jax.Array, np.ndarray, np.generic)):
        return _encode_array(value)
    if isinstance(value, Edge):
        return _encode_table(value) if isinstance(value, STORABLE) else _encode_edge(value)
    if type(value) in VALUES:
        return {"value": type(value).__name__, "fields": {name: _encode(getattr(value, name)) for name in VALUES[type(value)]}}
    raise FrameError(f"a {type(value).__name__} cannot be written as JSON: {value!r}")


def _encode_edge(edge: Edge) -> dict[str, Any]:
    cls = type(edge)
    name = file_name(cls)
    if name is None:
        raise EdgeError(
            f"{cls.__name__} has no name for files, so its edges cannot be written; give the family one: "
            f"@jf.edges.family(name=...) above the class {cls.__name__}"
        )
    arguments = edge.arguments()
    try:
        _signature(cls).bind(**arguments)
    except TypeError as error:
        raise EdgeError(
            f"the constructor of {cls.__name__} does not take what {cls.__name__}.arguments() returns ({error}); "
            "override arguments() to return what it takes, by name"
        ) from None
    return {"family": name, "arguments": {key: _encode(value) for key, value in arguments.items()}}


@functools.lru_cache(maxsize=256)
def _signature(cls: type[Edge]) -> inspect.Signature:
    return inspect.signature(cls)


def _encode_table(table: Any) -> dict[str, Any]:
    """Return a table as a table file, if that keeps every number."""
    content = to_bytes({"table": table})
    again = from_bytes(content, "the table")["table"].astype(float_dtype(table))
    if not _alike(table, again):
        raise FrameError(f"{table.describe()} holds numbers that a table file does not keep: its parameters were changed since it was made")
    return {"table": base64.b64encode(content).decode()}


def _alike(a: Any, b: Any) -> bool:
    pairs = zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=False)
    return jax.tree.structure(a) == jax.tree.structure(b) and all(np.array_equal(x, y, equal_nan=True) for x, y in pairs)


def _encode_array(value: Any) -> dict[str, Any]:
    if not is_concrete(value):
        raise FrameError("a traced number cannot be written as JSON; write the tree outside of jit, grad and vmap")
    array = np.asarray(value)
    head = {"dtype": array.dtype.name, "shape": list(array.shape)}
    if array.size > _INLINE:
        little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        return {**head, "base64": base64.b64encode(little.tobytes()).decode()}
    flat = array.reshape(-1).tolist()
    return {**head, "numbers": [n if isinstance(n, int) or math.isfinite(n) else repr(n) for n in flat]}


# ---------------------------------------------------------------------- reading
def _edge(entry: Any) -> Edge:
    edge = _decode(entry)
    if not isinstance(edge, Edge):
        raise FormatError("an edge is an object with its family and arguments, or with a table")
    return edge.astype(default_float())


def _decode(entry: Any) -> Any:
    if isinstance(entry, float) and not math.isfinite(entry):
        raise FormatError("a number is beyond what a float holds")
    if entry is None or isinstance(entry, (bool, int, float, str)):
        return entry
    if isinstance(entry, list):
        return tuple(_decode(v) for v in entry)
    match sorted(entry):
        case ["dtype", "numbers", "shape"] | ["base64", "dtype", "shape"]:
            return _decode_array(entry)
        case ["float"]:
            return INFINITE[_one_of(entry["float"], INFINITE, "a float that is no number of JSON")]
        case ["fields", "value"]:
            return _decode_value(entry)
        case ["table"]:
            return from_bytes(base64.b64decode(entry["table"], validate=True), "the table")["table"]
        case ["arguments", "family"]:
            return _decode_edge(entry["family"], entry["arguments"])
        case keys:
            raise FormatError(f"an object with the keys {keys} stands for nothing; an edge has 'family' and 'arguments', or 'table'")


def _one_of(word: Any, known: Sequence[str] | Mapping[str, Any], what: str) -> str:
    if not isinstance(word, str) or word not in known:
        raise FormatError(f"{what} is one of {', '.join(map(repr, known))}, found {word!r}")
    return word


def _decode_edge(name: Any, given: Any) -> Edge:
    family = family_named(name) if isinstance(name, str) else None
    if family is None:
        raise FormatError(
            f"there is no edge family {name!r} here.{suggest(str(name), family_names())} A family of your own is known once its module, "
            "with @jf.edges.family(name=...), has been imported"
        )
    arguments = {key: _decode(value) for key, value in given.items()}
    try:
        _signature(family).bind(**arguments)
    except TypeError as error:
        raise FormatError(f"{name!r} does not take these arguments: {error}") from None
    made = family(**arguments)
    given = {key: arguments[key] for key in family.parameter_fields() if key in arguments}
    return made.replace(**{key: value for key, value in given.items() if _same_form(value, getattr(made, key))})


def _same_form(given: Any, made: Any) -> bool:
    """Whether what a text gives for a parameter may stand for what the constructor made of it, which then has checked it."""
    shapes = ([np.shape(leaf) for leaf in jax.tree.leaves(value)] for value in (given, made))
    numbers = all(isinstance(leaf, np.ndarray) for leaf in jax.tree.leaves(given))
    return numbers and jax.tree.structure(given) == jax.tree.structure(made) and next(shapes) == next(shapes)


def _decode_value(entry: dict[str, Any]) -> Any:
    kinds = {kind.__name__: kind for kind in VALUES}
    kind = kinds[_one_of(entry["value"], kinds, "a value")]
    fields, wanted = {name: _decode(value) for name, value in entry["fields"].items()}, VALUES[kind]
    if set(fields) != set(wanted):
        raise FormatError(f"{kind.__name__} has the fields {sorted(wanted)}, found {sorted(fields)}")
    for name, form in wanted.items():
        value = fields[name]
        if isinstance(form, type):
            fits = isinstance(value, form)
        else:
            fits = isinstance(value, np.ndarray) and value.dtype.kind in "fV" and (not form or value.shape[-1:] == (form,))
        if not fits:
            text = form.__name__ if isinstance(form, type) else f"an array of floats [..., {form}]" if form else "an array of floats"
            found = f"shape {value.shape}, {value.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
            raise FormatError(f"{kind.__name__}: {name} is {text}, found {found}")
    return kind(**fields)


def _decode_array(entry: dict[str, Any]) -> np.ndarray:
    dtype, shape = np.dtype(_one_of(entry["dtype"], DTYPES, "a dtype")), entry["shape"]
    if not isinstance(shape, list) or not all(type(n) is int and n >= 0 for n in shape):
        raise FormatError(f"a shape is a list of whole numbers, found {shape!r}")
    if "base64" in entry:
        flat = np.frombuffer(base64.b64decode(entry["base64"], validate=True), dtype.newbyteorder("<")).astype(dtype)
    else:
        numbers = [INFINITE[_one_of(n, INFINITE, "a number that is text")] if isinstance(n, str) else n for n in entry["numbers"]]
        kinds = (bool,) if dtype.kind == "b" else (int, float)
        if any(type(n) not in kinds for n in numbers):
            raise FormatError(f"the numbers of an array of {dtype} are of another kind")
        flat = np.array(numbers, dtype)
    if flat.ndim != 1 or flat.size != math.prod(shape):
        raise FormatError(f"an array of shape {shape} needs {math.prod(shape)} numbers, found {flat.size}")
    return flat.reshape(shape)
