"""Vectors and quaternions as separate numbers: the algebra that every hot path is written in.

A component is a JAX array of any batch shape, or a plain Python number that is known while tracing. Known zeros and ones
are folded away, so the program of a robot whose axes are unit vectors holds only the arithmetic that it needs.
Why components and not arrays ``[..., 3]``: XLA fuses and vectorises elementwise arithmetic over the batch; stacks, matrix
products and slices in between stop it (measured: ten to fifty times slower on CPU).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import lax
from jax.typing import ArrayLike

from jaxframes.staging.columns import Component
from jaxframes.staging.sharding import aligned


def add(a: Component, b: Component) -> Component:
    """Return a + b; a known zero disappears."""
    if isinstance(a, float) and a == 0.0:
        return b
    if isinstance(b, float) and b == 0.0:
        return a
    return a + b


def sub(a: Component, b: Component) -> Component:
    """Return a - b; a known zero disappears."""
    if isinstance(b, float) and b == 0.0:
        return a
    if isinstance(a, float) and a == 0.0:
        return neg(b)
    return a - b


def neg(a: Component) -> Component:
    """Return -a; a known zero stays one (of positive sign)."""
    return 0.0 if isinstance(a, float) and a == 0.0 else -a


def mul(a: Component, b: Component) -> Component:
    """Return a * b; known zeros, ones and minus ones fold away."""
    if isinstance(b, float) and not isinstance(a, float):
        a, b = b, a
    if isinstance(a, float):
        if a == 0.0 or (isinstance(b, float) and b == 0.0):
            return 0.0
        if a == 1.0:
            return b
        if a == -1.0:
            return neg(b)
    return a * b


def add_all(*terms: Component) -> Component:
    """Return the sum of several components, left to right."""
    total: Component = 0.0
    for term in terms:
        total = add(total, term)
    return total


def select(condition: ArrayLike, a: ArrayLike, b: ArrayLike) -> jax.Array:
    """Return a where the condition holds and b elsewhere: ``jnp.where``, which is a call of its own, without the call."""
    dtypes = [x for x in (a, b) if not isinstance(x, float)]
    chosen = jnp.result_type(a, b) if dtypes else None  # of two plain numbers the result is one too: it takes any dtype
    return lax.select(*aligned(jnp.asarray(condition), jnp.asarray(a, chosen), jnp.asarray(b, chosen)))


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class V3:
    """A vector as three components."""

    x: Component
    y: Component
    z: Component

    def __iter__(self) -> Iterator[Component]:
        return iter((self.x, self.y, self.z))

    def __add__(self, other: "V3") -> "V3":
        return V3(*(add(a, b) for a, b in zip(self, other, strict=True)))

    def __sub__(self, other: "V3") -> "V3":
        return V3(*(sub(a, b) for a, b in zip(self, other, strict=True)))

    def __neg__(self) -> "V3":
        return V3(*(neg(a) for a in self))

    def __mul__(self, scale: Component) -> "V3":
        return V3(*(mul(a, scale) for a in self))

    @property
    def is_known_zero(self) -> bool:
        """Whether all components are zeros known while tracing."""
        return all(isinstance(c, float) and c == 0.0 for c in self)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, slots=True)
class Quat:
    """A quaternion w + xi + yj + zk as four components; a unit one is a rotation."""

    w: Component
    x: Component
    y: Component
    z: Component

    def __iter__(self) -> Iterator[Component]:
        return iter((self.w, self.x, self.y, self.z))

    @property
    def vector(self) -> V3:
        """The vector part."""
        return V3(self.x, self.y, self.z)

    @property
    def is_known_identity(self) -> bool:
        """Whether this is the identity rotation, known while tracing."""
        return isinstance(self.w, float) and self.w == 1.0 and self.vector.is_known_zero


ZERO = V3(0.0, 0.0, 0.0)
IDENTITY = Quat(1.0, 0.0, 0.0, 0.0)


def dot(a: V3, b: V3) -> Component:
    """Return the scalar product."""
    return add(add(mul(a.x, b.x), mul(a.y, b.y)), mul(a.z, b.z))


def cross(a: V3, b: V3) -> V3:
    """Return the vector product a x b."""
    return V3(
        sub(mul(a.y, b.z), mul(a.z, b.y)),
        sub(mul(a.z, b.x), mul(a.x, b.z)),
        sub(mul(a.x, b.y), mul(a.y, b.x)),
    )


def quat_from(scalar: Component, vector: V3) -> Quat:
    """Return the quaternion with the scalar and vector parts given."""
    return Quat(scalar, vector.x, vector.y, vector.z)


def quat_conj(q: Quat) -> Quat:
    """Return the conjugate, which is the inverse of a unit quaternion."""
    return Quat(q.w, neg(q.x), neg(q.y), neg(q.z))


def quat_mul(a: Quat, b: Quat) -> Quat:
    """Return the Hamilton product: the rotation b followed by the rotation a."""
    w = sub(sub(sub(mul(a.w, b.w), mul(a.x, b.x)), mul(a.y, b.y)), mul(a.z, b.z))
    x = sub(add(add(mul(a.w, b.x), mul(a.x, b.w)), mul(a.y, b.z)), mul(a.z, b.y))
    y = add(add(sub(mul(a.w, b.y), mul(a.x, b.z)), mul(a.y, b.w)), mul(a.z, b.x))
    z = add(sub(add(mul(a.w, b.z), mul(a.x, b.y)), mul(a.y, b.x)), mul(a.z, b.w))
    return Quat(w, x, y, z)


def quat_linear(a: Component, p: Quat, b: Component, q: Quat) -> Quat:
    """Return a p + b q."""
    return Quat(*(add(mul(a, x), mul(b, y)) for x, y in zip(p, q, strict=True)))


def quat_norm2(q: Quat) -> Component:
    """Return the squared norm."""
    return add(add(mul(q.w, q.w), mul(q.x, q.x)), add(mul(q.y, q.y), mul(q.z, q.z)))


def renormalized(q: Quat) -> Quat:
    """Return a nearly unit quaternion with its norm error squared: q (3 - |q|^2) / 2, one Newton step, without a root."""
    factor = mul(sub(3.0, quat_norm2(q)), 0.5)
    return Quat(*(mul(c, factor) for c in q))


def rotate(q: Quat, v: V3) -> V3:
    """Return q v q*: the vector v turned by the unit quaternion q.

    The form v + 2 w (u x v) + 2 u x (u x v) with u the vector part: 15 products and 15 sums when nothing is known.
    """
    if v.is_known_zero or q.is_known_identity:
        return v
    u = q.vector
    t = cross(u, v) * 2.0
    return v + t * q.w + cross(u, t)


def rotate_inverse(q: Quat, v: V3) -> V3:
    """Return q* v q: the vector v turned back."""
    return rotate(quat_conj(q), v)
