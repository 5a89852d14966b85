"""Motions that are functions of time, written by the user for one instant: exact velocities and accelerations by differentiating them."""

import inspect
import math
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.edges.instants import since_epoch
from jaxframes.edges.spans import Span, codes_of_span, exact_span, factor_within
from jaxframes.errors import EdgeError, FrameError, ShapeError
from jaxframes.numerics.components import IDENTITY, V3, ZERO, Component, Quat, quat_conj, quat_mul
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.numerics.two_part import recast_pairs
from jaxframes.spatial import Rotation, Transform
from jaxframes.staging.arrays import as_float, default_float, is_concrete, widest
from jaxframes.staging.blocks import SIZES, Batch, Work, run_work
from jaxframes.staging.columns import Component as Column
from jaxframes.staging.sharding import is_large, may_block
from jaxframes.time.epoch import Epoch

WANTED = "a jf.Transform, a jf.Rotation or a translation (an array [3], m), all for one instant"
PADDED = 1024
"""Large batches are filled up to a whole multiple of so many instants, so that they can be cut into blocks."""


@family(static=("fn", "structure", "shapes", "returns", "span"), name="function")
class Function(Edge):
    """A motion that is a function of time: pose of the child in its parent, with the velocity and acceleration that belong to it.

    ``fn(params, seconds)`` is written for one instant with ``jax.numpy`` and returns a ``Transform``, a ``Rotation`` (no translation) or a
    translation [3] in m (no rotation). Velocity and acceleration are its first and second derivatives by time, exact to rounding, as are
    derivatives by ``params``, ``since`` and the epoch, of any order. Define ``fn`` once, at the top of a module: programs are compiled
    for it, so the same function never traces again, in another tree either, and a new lambda does. Numbers that change go into
    ``params``; what ``fn`` reads besides is constant.

    ``seconds`` is the state's time past ``since``, the difference taken in two parts. In float32 give a ``since`` near the times asked for:
    from J2000 to 2026 neighbouring numbers are 64 s apart.

    Attributes:
        fn: The function (static).
        params: Its numbers: any tree of arrays; each leaf is a parameter of the tree by name (``"craft.params.radius"``). Numbers are
            kept as arrays [1], and ``fn`` gets them as numbers. Axes before those given here are batch axes.
        since: ``[2]``: where ``seconds`` counts from, in two parts, seconds past J2000 TDB.
        span: The exact start and stop of its coverage (static).

    Args:
        fn: The function of (params, seconds).
        params: Its numbers, as ``fn`` takes them. Default: none, an empty tuple.
        since: ``Epoch`` or seconds past J2000 TDB. Default: J2000.
        start: First instant that it covers: an ``Epoch``, seconds past J2000 TDB or text. Outside everything is NaN, gradients included,
            and the coverage code is -1 or +1. Default: no first.
        stop: Last instant that it covers, likewise.

    Raises:
        EdgeError: ``fn`` is no hashable function, fails, holds traced values or returns something else; a parameter is no number.
        ShapeError: What it returns, or a parameter given later, has another shape.

    Gradients: JAX's own, through ``fn``. A derivative that ``fn`` does not have is NaN as JAX gives it.

    Example:
        >>> import jax.numpy as jnp, jaxframes as jf
        >>> def circle(params, seconds):
        ...     angle = params["rate"] * seconds
        ...     return params["radius"] * jnp.stack([jnp.cos(angle), jnp.sin(angle), 0.0 * angle])
        >>> b = jf.TreeBuilder()
        >>> b.add("craft", parent="world", edge=jf.edges.Function(circle, {"radius": 2.0, "rate": 0.5}))
        >>> tree = b.build()
        >>> round(float(tree.velocity(tree.state(time=0.0), of="craft", relative_to="world").linear[1]), 6)
        1.0
    """

    needs_time: ClassVar[bool] = True
    params: Any
    since: jax.Array
    fn: Callable[[Any, jax.Array], Any]
    structure: Any
    shapes: tuple[tuple[int, ...], ...]
    returns: str
    span: Span

    def __init__(self, fn: Callable[[Any, jax.Array], Any], params: Any = (), since: Any = None, *, start: Any = None, stop: Any = None):
        _check_function(fn)
        leaves, structure = jax.tree.flatten(params)
        arrays = [_number(leaf, fn) for leaf in leaves]
        epoch = Epoch.from_et(0.0 if since is None else since)
        if epoch.shape:
            raise EdgeError(f"Function(since=...) takes one epoch, found a batch of shape {epoch.shape}")
        floats = [a.dtype for a in arrays if jnp.issubdtype(a.dtype, jnp.floating)]
        dtype = widest(*floats) if floats else default_float()
        kind = _kind_of(fn, jax.tree.unflatten(structure, arrays), dtype)
        stored = [a.reshape(1) if a.ndim == 0 else a for a in arrays]
        for name, value in (
            *(("fn", fn), ("params", jax.tree.unflatten(structure, stored)), ("structure", structure)),
            *(("since", jnp.stack([jnp.asarray(epoch.hi), jnp.asarray(epoch.lo)])), ("shapes", tuple(a.shape for a in arrays))),
            *(("returns", kind), ("span", exact_span(start, stop, "Function"))),
        ):
            object.__setattr__(self, name, value)

    @property
    def stackable(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return all(len(shape) <= 1 for shape in self.shapes)

    @property
    def batch_shape(self) -> tuple[int, ...]:
        batches = [np.shape(leaf)[: np.ndim(leaf) - max(len(own), 1)] for leaf, own in self._leaves()]
        return np.broadcast_shapes(np.shape(self.since)[:-1], *batches)

    def at(self, row: int) -> Self:
        leaves = [leaf[row] if np.ndim(leaf) > max(len(own), 1) else leaf for leaf, own in self._leaves()]
        since = self.since[row] if np.ndim(self.since) > 1 else self.since
        return self.replace(params=jax.tree.unflatten(self.structure, leaves), since=since)

    def astype(self, dtype: Any) -> Self:
        plain = super().astype(dtype)
        return plain.replace(since=recast_pairs(self.since, dtype))

    def arguments(self) -> dict[str, Any]:
        raise EdgeError(
            f"an edge that is {self.describe()} cannot be written: a file holds numbers, and this is code; make it an edge family "
            "of your own with a name, jf.edges.family(name=...), or sample it with jf.tables.Sampled"
        )

    def describe(self) -> str:
        return f"function {_name_of(self.fn)}"

    def coverage_code(self, time: Any) -> jax.Array:
        return codes_of_span(self.span, time)

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        values = self._values(since_epoch(self, inputs, self.since), inputs.batch_rank, order)
        factor = factor_within(self.span, *map(jnp.asarray, inputs.epoch_for(self)))
        if factor is not None:
            values = [component if isinstance(component, float) else factor * component for component in values]
        return (_motion(self.returns, values),)

    def _leaves(self) -> list[tuple[Any, tuple[int, ...]]]:
        return list(zip(jax.tree.leaves(self.params), self.shapes, strict=True))

    def _values(self, seconds: jax.Array, rank: int, order: int) -> list[Component]:
        """Return the components of the pose and its derivatives at seconds [...], flat: block after block where there are many."""
        batches, leaves = [], []
        for leaf, own in self._leaves():
            tail = own or (1,)
            array = jnp.asarray(leaf)
            batch = array.shape[: array.ndim - len(tail)]
            if array.shape[array.ndim - len(tail) :] != tail or array.ndim < len(tail):
                raise ShapeError(f"{self.describe()} takes a parameter [..., {', '.join(map(str, tail))}], found shape {array.shape}")
            padded = (1,) * (rank - len(batch)) + batch if batch else ()
            leaves.append(array.reshape(*padded, *own))
            batches.append(padded)
        shape = jnp.broadcast_shapes(seconds.shape, *batches)
        along = tuple(math.prod(batch) > 1 if all(isinstance(n, int) for n in batch) else bool(batch) for batch in batches)
        work = _Evaluation(self.fn, self.structure, self.returns, order, (*along, True) if shape else None)
        if not shape:
            return list(run_work(work, None, *(leaf.reshape(own) for leaf, own in zip(leaves, self.shapes, strict=True)), seconds))
        flat = [
            jnp.broadcast_to(leaf, (*shape, *own)).reshape(-1, *own) if many else leaf.reshape(own)
            for leaf, own, many in zip(leaves, self.shapes, along, strict=True)
        ]
        arrays = [*flat, jnp.broadcast_to(seconds, shape).reshape(-1)]
        count = arrays[-1].shape[0]
        if not isinstance(count, int):
            return [v.reshape(shape) for v in run_work(work, None, *arrays)]
        missing = -count % PADDED if is_large((count,), SIZES[1]) and may_block(arrays[-1]) else 0
        if missing:
            arrays = [_filled_up(a, missing) if many else a for a, many in zip(arrays, (*along, True), strict=True)]
        batch = Batch(count + missing, (*along, True), (True,) * _count(self.returns, order))
        return [v[:count].reshape(shape) for v in run_work(work, batch, *arrays)]


def _filled_up(array: jax.Array, missing: int) -> jax.Array:
    """Return an array with its last row repeated at the end."""
    return jnp.concatenate([array, jnp.broadcast_to(array[-1:], (missing, *array.shape[1:]))])


def _count(returns: str, order: int) -> int:
    pose = {"transform": 7, "rotation": 4, "translation": 3}[returns]
    return pose + order * {"transform": 6, "rotation": 3, "translation": 3}[returns]


def _motion(returns: str, values: Sequence[Component]) -> Rigid:
    """Return the motion of components: those of the pose, then those of each derivative."""
    turns, shifts = returns != "translation", returns != "rotation"
    rest = iter(values)
    take = lambda: V3(next(rest), next(rest), next(rest))  # noqa: E731
    rotation = Quat(next(rest), *take()) if turns else IDENTITY
    translation = take() if shifts else ZERO
    rates = []
    for _ in range((len(values) - _count(returns, 0)) // (3 * (turns + shifts))):
        rates += [take() if turns else ZERO, take() if shifts else ZERO]
    return Rigid(rotation, translation, *rates)


@dataclass(frozen=True)
class _Evaluation(Work):
    """The pose of a function and its derivatives by time, as components: of the leaves of its parameters, then seconds.

    Attributes:
        fn: The function.
        structure: How its parameters are put together.
        returns: What it returns.
        order: Highest derivative.
        along: Which of the arrays have the batch as their leading axis; None for one instant.
    """

    fn: Callable[[Any, jax.Array], Any]
    structure: Any
    returns: str
    order: int
    along: tuple[bool, ...] | None

    def __call__(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        if self.along is None:
            return self._at(*arrays)
        return jax.vmap(self._at, in_axes=tuple(0 if many else None for many in self.along))(*arrays)

    def _at(self, *arrays: jax.Array) -> Sequence[jax.Array]:
        *leaves, seconds = arrays
        params, one = jax.tree.unflatten(self.structure, leaves), jnp.ones_like(seconds)

        def pose(t: jax.Array) -> tuple[list[jax.Array], ...]:
            return _pose(self.fn(params, t), self.returns, self.fn, t.dtype)

        def moving(t: jax.Array) -> Any:
            return jax.jvp(pose, (t,), (one,))

        if self.order == 0:
            (turn, shift), rates = pose(seconds), []
        elif self.order == 1:
            (turn, shift), (turn1, shift1) = moving(seconds)
            rates = [(turn1, shift1)]
        else:
            ((turn, shift), _), ((turn1, shift1), (turn2, shift2)) = jax.jvp(moving, (seconds,), (one,))
            rates = [(turn1, shift1), (turn2, shift2)]
        out = [*turn, *shift]
        for turning, shifting in rates:  # of a unit quaternion: w = 2 vec(q' q*), alpha = 2 vec(q'' q*)
            turned = quat_mul(Quat(*turning), quat_conj(Quat(*turn))).vector * 2.0 if turn else ()
            out += [*turned, *shifting]
        return [jnp.asarray(c, seconds.dtype) for c in out]


def _pose(value: Any, returns: str, fn: Any, dtype: Any) -> tuple[list[jax.Array], list[jax.Array]]:
    """Return the components of a pose: of the rotation's quaternion at unit length, and of the translation; none where it has none."""
    found = _kind_of_value(value, fn)
    if found != returns:
        raise ShapeError(f"{_name_of(fn)} returned a {returns} when the edge was made, and now a {found}")
    rotation = value.rotation if isinstance(value, Transform) else value if isinstance(value, Rotation) else None
    translation = value.translation if isinstance(value, Transform) else None if isinstance(value, Rotation) else value
    turn: list[Column] = []
    if rotation is not None:
        wxyz = jnp.asarray(rotation.wxyz).astype(dtype)
        turn = list(wxyz * lax.rsqrt(jnp.sum(wxyz * wxyz)))
    shift = [] if translation is None else list(jnp.asarray(translation).astype(dtype))
    return turn, shift  # pyright: ignore[reportReturnType]


def _kind_of_value(value: Any, fn: Any) -> str:
    """Return what a value of a function is (EdgeError for another kind, ShapeError for another shape)."""
    name = _name_of(fn)
    if isinstance(value, Transform):
        kind, parts = "transform", {"rotation.wxyz": (value.rotation.wxyz, 4), "translation": (value.translation, 3)}
    elif isinstance(value, Rotation):
        kind, parts = "rotation", {"wxyz": (value.wxyz, 4)}
    elif isinstance(value, (jax.Array, np.ndarray, jax.ShapeDtypeStruct)):
        kind, parts = "translation", {"an array": (value, 3)}
    else:
        hint = "; velocities follow from the pose" if type(value).__name__ == "Motion" else ""
        hint = "; jnp.stack makes one array of three numbers" if isinstance(value, (tuple, list)) else hint
        raise EdgeError(f"{name} must return {WANTED}; found {type(value).__name__}{hint}")
    for part, (array, size) in parts.items():
        if np.shape(array) != (size,):
            raise ShapeError(f"{name} must return {WANTED}; found {part} of shape {np.shape(array)} instead of ({size},)")
    return kind


def _kind_of(fn: Any, params: Any, dtype: Any) -> str:
    """Return what a function returns, without running it."""
    try:
        value = jax.eval_shape(fn, params, jax.ShapeDtypeStruct((), dtype))
    except FrameError:
        raise
    except Exception as error:
        raise EdgeError(f"{_name_of(fn)}(params, seconds) fails for one instant: {type(error).__name__}: {error}") from error
    return _kind_of_value(value, fn)


def _check_function(fn: Any) -> None:
    if not callable(fn):
        raise EdgeError(f"Function(fn=...) takes a function of (params, seconds), found {type(fn).__name__}: {fn!r}")
    try:
        hash(fn)
    except TypeError as error:
        raise EdgeError(f"Function(fn=...) takes a hashable function, programs are compiled for it; {error}") from None
    held = inspect.getclosurevars(fn).nonlocals if isinstance(fn, (types.FunctionType, types.MethodType)) else {}
    for name, value in held.items():
        if not all(map(is_concrete, jax.tree.leaves(value))):
            raise EdgeError(f"{_name_of(fn)} reads {name!r}, which is traced; hand it over in params")


def _number(leaf: Any, fn: Any) -> jax.Array:
    """Return a leaf of the parameters as an array; floats for plain numbers."""
    if isinstance(leaf, bool) or not isinstance(leaf, (int, float, jax.Array, np.ndarray, np.generic)):
        raise EdgeError(f"the params of {_name_of(fn)} are numbers and arrays, found {type(leaf).__name__}: {leaf!r}")
    if isinstance(leaf, (jax.Array, np.ndarray, np.generic)) and not jnp.issubdtype(leaf.dtype, jnp.floating):
        return jnp.asarray(leaf)
    return as_float(leaf)


def _name_of(fn: Any) -> str:
    return fn.__name__ if isinstance(fn, (types.FunctionType, types.MethodType)) else type(fn).__name__
