"""What users give as samples, checked on the host: shapes, finite numbers, methods, and steps between attitudes."""

from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from jaxframes.errors import EdgeError
from jaxframes.spatial import Rotation
from jaxframes.staging.arrays import as_float, is_concrete
from jaxframes.tables.sample_times import SampleTimes

METHODS = ("linear", "lagrange", "hermite", "spline")
WIDTHS = {"positions": 3, "velocities": 3, "accelerations": 3, "angular_velocities": 3}
"""Numbers of each kind of sample but attitudes."""
WIDEST_STEP = {"spline": 90.0, "lagrange": 90.0, "hermite": 180.0, "linear": 180.0}
"""Largest angle between neighbouring attitudes for each method, degrees."""


def checked_samples(name: str, value: Any, count: int) -> jax.Array:
    """Return samples as an array [..., n, k] of floats.

    Args:
        name: What they are, one of ``WIDTHS``.
        value: What the user gave.
        count: How many times there are.

    Raises:
        EdgeError: Another shape, or a number that is not finite.
    """
    try:
        array = as_float(value)
    except (TypeError, ValueError):
        raise EdgeError(f"Sampled({name}=...) takes numbers [{count}, {WIDTHS[name]}], found {type(value).__name__}: {value!r}") from None
    _check(name, array, count, WIDTHS[name])
    return array


def checked_attitudes(value: Any, count: int) -> Rotation:
    """Return attitudes as rotations [..., n] (EdgeError)."""
    if not isinstance(value, Rotation):
        raise EdgeError(
            f"Sampled(attitudes=...) takes a jf.Rotation of {count} samples, found {type(value).__name__}; "
            "Rotation.from_quaternion_wxyz and from_quaternion_xyzw make one of arrays [n, 4]"
        )
    found = Rotation(as_float(value.wxyz))
    _check("attitudes", found.wxyz, count, 4)
    return found


def _check(name: str, array: jax.Array, count: int, width: int) -> None:
    if array.ndim < 2 or array.shape[-2:] != (count, width):
        shape = f"[{count}, {width}]" if name != "attitudes" else f"[{count}]"
        found = array.shape if name != "attitudes" else array.shape[:-1]
        raise EdgeError(f"Sampled({name}=...) takes one sample for each of {count} times, shape {shape}; found {found}")
    if is_concrete(array) and not np.isfinite(known := np.asarray(array)).all():
        place = ", ".join(str(int(i)) for i in np.argwhere(~np.isfinite(known))[0])
        raise EdgeError(f"Sampled: {name}[{place}] is not finite; leave the sample out, and longest_gap= marks what is then a gap")


def checked_method(method: str | None, samples: Mapping[str, Any], has_attitudes: bool) -> str:
    """Return the method for what is given.

    Args:
        method: What the user asks for, None for the default.
        samples: Samples by name, None for those that there are not.
        has_attitudes: Whether there are attitudes too.

    Raises:
        EdgeError: No such method, or what it needs is not there, or what is there it does not use.
    """
    has = {name for name, value in samples.items() if value is not None}
    if "positions" not in has and not has_attitudes:
        raise EdgeError("Sampled takes positions=, attitudes= or both; found none")
    rates = {"velocities", "accelerations", "angular_velocities"} & has
    needed = ({"velocities"} if "positions" in has else set()) | ({"angular_velocities"} if has_attitudes else set())
    chosen = ("hermite" if needed <= has else "spline") if method is None else method
    if chosen not in METHODS:
        raise EdgeError(f"Sampled(method=...) is one of {', '.join(map(repr, METHODS))}, found {method!r}")
    if chosen == "hermite" and not needed <= has:
        raise EdgeError(f"Sampled(method='hermite') needs the rates of its samples: give {', '.join(sorted(needed - has))} too")
    if chosen == "hermite" and (rates - needed - {"accelerations"} or ("accelerations" in rates and "velocities" not in needed)):
        extra = sorted(rates - needed)
        raise EdgeError(f"Sampled: {', '.join(extra)} are given without the samples that they are rates of")
    if chosen != "hermite" and rates:
        why = f"method={chosen!r} does not use" if method else "method='hermite' takes rates of all samples or none, and there are only"
        raise EdgeError(f"Sampled: {why} {', '.join(sorted(rates))}; leave them out, or give the rates of all samples for method='hermite'")
    return chosen


def checked_steps(attitudes: Rotation, method: str, times: SampleTimes) -> None:
    """Refuse attitudes so far from each other that they could be joined the other way round (EdgeError); traced ones pass."""
    if not is_concrete(attitudes.wxyz):
        return
    wxyz = np.asarray(attitudes.wxyz, np.float64)
    wxyz = wxyz / np.linalg.norm(wxyz, axis=-1, keepdims=True)
    if not np.isfinite(wxyz).all():
        raise EdgeError("Sampled: a quaternion of attitudes is zero, and stands for no rotation")
    left = times.left[~times.gaps]
    dots = np.abs(np.sum(wxyz[..., left, :] * wxyz[..., left + 1, :], -1))
    angles = np.degrees(2 * np.arccos(np.minimum(dots, 1.0)))
    widest, limit = float(angles.max(initial=0.0)), WIDEST_STEP[method]
    if widest > limit * (1 + 1e-9):
        at = int(left[np.unravel_index(angles.argmax(), angles.shape)[-1]])
        raise EdgeError(
            f"Sampled: attitudes[{at}] and attitudes[{at + 1}] are {widest:.1f} degrees apart, over the {limit:.0f} that method={method!r} "
            "joins; sample more often, or give angular_velocities"
        )
