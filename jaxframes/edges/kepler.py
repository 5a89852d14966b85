"""Orbits about one centre: Kepler's motion on ellipses, parabolas and hyperbolas by its elements, stacked over thousands."""

from typing import Any, ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from jaxframes.edges.base import Edge, Inputs
from jaxframes.edges.family import family
from jaxframes.edges.instants import since_epoch, two_part_epoch
from jaxframes.errors import EdgeError
from jaxframes.numerics import kepler
from jaxframes.numerics.components import V3, select
from jaxframes.numerics.rigid import Rigid
from jaxframes.numerics.steps import Step
from jaxframes.numerics.trig import sin_cos
from jaxframes.numerics.two_part import recast_pairs
from jaxframes.staging.arrays import as_float, common_float, is_concrete
from jaxframes.staging.stages import staged
from jaxframes.time.epoch import Epoch

CONICS = ("ellipse", "any")


@family(static=("conic",), name="kepler")
class Kepler(Edge):
    """The motion of a small body about a centre of gravity: position, velocity and acceleration from six elements; no rotation.

    The parent's origin is the centre, its axes are inertial. The orbit's plane is the parent's x-y plane turned by ``node`` about z, then
    by ``inclination`` about the new x; the periapsis lies ``argument`` radians ahead of the node. All eccentricities are served, ellipses
    to 0.999 by a closed solution, any other conic in universal variables; one formula for circle, parabola and hyperbola.

    Attributes:
        elements: ``[6]``: distance of the periapsis (m), eccentricity, inclination, node, argument of the periapsis (rad), and where the
            body is at the epoch: mean anomaly (rad) for ``conic="ellipse"``, seconds past the periapsis for ``"any"``.
        mu: ``[1]``: gravitational parameter GM of the centre, m3/s2.
        epoch: ``[2]``: the instant of the elements in two parts, seconds past J2000 TDB.
        conic: ``"ellipse"`` where all eccentricities are known to be below 0.999 when the edge is made, else ``"any"`` (static).

    Args:
        periapsis: Distance of the periapsis, m; or give ``semi_major``.
        semi_major: Semi-major axis, m; negative for a hyperbola, and none for a parabola.
        eccentricity: Zero or more.
        inclination: rad.
        node: Longitude (or right ascension) of the ascending node, rad.
        argument: Argument of the periapsis, rad.
        anomaly: Mean anomaly at the epoch, rad (of ellipses and hyperbolas); or give ``time``.
        time: Seconds past the periapsis at the epoch. Default: zero, at the periapsis.
        mu: Gravitational parameter of the centre, m3/s2.
        epoch: ``Epoch`` or seconds past J2000 TDB [...]. Default: J2000.
        conic: ``"any"`` for elements that an optimiser may carry beyond 0.999. Default: by the eccentricities.

    All numbers may have batch axes [...]; ``TreeBuilder.add_many`` takes one for each of its frames.

    Raises:
        EdgeError: A number is not finite or impossible (eccentricity below zero, periapsis or mu not above zero, a semi-major axis of the
            wrong sign), both or neither of two that exclude each other are given, or shapes do not broadcast. Traced numbers that are
            impossible give NaN.

    Gradients: by all elements, mu, the epoch and time; of the solution by the implicit rule, exact to any order. Angles of circles and of
    orbits in the plane are numbers like others. Source: Battin, An Introduction to the Mathematics and Methods of Astrodynamics, 1999.
    Precision: ellipses 1e-13 of the radius within days, then the rounding of the phase; ``time`` and ``epoch`` near each other keep it.

    Example:
        >>> import numpy as np, jaxframes as jf
        >>> b = jf.TreeBuilder(root="earth")
        >>> orbit = jf.edges.Kepler(semi_major=7e6, eccentricity=0.01, inclination=0.9, mu=3.986004418e14)
        >>> b.add("craft", parent="earth", edge=orbit)
        >>> tree = b.build()
        >>> round(float(np.linalg.norm(tree.transform(tree.state(time=0.0), of="craft", relative_to="earth").translation)))
        6930000
    """

    needs_time: ClassVar[bool] = True
    elements: jax.Array
    mu: jax.Array
    epoch: jax.Array
    conic: str

    def __init__(
        self,
        *,
        periapsis: Any = None,
        semi_major: Any = None,
        eccentricity: Any = 0.0,
        inclination: Any = 0.0,
        node: Any = 0.0,
        argument: Any = 0.0,
        anomaly: Any = None,
        time: Any = None,
        mu: Any,
        epoch: Any = 0.0,
        conic: str | None = None,
    ):
        if (periapsis is None) == (semi_major is None):
            raise EdgeError("Kepler takes periapsis= or semi_major=, one of the two")
        if anomaly is not None and time is not None:
            raise EdgeError("Kepler takes anomaly= or time=, not both: each says where the body is at the epoch")
        size = "periapsis" if semi_major is None else "semi_major"
        given = {size: periapsis if semi_major is None else semi_major, "eccentricity": eccentricity, "mu": mu}
        given |= {"inclination": inclination, "node": node, "argument": argument, "anomaly": anomaly, "time": time}
        found = {name: _number(name, value) for name, value in given.items() if value is not None}
        _check(found)
        found = _of_one_shape(found)
        e, gm = found["eccentricity"], found["mu"]
        known = is_concrete(e) and bool(np.all(np.asarray(e) < kepler.HIGHEST))
        chosen = ("ellipse" if known else "any") if conic is None else conic
        if chosen not in CONICS:
            raise EdgeError(f"Kepler(conic=...) is one of {', '.join(map(repr, CONICS))}, found {conic!r}")
        if chosen == "ellipse" and is_concrete(e) and not known:
            raise EdgeError(
                f"Kepler(conic='ellipse') takes eccentricities below {kepler.HIGHEST}, found {np.max(np.asarray(e))}; use 'any'"
            )
        q = found["periapsis"] if semi_major is None else found["semi_major"] * (1 - e)
        rate = jnp.sqrt(gm * jnp.abs(1 - e) ** 3 / q**3)
        zero = jnp.zeros_like(q)
        if chosen == "ellipse":
            last = found["anomaly"] if anomaly is not None else rate * found["time"] if time is not None else zero
        else:
            last = found["anomaly"] / rate if anomaly is not None else found["time"] if time is not None else zero
        elements = jnp.stack([q, e, found["inclination"], found["node"], found["argument"], last], -1)
        for name, value in (("elements", elements), ("mu", gm[..., None]), ("epoch", two_part_epoch(epoch, "Kepler")), ("conic", chosen)):
            object.__setattr__(self, name, value)

    @classmethod
    def from_state(cls, position: Any, velocity: Any, *, mu: Any, epoch: Any = 0.0, conic: str | None = None) -> "Kepler":
        """Return the orbit through a position with a velocity at an epoch.

        Args:
            position: [..., 3], m, relative to the centre.
            velocity: [..., 3], m/s.
            mu: Gravitational parameter of the centre [...], m3/s2.
            epoch: The instant, ``Epoch`` or seconds past J2000 TDB.
            conic: As for the constructor.

        Raises:
            EdgeError: A number is not finite, or the motion is along a line through the centre.

        Gradients: by position and velocity, but at a circle or an orbit in the x-y plane, whose periapsis or node is not defined:
        there the elements' derivatives are NaN, in the value the undefined angle is zero.
        """
        return cls(**elements_of(position, velocity, mu), mu=mu, epoch=epoch, conic=conic)

    def arguments(self) -> dict[str, Any]:
        q, e, inclination, node, argument, last = (self.elements[..., i] for i in range(6))
        where = {"anomaly" if self.conic == "ellipse" else "time": last}
        plane = {"inclination": inclination, "node": node, "argument": argument}
        epoch = Epoch(self.epoch[..., 0], self.epoch[..., 1])
        return {"periapsis": q, "eccentricity": e, **plane, **where, "mu": self.mu[..., 0], "epoch": epoch, "conic": self.conic}

    def describe(self) -> str:
        return "orbit"

    def astype(self, dtype: Any) -> Self:
        plain = super().astype(dtype)
        return plain.replace(epoch=recast_pairs(self.epoch, dtype))

    def steps(self, inputs: Inputs, order: int) -> tuple[Step, ...]:
        seconds = since_epoch(self, inputs, self.epoch)
        q, e, inclination, node, argument, last = (jnp.asarray(c, seconds.dtype) for c in inputs.components(self.elements))
        mu = jnp.asarray(inputs.components(self.mu)[0], seconds.dtype)
        bad = (q <= 0) | (e < 0) | (mu <= 0)  # traced numbers that are impossible
        q = select(bad, jnp.full_like(q, jnp.nan), q)
        in_plane = _ellipse(seconds, q, e, last, mu) if self.conic == "ellipse" else _any_conic(seconds, q, e, last, mu)
        towards, ahead = staged(lambda: _plane_axes(inclination, node, argument))  # once an orbit, not once a state
        return staged(lambda: (_in_space(in_plane, towards, ahead, mu, order),))


def _plane_axes(inclination: Any, node: Any, argument: Any) -> tuple[V3, V3]:
    """Return the directions towards the periapsis and a quarter turn ahead of it."""
    (si, ci), (sn, cn), (sw, cw) = map(sin_cos, (inclination, node, argument))
    towards = V3(cn * cw - sn * sw * ci, sn * cw + cn * sw * ci, sw * si)
    return towards, V3(-cn * sw - sn * cw * ci, -sn * sw + cn * cw * ci, cw * si)


def _in_space(plane: tuple[jax.Array, ...], towards: V3, ahead: V3, mu: Any, order: int) -> Rigid:
    """Return the motion in space of that in the orbit's plane: along the periapsis, ahead of it by a quarter turn, and their rates."""
    x, y, vx, vy, radius = plane
    place = towards * x + ahead * y
    rates: list[V3] = [towards * vx + ahead * vy] if order > 0 else []
    if order > 1:
        rates.append(place * (-mu / (radius * radius * radius)))
    return Rigid(translation=place, **dict(zip(("linear", "linear2"), rates, strict=False)))


def _ellipse(seconds: jax.Array, q: Any, e: Any, anomaly: Any, mu: Any) -> tuple[jax.Array, ...]:
    """Return place and velocity in the plane of an ellipse and the distance, from half the eccentric anomaly: no difference cancels."""
    a, rate, wide, drive = staged(lambda: _of_ellipse(q, e, mu))
    found = kepler.eccentric_anomaly(kepler.nearest_turn(anomaly + rate * seconds), e)
    s, c = map(jnp.asarray, sin_cos(found * 0.5))
    sine, versine = 2 * s * c, 2 * s * s
    radius = q + a * e * versine
    speed = drive / radius
    return q - a * versine, a * wide * sine, -speed * sine, speed * wide * (1 - versine), radius


def _of_ellipse(q: Any, e: Any, mu: Any) -> tuple[jax.Array, ...]:
    """Return semi-major axis, mean motion, ratio of the axes and sqrt(mu a): once an orbit, not once a state."""
    a = q / (1 - e)
    return a, jnp.sqrt(mu / a) / a, jnp.sqrt((1 - e) * (1 + e)), jnp.sqrt(mu * a)


def _any_conic(seconds: jax.Array, q: Any, e: Any, time: Any, mu: Any) -> tuple[jax.Array, ...]:
    """Return the same of any conic, in universal variables from the periapsis."""
    past = kepler.within_half_period(*jnp.broadcast_arrays(time + seconds, mu * (1 - e) / q, mu))
    beta = mu * (1 - e) / q
    s = kepler.universal_anomaly(past, q, e, mu)
    g0, g1, g2, _ = kepler.universal_functions(s, beta)
    radius = q + mu * e * g2
    speed = jnp.sqrt(mu * (1 + e) * q)  # at the periapsis, times its distance
    return q - mu * g2, speed * g1, -mu * g1 / radius, speed * g0 / radius, radius


def elements_of(position: Any, velocity: Any, mu: Any) -> dict[str, jax.Array]:
    """Return periapsis, eccentricity, angles and the time past periapsis of an orbit through a state; arguments of ``Kepler``.

    Args:
        position: [..., 3], m.
        velocity: [..., 3], m/s.
        mu: Gravitational parameter [...], m3/s2.
    """
    r, v, gm = as_float(position), as_float(velocity), as_float(mu)
    if not all(is_concrete(x) and np.isfinite(np.asarray(x)).all() for x in (r, v, gm) if is_concrete(x)):
        raise EdgeError("Kepler.from_state takes finite numbers")
    momentum = jnp.cross(r, v)
    h2 = jnp.sum(momentum * momentum, -1)
    if is_concrete(h2) and not np.all(np.asarray(h2) > 0):
        raise EdgeError("Kepler.from_state: position and velocity are along one line through the centre, which is no conic")
    h, distance, along = jnp.sqrt(h2), jnp.sqrt(jnp.sum(r * r, -1)), jnp.sum(r * v, -1)
    p = h2 / gm
    ecos, esin = p / distance - 1, along * h / (gm * distance)  # e cos f, e sin f
    e = jnp.hypot(ecos, esin)
    q = p / (1 + e)
    inclination = jnp.arctan2(jnp.hypot(momentum[..., 0], momentum[..., 1]), momentum[..., 2])
    node = jnp.arctan2(momentum[..., 0], -momentum[..., 1])
    node = jnp.where(jnp.hypot(momentum[..., 0], momentum[..., 1]) == 0, 0.0 * node, node)
    in_plane = jnp.stack([jnp.cos(node), jnp.sin(node), jnp.zeros_like(node)], -1)
    across = jnp.cross(momentum / h[..., None], in_plane)
    latitude = jnp.arctan2(jnp.sum(across * r, -1), jnp.sum(in_plane * r, -1))
    true = jnp.arctan2(esin, ecos)
    return {
        "periapsis": q,
        "eccentricity": e,
        "inclination": inclination,
        "node": node,
        "argument": latitude - true,
        "time": time_past_periapsis(true, q, e, gm),
    }


def time_past_periapsis(true: jax.Array, q: jax.Array, e: jax.Array, mu: jax.Array) -> jax.Array:
    """Return the seconds past periapsis at a true anomaly in (-pi, pi), for any conic.

    By w = tan(f/2) sqrt(q / (mu (1 + e))) the universal anomaly is s = 2 w a(b w^2), a the arc tangent's series, of either sign.
    """
    beta = mu * (1 - e) / q
    w = jnp.tan(true / 2) * jnp.sqrt(q / (mu * (1 + e)))
    x = beta * w * w
    near = jnp.abs(x) < 1e-3
    safe = jnp.where(near, 1.0, x).astype(x.dtype)
    root = jnp.sqrt(jnp.abs(safe))
    arc = jnp.where(safe > 0, jnp.arctan(root), jnp.arctanh(jnp.minimum(root, 1 - jnp.finfo(x.dtype).eps))) / root
    small = jnp.where(near, x, 0.0).astype(x.dtype)
    series = 1 + small * (-1 / 3 + small * (1 / 5 + small * (-1 / 7 + small * (1 / 9 - small / 11))))
    s = 2 * w * jnp.where(near, series, arc)
    return q * s + mu * e * kepler.universal_functions(s, beta)[3]


def _number(name: str, value: Any) -> jax.Array:
    try:
        found = as_float(value)
    except (TypeError, ValueError):
        raise EdgeError(f"Kepler({name}=...) takes a number, or an array of them, found {value!r}") from None
    if is_concrete(found) and not np.isfinite(np.asarray(found)).all():
        raise EdgeError(f"Kepler({name}=...) is not finite: {value!r}")
    return found


def _of_one_shape(found: dict[str, jax.Array]) -> dict[str, jax.Array]:
    """Return numbers broadcast to one shape, of one dtype."""
    try:
        shape = jnp.broadcast_shapes(*(np.shape(value) for value in found.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {np.shape(value)}" for name, value in found.items())
        raise EdgeError(f"Kepler: the shapes of its numbers do not broadcast: {shapes}") from None
    return {name: jnp.broadcast_to(value, shape) for name, value in zip(found, common_float(*found.values()), strict=True)}


def _check(found: dict[str, jax.Array]) -> None:
    """Refuse known numbers that no orbit has."""
    known = {name: np.asarray(value) for name, value in found.items() if is_concrete(value)}
    for name, least, strict in (("eccentricity", 0.0, False), ("periapsis", 0.0, True), ("mu", 0.0, True)):
        if name in known and not np.all(known[name] > least if strict else known[name] >= least):
            raise EdgeError(f"Kepler({name}=...) is {'above zero' if strict else 'zero or more'}, found {np.min(known[name])}")
    if "eccentricity" not in known:
        return
    e = known["eccentricity"]
    if "semi_major" in known and not np.all(known["semi_major"] * (1 - e) > 0):
        raise EdgeError(
            f"Kepler(semi_major={np.asarray(known['semi_major']).tolist()}): above zero for e < 1, below zero for e > 1, no number "
            f"for e = 1; found e = {e.tolist()}; give periapsis="
        )
    if "anomaly" in known and np.any(e == 1):
        raise EdgeError("Kepler(anomaly=...): a parabola has no mean anomaly; give time=, seconds past the periapsis")
