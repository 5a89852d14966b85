"""The base of every edge that SPICE data make: it knows which bodies or frames it stands between, and can be evaluated by itself."""

from typing import Any

import jax

from jaxframes.edges.base import Edge
from jaxframes.tables.info import Info


class TableEdge(Edge):
    """What tables, orientation models and fixed frames share.

    Attributes:
        info: Names, ids, coverage and kernels; static.
    """

    info: Info

    def evaluate(self, time: Any, order: int = 2) -> tuple[jax.Array, ...]:
        """Return value, rate and acceleration at epochs [...]; the first ``order + 1`` of them.

        Args:
            time: An ``Epoch`` [...], or seconds past J2000 TDB [...].
            order: 0, 1 or 2.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say its values")

    def report(self) -> str:
        """Return what the edge is made of, in lines."""
        raise NotImplementedError(f"{type(self).__name__} does not report")
