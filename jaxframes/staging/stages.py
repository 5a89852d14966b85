"""Stages: parts of a program that XLA:CPU compiles by themselves.

XLA:CPU fuses elementwise arithmetic into whatever reads it. Of a long computation with several readers, or one that indexes it in
several ways, it then computes the whole once for each of them, or puts so much into one loop that this falls off a cliff. A stage is a
call that the compiler is told not to inline: what is inside is fused to a few loops, its results are computed once and lie in memory,
and whatever reads them cannot reach inside. It costs no copy and no arithmetic, unlike a product with the identity;
``lax.optimization_barrier`` does not do, it is removed before fusion. Other platforms fuse well: there a stage is what it holds.

A stage is a primitive of its own. What it becomes is decided where a program is lowered for a platform, so nothing is traced twice and
no global state tells traces apart. Its derivative and its transpose are stages too, which work out anew what they need of the inside: of
a stage, reverse mode keeps nothing but the inputs.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata
from jax.interpreters import ad, batching, mlir

from jaxframes.staging.internals import Primitive
from jaxframes.staging.jaxprs import Program, program_of


def stage(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes the same as a stage of its own, on CPU; its derivatives are stages too.

    Arguments are trees of arrays. Arrays of an outer trace that the function holds are passed on. It must not call ``jnp`` functions
    that are jitted themselves (``where``, ``clip``, ``round``): in derivatives these would become stages within the stage.
    ``components.select`` is not.
    """

    def run(*operands: Any) -> Any:
        leaves, given = jax.tree.flatten(operands)
        made: list[Any] = []

        def flat(*arrays: jax.Array) -> list[jax.Array]:
            out, structure = jax.tree.flatten(function(*jax.tree.unflatten(given, arrays)))
            made[:] = [structure]
            return out

        results = _staged(flat, *leaves)
        return jax.tree.unflatten(made[0], results)

    return run


def staged(make: Callable[[], Any]) -> Any:
    """Return a structure of components whose arrays are worked out as a stage; numbers known while tracing stay known."""
    made: list[Any] = []

    def arrays() -> list[jax.Array]:
        leaves, structure = jax.tree.flatten(make())
        made[:] = structure, [None if isinstance(leaf, jax.Array) else leaf for leaf in leaves]
        return [leaf for leaf in leaves if isinstance(leaf, jax.Array)]

    found = iter(stage(arrays)())
    structure, known = made
    return jax.tree.unflatten(structure, [next(found) if value is None else value for value in known])


def _staged(function: Callable[..., Sequence[jax.Array]], *arrays: jax.Array) -> Sequence[jax.Array]:
    """Return the results of a function of arrays as a stage."""
    program, held = program_of(function, *arrays)
    return STAGE.bind(*held, *arrays, program=program)


STAGE = Primitive("stage")
STAGE.multiple_results = True
STAGE.def_abstract_eval(lambda *kinds, program: program.results)


@functools.lru_cache(maxsize=1024)
def _compiled(program: Program) -> Callable[..., Any]:
    return jax.jit(program.run)


STAGE.def_impl(lambda *arrays, program: _compiled(program)(*arrays))


def _not_inlined(*arrays: jax.Array, program: Program) -> Sequence[jax.Array]:
    with set_xla_metadata(inlineable="false"):
        return _compiled(program)(*arrays)


mlir.register_lowering(STAGE, mlir.lower_fun(lambda *arrays, program: program.evaluate(*arrays)))
mlir.register_lowering(STAGE, mlir.lower_fun(_not_inlined), platform="cpu")


# What follows from a program is a program again, traced once: outside of jit, the derivative of an operation comes along at every call.


def _derivative(primals: Sequence[jax.Array], tangents: Sequence[Any], *, program: Program) -> tuple[Any, Any]:
    results = STAGE.bind(*primals, program=program)
    moved = tuple(i for i, tangent in enumerate(tangents) if not isinstance(tangent, ad.Zero))
    given = [*primals, *(tangents[i] for i in moved)]
    change, held, kept = _change(program, moved, tuple(map(jax.typeof, given)))
    found = dict(zip(kept, STAGE.bind(*held, *given, program=change), strict=True)) if kept else {}
    zeros = (ad.Zero(jax.typeof(r).to_tangent_aval()) for r in results)
    return results, [found.get(i, zero) for i, zero in enumerate(zeros)]


@functools.lru_cache(maxsize=1024)
def _change(program: Program, moved: tuple[int, ...], kinds: tuple[Any, ...]) -> tuple[Program, Sequence[jax.Array], list[int]]:
    """Return the program of the change of a program's results with some of its inputs, and which of the results change."""
    count, depends = len(program.kinds), program.depends_on(moved)
    floats = [jnp.issubdtype(kind.dtype, jnp.floating) for kind in program.results]
    kept = [i for i, (yes, is_float) in enumerate(zip(depends, floats, strict=True)) if yes and is_float]

    def change(*arrays: jax.Array) -> list[jax.Array]:
        full, steps = arrays[:count], arrays[count:]

        def of_moved(*given: jax.Array) -> list[jax.Array]:
            inputs = list(full)
            for i, value in zip(moved, given, strict=True):
                inputs[i] = value
            results = program.evaluate(*inputs)
            return [results[i] for i in kept]

        return jax.jvp(of_moved, tuple(full[i] for i in moved), steps)[1]

    return *program_of(change, *kinds), kept


def _transposed(cotangents: Sequence[Any], *arrays: Any, program: Program) -> list[Any]:
    """Return the cotangents of the inputs in which a stage is linear, as a stage."""
    linear = tuple(i for i, array in enumerate(arrays) if ad.is_undefined_primal(array))
    given = tuple(i for i, ct in enumerate(cotangents) if not isinstance(ct, ad.Zero))
    if not given:
        return [ad.Zero(array.aval) if i in linear else None for i, array in enumerate(arrays)]
    kinds = tuple(arrays[i].aval for i in linear)
    inputs = [*(array for i, array in enumerate(arrays) if i not in linear), *(cotangents[i] for i in given)]
    back, held = _adjoint(program, linear, given, kinds, tuple(map(jax.typeof, inputs)))
    found = dict(zip(linear, STAGE.bind(*held, *inputs, program=back), strict=True))
    return [found.get(i) for i in range(len(arrays))]


@functools.lru_cache(maxsize=1024)
def _adjoint(
    program: Program, linear: tuple[int, ...], given: tuple[int, ...], moving: tuple[Any, ...], kinds: tuple[Any, ...]
) -> tuple[Program, Sequence[jax.Array]]:
    """Return the program of the cotangents of some inputs: of the other inputs and the cotangents of some results."""
    fixed = [i for i in range(len(program.kinds)) if i not in linear]

    def back(*values: jax.Array) -> list[jax.Array]:
        known = dict(zip(fixed, values, strict=False))

        def forward(*steps: jax.Array) -> list[jax.Array]:
            inputs = known | dict(zip(linear, steps, strict=True))
            results = program.evaluate(*(inputs[i] for i in range(len(inputs))))
            return [results[i] for i in given]

        return list(jax.linear_transpose(forward, *moving)(list(values[len(fixed) :])))

    return program_of(back, *kinds)


def _batched(arrays: Sequence[jax.Array], axes: Sequence[int | None], *, program: Program) -> tuple[Any, Any]:
    over, held = _mapped(program, tuple(axes), tuple(map(jax.typeof, arrays)))
    results = STAGE.bind(*held, *arrays, program=over)
    return results, [0] * len(results)


@functools.lru_cache(maxsize=1024)
def _mapped(program: Program, axes: tuple[int | None, ...], kinds: tuple[Any, ...]) -> tuple[Program, Sequence[jax.Array]]:
    """Return the program over a further axis of some inputs."""
    return program_of(jax.vmap(program.evaluate, in_axes=axes), *kinds)


ad.primitive_jvps[STAGE] = _derivative
ad.primitive_transposes[STAGE] = _transposed
batching.primitive_batchers[STAGE] = _batched
