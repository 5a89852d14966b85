"""Attachments as data: motions of frames whose parents are traced numbers, by pointer doubling.

The attachable frames cut a tree into static components. Within a component everything goes along static paths.
Between components each attachable frame is a link from its component's root to a frame that the state names: the poses of the frames
that it may hang on are worked out along static paths, the right one is selected, and the links are composed by doubling
X_i <- X_p(i) X_i, p <- p(p), in ceil(log2 n) rounds for n components on the way. A link that does not arrive at the root then is
part of a cycle, or hangs on one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.errors import MissingInputError, NoAccelerationError
from jaxframes.kinematics import path, pointer_doubling
from jaxframes.kinematics.context import Context
from jaxframes.kinematics.path import known_pose, outward
from jaxframes.numerics.components import Component, select
from jaxframes.numerics.packed import Packed, unpacked
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, relative
from jaxframes.staging.stages import stage

Table = dict[int, Any]

MAX_SELECTED = 12
"""Up to so many candidates in all are told apart by selects, which XLA vectorises; more are gathered, which compiles faster."""


@dataclass(frozen=True)
class Touched:
    """What a query about some frames may touch.

    Attributes:
        links: The attachable frames whose links it may follow, roots of their components.
        wanted: For each component, 0 the root's, the frames that are asked about or that something may hang on.
        anchor: A frame near to what is asked for, which all components are reached from: the first of the frames itself, or the frame that
            it is declared on. Paths to the candidates start there and go through common ancestors, so a distant root does not enter.
    """

    links: tuple[int, ...]
    wanted: Mapping[int, frozenset[int]]
    anchor: int


def touched(context: Context, frames: tuple[int, ...]) -> Touched:
    """Return what a query about frames may touch."""
    topology = context.topology
    rows = {frame: row for row, frame in enumerate(topology.attachables)}
    wanted, ahead = {0: set[int]()}, list(frames)
    while ahead:
        frame = ahead.pop()
        component = topology.static_components[frame]
        if component not in wanted:
            wanted[component] = {component}
            ahead.extend(topology.candidates[rows[component]])
        wanted[component].add(frame)
    links = tuple(component for component in wanted if component)
    return Touched(links, {component: frozenset(needed) for component, needed in wanted.items() if needed}, nearest(context, frames[0]))


MAX_TOUCHED = 48
"""Frames in other components, or candidates in all, from which on a query goes by level: unrolled, each would take its time to compile."""


def touches_many(context: Context, frames: tuple[int, ...]) -> bool:
    """Return whether a query about frames of several components may touch so many frames that it should go by level."""
    near = touched(context, frames)
    depths = context.topology.depths
    return sum(depths[frame] - depths[component] for component, needed in near.wanted.items() for frame in needed) > MAX_TOUCHED


def static_components_of(context: Context, frames: tuple[int, ...]) -> "StaticComponents":
    """Return the static components that a query about frames may touch, the motions within them worked out along static paths."""
    near = touched(context, frames)
    inside: dict[int, Packed | Rigid] = {}
    for component, needed in near.wanted.items():
        root = component or near.anchor
        known = {frame: pose for frame in needed if (pose := known_pose(context, frame, root)) is not None}
        try:
            inside |= known | (outward(context, root, needed - known.keys()) if len(known) < len(needed) else {})
        except (MissingInputError, NoAccelerationError) as error:
            names = ", ".join(repr(context.topology.names[link]) for link in near.links)
            raise type(error)(
                f"{error} (it may be on the way to a candidate of {names}: Attachable(candidates=...) restricts these)"
            ) from None
    return StaticComponents(context, near, inside)


class StaticComponents:
    """The static components that a query may touch. What depends on the parents is worked out anew by each stage that asks for it.

    Motions may be wrong where a link is not valid (a cycle, a parent that is no candidate): ``nan_where_invalid`` makes them NaN. It comes
    last, so that an invalid link makes nothing NaN that does not depend on it, in value and gradient.
    """

    def __init__(self, context: Context, near: Touched, inside: Mapping[int, Packed | Rigid]):
        self.context, self._near, self._inside = context, near, inside
        self._rows = {frame: row for row, frame in enumerate(context.topology.attachables)}

    def placed(self) -> "Placed":
        """Return each component's root placed in the anchor; call it within a stage."""
        motions: dict[int, dict[int, Rigid]] = {component: {} for component in self._near.wanted}
        for frame, motion in self._inside.items():
            motions[self.context.topology.static_components[frame]][frame] = motion if isinstance(motion, Rigid) else unpacked(motion)
        candidates = [self.context.topology.candidates[self._rows[component]] for component in self._near.links]
        if sum(map(len, candidates)) > MAX_SELECTED:
            roots, valid = pointer_doubling.place(self.context, self._near.links, self._rows, motions)
        else:
            roots, valid = _place_unrolled(self.context, self._near.links, self._rows, motions)
        return Placed(self.context, motions, roots, valid)


def _place_unrolled(
    context: Context, links: tuple[int, ...], rows: dict[int, int], inside: dict[int, dict[int, Rigid]]
) -> tuple[Table, Table]:
    """Return where each component's root is in the anchor, and whether it hangs on the root at all, told apart by selects."""
    home = context.topology.static_components
    codes = {0: 0, **{component: i for i, component in enumerate(links, 1)}}
    pointers: Table = {}
    roots: Table = {0: AT_REST}
    valid: Table = {}
    for component in links:
        parent, held = context.attachment(rows[component])
        candidates = context.topology.candidates[rows[component]]
        options = [(c, inside[home[c]][c]) for c in candidates]
        roots[component] = compose(_select(parent, options, context.dtype), held, context.order)
        valid[component] = is_one_of(parent, candidates)
        pointers[component] = _choose(parent, [(c, codes[home[c]]) for c in candidates])
    for _ in range(max(len(links) - 1, 0).bit_length()):
        roots, pointers, valid = _double(context, roots, pointers, valid, codes)
    return roots, {component: valid[component] & (jnp.asarray(pointers[component]) == 0) for component in links}


def _double(context: Context, roots: Table, pointers: Table, valid: Table, codes: dict[int, int]) -> tuple[Table, Table, Table]:
    places = [(code, component) for component, code in codes.items()]
    new_roots, new_pointers, new_valid = {0: AT_REST}, {}, {}
    for component in pointers:
        at = jnp.asarray(pointers[component])
        above = _select(at, [(code, roots[other]) for code, other in places], context.dtype)
        new_roots[component] = compose(above, roots[component], context.order)
        new_pointers[component] = _choose(at, [(code, pointers[other] if other else 0) for code, other in places])
        good = _choose(at, [(code, valid[other] if other else True) for code, other in places])
        new_valid[component] = valid[component] & good
    return new_roots, new_pointers, new_valid


class Placed:
    """Components whose roots are placed in the anchor, as components.

    Attributes:
        valid: For each attachable frame whether it hangs, link by link, on the root.
    """

    def __init__(self, context: Context, inside: dict[int, dict[int, Rigid]], roots: Table, valid: Table):
        self.context, self.valid = context, valid
        self._inside, self._roots = inside, {**roots, 0: AT_REST}

    def nan_where_invalid(self, motion: Rigid, *frames: int) -> Rigid:
        """Return a motion that is NaN where the frames that it comes from do not hang, link by link, on the root."""
        for component in sorted({self.context.topology.static_components[frame] for frame in frames} - {0}):
            motion = nan_unless(motion, self.valid[component], self.context.dtype)
        return motion

    def between(self, of: int, relative_to: int) -> Rigid:
        """Return the motion of ``of`` as ``relative_to`` sees it."""
        motion = relative(self.motion(relative_to), self.motion(of), self.context.order)
        return self.nan_where_invalid(motion, of, relative_to)

    def motion(self, frame: int) -> Rigid:
        """Return the motion of a frame relative to the anchor (valid or not)."""
        component = self.context.topology.static_components[frame]
        return compose(self._roots[component], self._inside[component][frame], self.context.order)

    def motion_of_traced(self, frame: jax.Array, candidates: tuple[int, ...]) -> tuple[Rigid, jax.Array]:
        """Return the motion relative to the anchor of a frame given as data, and where it is a candidate that hangs on the root."""
        motions, known = [self.motion(c) for c in candidates], is_one_of(frame, candidates)
        if len(candidates) > MAX_SELECTED:
            shape = jnp.broadcast_shapes(self.context.shape, frame.shape)
            place = _choose(frame, [(c, i) for i, c in enumerate(candidates)])
            table = pointer_doubling.stack_components(motions, shape, self.context.dtype)
            found = pointer_doubling.take_motions(table, jnp.broadcast_to(place, shape)[..., None])
            motion = jax.tree.map(lambda c: c if isinstance(c, float) else c[..., 0], found)
        else:
            motion = _select(frame, list(zip(candidates, motions, strict=True)), self.context.dtype)
        home = self.context.topology.static_components
        hangs = _choose(frame, [(c, self.valid[home[c]] if home[c] else True) for c in candidates])
        return motion, known & hangs


def between(context: Context, of: int, relative_to: int) -> Packed:
    """Return the motion of ``of`` as ``relative_to`` sees it, whatever stands between them."""
    home = context.topology.static_components
    if home[of] == home[relative_to]:
        return path.between(context, of, relative_to)
    first, second = (of, relative_to) if home[relative_to] and not home[of] else (relative_to, of)
    static_components = static_components_of(context, (first, second))
    return stage(lambda: context.kind.packed(static_components.placed().between(of, relative_to)))()


def all_frames(context: Context, relative_to: int) -> dict[int, Packed]:
    """Return the motions of all frames as ``relative_to`` sees them, in a tree with attachable frames."""
    near = outward(context, relative_to)
    far = [frame for frame in range(len(context.topology.names)) if frame not in near]
    return near | between_many(context, far, relative_to)


def between_many(context: Context, frames: Sequence[int], relative_to: int) -> dict[int, Packed]:
    """Return the motions, as one frame sees them, of several frames of other components than its own."""
    if not frames:
        return {}
    static_components = static_components_of(context, (relative_to, *frames))

    def all_of_them() -> dict[int, Packed]:
        placed = static_components.placed()
        return {frame: context.kind.packed(placed.between(frame, relative_to)) for frame in frames}

    return stage(all_of_them)()


def is_one_of(frame: jax.Array, candidates: tuple[int, ...]) -> jax.Array:
    """Return where a frame index is among the candidates."""
    return _choose(frame, [(c, True) for c in candidates], False)


def nearest(context: Context, frame: int) -> int:
    """Return the frame of the root's component nearest to one: itself, or what it is declared on, link by link."""
    topology = context.topology
    while topology.static_components[frame] != 0:
        frame = topology.parents[topology.static_components[frame]]
    return frame


def _choose(key: jax.Array, options: list[tuple[int, Any]], otherwise: Any = None) -> jax.Array:
    """Return the option whose key matches, elementwise; ``otherwise`` (by default the last option) where none does."""
    if otherwise is None:
        *options, (_, otherwise) = options
    out = jnp.asarray(otherwise)
    for value, option in options:
        out = select(key == value, jnp.asarray(option, out.dtype), out)
    return out


def _select(key: jax.Array, options: list[tuple[int, Rigid]], dtype: Any) -> Rigid:
    """Return the motion whose key matches, component by component; the last one where none does."""
    if len(options) == 1:
        return options[0][1]

    def pick(*parts: Component) -> Component:
        first = parts[0]
        if isinstance(first, float) and all(isinstance(p, float) and p == first for p in parts):
            return first
        out = jnp.asarray(parts[-1], dtype)
        for (value, _), part in zip(options[:-1], parts[:-1], strict=True):
            out = select(key == value, jnp.asarray(part, dtype), out)
        return out

    return jax.tree.map(pick, *(motion for _, motion in options))


def nan_unless(motion: Rigid, valid: jax.Array, dtype: Any) -> Rigid:
    """Return a motion that is NaN, in value and gradient, where it is not valid."""
    factor = select(valid, 1.0, float("nan")).astype(dtype)
    return jax.tree.map(lambda component: factor * component, motion)
