"""Frames defined by other frames: axes along two vectors, each a direction, a velocity or a constant; orbital and pointing frames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs, Read
from jaxframes.edges.family import family
from jaxframes.edges.joint import unit_axis
from jaxframes.errors import EdgeError
from jaxframes.numerics.components import V3, Component, Quat
from jaxframes.numerics.rigid import Rigid, compose
from jaxframes.numerics.steps import Step
from jaxframes.numerics.two_vector import with_rates
from jaxframes.spatial import so3
from jaxframes.staging.stages import staged


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Direction:
    """The direction from the origin of one frame to that of another.

    Attributes:
        of: Name of the frame that it points to.
        relative_to: Name of the frame that it starts from.
    """

    of: str = field(metadata={"static": True})
    relative_to: str = field(metadata={"static": True})

    @property
    def reads(self) -> tuple[Read, ...]:
        """The motions that it needs: of one frame as the other sees it, and of that one as the edge's parent does."""
        return Read(self.of, self.relative_to), Read(self.relative_to, None)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Velocity:
    """The velocity of a frame as another one observes it; for orbital frames name an inertial one.

    Attributes:
        of: Name of the frame that moves.
        relative_to: Name of the observer.
    """

    of: str = field(metadata={"static": True})
    relative_to: str = field(metadata={"static": True})

    @property
    def reads(self) -> tuple[Read, ...]:
        """The motions that it needs, the first with one derivative more."""
        return Read(self.of, self.relative_to, further=True), Read(self.relative_to, None)


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Constant:
    """A vector that is constant in the axes of a frame.

    Attributes:
        vector: ``[3]``, of any length but zero; a parameter of the tree.
        frame: Name of the frame.
    """

    vector: jax.Array
    frame: str = field(metadata={"static": True})

    def __post_init__(self) -> None:
        if isinstance(self.vector, (tuple, list, np.ndarray)):  # what a user gives; anything else may come from a transformation
            object.__setattr__(self, "vector", unit_axis(self.vector))

    @property
    def reads(self) -> tuple[Read, ...]:
        """The motion that it needs."""
        return (Read(self.frame, None),)


Vector = Direction | Velocity | Constant
KINDS = {"direction": Direction, "velocity": Velocity, "constant": Constant}


@family(static=("axes",), name="two_vector")
class TwoVector(Edge):
    """Axes that other frames define: one along a primary vector, another as near as can be to a secondary one; the origin is the parent's.

    Hang it wherever its origin shall be; what its vectors are made of may lie anywhere else in the tree. Angular velocity and acceleration
    are exact on every source that has the derivatives. In which order such frames are worked out is settled when the tree is built, and
    frames that need each other are refused there. A velocity's angular acceleration needs the jerk of its source: functions of time
    (``Function``, ``Sampled``, ``Kepler``, tables, fixed mounts) have one; over joints and prescribed edges, whose state ends at
    accelerations, it is refused by name when it is asked for.

    Attributes:
        primary: The vector that the first axis lies along: ``Direction``, ``Velocity`` or ``Constant``.
        secondary: The vector in whose half plane the second axis lies.
        axes: The two axes, such as ``("x", "y")`` or ``("-z", "x")`` (static). The third makes the frame right-handed.

    Raises:
        EdgeError: A vector is none of these, or the axes are not two different ones.
        UnknownFrameError: When the tree is built: a frame that it reads does not exist.
        TopologyError: When the tree is built: frames need each other.

    Where both vectors are parallel, or one is zero, everything is NaN, gradients included; ``tree.axes_defined(state)`` says where, and
    ``tree.check(state)`` how near. The error of the axes grows as rounding over the sine of the angle between the vectors.

    Example:
        >>> import jaxframes as jf
        >>> b = jf.TreeBuilder(root="world")
        >>> b.add("mast", parent="world", edge=jf.edges.Fixed(jf.Transform.from_translation((0, 0, 2))))
        >>> b.add("ball", parent="world", edge=jf.edges.Movable(jf.Transform.from_translation((3, 0, 2))))
        >>> b.add("camera", parent="mast", edge=jf.edges.Pointing(at="ball", craft="mast", axis="z", up=((0, 0, 1), "world")))
        >>> tree = b.build()
        >>> pose = tree.transform(tree.state(), of="camera", relative_to="world")
        >>> [round(float(v), 6) for v in pose.rotation @ (0.0, 0.0, 1.0)]
        [1.0, 0.0, 0.0]
    """

    stackable: ClassVar[bool] = False
    primary: Any
    secondary: Any
    axes: tuple[str, str]

    def __init__(self, primary: Vector, secondary: Vector, axes: Sequence[str] = ("x", "y")):
        found = tuple(axes) if isinstance(axes, (tuple, list)) else ()
        names = [name[-1] for name in found if isinstance(name, str) and name.removeprefix("-") in ("x", "y", "z")]
        if len(found) != 2 or len(set(names)) != 2:
            raise EdgeError(f"TwoVector(axes=...) takes two different ones of x, y, z, -x, -y, -z, such as ('-z', 'x'); found {axes!r}")
        for name, value in (("primary", _vector("primary", primary)), ("secondary", _vector("secondary", secondary)), ("axes", found)):
            object.__setattr__(self, name, value)

    @property
    def reads(self) -> tuple[Read, ...]:
        return (*self.primary.reads, *self.secondary.reads)

    @property
    def batch_shape(self) -> tuple[int, ...]:
        return np.broadcast_shapes(*(np.shape(leaf)[:-1] for leaf in jax.tree.leaves(self)))

    def renamed(self, rename: Callable[[str], str]) -> "TwoVector":
        return self.replace(primary=_renamed(self.primary, rename), secondary=_renamed(self.secondary, rename))

    def arguments(self) -> dict[str, Any]:
        return {"primary": _plain(self.primary), "secondary": _plain(self.secondary), "axes": self.axes}

    def describe(self) -> str:
        return f"two vectors: {self.axes[0]} along {_text(self.primary)}, {self.axes[1]} near {_text(self.secondary)}"

    def vectors(self, inputs: Inputs, order: int) -> tuple[list[V3], list[V3]]:
        """Return both vectors with their derivatives by time in the parent's axes; components are arrays of one shape."""
        motions, found = iter(inputs.motions), []
        for vector in (self.primary, self.secondary):
            if isinstance(vector, Constant):
                parts = [V3(*inputs.components(vector.vector))]
            else:
                seen = next(motions)
                whole = [seen.motion.translation, seen.motion.linear, seen.motion.linear2, *([seen.jerk] if seen.jerk is not None else [])]
                parts = whole[int(isinstance(vector, Velocity)) :]
            observer = next(motions).motion
            turning = Rigid(observer.rotation, angular=observer.angular, angular2=observer.angular2)
            names = ("translation", "linear", "linear2")[: order + 1]
            carried = compose(turning, Rigid(**dict(zip(names, parts, strict=False))), order)
            found.append([carried.translation, carried.linear, carried.linear2][: order + 1])
        arrays = jnp.broadcast_arrays(*(jnp.asarray(c, _dtype(found)) for vectors in found for v in vectors for c in v))
        flat = iter(arrays)
        first, second = ([V3(next(flat), next(flat), next(flat)) for _ in vectors] for vectors in found)
        return first, second

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        def made() -> tuple[Step, ...]:
            (x, y, z), rates = with_rates(self.axes, *self.vectors(inputs, order))
            rotation = so3.from_matrix((x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z))
            return (Rigid(Quat(*rotation), **dict(zip(("angular", "angular2"), rates, strict=False))),)

        return staged(made)


def _dtype(found: Sequence[Sequence[V3]]) -> Any:
    arrays: list[Component] = [c for vectors in found for v in vectors for c in v]
    known = [c for c in arrays if isinstance(c, jax.Array)]
    return jnp.result_type(*known) if known else jnp.result_type(float)


def LVLH(craft: str, center: str, inertial: str | None = None) -> TwoVector:
    """Return the local vertical, local horizontal frame of an orbit: z to the centre, y against the orbit's normal, x ahead (CCSDS LVLH).

    Args:
        craft: Name of the frame that orbits; hang the edge on it.
        center: Name of the frame at the centre.
        inertial: Name of the frame that observes the velocity; its axes must not turn. Default: the centre's own frame.
    """
    return TwoVector(Direction(craft, center), Velocity(craft, inertial or center), ("-z", "x"))


def RTN(craft: str, center: str, inertial: str | None = None) -> TwoVector:
    """Return the radial, transverse, normal frame of an orbit: x outward, z along r x v (also RSW, RIC, QSW). Arguments as for ``LVLH``."""
    return TwoVector(Direction(craft, center), Velocity(craft, inertial or center), ("x", "y"))


def VNC(craft: str, center: str, inertial: str | None = None) -> TwoVector:
    """Return the velocity, normal, co-normal frame of an orbit: x along the velocity, y along r x v. Arguments as for ``LVLH``.

    z = x cross y completes it; it lies in the half plane of the radius.
    """
    return TwoVector(Velocity(craft, inertial or center), Direction(craft, center), ("x", "z"))


def Pointing(at: str, craft: str, axis: str = "z", *, up: tuple[Any, str] | Vector, up_axis: str | None = None) -> TwoVector:
    """Return a frame of which one axis points from a frame at another: nadir and sun pointing, cameras that follow.

    Args:
        at: Name of the frame that it points at.
        craft: Name of the frame that it points from; hang the edge on it.
        axis: The axis that points, such as ``"z"``, or ``"-z"`` for a camera of MuJoCo or OpenGL.
        up: (vector, name of a frame) for a direction that is constant in that frame, or a ``Direction``, ``Velocity`` or ``Constant``.
        up_axis: The axis that lies as near to ``up`` as can be. Default: y, or x where y points.

    Example: MuJoCo's ``mode="targetbody"`` is ``Pointing(at=target, craft=camera, axis="-z", up=((0, 0, 1), "world"))``; its
    ``mode="track"`` is ``TwoVector`` of two ``Constant`` vectors of the world.
    """
    vector = Constant(*up) if isinstance(up, (tuple, list)) else up
    near = up_axis or ("x" if axis[-1:] == "y" else "y")
    return TwoVector(Direction(at, craft), vector, (axis, near))


def _vector(name: str, value: Any) -> Any:
    if isinstance(value, (tuple, list)) and value and value[0] in KINDS:  # as a file keeps it
        value = KINDS[value[0]](*value[1:])
    if not isinstance(value, (Direction, Velocity, Constant)):
        raise EdgeError(f"TwoVector({name}=...) takes jf.edges.Direction, Velocity or Constant, found {type(value).__name__}: {value!r}")
    frames = [value.frame] if isinstance(value, Constant) else [value.of, value.relative_to]
    if not all(isinstance(frame, str) and frame for frame in frames):
        raise EdgeError(f"TwoVector({name}=...): frames are named by text that is not empty, found {frames}")
    if len(set(frames)) < len(frames):
        raise EdgeError(f"TwoVector({name}=...): {frames[0]!r} relative to itself has neither direction nor velocity; name two frames")
    return value


def _renamed(vector: Any, rename: Callable[[str], str]) -> Any:
    if isinstance(vector, Constant):
        return replace(vector, frame=rename(vector.frame))
    return replace(vector, of=rename(vector.of), relative_to=rename(vector.relative_to))


def _plain(vector: Any) -> tuple[Any, ...]:
    if isinstance(vector, Constant):
        return "constant", vector.vector, vector.frame
    return type(vector).__name__.lower(), vector.of, vector.relative_to


def _text(vector: Any) -> str:
    if isinstance(vector, Constant):
        return f"a constant in {vector.frame}"
    word = "the direction to" if isinstance(vector, Direction) else "the velocity of"
    return f"{word} {vector.of} from {vector.relative_to}"
