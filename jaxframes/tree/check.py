"""Checks on the host: which numbers of a tree or a state are wrong, said by name."""

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import numpy as np

from jaxframes.edges.base import Edge
from jaxframes.kinematics import queries
from jaxframes.model.attachment_graph import hangs_on
from jaxframes.model.state import State
from jaxframes.tables.placing import misplaced
from jaxframes.tree.states import States


def check(tree: States, state: State) -> tuple[str, ...]:
    """Return one sentence for each thing that is wrong."""
    edges = tree.edges
    frames = ((name, tree.parent(name) if name in edges else None, edges.get(name), tree.properties[name]) for name in tree.names)
    return (
        *_edges(edges),
        *misplaced(frames),
        *_joints(tree, state),
        *_prescribed(tree, state),
        *_attachments(tree, state),
        *_times(tree, state),
        *_axes(tree, state),
    )


def _where(bad: Any) -> str:
    """Say where in a batch something is wrong."""
    bad = np.asarray(bad)
    if bad.ndim == 0:
        return ""
    places = np.argwhere(bad)
    first = ", ".join(str(int(i)) for i in places[0])
    return f" at batch index {first}" + (f" and {len(places) - 1} more" if len(places) > 1 else "")


def _finite(values: Any) -> Any:
    return np.isfinite(np.asarray(values)).all(-1)


def _norm_off(wxyz: Any) -> Any:
    wxyz = np.asarray(wxyz)
    return np.abs(np.linalg.norm(wxyz.astype(np.float64), axis=-1) - 1) > 64 * np.finfo(wxyz.dtype).eps


def _edges(edges: Mapping[str, Edge]) -> Iterator[str]:
    for name, edge in edges.items():
        about = f"frame {name!r}: a parameter of its edge ({edge.describe()})"
        for path, leaf in jax.tree_util.tree_flatten_with_path(edge.checkable())[0]:
            values = np.asarray(leaf)
            if np.issubdtype(values.dtype, np.floating) and "limits" not in jax.tree_util.keystr(path) and not np.isfinite(values).all():
                yield f"{about}, {jax.tree_util.keystr(path)[1:]}, is not finite"
        for field, axis in edge.directions().items():
            if (off := _norm_off(axis)).any():
                norm = np.linalg.norm(np.asarray(axis), axis=-1)[off].reshape(-1)[0]
                yield f"frame {name!r}: {field} of its edge ({edge.describe()}) has length {norm:.6g}{_where(off)}; queries read it as 1"
        for wxyz in edge.quaternions():
            if _norm_off(wxyz).any():
                norm = np.linalg.norm(np.asarray(wxyz), axis=-1).reshape(-1)[0]
                yield f"{about} is a quaternion of norm {norm:.6g}; queries read it at norm 1"


def _joints(tree: States, state: State) -> Iterator[str]:
    topology = tree.topology
    for joint, frame in zip(topology.joint_names, topology.joint_frames, strict=True):
        first_q, nq, first_v, nv = topology.coordinates[frame]
        for kind, first, count in (("q", first_q, nq), ("qd", first_v, nv), ("qdd", first_v, nv)):
            values = np.asarray(getattr(state, kind))[..., first : first + count]
            if not _finite(values).all():
                yield f"joint {joint!r}: {kind} is not finite{_where(~_finite(values))}"
        q = np.asarray(state.q)[..., first_q : first_q + nq]
        for what, values, low, high in _bounded(tree.edge(topology.names[frame]), q):
            outside = (values < low) | (values > high)
            if outside.any():
                worst, lower, upper = (side[outside].reshape(-1)[0] for side in (values, low, high))
                yield f"joint {joint!r}: {what} = {worst:.6g} is outside its limits [{lower:.6g}, {upper:.6g}]{_where(outside)}"
        if nq != nv and (nothing := np.linalg.norm(q[..., :4], axis=-1) == 0).any():
            yield f"joint {joint!r}: its quaternion is zero{_where(nothing)}; start from tree.neutral()"


def _bounded(edge: Edge, q: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield what is limited of an edge: a name, values, lower and upper bounds [...]."""
    limits = edge.limits_of()
    if limits is not None:
        low, high, wide = np.broadcast_arrays(*map(np.asarray, limits), q)
        for i in range(q.shape[-1]):
            yield f"q[{i}]" if q.shape[-1] > 1 else "q", wide[..., i], low[..., i], high[..., i]
    yield from edge.bounded(q)


def _prescribed(tree: States, state: State) -> Iterator[str]:
    rows = [(frame, row, state.prescribed) for frame, row in enumerate(tree.topology.prescribed) if row >= 0]
    if state.attachments is not None:
        rows += [(frame, row, state.attachments.motion) for row, frame in enumerate(tree.topology.attachables)]
    for frame, row, held in rows:
        name = tree.names[frame]
        for leaf in jax.tree.leaves(held):
            values = np.asarray(leaf)[..., row, :]
            if not _finite(values).all():
                yield f"frame {name!r}: the motion that the state holds for it is not finite{_where(~_finite(values))}"
                break
        wxyz = np.asarray(held.transform.rotation.wxyz)[..., row, :]
        if _finite(wxyz).all() and _norm_off(wxyz).any():
            yield f"frame {name!r}: the quaternion of its pose in the state is not unit{_where(_norm_off(wxyz))}; normalise it"


def _attachments(tree: States, state: State) -> Iterator[str]:
    if state.attachments is None:
        if tree.topology.attachables:
            yield "the state holds no attachments, so it is not one of this tree; make it with this tree.state(...)"
        return
    topology, parents = tree.topology, np.asarray(state.attachments.parents)
    for row, frame in enumerate(topology.attachables):
        name, hung_on = tree.names[frame], parents[..., row]
        strange = ~np.isin(hung_on, topology.candidates[row])
        if strange.any():
            target = hung_on[strange].reshape(-1)[0]
            yield f"frame {name!r}: it hangs on frame number {target}, which is not among its candidates{_where(strange)}"
        elif (loop := hangs_on(topology, parents, hung_on, frame)).any():
            yield f"frame {name!r}: it hangs on itself, a cycle through {tree.names[int(hung_on[loop].reshape(-1)[0])]!r}{_where(loop)}"


def _axes(tree: States, state: State) -> Iterator[str]:
    if any(edge.needs_time for edge in tree.edges.values()) and state.time is None:
        return  # said already
    for name, defined in tree.axes_defined(state).items():
        bad = ~np.asarray(defined)
        if not bad.any():
            continue
        angle = np.asarray(queries.angle_between_vectors(tree, state, tree.topology.index(name)))[bad].reshape(-1)[0]
        what = "one of its two vectors is zero or no number" if np.isnan(angle) else f"its two vectors are {angle:.3g} rad apart: parallel"
        yield f"frame {name!r}: {what}, so its axes are not defined ({tree.edge(name).describe()}){_where(bad)}"


def _times(tree: States, state: State) -> Iterator[str]:
    timed = [name for name, edge in tree.edges.items() if edge.needs_time]
    if not timed:
        return
    if state.time is None:
        yield f"the state has no time, which the edge of frame {timed[0]!r} needs; pass time= to tree.state"
        return
    clock = np.isfinite(np.asarray(state.time.hi)) & np.isfinite(np.asarray(state.time.lo))
    if not clock.all():
        yield f"the state's time is not finite{_where(~clock)}"
    codes = tree.coverage(state)
    for name, code in codes.items():
        code = np.where(clock, np.asarray(code), 0)
        for side, word in ((-1, "before"), (1, "after (or in a gap of)" if tree.edge(name).has_gaps else "after")):
            if (code == side).any():
                yield f"frame {name!r}: the time lies {word} the span of its edge ({tree.edge(name).describe()}){_where(code == side)}"
