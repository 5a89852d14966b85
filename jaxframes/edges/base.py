"""What an edge family must say: how many coordinates it takes, the steps it is made of, and how it prints."""

import dataclasses
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.errors import EdgeError, MissingInputError, suggest
from jaxframes.numerics.components import V3, Component, Quat
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.spatial import Rotation, Transform
from jaxframes.staging.arrays import as_float, unit
from jaxframes.staging.columns import parameters


class Read(NamedTuple):
    """A motion of the tree that an edge needs beside a state's own numbers.

    Attributes:
        of: Name of the frame that moves.
        relative_to: Name of the frame that observes it; None for the parent that the edge hangs on.
        further: Whether one derivative more is needed than is asked of the edge.
    """

    of: str
    relative_to: str | None
    further: bool = False


class Seen(NamedTuple):
    """A motion that an edge reads, as components.

    Attributes:
        motion: Pose, velocity and acceleration, as far as the order asks (one further where the edge said so).
        jerk: Derivative of the linear acceleration, where that was asked for beyond it; else None.
    """

    motion: Rigid
    jerk: V3 | None = None


class Inputs(NamedTuple):
    """What an edge may read of a state, all as components.

    Attributes:
        q: The edge's own ``nq`` coordinates.
        qd: Its own ``nv`` rates.
        qdd: Its own ``nv`` second derivatives.
        time: The epoch as (hi, lo) seconds past J2000 TDB, or None where the state has none.
        prescribed: The motion that the state holds for this edge, if its family is prescribed.
        batch_rank: Rank of the batch, to which batched parameters are aligned.
        motions: What the edge's ``reads`` name, in that order, each a ``Seen``.
    """

    q: tuple[Component, ...] = ()
    qd: tuple[Component, ...] = ()
    qdd: tuple[Component, ...] = ()
    time: tuple[Component, Component] | None = None
    prescribed: Rigid | None = None
    batch_rank: int = 0
    motions: tuple[Seen, ...] = ()

    def epoch_for(self, edge: "Edge") -> tuple[Component, Component]:
        """Return the epoch that an edge reads, in two parts (MissingInputError where the state has none)."""
        if self.time is None:
            raise MissingInputError(f"{edge.describe()} depends on time: give the state one, tree.state(time=...).")
        return self.time

    def components(self, parameter: jax.Array) -> tuple[Component, ...]:
        """Return the k components of a parameter [..., k], aligned to the batch; plain numbers where they are known while tracing."""
        return parameters(parameter, self.batch_rank)

    def pose(self, transform: Transform) -> tuple[Quat, V3]:
        """Return rotation and translation of a pose among the parameters, likewise."""
        return Quat(*self.components(transform.rotation.wxyz)), V3(*self.components(transform.translation))


@dataclasses.dataclass(frozen=True, eq=False, repr=False, init=False)
class Edge:
    """Base of all edge families.

    A family is a class decorated with ``family``. Array fields [..., k] are parameters: leaves of the tree that can be batched,
    differentiated and replaced. Other fields are static and must be hashable. A family must say its ``steps``; everything else has a
    default. ``docs/extending.md`` shows one.

    Attributes:
        nq: How many stored coordinates an edge takes from ``q``.
        nv: How many rates it takes from ``qd`` and ``qdd`` (its mobility).
        stackable: Whether the parameters of all edges of this family may be stored as one array with a leading axis.
        needs_time: Whether the edge reads the epoch of the state.
        is_prescribed: Whether the state holds a motion for the edge.
        is_attachable: Whether the state says what the child hangs on.
        is_manifold: Whether ``integrate``, ``difference``, ``random`` or ``project`` is more than plain arithmetic on coordinates.
    """

    nq: ClassVar[int] = 0
    nv: ClassVar[int] = 0
    is_manifold: ClassVar[bool] = False
    stackable: ClassVar[bool] = True
    needs_time: ClassVar[bool] = False
    is_prescribed: ClassVar[bool] = False
    is_attachable: ClassVar[bool] = False
    family_fields: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that are parameters, as ``family`` found them; ``parameter_fields`` returns them."""

    def __post_init__(self) -> None:
        """Make arrays [k] of parameters that were given as plain numbers; families whose constructor takes their fields run this.

        Raises:
            EdgeError: A parameter is no number, array or value made of arrays.
        """
        for name in self.parameter_fields():
            value = getattr(self, name)
            row = list(value) if isinstance(value, (list, tuple)) else [value]
            if row and all(isinstance(v, (int, float)) for v in row):
                object.__setattr__(self, name, as_float([float(v) for v in row]))
            elif not all(isinstance(leaf, (jax.Array, np.ndarray, np.generic)) for leaf in jax.tree.leaves(value)):
                raise EdgeError(
                    f"{type(self).__name__}({name}=...) is a parameter, so it takes numbers or arrays, found {value!r}; "
                    f"what is none is static: family(static=({name!r},))"
                )

    @property
    def supports_accelerations(self) -> bool:
        """Whether the edge can say its acceleration."""
        return True

    @property
    def reads(self) -> tuple[Read, ...]:
        """Motions of other frames that the edge needs, handed over as ``inputs.motions``; none for most."""
        return ()

    @property
    def has_further_derivatives(self) -> bool:
        """Whether derivatives of the edge's acceleration by time are exact: a state says no more of joints and prescribed motions."""
        return not (self.nq or self.is_prescribed or self.is_attachable or self.follows is not None)

    @property
    def dof(self) -> int:
        """Mobility: in how many independent directions the child can move against its parent."""
        return 6 if self.is_prescribed or self.is_attachable else self.nv

    @property
    def state_size(self) -> int:
        """How many numbers of a state say where the child is: coordinates, or the seven of a pose."""
        return 7 if self.is_prescribed or self.is_attachable else self.nq

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Batch axes of the edge's own numbers, broadcast: all axes but the last; none for a family that does not stack, unless it says."""
        if not self.stackable:
            return ()
        return np.broadcast_shapes(*{np.shape(leaf)[:-1] for leaf in jax.tree.leaves(self)})

    def at(self, row: int) -> Self:
        """Return the edge at one place of the leading batch axis of its numbers; those without batch axes are the same for all."""
        return jax.tree.map(lambda leaf: leaf[row] if np.ndim(leaf) > 1 else leaf, self)

    @property
    def follows(self) -> str | None:
        """Name of the joint whose coordinates the edge takes instead of its own, if it does."""
        return None

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        """Return the elementary motions from parent to child, as components.

        Args:
            inputs: The values that the edge may read.
            order: 0 for the pose, 1 with the velocity, 2 with the acceleration.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say its steps")

    def kind(self) -> Hashable | None:
        """Return what edges have in common that do not stack and yet are evaluated together; None for an edge by itself."""
        return None

    @classmethod
    def together(cls, edges: "Sequence[Edge]") -> "Edge":
        """Return edges of one kind as one, whose components have a last axis over the edges."""
        raise NotImplementedError(f"{cls.__name__} edges are of no kind that is evaluated together")

    def alone(self, row: int) -> "Edge":
        """Return one of the edges that ``together`` made one."""
        raise NotImplementedError(f"{type(self).__name__} is one edge")

    def describe(self) -> str:
        """Return the kind of the edge and what tells it from others, in a few words."""
        return type(self).__name__.lower()

    def coverage_code(self, time: Any) -> jax.Array:
        """Return -1 where an ``Epoch`` lies before what the edge covers, 0 inside, +1 after: int32 [...]."""
        return jnp.zeros(time.shape, jnp.int32)

    def coordinate_rates(self, q: tuple[Component, ...], qd: tuple[Component, ...]) -> tuple[Component, ...]:
        """Return the time derivatives of the coordinates from the rates; the rates themselves unless a family says otherwise."""
        return qd

    def astype(self, dtype: Any) -> Self:
        """Return a copy with its float numbers converted; a family that keeps numbers in two parts converts them together."""
        return jax.tree.map(lambda leaf: leaf.astype(dtype) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf, self)

    def renamed(self, rename: Callable[[str], str]) -> "Edge":
        """Return the edge with the names of frames and joints that it holds changed by a function; most hold none."""
        return self

    def preceded_by(self, change: Transform) -> "Edge | None":
        """Return the edge whose child lies at ``change @`` where this one puts it; None for a family that cannot say so."""
        return None

    def limits_of(self) -> tuple[Any, Any] | None:
        """Return the lower and upper bounds of the coordinates, NumPy arrays [nq] each, or None where there are none."""
        return None

    @classmethod
    def parameter_fields(cls) -> tuple[str, ...]:
        """Return the names of the fields that are parameters; the others are static."""
        return cls.family_fields

    def arguments(self) -> dict[str, Any]:
        """Return what the constructor takes, by name, to make this edge again: what a file keeps. Default: all fields."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    def checked_fact(self, name: str, value: Any) -> Any:
        """Return a value for a static field as the constructor would keep it (EdgeError if it cannot)."""
        return value

    def normalized(self) -> Self:
        """Return the edge with all rotations, and what else lies on a sphere, at unit length: every query reads it so.

        A step of an optimiser off the sphere then distorts no pose, and derivatives are along the sphere.
        """
        return jax.tree.map(
            lambda x: x.replace(wxyz=unit(x.wxyz)) if isinstance(x, Rotation) else x, self, is_leaf=lambda x: isinstance(x, Rotation)
        )

    def directions(self) -> dict[str, Any]:
        """Return the unit vectors [..., 3] among the parameters by the names of their fields (for checks)."""
        return {}

    def bare(self) -> "Edge":
        """Return the edge without what no query reads: edges whose bare structures are equal share programs and are stacked."""
        return self

    def angles(self) -> tuple[bool, ...]:
        """Return, for each coordinate, whether it is an angle in radians (else a length in metres)."""
        return (True,) * self.nq

    def periodic(self) -> tuple[bool, ...]:
        """Return, for each coordinate, whether a whole turn (2 pi) more of it is the same pose; False unless a family says so."""
        return (False,) * self.nq

    def wiring(self) -> dict[str, Any]:
        """Return the static fields, by name, that name other frames or joints: a tree is compiled for them, so they stay in it."""
        return {}

    def integrate(self, q: jax.Array, step: jax.Array) -> jax.Array:
        """Return the coordinates [..., nq] that a constant rate leads to, from q; ``step`` [..., nv] is the rate times the time."""
        return q + step

    def difference(self, q0: jax.Array, q1: jax.Array) -> jax.Array:
        """Return the step [..., nv] that ``integrate`` takes from q0 to q1."""
        return q1 - q0

    def project(self, q: jax.Array) -> jax.Array:
        """Return the coordinates [..., nq] in the form they should have, such as unit quaternions."""
        return q

    def clamp(self, q: jax.Array) -> jax.Array:
        """Return coordinates [..., nq], each within its bounds already, moved inside what else limits the edge; in their proper form."""
        return self.project(q)

    def bounded(self, q: np.ndarray) -> tuple[tuple[str, np.ndarray, np.ndarray, np.ndarray], ...]:
        """Return what is limited beside single coordinates: (what, values, lower, upper) [...] for coordinates [..., nq] (for checks)."""
        return ()

    def random(self, key: jax.Array, q: jax.Array) -> jax.Array:
        """Return random coordinates; ``q`` [..., nq] holds numbers drawn uniformly within limits, to be taken or replaced."""
        return q

    def quaternions(self) -> tuple[Any, ...]:
        """Return the unit quaternions [..., 4] among the parameters (for checks)."""
        found: list[Any] = []
        jax.tree.map(lambda x: found.append(x.wxyz) if isinstance(x, Rotation) else None, self, is_leaf=lambda x: isinstance(x, Rotation))
        return tuple(found)

    @property
    def has_gaps(self) -> bool:
        """Whether there are instants without data between its first and its last."""
        return False

    def checkable(self) -> Self:
        """Return the edge as a check reads it: without the infinities and NaN that mean something."""
        return self

    def replace(self, **changes: Any) -> Self:
        """Return a copy with the fields given replaced, taken as they are (values may be traced)."""
        fields = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        unknown = sorted(set(changes) - set(fields))
        if unknown:
            raise EdgeError(f"{type(self).__name__} has no field {unknown[0]!r}.{suggest(unknown[0], fields)}")
        return assembled(type(self), {**fields, **changes})

    def __repr__(self) -> str:
        return f"<{self.describe()}>"

    def neutral(self) -> tuple[float, ...]:
        """Return the ``nq`` coordinates of the edge at rest position."""
        return (0.0,) * self.nq


def assembled(cls: type, fields: Mapping[str, Any]) -> Any:
    """Return an edge of a family with the fields given, without its constructor."""
    edge = object.__new__(cls)
    for name, value in fields.items():
        object.__setattr__(edge, name, value)
    return edge
