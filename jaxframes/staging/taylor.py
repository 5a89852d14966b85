"""Taylor series through our primitives, for ``jax.experimental.jet``: stages and operations are what they compute, columns are linear."""

from collections.abc import Sequence
from typing import Any

from jax.experimental import jet

from jaxframes.staging import blocks, columns, operation, stages


def _of_stage(primals: Sequence[Any], series: Sequence[Any], *, program: Any) -> Any:
    return jet.jet(program.evaluate, tuple(primals), tuple(series), factorial_scaled=False)


def _of_operation(primals: Sequence[Any], series: Sequence[Any], *, operation: Any) -> Any:
    return jet.jet(lambda *arrays: list(operation.compute(*arrays)), tuple(primals), tuple(series), factorial_scaled=False)


def _of_work(primals: Sequence[Any], series: Sequence[Any], *, work: Any, batch: Any) -> Any:
    return jet.jet(lambda *arrays: list(work(*arrays)), tuple(primals), tuple(series), factorial_scaled=False)


def register() -> None:
    """Tell JAX the rules."""
    jet.jet_rules[stages.STAGE] = _of_stage
    jet.jet_rules[operation.OPERATION] = _of_operation
    jet.jet_rules[blocks.WORK] = _of_work
    for linear in columns.PRIMITIVES:
        jet.deflinear(linear)
