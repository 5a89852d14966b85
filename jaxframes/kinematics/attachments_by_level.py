"""Over all frames of a large tree with attachable frames: by level within each static component, and all links at once by pointer doubling.

The static components that attachable frames cut a tree into are worked out together, each relative to its root. A link is the
motion of a component's root relative to the frame that the state names. Links are composed by doubling, as arrays over all of them, and one
last composition takes every frame along with its component. The program does not grow with the number of frames or links.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.kinematics import levels
from jaxframes.kinematics.attachments import nan_unless, nearest
from jaxframes.kinematics.context import Context
from jaxframes.numerics.packed import Kind, Packed, unpacked
from jaxframes.numerics.rigid import AT_REST, compose, relative
from jaxframes.staging.stages import stage


def all_frames(context: Context, observer: int) -> Packed:
    """Return the motions of all frames as an observer sees them, arrays [*batch, n_frames, k]; NaN where a frame hangs on no root."""
    topology, count = context.topology, len(context.topology.names)
    static_components = np.array(topology.static_components)
    near = static_components == static_components[observer]
    # Those of the root's component from near the observer, those of others from their roots.
    inside = levels.all_frames(context, nearest(context, observer))
    codes = np.zeros(count, np.int32)  # 0 for the root's component, 1 and more for the links
    codes[list(topology.attachables)] = 1 + np.arange(len(topology.attachables))
    codes = codes[static_components]
    roots, valid = _links(context, inside, codes)
    kind = Kind((*context.shape, count), context.dtype, context.order)
    here = np.array([observer])

    def seen(inside: Packed, roots: Packed, valid: jax.Array) -> Packed:
        own = unpacked(levels.rows_of(inside, here))
        placed = compose(unpacked(levels.rows_of(roots, codes)), unpacked(inside), context.order)
        eye = compose(unpacked(levels.rows_of(roots, codes[here])), own, context.order)
        good = valid[..., codes] & valid[..., codes[here]]
        far = nan_unless(relative(eye, placed, context.order), good, context.dtype)
        close = relative(own, unpacked(inside), context.order)  # in the observer's own component nothing else enters
        return kind.packed(jax.tree.map(lambda a, b: jnp.where(near, a, b), close, far))

    return stage(seen)(inside, roots, valid)


def _links(context: Context, inside: Packed, codes: np.ndarray) -> tuple[Packed, jax.Array]:
    """Return the motions [*batch, 1 + n_links, k] of all components' roots relative to the anchor, and whether each hangs on the root."""
    topology, state, shape = context.topology, context.state, context.shape
    held, links, count = state.attachments, len(topology.attachables), len(topology.names)
    assert held is not None
    member = np.zeros((links, count), bool)
    for i, candidates in enumerate(topology.candidates):
        member[i, list(candidates)] = True
    parents = jnp.broadcast_to(held.parents, (*shape, links))
    clipped = jnp.clip(parents, 0, count - 1)
    known = jnp.asarray(member)[np.arange(links), clipped] & (clipped == parents)
    kind = Kind((*shape, links), context.dtype, context.order)
    motions = context.packed_motions(held.motion, kind)
    parent_motions = _rows_at(inside, clipped)
    composed = stage(lambda a, b: kind.packed(compose(unpacked(a), unpacked(b), context.order)))(parent_motions, motions)
    rest = Kind((*shape, 1), context.dtype, context.order).packed(AT_REST)
    found = tuple(jnp.concatenate([first, others], -2) for first, others in zip(rest, composed, strict=True))
    start = jnp.zeros((*shape, 1), np.int32)
    pointer = jnp.concatenate([start, jnp.asarray(codes)[clipped]], -1)
    valid = jnp.concatenate([start == 0, known], -1)
    whole = Kind((*shape, links + 1), context.dtype, context.order)
    double = stage(lambda a, b: whole.packed(compose(unpacked(a), unpacked(b), context.order)))
    for _ in range((links - 1).bit_length()):
        found = double(_rows_at(found, pointer), found)
        valid = valid & jnp.take_along_axis(valid, pointer, -1)
        pointer = jnp.take_along_axis(pointer, pointer, -1)
    return found, valid & (pointer == 0)


def _rows_at(arrays: Packed, index: jax.Array) -> Packed:
    """Return the rows of arrays [..., n, k] at an index [..., m]."""
    return tuple(jnp.take_along_axis(array, index[..., None], -2) for array in arrays)
