"""Edge families: what makes a class one, and the names by which files know them."""

import dataclasses
import inspect
import operator
import weakref
from collections.abc import Callable
from typing import Any, TypeVar, dataclass_transform

import jax

from jaxframes.edges.base import Edge, assembled
from jaxframes.errors import EdgeError, suggest

Family = TypeVar("Family", bound=type[Edge])

_BY_NAME: dict[str, type[Edge]] = {}


@dataclass_transform(frozen_default=True, eq_default=False)
def family(static: tuple[str, ...] = (), name: str | None = None) -> Callable[[Family], Family]:
    """Return a decorator that makes a class an edge family: a frozen dataclass and a pytree whose array fields are leaves.

    A constructor that the class has, of its own or from its bases, stays; without one, it takes the fields in order, and plain numbers
    become arrays. Trees are put together again without it, so a constructor may validate and normalise what a user gives, while
    transformations may put anything into the leaves. A class that shares fields with others inherits them; its own parameters come
    before those, as leaves of a tree.

    Args:
        static: Names of the fields that are not parameters; they must be hashable and equal by value.
        name: A short name for files, such as ``"acme.cam"``: ``jf.to_json`` writes edges of the family under it, ``jf.from_json`` reads
            them wherever the family has been defined. Without one, edges of the family cannot be written.

    Raises:
        EdgeError: The class is no ``Edge``, has no such field, a field of a name that ``Edge`` uses, or the name is taken.

    Example:
        >>> import jax, jaxframes as jf
        >>> @jf.edges.family()
        ... class Lift(jf.edges.Edge):
        ...     height: jax.Array
        ...     def steps(self, inputs, order):
        ...         return (jf.edges.steps.Rigid(translation=jf.edges.steps.V3(0.0, 0.0, *inputs.components(self.height))),)
        >>> Lift(0.3).height.shape
        (1,)
    """
    if isinstance(static, (str, type)):
        raise EdgeError(f"family(static=...) takes a tuple of names of fields, found {static!r}; a decorator without any is @family()")

    def decorate(cls: Family) -> Family:
        if not (isinstance(cls, type) and issubclass(cls, Edge)):
            raise EdgeError(f"{cls.__name__} is no edge family; derive it from jf.edges.Edge")
        takes_fields = _has_no_constructor(cls)
        made = dataclasses.dataclass(frozen=True, eq=False, repr=False, init=takes_fields)(cls)
        if takes_fields:
            _MADE_CONSTRUCTORS.add(made.__init__)
        _check_fields(made, static)
        data = _parameters_of(made, static)
        made.family_fields = data
        keys = tuple(map(jax.tree_util.GetAttrKey, data))
        parts, facts = _getter(data), _getter(static)

        def flatten(edge: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
            return parts(edge), facts(edge)

        def flatten_with_keys(edge: Any) -> tuple[list[tuple[Any, Any]], tuple[Any, ...]]:
            return list(zip(keys, parts(edge), strict=True)), facts(edge)

        def unflatten(meta: tuple[Any, ...], leaves: Any) -> Any:
            return assembled(made, {**dict(zip(data, leaves, strict=True)), **dict(zip(static, meta, strict=True))})

        jax.tree_util.register_pytree_with_keys(made, flatten_with_keys, unflatten, flatten)
        if name is not None:
            _register(made, name)
        return made

    return decorate


_MADE_CONSTRUCTORS: weakref.WeakSet[Any] = weakref.WeakSet()
"""Constructors that take the fields of a family."""


def _has_no_constructor(cls: type) -> bool:
    """Whether nobody wrote a constructor, for a family or for a base of it."""
    return cls.__init__ is object.__init__ or cls.__init__ in _MADE_CONSTRUCTORS


def _check_fields(cls: Any, static: tuple[str, ...]) -> None:
    fields = [f.name for f in dataclasses.fields(cls)]
    for name in static:
        if name not in fields:
            raise EdgeError(f"{cls.__name__} has no field {name!r} to be static.{suggest(name, fields)}")
    for name in fields:
        if name in dir(Edge):
            raise EdgeError(f"{cls.__name__} has a field {name!r}, which every edge has; say it of the class, without a type: {name} = ...")


def _parameters_of(cls: Any, static: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the fields that are parameters, those of the class before those that it inherits."""
    own = [inspect.get_annotations(base) for base in cls.__mro__]
    names = [f.name for f in dataclasses.fields(cls) if f.name not in static]
    return tuple(sorted(names, key=lambda name: next(i for i, fields in enumerate(own) if name in fields)))


def _getter(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """Return the function that reads fields as a tuple."""
    if len(names) > 1:
        return operator.attrgetter(*names)
    if not names:
        return lambda value: ()
    one = operator.attrgetter(names[0])
    return lambda value: (one(value),)


def is_family(cls: type[Edge]) -> bool:
    """Whether a class of edges was made a family: one derived from a family is none without the decorator."""
    return "family_fields" in vars(cls) and cls is not Edge


def _register(cls: type[Edge], name: str) -> None:
    """Let files know a family by a name; a class that is defined again (in a notebook) takes the place of the one before."""
    if not isinstance(name, str) or not name:
        raise EdgeError(f"family(name=...) of {cls.__name__} takes text that is not empty, found {name!r}")
    other = _BY_NAME.get(name, cls)
    if (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
        raise EdgeError(f"{name!r} is the name of {other.__module__}.{other.__qualname__} already; give {cls.__name__} another one")
    _BY_NAME[name] = cls


def file_name(cls: type[Edge]) -> str | None:
    """Return the name by which files know a family, None where it has none."""
    return next((name for name, held in _BY_NAME.items() if held is cls), None)


def family_named(name: str) -> type[Edge] | None:
    """Return the family that files know by a name, None where there is none."""
    return _BY_NAME.get(name)


def family_names() -> tuple[str, ...]:
    """Return the names of all families that files know."""
    return tuple(_BY_NAME)
