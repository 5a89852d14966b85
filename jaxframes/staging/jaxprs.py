"""Programs: what a function of arrays does, traced once and kept without any array, equal by value."""

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import jax
import jax.core
import numpy as np
from jax.experimental.xla_metadata import set_xla_metadata

from jaxframes.staging.internals import ClosedJaxpr, Jaxpr, Literal


class Program:
    """A traced function of arrays that holds none: fit to be a parameter of a primitive.

    Two programs are equal when they do the same to inputs of the same types, so what is compiled for one serves the other.

    Attributes:
        kinds: Types of the inputs.
        results: Types of the results.
    """

    __slots__ = ("_closed", "_hash", "kinds", "results")

    def __init__(self, closed: Any):
        self._closed = closed
        self.kinds, self.results = tuple(closed.in_avals), tuple(closed.out_avals)
        self._hash = hash((self.kinds, self.results, len(closed.jaxpr.eqns)))

    def evaluate(self, *arrays: jax.Array) -> list[jax.Array]:
        """Return the results for inputs of the types that the program was traced for."""
        return jax.core.eval_jaxpr(self._closed.jaxpr, self._closed.consts, *arrays)

    def run(self, *arrays: jax.Array) -> list[jax.Array]:
        """Return the same, as what a stage holds: what is traced inside is no stage itself."""
        with set_xla_metadata(inlineable=None):
            return self.evaluate(*arrays)

    def depends_on(self, inputs: Iterable[int]) -> tuple[bool, ...]:
        """Return for each result whether it is made of any of the inputs at some places."""
        moved = frozenset(inputs)
        return tuple(bool(needs & moved) for needs in self.needs())

    def needs(self) -> tuple[frozenset[int], ...]:
        """Return for each result the places of the inputs that it is made of."""
        jaxpr, none = self._closed.jaxpr, frozenset[int]()
        known = {variable: frozenset([i]) for i, variable in enumerate(jaxpr.invars)}
        for equation in jaxpr.eqns:
            made = none.union(*(known.get(v, none) for v in _variables(equation.invars)))
            known.update(dict.fromkeys(equation.outvars, made))
        return tuple(none.union(*(known.get(v, none) for v in _variables([atom]))) for atom in jaxpr.outvars)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return isinstance(other, Program) and self._hash == other._hash and _same(self._closed, other._closed)

    def __repr__(self) -> str:
        return f"Program({len(self._closed.jaxpr.eqns)} equations, {len(self.kinds)} inputs, {len(self.results)} results)"


def program_of(function: Callable[..., Sequence[jax.Array]], *arrays: Any) -> tuple[Program, Sequence[jax.Array]]:
    """Return what a function does to arrays like these as a program, and the arrays it holds besides, which come first among its inputs."""
    traced = jax.make_jaxpr(function)(*arrays)
    held = traced.consts
    if held:
        inner = traced.jaxpr
        traced = jax.make_jaxpr(lambda *inputs: jax.core.eval_jaxpr(inner, inputs[: len(held)], *inputs[len(held) :]))(*held, *arrays)
    return Program(traced), held


def _variables(atoms: Sequence[Any]) -> list[Any]:
    return [atom for atom in atoms if not isinstance(atom, Literal)]  # the others are numbers written into the program


def _equations_and_arrays(traced: Any) -> tuple[Any, Sequence[Any]]:
    """Return the equations of a traced function and the arrays it holds (jax 0.12 has one class for both of 0.10's)."""
    return (traced.jaxpr, traced.consts) if isinstance(traced, ClosedJaxpr) else (traced, ())


def _same(one: Any, other: Any) -> bool:
    """Return whether two traced functions are the same, equation by equation."""
    if one is other:
        return True
    (a, held), (b, others) = _equations_and_arrays(one), _equations_and_arrays(other)
    if len(held) != len(others) or any(x is not y for x, y in zip(held, others, strict=True)):
        return False
    names: dict[Any, Any] = dict(zip((*a.constvars, *a.invars), (*b.constvars, *b.invars), strict=False))

    def alike(x: Any, y: Any) -> bool:
        if isinstance(x, Literal) or isinstance(y, Literal):
            return type(x) is type(y) and x.aval == y.aval and np.array_equal(x.val, y.val, equal_nan=np.asarray(x.val).dtype.kind in "fc")
        return names.get(x) is y

    if [len(part) for part in (a.constvars, a.invars, a.eqns, a.outvars)] != [
        len(part) for part in (b.constvars, b.invars, b.eqns, b.outvars)
    ]:
        return False
    for one, other in zip(a.eqns, b.eqns, strict=True):
        fits = one.primitive is other.primitive and len(one.invars) == len(other.invars) and len(one.outvars) == len(other.outvars)
        if not fits or not all(map(alike, one.invars, other.invars)) or not _alike(one.params, other.params):
            return False
        if [v.aval for v in one.outvars] != [v.aval for v in other.outvars]:
            return False
        names.update(zip(one.outvars, other.outvars, strict=True))
    return all(map(alike, a.outvars, b.outvars))


@functools.singledispatch
def _alike(one: Any, other: Any) -> bool:
    """Return whether two parameters of a primitive are the same; False where they cannot tell."""
    try:
        return type(one) is type(other) and bool(one == other)
    except (TypeError, ValueError):
        return False


@_alike.register
def _(one: dict, other: Any) -> bool:
    return isinstance(other, dict) and one.keys() == other.keys() and all(_alike(value, other[key]) for key, value in one.items())


@_alike.register(tuple)
@_alike.register(list)
def _(one: Sequence[Any], other: Any) -> bool:
    return type(one) is type(other) and len(one) == len(other) and all(map(_alike, one, other))


@_alike.register(ClosedJaxpr)
@_alike.register(Jaxpr)
def _(one: Any, other: Any) -> bool:
    return type(one) is type(other) and _same(one, other)
