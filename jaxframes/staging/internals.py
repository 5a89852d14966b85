"""What we need of JAX's inside, in one file.

``jax.extend.core`` has the same names; but on jax 0.12 importing ``jax.extend`` loads Pallas, which adds to the key of every compiled
function: all functions that were compiled before trace once more.
"""

from typing import Any

from jax._src import core
from jax._src.core import Jaxpr, Literal, Primitive
from jax._src.core import unsafe_am_i_under_a_jit as is_compiling

__all__ = ["ClosedJaxpr", "Jaxpr", "Literal", "Primitive", "is_compiling"]

ClosedJaxpr: Any = getattr(core, "ClosedJaxpr", core.Jaxpr)  # jax 0.12 has one class for both
