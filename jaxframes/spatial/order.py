"""Order of numbers kept in two parts: exact comparisons, elementwise."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from jaxframes.numerics.eft import two_sum
from jaxframes.spatial.batch import Batched
from jaxframes.spatial.parts import same_rank
from jaxframes.staging.arrays import common_float


class Ordered(Batched):
    """A number hi + lo [...] that is compared with others of its class: both parts together, booleans [...]; NaN is never equal."""

    own_axes: ClassVar[int] = 0
    hi: jax.Array
    lo: jax.Array

    def _ordered(self, other: Any) -> tuple[jax.Array, ...] | None:
        """Return the parts of both, normalised, so that equal sums have equal parts; None if the other is of another class."""
        if not isinstance(other, type(self)):
            return None
        a, b, c, d = common_float(self.hi, self.lo, other.hi, other.lo)
        (a, b), (c, d) = two_sum(*same_rank(a, b)), two_sum(*same_rank(c, d))
        finite = [jnp.where(jnp.isinf(high), jnp.zeros_like(low), low) for high, low in ((a, b), (c, d))]
        return (*same_rank(a, c), *same_rank(*finite))

    def __eq__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] == found[1]) & (found[2] == found[3])

    def __ne__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] != found[1]) | (found[2] != found[3])

    def __lt__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] < found[1]) | ((found[0] == found[1]) & (found[2] < found[3]))

    def __le__(self, other: Any) -> Any:
        found = self._ordered(other)
        return NotImplemented if found is None else (found[0] < found[1]) | ((found[0] == found[1]) & (found[2] <= found[3]))

    def __gt__(self, other: Any) -> Any:
        return other < self if isinstance(other, type(self)) else NotImplemented

    def __ge__(self, other: Any) -> Any:
        return other <= self if isinstance(other, type(self)) else NotImplemented

    __hash__ = object.__hash__
