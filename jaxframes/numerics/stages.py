"""Stages: parts of a program that XLA:CPU compiles by themselves.

XLA:CPU fuses elementwise arithmetic into whatever reads it. Of a long computation with several readers, or one that indexes it in
several ways, it then computes the whole once for each of them, or puts so much into one loop that this falls off a cliff. A stage is a
call that the compiler is told not to inline: what is inside is fused to a few loops, its results are computed once and lie in memory,
and whatever reads them cannot reach inside. It costs no copy and no arithmetic, unlike a product with the identity;
``lax.optimization_barrier`` does not do, it is removed before fusion. Other platforms fuse well and get no stages.
"""

from collections.abc import Callable
from typing import Any

import jax
from jax import lax
from jax.experimental.xla_metadata import set_xla_metadata

_platform = jax.make_user_context("")
"""The platform that what is traced just now is for; empty where it may be any. JAX keeps traces made under different values apart."""


def by_platform(*operands: Any, cpu: Callable[..., Any], default: Callable[..., Any]) -> Any:
    """Return ``cpu(*operands)`` in programs for CPUs and ``default(*operands)`` in others: ``lax.platform_dependent``, told apart once.

    What either of them asks in turn by this function is answered while tracing, so that nothing is traced for a platform it is not for.
    """
    known = _platform.value
    if known:
        return (cpu if known == "cpu" else default)(*operands)
    return lax.platform_dependent(*operands, cpu=_for("cpu", cpu), default=_for("default", default))


def _for(platform: str, function: Callable[..., Any]) -> Callable[..., Any]:
    def run(*operands: Any) -> Any:
        with _platform(platform):
            return function(*operands)

    return run


def stage(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that computes the same as a stage of its own, on CPU; its derivatives are stages too.

    Of what is computed inside, reverse mode keeps nothing: it is worked out anew in the loop that needs it. Arrays of an outer trace that
    the function holds are passed on. It must not call ``jnp`` functions that are jitted themselves (``where``, ``clip``, ``round``): in
    derivatives these would become stages within the stage. ``components.select`` is not.
    """

    @jax.checkpoint
    def inside(*operands: Any) -> Any:
        with set_xla_metadata(inlineable=None):
            return function(*operands)

    def called(*operands: Any) -> Any:
        with set_xla_metadata(inlineable="false"):
            return jax.jit(inside)(*operands)

    def run(*operands: Any) -> Any:
        return by_platform(*operands, cpu=called, default=function)

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
