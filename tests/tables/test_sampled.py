"""Sampled trajectories against SciPy's interpolants and mpmath: values, rates, breaks, gaps, ends, gradients, many of them at once."""

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicHermiteSpline, CubicSpline
from scipy.spatial.transform import Rotation as ScipyRotation
from scipy.spatial.transform import RotationSpline, Slerp

import jaxframes as jf
from jaxframes.errors import EdgeError, MissingInputError, ShapeError
from jaxframes.numerics.two_part import recast_pair
from tests.compilations import compilations
from tests.hung import motion, tree_of

Sampled = jf.tables.Sampled
RNG = np.random.default_rng(5)
TIMES = np.r_[0.0, np.cumsum(RNG.uniform(5, 120, 39))]
RATE, RADIUS = 1.08e-3, 7e6
ANGLES = [RATE * TIMES + k * np.pi / 2 for k in range(3)]
ORBIT = [RADIUS * RATE**k * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1) for k, angle in enumerate(ANGLES)]
AT = np.sort(RNG.uniform(TIMES[0], TIMES[-1], 64))


def truth(t):
    return ScipyRotation.from_rotvec(np.stack([0.6 * np.sin(t / 70), 0.6 * np.cos(t / 110), 0.6 * np.sin(t / 50 + 1)], -1))


def rotation(scipy_rotation):
    return jf.Rotation.from_quaternion_xyzw(scipy_rotation.as_quat())


def linear_parts(found):
    return found.transform.translation, found.velocity.linear, found.acceleration.linear


ORACLES = {
    "spline": (lambda: Sampled(TIMES, ORBIT[0]), lambda: CubicSpline(TIMES, ORBIT[0]), (1e-14, 1e-13, 2e-12)),
    "natural": (
        lambda: Sampled(TIMES, ORBIT[0], ends="natural"),
        lambda: CubicSpline(TIMES, ORBIT[0], bc_type="natural"),
        (1e-14, 1e-13, 2e-12),
    ),
    "cubic": (lambda: Sampled(TIMES, ORBIT[0], velocities=ORBIT[1]), lambda: CubicHermiteSpline(TIMES, *ORBIT[:2]), (1e-14, 1e-13, 2e-12)),
    "quintic": (
        lambda: Sampled(TIMES, ORBIT[0], velocities=ORBIT[1], accelerations=ORBIT[2]),
        lambda: BPoly.from_derivatives(TIMES, np.stack(ORBIT, 1)),
        (1e-14, 2e-12, 2e-9),
    ),
}


@pytest.mark.float64
@pytest.mark.parametrize("name", ORACLES)
def test_positions_are_scipys(name):
    make, oracle, bounds = ORACLES[name]
    found, wanted = motion(tree_of(make()), AT), oracle()
    for order, (value, bound) in enumerate(zip(linear_parts(found), bounds, strict=True)):
        exact = wanted(AT, order)
        assert np.abs(value - exact).max() <= bound * np.abs(exact).max()


@pytest.mark.parametrize("name", ["spline", "cubic"])
def test_an_orbit_in_any_precision(name, dtype):
    """Steps up to 120 s of an orbit of 97 minutes: h^4 / 384 of it for cubics; float32 adds its rounding."""
    inner = AT[15:-15]  # a spline does not know its rates at the ends
    found = motion(tree_of(ORACLES[name][0]()), inner).transform.translation
    exact = RADIUS * np.stack([np.cos(RATE * inner), np.sin(RATE * inner), 0 * inner], 1)
    assert np.abs(found - exact).max() < 2 * RADIUS * ((RATE * 120) ** 4 / 384 + 4 * np.finfo(dtype).eps)


@pytest.mark.float64
def test_lagrange_is_the_polynomial_to_forty_digits():
    found = motion(tree_of(Sampled(TIMES, ORBIT[0], method="lagrange", points=6)), AT[::9])
    for i, t in enumerate(AT[::9]):
        left = np.searchsorted(TIMES, t, side="right") - 1
        first = int(np.clip(left - 2, 0, len(TIMES) - 6))
        with mp.workdps(40):
            nodes = [mp.mpf(x) for x in TIMES[first : first + 6]]

            def polynomial(s, axis, first=first, nodes=nodes):
                total = mp.mpf(0)
                for j, node in enumerate(nodes):
                    weight = mp.mpf(float(ORBIT[0][first + j, axis]))
                    for k, other in enumerate(nodes):
                        weight *= 1 if k == j else (s - other) / (node - other)
                    total += weight
                return total

            exact = [[float(mp.diff(lambda s, a=a: polynomial(s, a), mp.mpf(t), n)) for a in range(3)] for n in range(3)]
        for value, wanted, bound in zip(linear_parts(found), exact, (1e-15, 1e-13, 1e-12), strict=True):
            scale = RADIUS * RATE ** (0 if bound == 1e-15 else 1 if bound == 1e-13 else 2)
            assert np.abs(value[i] - np.array(wanted)).max() <= 4 * bound * scale


def test_lines_and_slerp(dtype, tol):
    tree = tree_of(Sampled(TIMES, ORBIT[0] / RADIUS, rotation(truth(TIMES)), method="linear"))
    found = motion(tree, AT.astype(dtype))
    at = AT.astype(dtype).astype(np.float64)
    exact = np.stack([np.interp(at, TIMES, ORBIT[0][:, k] / RADIUS) for k in range(3)], 1)
    np.testing.assert_allclose(found.transform.translation, exact, atol=20 * tol)
    turned = Slerp(TIMES, truth(TIMES))(at)
    np.testing.assert_allclose(np.asarray(found.transform.rotation.to_matrix()), turned.as_matrix(), atol=20 * tol)
    left = np.searchsorted(TIMES, at, side="right") - 1
    step = (truth(TIMES[left + 1]) * truth(TIMES[left]).inv()).as_rotvec() / np.diff(TIMES)[left][:, None]
    np.testing.assert_allclose(found.velocity.angular, step, atol=tol)
    assert not np.asarray(found.acceleration.as_vector()).any()


@pytest.mark.float64
@pytest.mark.parametrize("method", ["spline", "hermite", "lagrange"])
def test_attitudes_come_near_to_a_smooth_truth(method):
    times = np.arange(0.0, 400.0, 8.0)
    at = np.linspace(30.0, 350.0, 200)
    h = 1e-4
    spin = lambda t: (truth(t + h) * truth(t - h).inv()).as_rotvec() / (2 * h)
    rates = {"angular_velocities": spin(times)} if method == "hermite" else {}
    flipped = np.where(np.arange(len(times)) % 3 == 0, -1.0, 1.0)[:, None]  # signs of quaternions mean nothing
    attitudes = jf.Rotation(flipped * np.asarray(rotation(truth(times)).wxyz))
    found = motion(tree_of(Sampled(times, attitudes=attitudes, method=method, **rates)), at)
    ours = ScipyRotation.from_quat(np.asarray(found.transform.rotation.wxyz)[:, [1, 2, 3, 0]])
    error = (ours * truth(at).inv()).magnitude().max()
    reference = (RotationSpline(times, truth(times))(at) * truth(at).inv()).magnitude().max()
    assert error < 2 * reference
    wanted = RotationSpline(times, truth(times))(at, 1)
    assert np.abs(found.velocity.angular - spin(at)).max() < 2 * np.abs(wanted - spin(at)).max() + 1e-9
    if method == "hermite":
        held = motion(tree_of(Sampled(times, attitudes=attitudes, method=method, **rates)), times)
        np.testing.assert_allclose(held.velocity.angular, rates["angular_velocities"], atol=1e-15)


KINDS = {
    "spline": {},
    "linear": {"method": "linear"},
    "lagrange": {"method": "lagrange", "points": 5},
    "hermite": {"velocities": ORBIT[1] / RADIUS, "angular_velocities": np.ones((len(TIMES), 3)) * 1e-3},
}


@pytest.mark.parametrize("name", KINDS)
def test_rates_are_the_derivatives_of_the_pose(name, dtype, tol):
    tree = tree_of(Sampled(TIMES, ORBIT[0] / RADIUS, rotation(truth(TIMES)), **KINDS[name]))
    time = jnp.asarray(AT[20], dtype)
    found, change = jax.jit(lambda t: jax.jvp(lambda t: motion(tree, t), (t,), (jnp.ones_like(t),)))(time)
    q, dq = (np.asarray(x.transform.rotation.wxyz, float) for x in (found, change))  # q' = w q / 2
    w = 2 * (q[0] * dq[1:] - dq[0] * q[1:] - np.cross(dq[1:], q[1:]))
    np.testing.assert_allclose(found.velocity.angular, w, atol=tol)
    np.testing.assert_allclose(change.transform.translation, found.velocity.linear, atol=tol)
    np.testing.assert_allclose(change.velocity.linear, found.acceleration.linear, atol=tol)
    np.testing.assert_allclose(change.velocity.angular, found.acceleration.angular, atol=tol)


def test_batches_vmap_loops_jit_and_records_agree(dtype, tol):
    tree = tree_of(Sampled(TIMES, ORBIT[0] / RADIUS, rotation(truth(TIMES))))
    ask = lambda tree, t: tree.velocity(tree.state(time=t), of="c0", relative_to="world")
    times = jnp.asarray(AT[:6], dtype)
    whole = ask(tree, times.reshape(2, 3)).reshape(6)
    mapped = jax.vmap(lambda t: ask(tree, t))(times)
    many = ask(tree, jnp.resize(times, 600))  # more than a block
    looped = jax.lax.map(lambda t: ask(tree, t), times)
    records = ask(tree_of(tree.edge("c0").records()), times)
    for i in (0, 5):
        one = ask(tree, times[i])
        for found in (whole, mapped, many, looped, records):
            np.testing.assert_allclose(found[i].as_vector(), one.as_vector(), atol=tol)


def test_gradients_by_the_samples_are_exact(dtype, tol):
    """A sum of squares is quadratic in positions, of which central differences are exact; the map to positions is linear."""
    tree = tree_of(Sampled(TIMES, ORBIT[0] / RADIUS, rotation(truth(TIMES))))
    times = jnp.asarray(AT[::16], dtype)
    place = lambda tree: tree.transform(tree.state(time=times), of="c0", relative_to="world").translation
    loss = jax.jit(lambda p: jnp.sum(place(tree.with_values({"c0.positions": p})) ** 2))
    samples = jnp.asarray(ORBIT[0] / RADIUS, dtype)
    step = jnp.asarray(RNG.normal(size=samples.shape), dtype)
    slope = jnp.sum(jax.jit(jax.grad(loss))(samples) * step)
    np.testing.assert_allclose(slope, (loss(samples + step) - loss(samples - step)) / 2, rtol=100 * tol)
    ask = lambda tree: tree.velocity(tree.state(time=times), of="c0", relative_to="world").angular
    turn = jax.jit(lambda q: jnp.sum(ask(tree.with_values({"c0.attitudes.wxyz": q})) * 100))
    q, h = tree.get("c0.attitudes.wxyz"), 1e-5 if dtype == np.float64 else 1e-2
    change = jnp.asarray(RNG.normal(size=q.shape), dtype)
    by_attitudes = jnp.sum(jax.jit(jax.grad(turn))(q) * change)
    rough = 1e-6 if dtype == np.float64 else 2e-2
    np.testing.assert_allclose(by_attitudes, (turn(q + h * change) - turn(q - h * change)) / (2 * h), rtol=rough, atol=rough)


def test_batches_of_samples_broadcast(dtype, tol):
    tree = tree_of(Sampled(TIMES, ORBIT[0] / RADIUS))
    batch = jnp.asarray(np.stack([ORBIT[0], 2 * ORBIT[0], -ORBIT[0]]) / RADIUS, dtype)
    many, times = tree.with_values({"c0.positions": batch}), jnp.asarray(AT[:2], dtype)[:, None]
    assert many.batch_shape == (3,)
    found, one = motion(many, times), motion(tree, times[:, 0])
    for k, factor in enumerate((1, 2, -1)):
        for a, b in zip(linear_parts(found), linear_parts(one), strict=True):
            np.testing.assert_allclose(a[:, k], factor * b, atol=10 * tol)
    with pytest.raises(ShapeError, match=r"positions take an array \[\.\.\., 40, k\]"):
        motion(tree.with_values({"c0.positions": batch[0, :30]}), times)


BROKEN = np.r_[0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 5.0, 6.0, 7.0, 30.0, 31.0, 33.0, 34.0]


def test_breaks_and_gaps(dtype, tol):
    values = np.cumsum(RNG.normal(size=(len(BROKEN), 3)), 0)
    tree = tree_of(Sampled(BROKEN, values, longest_gap=5.0))
    segments = [(0, 5), (5, 9), (9, 13)]
    inside = [np.linspace(BROKEN[first], BROKEN[last - 1] - (first == 0) * 0.25, 7) for first, last in segments]
    beside, codes = np.array([-0.5, 4.0, 7.5, 29.0, 35.0]), np.array([-1, 0, 1, 1, 1])
    state = tree.state(time=np.concatenate([*inside, beside]).astype(dtype))
    found = tree.motion(state, of="c0", relative_to="world")
    for i, (first, last) in enumerate(segments):
        oracle = CubicSpline(BROKEN[first:last], values[first:last])
        for order, value in enumerate(linear_parts(found)):
            np.testing.assert_allclose(value[7 * i : 7 * i + 7], oracle(inside[i], order), atol=200 * tol)
    np.testing.assert_allclose(found.transform.translation[22], values[5], atol=20 * tol)  # the later sample counts
    np.testing.assert_array_equal(tree.coverage(state)["c0"], [*[0] * 21, *codes])
    for value in linear_parts(found):
        np.testing.assert_array_equal(np.isnan(np.asarray(value)).all(-1), [*[False] * 21, *(codes != 0)])
    place = lambda p, t: tree.with_values({"c0.positions": p}).transform(tree.state(time=t), of="c0", relative_to="world").translation[0]
    by_samples, by_time = jax.jit(jax.grad(place, (0, 1)))(tree.get("c0.positions"), jnp.asarray(10.0, dtype))
    assert np.isnan(by_time)
    assert np.isnan(by_samples).any()
    assert tree.edge("c0").has_gaps
    assert any("in a gap of" in line for line in tree.check(tree.state(time=10.0)))
    assert tree.check(tree.state(time=1.0)) == ()


@pytest.mark.parametrize("method", ["spline", "linear"])
def test_outside_by_name(method, dtype, tol):
    times, place = np.array([0.0, 1.0, 2.0, 4.0]), RNG.normal(size=(4, 3))
    turns = truth(times * 20)
    make = lambda outside: Sampled(times, place, rotation(turns), method=method, outside=outside)
    tree = tree_of(make("hold"), make("extrapolate"))
    at = np.array([-2.0, 1.5, 6.0])
    held, further = motion(tree, at), motion(tree, at, "c1")
    for row, end in ((0, 0), (2, 3)):
        np.testing.assert_allclose(held.transform.translation[row], place[end], atol=20 * tol)
        np.testing.assert_allclose(held.transform.rotation.to_matrix()[row], turns[end].as_matrix(), atol=20 * tol)
        assert not np.asarray(held.velocity.as_vector()[row]).any()
        assert not np.asarray(held.acceleration.as_vector()[row]).any()
    oracle = CubicSpline(times, place)
    if method == "spline":
        for order, value in enumerate(linear_parts(further)):
            np.testing.assert_allclose(value, oracle(at, order), atol=200 * tol)
    else:
        line = place[0] + (place[1] - place[0]) * at[0]
        np.testing.assert_allclose(further.transform.translation[0], line, atol=20 * tol)
        turned = truth(times[0] * 20) * ScipyRotation.identity()
        step = (turns[1] * turns[0].inv()).as_rotvec()
        np.testing.assert_allclose(
            further.transform.rotation.to_matrix()[0], (ScipyRotation.from_rotvec(step * at[0]) * turned).as_matrix(), atol=20 * tol
        )
    for name in ("c0", "c1"):
        np.testing.assert_array_equal(tree.coverage(tree.state(time=at))[name], [-1, 0, 1])
    place = lambda t: tree.transform(tree.state(time=t), of="c0", relative_to="world").translation[0]
    assert jax.jit(jax.grad(place))(jnp.asarray(-2.0, dtype)) == 0


@pytest.mark.float64
@pytest.mark.parametrize("grid", ["logarithmic", "cluster"])
def test_hostile_grids(grid):
    times = (
        np.geomspace(1e-3, 1e5, 300) if grid == "logarithmic" else np.sort(np.r_[np.linspace(0, 1e4, 100), 5e3 + np.linspace(1e-3, 1, 200)])
    )
    values = np.sin(np.log(times + 1.0))[:, None] * np.ones(3)
    edge = Sampled(times, values, method="linear")
    at = np.sort(np.r_[times, (times[1:] + times[:-1]) / 2])
    np.testing.assert_allclose(motion(tree_of(edge), at).transform.translation[:, 0], np.interp(at, times, values[:, 0]), atol=1e-14)
    assert edge.grid.index.compares.bit_length() <= 9 < edge.grid.index.compares


def ragged(count, rng, dtype):
    edges = []
    for i in range(count):
        times = np.r_[0.0, np.cumsum(rng.uniform(5, 120, 9 + i))]
        edges.append(Sampled(times * 1000 / times[-1], rng.normal(size=(len(times), 3)).astype(dtype)))
    return edges


def test_many_of_different_lengths_are_one_program(rng, dtype, tol):
    # Numbers that no other test has: arrays [12, 4] of quaternions, say, may have been normalised in this process before.
    tree, more = tree_of(*ragged(23, rng, dtype)), tree_of(*ragged(47, rng, dtype))
    assert "by level" in tree.explain()
    state = tree.state(time=jnp.asarray([0.0, 333.0, 1000.0], dtype))
    ask = lambda tree: tree.world_motions(state)
    ask(tree_of(*ragged(19, rng, dtype)))  # what is compiled once a process
    assert compilations(ask, tree) == compilations(ask, more)
    together = ask(tree)
    for name in ("c0", "c11"):
        alone, row = motion(tree, state.time, name), tree.names.index(name)
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(a[:, row], b, atol=20 * tol)
    other = tree.with_values({"c3.positions": 2 * tree.get("c3.positions")})
    assert compilations(ask, other) == 0
    np.testing.assert_allclose(ask(other).transform.translation[:, 4], 2 * together.transform.translation[:, 4], atol=20 * tol)


def test_epochs_keep_two_parts(dtype):
    start = jf.Epoch.from_tdb("2026-03-01T00:00:00.125")
    offsets = np.arange(8) * 0.5
    edge = Sampled(start + offsets, np.stack([offsets, offsets**2, -offsets], 1), method="spline")
    tree = tree_of(edge)
    found = motion(tree, start + 1.3)
    eps = float(np.finfo(dtype).eps)
    np.testing.assert_allclose(found.transform.translation, [1.3, 1.69, -1.3], atol=64 * eps + 2e-5 * (dtype == np.float32))
    np.testing.assert_allclose(found.velocity.linear, [1.0, 2.6, -1.0], atol=300 * eps + 2e-5 * (dtype == np.float32))
    np.testing.assert_allclose(edge.knots - start, offsets, atol=1e-15 if dtype == np.float64 else 1e-5)
    narrow, instant = tree.astype(np.float32), start + 1.3
    epoch = jf.Epoch(*recast_pair(instant.hi, instant.lo, np.float32))
    again = narrow.transform(narrow.state(time=epoch).astype(np.float32), of="c0", relative_to="world").translation
    assert again.dtype == np.float32
    np.testing.assert_allclose(again, [1.3, 1.69, -1.3], atol=1e-4)


def test_files_keep_every_number():
    broken = Sampled(BROKEN, RNG.normal(size=(len(BROKEN), 3)), longest_gap=5.0, outside="hold")
    tree = tree_of(broken, Sampled(TIMES, attitudes=rotation(truth(TIMES)), method="linear"))
    again = jf.from_json(jf.to_json(tree))
    assert again.topology == tree.topology
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(tree), strict=True):
        np.testing.assert_array_equal(a, b)
    with pytest.raises(EdgeError, match="write the tree with the Sampled edge"):
        jf.to_json(tree_of(broken.records()))
    with pytest.raises(MissingInputError, match="sampled"):
        tree.motion(tree.state(), of="c0", relative_to="world")


FIVE = np.arange(5.0)
PLACES = np.zeros((5, 3))
REFUSED = [
    (lambda: Sampled(FIVE[::-1], PLACES), "times\\[1\\] lies 1 s before times\\[0\\]"),
    (lambda: Sampled(np.zeros(3), PLACES[:3]), "three are too many"),
    (lambda: Sampled([0.0, np.nan], PLACES[:2]), "times\\[1\\] is not finite"),
    (lambda: Sampled([0.0], PLACES[:1]), "two or more instants"),
    (lambda: Sampled(["a", "b"], PLACES[:2]), "from_tdb, from_utc"),
    (lambda: Sampled(FIVE, PLACES[:4]), r"one sample for each of 5 times, shape \[5, 3\]; found \(4, 3\)"),
    (lambda: Sampled(FIVE, np.where(FIVE[:, None] == 2, np.inf, PLACES)), r"positions\[2, 0\] is not finite"),
    (lambda: Sampled(FIVE), "positions=, attitudes= or both"),
    (lambda: Sampled(FIVE, PLACES, method="cubic"), "method=...\\) is one of 'linear'"),
    (lambda: Sampled(FIVE, PLACES, method="hermite"), "give velocities too"),
    (lambda: Sampled(FIVE, PLACES, velocities=PLACES, method="spline"), "does not use velocities"),
    (lambda: Sampled(FIVE, attitudes=jf.Rotation.identity().broadcast_to((5,)), velocities=PLACES), "only velocities"),
    (lambda: Sampled(FIVE, PLACES, method="lagrange"), "points=8\\): 5 samples from times\\[0\\]"),
    (lambda: Sampled(FIVE, PLACES, outside="clamp"), "outside=...\\) is one of 'nan'"),
    (lambda: Sampled(FIVE, PLACES, ends="periodic"), "ends=...\\) is one of"),
    (lambda: Sampled(FIVE, PLACES, longest_gap=-1), "above zero"),
    (lambda: Sampled([0.0, 1.0, 9.0], PLACES[:3], longest_gap=2.0), "times\\[2\\] stands alone"),
    (lambda: Sampled(FIVE, attitudes=np.zeros((5, 4))), "Rotation.from_quaternion_wxyz"),
    (
        lambda: Sampled(FIVE, attitudes=jf.Rotation.from_axis_angle((0, 0, 1), 1.7 * FIVE)),
        r"attitudes\[\d\] and attitudes\[\d\] are 97.4 degrees",
    ),
]


@pytest.mark.parametrize(("make", "words"), REFUSED, ids=[words[:20] for _, words in REFUSED])
def test_what_is_wrong_is_said(make, words):
    with pytest.raises(EdgeError, match=words):
        make()


def test_a_trajectory_made_under_jit_carries_gradients(dtype):
    """What an integrator returns, inside of one program: the place is linear in the start, so its derivative is exact by a difference."""
    times = np.arange(5.0)

    def place(start):
        states = jax.lax.scan(lambda y, _: (y + 0.5 * jnp.roll(y, 1), y), start, length=5)[1]
        tree = tree_of(Sampled(times, states, velocities=0.5 * jnp.roll(states, 1, axis=1)))
        return tree.transform(tree.state(time=2.3), of="c0", relative_to="world").translation

    start = jnp.asarray([1.0, -2.0, 0.5], dtype)
    slope = jax.jit(jax.jacrev(place))(start)
    np.testing.assert_allclose(slope @ start, jax.jit(place)(start), rtol=1e-12 if dtype == np.float64 else 1e-5)
