"""Checks on the host: which numbers of a tree or a state are wrong, said by name."""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from jaxframes.tree.attaching import hangs_on
from jaxframes.tree.state import State


def check(tree: Any, state: State) -> tuple[str, ...]:
    """Return one sentence for each thing that is wrong."""
    return (*_edges(tree), *_joints(tree, state), *_prescribed(tree, state), *_attachments(tree, state), *_times(tree, state))


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


def _edges(tree: Any) -> Iterator[str]:
    for name, edge in tree.edges.items():
        about = f"frame {name!r}: a parameter of its edge ({edge.describe()})"
        for path, leaf in jax.tree_util.tree_flatten_with_path(edge)[0]:
            values = np.asarray(leaf)
            if np.issubdtype(values.dtype, np.floating) and "limits" not in jax.tree_util.keystr(path) and not np.isfinite(values).all():
                yield f"{about}, {jax.tree_util.keystr(path)[1:]}, is not finite"
        for wxyz in edge.quaternions():
            if _norm_off(wxyz).any():
                norm = np.linalg.norm(np.asarray(wxyz), axis=-1).reshape(-1)[0]
                yield f"{about} is a quaternion of norm {norm:.6g}; normalise it"


def _joints(tree: Any, state: State) -> Iterator[str]:
    topology = tree.topology
    for joint, frame in zip(topology.joint_names, topology.joint_frames, strict=True):
        first_q, nq, first_v, nv = topology.coordinates[frame]
        for kind, first, count in (("q", first_q, nq), ("qd", first_v, nv), ("qdd", first_v, nv)):
            values = np.asarray(getattr(state, kind))[..., first : first + count]
            if not _finite(values).all():
                yield f"joint {joint!r}: {kind} is not finite{_where(~_finite(values))}"
        q = np.asarray(state.q)[..., first_q : first_q + nq]
        limits = tree.edge(topology.names[frame]).limits_of()
        if limits is not None:
            low, high = (np.asarray(bound) for bound in limits)
            outside = ((q < low) | (q > high)).any(-1)
            if outside.any():
                worst = q[outside].reshape(-1)[0]
                span = f"[{low.reshape(-1)[0]:.6g}, {high.reshape(-1)[0]:.6g}]"
                yield f"joint {joint!r}: q = {worst:.6g} is outside its limits {span}{_where(outside)}"


def _prescribed(tree: Any, state: State) -> Iterator[str]:
    held = state.prescribed
    for frame, row in enumerate(tree.topology.prescribed):
        if row < 0:
            continue
        name = tree.names[frame]
        for leaf in jax.tree.leaves(held):
            values = np.asarray(leaf)[..., row, :]
            if not _finite(values).all():
                yield f"frame {name!r}: its prescribed motion is not finite{_where(~_finite(values))}"
                break
        wxyz = np.asarray(held.transform.rotation.wxyz)[..., row, :]
        if _finite(wxyz).all() and _norm_off(wxyz).any():
            yield f"frame {name!r}: the quaternion of its prescribed pose is not unit{_where(_norm_off(wxyz))}; normalise it"


def _attachments(tree: Any, state: State) -> Iterator[str]:
    if state.attachments is None:
        return
    topology, parents = tree.topology, np.asarray(state.attachments.parents)
    for row, frame in enumerate(topology.attachables):
        name, seats = tree.names[frame], parents[..., row]
        strange = ~np.isin(seats, topology.candidates[row])
        if strange.any():
            seat = seats[strange].reshape(-1)[0]
            yield f"frame {name!r}: it hangs on frame number {seat}, which is not among its candidates{_where(strange)}"
        elif (loop := hangs_on(topology, parents, seats, frame)).any():
            yield f"frame {name!r}: it hangs on itself, a cycle through {tree.names[int(seats[loop].reshape(-1)[0])]!r}{_where(loop)}"


def _times(tree: Any, state: State) -> Iterator[str]:
    timed = [name for name, edge in tree.edges.items() if edge.needs_time]
    if not timed:
        return
    if state.time is None:
        yield f"the state has no time, which the edge of frame {timed[0]!r} needs; pass time= to tree.state"
        return
    codes = tree.coverage(state)
    for name, code in codes.items():
        code = np.asarray(code)
        for side, word in ((-1, "before"), (1, "after")):
            if (code == side).any():
                yield f"frame {name!r}: the time lies {word} the span of its edge ({tree.edge(name).describe()}){_where(code == side)}"
