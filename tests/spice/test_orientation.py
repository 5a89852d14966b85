"""ITRF93 from a binary PCK against live CSPICE."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests.spice import made


def matrices(quaternions):
    w, x, y, z = np.asarray(quaternions, float).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def angles(rotation, reference):
    """Rotation angle of the difference, from its antisymmetric part: right for small ones."""
    d = np.einsum("nij,nkj->nik", rotation, reference)
    return np.linalg.norm(np.stack([d[:, 2, 1] - d[:, 1, 2], d[:, 0, 2] - d[:, 2, 0], d[:, 1, 0] - d[:, 0, 1]], 1), axis=1) / 2


def from_spice(cspice, times, base="J2000", frame="ITRF93"):
    """Matrices that take coordinates of the frame to the base, and angular velocities in the base's axes."""
    found = [cspice.xf2rav(cspice.sxform(base, frame, float(t))) for t in times]
    return np.array([m.T for m, _ in found]), np.array([w for _, w in found])


@pytest.mark.float64
@pytest.mark.parametrize("base", ["J2000", "ECLIPJ2000"])
def test_itrf93_over_all_segments(kernels, cspice, rng, base):
    edge = kernels.orientation(frame="ITRF93", relative_to=base)
    assert len(edge.info.segments) >= 1
    times = rng.integers(-43000, 853800000, 500).astype(float)
    q, w, _ = edge.evaluate(times)
    rotation, rate = from_spice(cspice, times, base)
    assert angles(matrices(q), rotation).max() <= 1e-12
    assert np.linalg.norm(np.asarray(w) - rate, axis=1).max() <= 1e-18
    assert np.abs(np.linalg.norm(q, axis=1) - 1).max() < 1e-15


@pytest.mark.slow
@pytest.mark.float64
@pytest.mark.parametrize("whole", [True, False])
def test_the_figure_that_the_readme_gives_for_itrf93(kernels, cspice, rng, whole):
    # a wider search, 1.6 million instants of either kind, gives the README's figures; these instants are to stay near them
    edge = kernels.orientation(frame="ITRF93")
    times = rng.integers(-43000, 853800000, 20000).astype(float) if whole else rng.uniform(-43000, 853800000, 20000)
    q, w, _ = edge.evaluate(times)
    rotation, rate = from_spice(cspice, times)
    assert angles(matrices(q), rotation).max() <= 3e-15
    assert np.linalg.norm(np.asarray(w) - rate, axis=1).max() <= 7e-20


@pytest.mark.float64
def test_angular_acceleration_is_the_derivative_of_the_angular_velocity(itrf93, rng):
    times = jnp.asarray(rng.uniform(820497600, 852033600, 20))
    exact = jax.vmap(jax.jacfwd(lambda t: itrf93.evaluate(t, order=1)[1]))(times)
    alpha = np.asarray(itrf93.evaluate(times)[2])
    assert np.abs(exact - alpha).max() <= 1e-12 * np.abs(alpha).max()


def test_itrf93_in_either_precision(itrf93, cspice, dtype):
    times = 820497600.0 + 86400.0 * np.arange(1, 364, 9)
    q, w, _ = itrf93.evaluate(times)
    rotation, rate = from_spice(cspice, times)
    assert angles(matrices(q), rotation).max() <= (1e-12 if dtype == np.float64 else 2e-6)
    assert np.abs(np.asarray(w, float) - rate).max() <= (1e-18 if dtype == np.float64 else 1e-10)


@pytest.mark.float64
def test_edges_of_a_tree_agree_with_sxform_and_spkezr(cspice, moon, itrf93):
    b = jf.TreeBuilder(root="earth")
    b.add("moon", parent="earth", edge=moon)
    b.add("itrf93", parent="earth", edge=itrf93)
    tree = b.build()
    t = 831000000.0
    state = tree.state(time=jf.Epoch.from_et(t))
    motion = tree.motion(state, of="moon", relative_to="itrf93")
    reference = cspice.spkezr("MOON", t, "ITRF93", "NONE", "EARTH")[0] * 1e3
    assert np.linalg.norm(motion.transform.translation - reference[:3]) < 2e-6
    assert np.linalg.norm(motion.velocity.linear - reference[3:]) < 2e-10
    position = lambda t: tree.transform(state.replace(time=t), of="moon", relative_to="itrf93").translation
    assert np.allclose(jax.jacfwd(position)(t), motion.velocity.linear, rtol=1e-13)
    assert np.allclose(jax.jacfwd(jax.jacfwd(position))(t), motion.acceleration.linear, rtol=1e-12, atol=1e-14)


@pytest.mark.float64
def test_angles_that_wind_up_are_unwound(cspice, tmp_path, rng):
    cdata = made.coefficients(rng, 3, 3, 7, scale=0.1)
    cdata[:, 2, 0] += 7000.0 + 500.0 * np.arange(3)
    path = made.pck(tmp_path / "wound.bpc", [(3000, "ECLIPJ2000", 0.0, 300.0, 0.0, 100.0, cdata)])
    with jf.spice.Kernels([path]) as kernels:
        edge = kernels.orientation(frame="ITRF93")
    assert float(jnp.abs(edge.record_tables[0].rows[:, 2]).max()) < 7.0
    cspice.furnsh(path)
    times = rng.integers(0, 300, 100).astype(float)
    q, w, _ = edge.evaluate(times)
    rotation, rate = from_spice(cspice, times)
    assert angles(matrices(q), rotation).max() <= 1e-12
    assert np.linalg.norm(np.asarray(w) - rate, axis=1).max() <= 1e-15
