"""Orbits against SPICE's conics and oscelt, rates and gradients against differences, turning at constant rates against compositions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import spiceypy

import jaxframes as jf
from jaxframes.errors import EdgeError, MissingInputError
from tests.hung import motion, tree_of

E = jf.edges
MU = 3.986004418e14
ANGLES = {"inclination": 0.9, "node": 1.1, "argument": -2.0}
ECCENTRICITIES = {"ellipse": np.array([0.0, 1e-8, 0.3, 0.9, 0.99]), "any": np.array([0.0, 0.3, 0.99, 1.0, 1.0001, 1.5, 5.0])}
TIMES = np.array([-40_000.0, -300.0, 0.0, 10.0, 2_500.0, 100_000.0])


def orbit(conic, e, **more):
    return E.Kepler(periapsis=7e6, eccentricity=e, time=350.0, mu=MU, epoch=10.0, conic=conic, **ANGLES, **more)


def conics(e, times):
    """Position and velocity by SPICE, in SI units."""
    q, mu = 7e3, MU / 1e9
    mean = 350.0 * np.sqrt(mu * (abs(1 - e) if e != 1 else 2.0) ** (3 if e != 1 else -1) / q**3)
    elements = [q, e, *ANGLES.values(), mean, 10.0, mu]
    return np.array([spiceypy.conics(elements, t) for t in times]) * 1e3


@pytest.mark.parametrize("conic", ECCENTRICITIES)
def test_orbits_are_spices(conic, dtype):
    """In float64 to the rounding of the phase; float32 holds times and phases to 6e-8, and the orbits near the epoch only."""
    e, times = ECCENTRICITIES[conic], TIMES if dtype == np.float64 else TIMES[1:4]
    found = motion(tree_of(orbit(conic, e)), times[:, None])
    bound = 3e-12 if dtype == np.float64 else 1e-5
    for k, ecc in enumerate(e):
        exact = conics(ecc, times)
        for ours, theirs in ((found.transform.translation, exact[:, :3]), (found.velocity.linear, exact[:, 3:])):
            error = np.linalg.norm(np.asarray(ours)[:, k] - theirs, axis=1) / np.linalg.norm(theirs, axis=1)
            assert error.max() < bound, (ecc, error)
        pull = -MU * exact[:, :3] / np.linalg.norm(exact[:, :3], axis=1, keepdims=True) ** 3
        np.testing.assert_allclose(found.acceleration.linear[:, k], pull, atol=10 * bound * np.abs(pull).max())


@pytest.mark.parametrize("conic", ECCENTRICITIES)
def test_rates_are_derivatives(conic, dtype, tol):
    tree = tree_of(orbit(conic, ECCENTRICITIES[conic]))
    found, change = jax.jit(lambda t: jax.jvp(lambda t: motion(tree, t), (t,), (jnp.ones_like(t),)))(jnp.asarray(700.0, dtype))
    for rate, value in ((change.transform.translation, found.velocity.linear), (change.velocity.linear, found.acceleration.linear)):
        np.testing.assert_allclose(rate, value, rtol=0, atol=20 * tol * np.abs(value).max())


@pytest.mark.float64
@pytest.mark.parametrize(("conic", "e"), [("ellipse", 0.3), ("any", 1.0), ("any", 1.7)])
def test_gradients_by_elements(conic, e):
    tree = tree_of(orbit(conic, e))
    names = ("c0.elements", "c0.mu", "c0.epoch")

    def loss(values):
        found = motion(tree.with_values(dict(zip(names, values, strict=True))), 2500.0)
        return jnp.sum(found.transform.translation) / 1e7 + jnp.sum(found.velocity.linear) / 1e4

    values = tuple(tree.get(name) for name in names)
    slopes = jax.jit(jax.grad(loss))(values)
    value = jax.jit(loss)
    for k, (slope, at) in enumerate(zip(slopes, values, strict=True)):
        for i in range(2 if k == 2 else len(at)):
            h = 1e-5 * max(abs(float(at[i])), 1.0) if k < 2 else 1e-2
            up, down = (value(tuple(v.at[i].add(s * h) if j == k else v for j, v in enumerate(values))) for s in (1, -1))
            np.testing.assert_allclose(slope[i], (up - down) / (2 * h), rtol=2e-6, atol=1e-9)


def test_thousands_stack_and_broadcast(rng, dtype, tol):
    edges = [orbit("ellipse", e) for e in rng.uniform(0, 0.5, 22)]
    edges += [E.UniformRotation(rng.normal(size=3), rate=r) for r in rng.normal(size=3)]
    tree = tree_of(*edges)
    assert "by level" in tree.explain()
    assert len(tree.topology.groups) == 2
    state = tree.state(time=jnp.asarray([0.0, 500.0], dtype))
    together = tree.world_motions(state)
    for name in ("c0", "c21", "c23"):
        alone, row = motion(tree, state.time, name), tree.names.index(name)
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(a[:, row], b, rtol=50 * tol, atol=50 * tol * max(1.0, float(np.abs(b).max())))
    one = jax.vmap(lambda t: motion(tree, t))(state.time.hi)
    np.testing.assert_allclose(one.transform.translation, together.transform.translation[:, 1], rtol=50 * tol)


@pytest.mark.float64
def test_from_a_state_is_oscelt():
    for e in (0.01, 0.7, 1.4):
        state = conics(e, [1234.0])[0]
        edge = E.Kepler.from_state(state[:3], state[3:], mu=MU, epoch=1234.0)
        q, ecc, inclination, node, argument, *_ = spiceypy.oscelt(state / 1e3, 1234.0, MU / 1e9)
        found = np.asarray(edge.elements)
        np.testing.assert_allclose(found[:3], [q * 1e3, ecc, inclination], rtol=1e-12)
        np.testing.assert_allclose(np.cos(found[3:5] - [node, argument]), 1.0, atol=1e-14)
        again = motion(tree_of(edge), 1234.0)
        np.testing.assert_allclose(again.transform.translation, state[:3], rtol=1e-12)
        np.testing.assert_allclose(again.velocity.linear, state[3:], rtol=1e-11)
    plain = E.Kepler.from_state((7e6, 0.0, 0.0), (0.0, np.sqrt(MU / 7e6), 0.0), mu=MU)  # a circle in the plane: no node, no periapsis
    np.testing.assert_allclose(motion(tree_of(plain), 0.0).transform.translation, [7e6, 0, 0], atol=1e-6)
    slope = jax.jacfwd(lambda v: E.Kepler.from_state(state[:3], v, mu=MU).elements[0])(state[3:])
    h = 1e-3
    place = lambda k, s: E.Kepler.from_state(state[:3], state[3:] + s * h * np.eye(3)[k], mu=MU).elements[0]
    np.testing.assert_allclose(slope, [(place(k, 1) - place(k, -1)) / (2 * h) for k in range(3)], rtol=1e-6)


def test_turning_at_constant_rates(dtype, tol):
    axis, start = np.array([0.6, 0.0, 0.8]), jf.Epoch.from_tdb("2026-03-01")
    spin = E.UniformRotation(2 * axis, rate=0.01, angle=0.3, epoch=start)
    top = E.Precession(0.02, 0.4, node=0.5, rate=-1.5, angle=0.1, epoch=start)
    tree = tree_of(spin, top)
    time = start + 12.5
    turn = lambda axis, angle: jf.Rotation.from_axis_angle(axis, angle)
    x, z = np.eye(3)[0], np.eye(3)[2]
    wanted = turn(z, 0.5 + 0.02 * 12.5) @ turn(x, 0.4) @ turn(z, 0.1 - 1.5 * 12.5)
    loose = tol if dtype == np.float64 else 2e-4  # an epoch of float32 is good to 4e-6 s
    np.testing.assert_allclose(motion(tree, time).transform.rotation.to_matrix(), turn(axis, 0.3 + 0.125).to_matrix(), atol=loose)
    np.testing.assert_allclose(motion(tree, time).velocity.angular, 0.01 * axis, atol=tol)
    found = motion(tree, time, "c1")
    np.testing.assert_allclose(found.transform.rotation.to_matrix(), wanted.to_matrix(), atol=loose)
    axis_now = np.asarray(wanted @ z)
    np.testing.assert_allclose(found.velocity.angular, 0.02 * z - 1.5 * axis_now, atol=loose)
    np.testing.assert_allclose(found.acceleration.angular, np.cross(0.02 * z, -1.5 * axis_now), atol=loose)


def test_files_and_text():
    tree = tree_of(orbit("ellipse", 0.3), orbit("any", 1.5), E.UniformRotation(rate=0.1, epoch=1.0), E.Precession(0.1, 0.2))
    again = jf.from_json(jf.to_json(tree))
    assert again.topology == tree.topology
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(tree), strict=True):
        np.testing.assert_allclose(a, b, rtol=4 * np.finfo(np.asarray(b).dtype).eps)
    assert "orbit" in str(tree)
    with pytest.raises(MissingInputError, match="hangs on orbit, and the state has no time"):
        tree.motion(tree.state(), of="c0", relative_to="world")
    narrow = tree.astype(np.float32)
    assert narrow.get("c0.elements").dtype == np.float32


def test_impossible_traced_numbers_are_nan(dtype):
    tree = tree_of(orbit("ellipse", 0.3))
    bad = jnp.asarray([[-7e6, 0.3, 0, 0, 0, 0], [7e6, -0.1, 0, 0, 0, 0], [7e6, 1.2, 0, 0, 0, 0]], dtype)
    place = lambda elements: motion(tree.with_values({"c0.elements": elements}), 1.0).transform.translation
    assert np.isnan(place(bad)).all()
    assert np.isnan(jax.jit(jax.jacrev(place))(bad[0])).any()


REFUSED = [
    (lambda: E.Kepler(mu=MU), "periapsis= or semi_major="),
    (lambda: E.Kepler(periapsis=7e6, semi_major=7e6, mu=MU), "one of the two"),
    (lambda: E.Kepler(periapsis=7e6, anomaly=0.0, time=0.0, mu=MU), "not both"),
    (lambda: E.Kepler(periapsis=-7e6, mu=MU), "periapsis=...\\) is above zero, found -7"),
    (lambda: E.Kepler(periapsis=7e6, eccentricity=-0.1, mu=MU), "zero or more, found -0.1"),
    (lambda: E.Kepler(periapsis=7e6, mu=0.0), "mu=...\\) is above zero"),
    (lambda: E.Kepler(semi_major=7e6, eccentricity=1.5, mu=MU), "below zero for e > 1"),
    (lambda: E.Kepler(semi_major=7e6, eccentricity=1.0, mu=MU), "give periapsis="),
    (lambda: E.Kepler(periapsis=7e6, eccentricity=1.0, anomaly=0.1, mu=MU), "a parabola has no mean anomaly"),
    (lambda: E.Kepler(periapsis=7e6, eccentricity=0.9995, mu=MU, conic="ellipse"), "use 'any'"),
    (lambda: E.Kepler(periapsis=np.ones(2), eccentricity=np.zeros(3), mu=MU), "do not broadcast: periapsis \\(2,\\)"),
    (lambda: E.Kepler(periapsis=np.nan, mu=MU), "is not finite"),
    (lambda: E.Kepler.from_state((1.0, 0, 0), (2.0, 0, 0), mu=1.0), "along one line"),
    (lambda: E.UniformRotation((0, 0, 0)), "not zero"),
    (lambda: E.UniformRotation(rate="fast"), "one number"),
    (lambda: E.Precession(0.1, np.inf), "one finite number"),
]


@pytest.mark.parametrize(("make", "words"), REFUSED, ids=[words[:20] for _, words in REFUSED])
def test_what_is_wrong_is_said(make, words):
    with pytest.raises(EdgeError, match=words):
        make()
