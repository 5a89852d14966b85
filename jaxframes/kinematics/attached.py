"""Attachments as data: motions of frames whose parents are traced numbers, by pointer doubling.

The attachable frames cut a tree into islands, each with a static inside. Within an island everything goes along static paths.
Between islands each attachable frame is a link from its island's root to a frame that the state names: the poses of the frames
that it may hang on are worked out along static paths, the right one is selected, and the links are composed by doubling
X_i <- X_p(i) X_i, p <- p(p), in ceil(log2 n) rounds for n islands on the way. A link that does not arrive at the root then is
part of a cycle, or hangs on one.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxframes.errors import MissingInputError, NoAccelerationError
from jaxframes.kinematics import doubling
from jaxframes.kinematics.context import Context
from jaxframes.kinematics.walk import outward
from jaxframes.numerics.components import Component
from jaxframes.numerics.rigid import AT_REST, Rigid, compose, relative

Table = dict[int, Any]

UNROLLED = 12
"""Up to so many candidates in all are told apart by selects, which XLA vectorises; more are gathered, which compiles faster."""


class Islands:
    """The islands that a query may touch, each one's root placed in the anchor: a frame that all of them are reached from.

    The anchor is a frame near to what is asked for: the first of the frames itself, or the frame that it is declared on. Paths to
    the candidates start there and go through common ancestors, so a distant root does not enter.

    Motions may be wrong where a link is not valid (a cycle, a parent that is no candidate): ``spoil`` makes them NaN. It comes
    last, so that an invalid link spoils nothing that does not depend on it, in value and gradient.
    """

    def __init__(self, context: Context, frames: tuple[int, ...]):
        topology = context.topology
        self.context, self._rows = context, {frame: row for row, frame in enumerate(topology.attachables)}
        wanted, ahead = {0: set[int]()}, list(frames)
        while ahead:
            frame = ahead.pop()
            island = topology.islands[frame]
            if island not in wanted:
                wanted[island] = {island}
                ahead.extend(topology.candidates[self._rows[island]])
            wanted[island].add(frame)
        self.links = tuple(island for island in wanted if island)
        self.anchor = _near(context, frames[0])
        self._inside = {island: self._walk(island, needed, frames) for island, needed in wanted.items() if needed}
        self._place()

    def _walk(self, island: int, needed: set[int], asked: tuple[int, ...]) -> dict[int, Rigid]:
        try:
            return outward(self.context, island or self.anchor, frozenset(needed))
        except (MissingInputError, NoAccelerationError) as error:
            names = ", ".join(repr(self.context.topology.names[link]) for link in self.links)
            raise type(error)(
                f"{error} (it may be on the way to a candidate of {names}: Attachable(candidates=...) restricts these)"
            ) from None

    def _place(self) -> None:
        """Work out where each island's root is in the anchor, and whether it hangs on the root at all."""
        candidates = [self.context.topology.candidates[self._rows[island]] for island in self.links]
        if sum(map(len, candidates)) > UNROLLED:
            roots, self.valid = doubling.place(self.context, self.links, self._rows, self._inside)
        else:
            roots, self.valid = self._place_unrolled()
        self.roots = {**roots, 0: AT_REST}

    def _place_unrolled(self) -> tuple[Table, Table]:
        """Do the same for few links and candidates, told apart by selects."""
        codes = {0: 0, **{island: i for i, island in enumerate(self.links, 1)}}
        pointers: Table = {}
        roots: Table = {0: AT_REST}
        valid: Table = {}
        for island in self.links:
            row = self._rows[island]
            parent, held = self.context.attachment(row)
            candidates = self.context.topology.candidates[row]
            options = [(c, self._inside[self.context.topology.islands[c]][c]) for c in candidates]
            roots[island] = compose(_select(parent, options, self.context.dtype), held, self.context.order)
            valid[island] = is_one_of(parent, candidates)
            pointers[island] = _choose(parent, [(c, codes[self.context.topology.islands[c]]) for c in candidates])
        for _ in range(max(len(self.links) - 1, 0).bit_length()):
            roots, pointers, valid = self._double(roots, pointers, valid, codes)
        return roots, {island: valid[island] & (jnp.asarray(pointers[island]) == 0) for island in self.links}

    def _double(self, roots: Table, pointers: Table, valid: Table, codes: dict[int, int]) -> tuple[Table, Table, Table]:
        places = [(codes[island], island) for island in (0, *self.links)]
        new_roots, new_pointers, new_valid = {0: AT_REST}, {}, {}
        for island in self.links:
            at = jnp.asarray(pointers[island])
            above = _select(at, [(code, roots[other]) for code, other in places], self.context.dtype)
            new_roots[island] = compose(above, roots[island], self.context.order)
            new_pointers[island] = _choose(at, [(code, pointers[other] if other else 0) for code, other in places])
            good = _choose(at, [(code, valid[other] if other else True) for code, other in places])
            new_valid[island] = valid[island] & good
        return new_roots, new_pointers, new_valid

    def spoil(self, motion: Rigid, *frames: int) -> Rigid:
        """Return a motion that is NaN where the frames that it comes from do not hang, link by link, on the root."""
        for island in sorted({self.context.topology.islands[frame] for frame in frames} - {0}):
            motion = spoiled(motion, self.valid[island], self.context.dtype)
        return motion

    def between(self, of: int, relative_to: int) -> Rigid:
        """Return the motion of ``of`` as ``relative_to`` sees it."""
        motion = relative(self.motion(relative_to), self.motion(of), self.context.order)
        return self.spoil(motion, of, relative_to)

    def motion(self, frame: int) -> Rigid:
        """Return the motion of a frame relative to the anchor (not spoiled)."""
        island = self.context.topology.islands[frame]
        return compose(self.roots[island], self._inside[island][frame], self.context.order)

    def motion_of_traced(self, frame: jax.Array, candidates: tuple[int, ...]) -> tuple[Rigid, jax.Array]:
        """Return the motion relative to the anchor of a frame given as data, and where it is a candidate that hangs on the root."""
        motions, known = [self.motion(c) for c in candidates], is_one_of(frame, candidates)
        if len(candidates) > UNROLLED:
            shape = jnp.broadcast_shapes(self.context.shape, frame.shape)
            place = _choose(frame, [(c, i) for i, c in enumerate(candidates)])
            table = doubling.stacked(motions, shape, self.context.dtype)
            found = doubling.picked(table, jnp.broadcast_to(place, shape)[..., None])
            motion = jax.tree.map(lambda c: c if isinstance(c, float) else c[..., 0], found)
        else:
            motion = _select(frame, list(zip(candidates, motions, strict=True)), self.context.dtype)
        home = self.context.topology.islands
        hangs = _choose(frame, [(c, self.valid[home[c]] if home[c] else True) for c in candidates])
        return motion, known & hangs


def between(context: Context, of: int, relative_to: int) -> Rigid:
    """Return the motion of ``of`` as ``relative_to`` sees it, when attachable frames stand between them."""
    home = context.topology.islands
    first, second = (of, relative_to) if home[relative_to] and not home[of] else (relative_to, of)
    return Islands(context, (first, second)).between(of, relative_to)


def all_frames(context: Context, relative_to: int) -> dict[int, Rigid]:
    """Return the motions of all frames as ``relative_to`` sees them, in a tree with attachable frames."""
    every = tuple(range(len(context.topology.names)))
    islands = Islands(context, (relative_to, *every))
    near = outward(context, relative_to)
    return {frame: near[frame] if frame in near else islands.between(frame, relative_to) for frame in every}


def is_one_of(frame: jax.Array, candidates: tuple[int, ...]) -> jax.Array:
    """Return where a frame index is among the candidates."""
    return _choose(frame, [(c, True) for c in candidates], False)


def _near(context: Context, frame: int) -> int:
    """Return the frame of the root's island nearest to one: itself, or what it is declared on, link by link."""
    topology = context.topology
    while topology.islands[frame] != 0:
        frame = topology.parents[topology.islands[frame]]
    return frame


def _choose(key: jax.Array, options: list[tuple[int, Any]], otherwise: Any = None) -> jax.Array:
    """Return the option whose key matches, elementwise; ``otherwise`` (by default the last option) where none does."""
    if otherwise is None:
        *options, (_, otherwise) = options
    out = jnp.asarray(otherwise)
    for value, option in options:
        out = jnp.where(key == value, jnp.asarray(option, out.dtype), out)
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
            out = jnp.where(key == value, jnp.asarray(part, dtype), out)
        return out

    return jax.tree.map(pick, *(motion for _, motion in options))


def spoiled(motion: Rigid, valid: jax.Array, dtype: Any) -> Rigid:
    """Return a motion that is NaN, in value and gradient, where it is not valid."""
    factor = jnp.where(valid, 1.0, jnp.nan).astype(dtype)
    return jax.tree.map(lambda component: factor * component, motion)
