"""Light time and stellar aberration against live CSPICE, finite differences and the coverage of the tables."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors

MARS, MOON, EARTH = "MARS BARYCENTER", "MOON", "EARTH"
START, STOP = 820497600.0, 852033600.0
LOOKS = {
    "LT": {"light_time": "LT"},
    "CN": {},
    "CN+S": {"aberration": True},
    "XCN+S": {"aberration": True, "direction": "transmission"},
}


@pytest.fixture(scope="module")
def tree(kernels):
    b = jf.TreeBuilder(root="ssb")
    for name in (MARS, MOON, EARTH):
        b.add(name, parent="ssb", edge=kernels.translation(target=name, center="SSB", start="2026-01-01", stop="2027-01-01"))
    b.add("tilted", parent="ssb", edge=jf.edges.Fixed(jf.Transform.from_rotation(jf.Rotation.from_axis_angle((0.0, 0.0, 1.0), 0.5))))
    return b.build()


@pytest.fixture(scope="module")
def times():
    return np.random.default_rng(3).integers(START + 1e5, STOP - 1e5, 40).astype(float)


@pytest.fixture(scope="module")
def look_at(tree):
    """Mars from the Earth, compiled once for each correction and 40 epochs."""
    compiled = {
        name: jax.jit(lambda epoch, kw=kw: tree.apparent(tree.state(time=epoch), of=MARS, relative_to=EARTH, **kw))
        for name, kw in LOOKS.items()
    }
    return lambda name, seconds: compiled[name](seconds if isinstance(seconds, jf.Epoch) else jf.Epoch.from_et(seconds))


def seen(cspice, target, correction, times):
    found = [cspice.spkezr(target, float(t), "J2000", correction, EARTH) for t in times]
    return np.array([state for state, _ in found]) * 1e3, np.array([delay for _, delay in found])


@pytest.mark.float64
@pytest.mark.parametrize("correction", LOOKS)
def test_apparent_states_agree_with_spkezr(tree, look_at, cspice, times, correction):
    for target in (MARS, MOON)[: 1 + (correction == "CN")]:
        found = look_at(correction, times) if target == MARS else tree.apparent(tree.state(time=times), of=target, relative_to=EARTH)
        states, delays = seen(cspice, target, correction, times)
        assert np.linalg.norm(found.position - states[:, :3], axis=1).max() <= 5e-3
        assert np.linalg.norm(found.velocity - states[:, 3:], axis=1).max() <= 1e-8
        assert np.abs(found.light_time - delays).max() <= 2e-11
        assert not np.any(found.coverage)
        assert (found.acceleration is None) == (correction == "LT")


SITE = np.array([-2353621.0, -4641341.0, 3677052.0])


@pytest.fixture(scope="module")
def with_station(kernels):
    b = jf.TreeBuilder.from_tree(kernels.tree(bodies=[MARS, MOON], frames="ITRF93", start="2026-01-01", stop="2027-01-01"))
    b.add("station", parent="ITRF93", edge=jf.edges.Fixed(jf.Transform.from_translation(SITE)))
    return b.build()


@pytest.mark.float64
@pytest.mark.parametrize("correction", LOOKS)
def test_seen_from_a_station_as_spkcpo_says(with_station, cspice, times, correction):
    ask = functools.partial(with_station.apparent, relative_to="station", **LOOKS[correction])

    @jax.jit
    def look(state):  # both targets, in both axes, by one program
        return {target: (ask(state, of=target, order=1), ask(state, of=target, expressed_in="ITRF93", order=0)) for target in (MARS, MOON)}

    both = look(with_station.state(time=jf.Epoch.from_et(times)))
    # CSPICE has the velocity of stellar aberration from the observer's velocity differenced over 1 s either side. For a station that is off
    # by its spin's third derivative, 400 m/s (7.3e-5 / s)^3 / 6 = 3e-11 m/s2, times the light time: 3.4e-8 m/s measured for Mars, and
    # 5e-10 m/s for the Moon, as much as without aberration.
    for target, spread in ((MARS, 5e-8 if "S" in correction else 1e-9), (MOON, 1e-9)):
        found, turned = both[target]
        observer = ("OBSERVER", correction, SITE / 1e3, "EARTH", "ITRF93")
        seen = [cspice.spkcpo(target, float(t), "J2000", *observer) for t in times]
        states, delays = np.array([s for s, _ in seen]) * 1e3, np.array([d for _, d in seen])
        assert np.linalg.norm(found.position - states[:, :3], axis=1).max() <= 5e-3
        assert np.linalg.norm(found.velocity - states[:, 3:], axis=1).max() <= spread
        assert np.abs(found.light_time - delays).max() <= 2e-11
        states = np.array([cspice.spkcpo(target, float(t), "ITRF93", *observer)[0] for t in times]) * 1e3
        assert np.linalg.norm(turned.position - states[:, :3], axis=1).max() <= 5e-3


def test_in_float32_the_error_is_that_of_the_distance_from_the_root(look_at, cspice, dtype):
    t = START + 86400.0 * np.arange(1, 361, 9)
    found = look_at("XCN+S", t)
    states, _ = seen(cspice, MARS, "XCN+S", t)
    limit = 5e-3 if dtype == np.float64 else 6e4
    assert np.linalg.norm(np.asarray(found.position, float) - states[:, :3], axis=1).max() <= limit
    assert np.linalg.norm(np.asarray(found.velocity, float) - states[:, 3:], axis=1).max() <= (1e-8 if dtype == np.float64 else 0.05)


@pytest.mark.float64
@pytest.mark.parametrize("correction", ["CN+S", "XCN+S"])
def test_acceleration_and_light_time_rate_are_derivatives(look_at, times, correction):
    step, epoch = 3000.0, jf.Epoch.from_et(times)
    # The eighth-order central difference.
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    around = {k: (look_at(correction, epoch + k * step), look_at(correction, epoch + -k * step)) for k in weights}
    slope = lambda part: sum(w * (getattr(around[k][0], part) - getattr(around[k][1], part)) for k, w in weights.items()) / step
    found = look_at(correction, epoch)
    relative = np.linalg.norm(slope("velocity") - found.acceleration, axis=1) / np.linalg.norm(found.acceleration, axis=1)
    assert relative.max() <= 1e-9
    np.testing.assert_allclose(slope("light_time"), found.light_time_rate, rtol=1e-8, atol=1e-15)


@pytest.mark.float64
def test_forward_and_reverse_derivatives(tree, look_at, times):
    t = jnp.asarray(times[0])
    look = lambda tree, t: tree.apparent(tree.state(time=t), of=MARS, relative_to=EARTH, order=0).position
    found = jax.tree.map(lambda x: x[0], look_at("CN", times))
    np.testing.assert_allclose(jax.jit(jax.jacfwd(lambda t: look(tree, t)))(t), found.velocity, rtol=1e-13)
    distance = lambda tree, t: jnp.linalg.norm(look(tree, t))
    # All of Mars moved along x: the light time changes too, which is what the implicit derivative is about.
    mars = tree.edge(MARS)
    moved = lambda d: (dataclasses.replace(mars.record_tables[0], rows=mars.record_tables[0].rows.at[:, 0].add(d)), *mars.record_tables[1:])
    along = jax.jit(lambda d: distance(tree.with_edge(MARS, mars.replace(record_tables=moved(d))), t))
    np.testing.assert_allclose(jax.jit(jax.grad(along))(0.0), (along(500.0) - along(-500.0)) / 1000.0, rtol=1e-7)


def test_batches_and_vmap_and_axes(tree, times, dtype):
    state = tree.state(time=jf.Epoch.from_et(times[:4].reshape(2, 2)))
    grid = tree.apparent(state, of=MARS, relative_to=EARTH, expressed_in="tilted", order=0)
    assert grid.position.shape == (2, 2, 3)
    assert grid.coverage.shape == grid.light_time.shape == (2, 2)
    assert grid.acceleration is grid.velocity is None
    rows = jax.vmap(lambda e: tree.apparent(tree.state(time=e), of=MARS, relative_to=EARTH, order=0))(state.time)
    turned = jf.Rotation.from_axis_angle((0.0, 0.0, 1.0), -0.5) @ rows.position
    eps = np.finfo(dtype).eps
    np.testing.assert_allclose(grid.position, turned, atol=8 * eps * 4e11)
    np.testing.assert_allclose(grid.light_time, rows.light_time, rtol=8 * eps)


def test_lower_orders_are_parts_of_the_whole(tree, look_at, times, dtype):
    whole = look_at("XCN+S", times)
    for order in (0, 1):
        part = tree.apparent(tree.state(time=jf.Epoch.from_et(times)), of=MARS, relative_to=EARTH, order=order, **LOOKS["XCN+S"])
        np.testing.assert_allclose(part.position, whole.position, rtol=0, atol=8 * np.finfo(dtype).eps * 4e11)
        if order:
            np.testing.assert_allclose(part.velocity, whole.velocity, rtol=0, atol=40 * np.finfo(dtype).eps * 3e4)
    assert part.acceleration is None


def test_without_light_time_it_is_the_geometric_state(tree, times, tol):
    state = tree.state(time=times[:3])
    found = tree.apparent(state, of=MOON, relative_to=EARTH, light_time=False)
    motion = tree.motion(state, of=MOON, relative_to=EARTH)
    np.testing.assert_allclose(found.position, motion.transform.translation, atol=tol * 1.5e11)
    np.testing.assert_allclose(found.acceleration, motion.acceleration.linear, atol=tol * 1e-2)
    assert not np.any(found.light_time)


def test_coverage_at_the_instant_looked_at_counts(tree, look_at):
    # Two hours around the start: the light of the first part left before the tables begin.
    around = np.linspace(-4000.0, 4000.0, 40)
    for correction, end, code in (("CN", START, -1), ("XCN+S", STOP, 1)):
        found = look_at(correction, end + around)
        codes, delay = np.asarray(found.coverage), float(np.nanmean(found.light_time))
        outside = around < delay if code < 0 else around > -delay
        sure = np.abs(around + code * delay) > 70.0  # one float32 of these epochs is 64 s
        assert np.array_equal(codes[sure], np.where(outside, code, 0)[sure])
        for part in (found.position[:, 0], found.velocity[:, 1], found.acceleration[:, 2], found.light_time):
            assert np.array_equal(np.isnan(part), codes != 0)
        assert 0 < np.sum(codes == 0) < 40
    slope = jax.grad(lambda t: tree.apparent(tree.state(time=t), of=MARS, relative_to=EARTH, order=0).position[0])
    assert np.isnan(slope(jnp.asarray(START + 64.0)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"light_time": "CN+S"}, r"light_time='CN\+S': give True .*'LT'.*False"),
        ({"aberration": "S"}, r"aberration='S'"),
        ({"light_time": False, "aberration": True}, r"aberration=True needs light_time"),
        ({"direction": "X"}, r"direction='X': give 'reception'.*'transmission'"),
        ({"order": 3}, r"order=3: give 0"),
        ({"of": EARTH}, r"the same frame 'EARTH'"),
        ({"of": "MARS"}, r"'MARS'.*MARS BARYCENTER"),
    ],
)
def test_options_that_do_not_exist(tree, options, message):
    with pytest.raises(errors.FrameError, match=message):
        tree.apparent(tree.state(time=START), **{"of": MARS, "relative_to": EARTH, **options})


def test_a_state_without_time(tree):
    with pytest.raises(errors.MissingInputError, match="light time needs the time"):
        tree.apparent(tree.state(), of=MARS, relative_to=EARTH)


@pytest.mark.parametrize("correction", LOOKS)
def test_origins_that_coincide_are_seen_where_they_are(correction, cspice, dtype):
    """As CSPICE says of a body seen from itself: no distance, no light time; and gradients are finite, zero for the light time."""
    b = jf.TreeBuilder(root="ssb")
    b.add("craft", parent="ssb", edge=jf.edges.Prescribed())
    b.add("camera", parent="craft", edge=jf.edges.Movable())
    b.add("bracket", parent="craft", edge=jf.edges.Fixed())
    tree = b.build()
    motion = jf.Motion.at_rest(jf.Transform.from_translation(jnp.asarray([1e8, 2e8, -3e8], dtype)))
    motion = dataclasses.replace(
        motion,
        velocity=jf.SpatialVelocity(jnp.zeros(3, dtype), jnp.asarray([1e4, -2e4, 5e3], dtype)),
        acceleration=jf.SpatialAcceleration(jnp.zeros(3, dtype), jnp.asarray([1e-3, 2e-3, 0.0], dtype)),
    )
    state = tree.set_motions(tree.state(time=8.3e8), {"craft": motion})

    def look(state):
        return tree.apparent(state, of="bracket", relative_to="craft", **LOOKS[correction])

    known, delay = cspice.spkezr("EARTH", 8.3e8, "J2000", correction, "EARTH")
    assert np.array_equal(known, np.zeros(6))
    assert delay == 0.0
    for seen_so in (look(state), jax.jit(look)(state)):
        for part in (seen_so.position, seen_so.velocity, seen_so.acceleration, seen_so.light_time, seen_so.light_time_rate):
            assert part is None or np.array_equal(part, np.zeros_like(part))
        assert seen_so.coverage == 0

    def light_time(p):
        moved = dataclasses.replace(motion, transform=jf.Transform.from_translation(p))
        found = look(tree.set_motion(state, "craft", moved.transform))
        return found.light_time + jnp.sum(found.position) + jnp.sum(found.velocity)

    gradient = jax.grad(light_time)(motion.transform.translation)
    assert np.array_equal(gradient, np.zeros(3))


def test_the_batch_of_a_tree_and_that_of_the_times_broadcast(tree, times, dtype):
    shifts = np.array([0.0, 1e7])
    b = jf.TreeBuilder.from_tree(tree)
    at = jf.Transform.from_translation(np.stack([shifts, 0 * shifts, 0 * shifts], -1)[:, None])
    b.add("probe", parent=EARTH, edge=jf.edges.Fixed(at))
    batched = b.build()
    few = jf.Epoch.from_et(times[:5])
    found = batched.apparent(batched.state(time=few), of=MARS, relative_to="probe", aberration=True)
    assert found.position.shape == (2, 5, 3)
    assert found.light_time.shape == found.coverage.shape == (2, 5)
    for i, shift in enumerate(shifts):
        alone = jf.TreeBuilder.from_tree(tree)
        alone.add("probe", parent=EARTH, edge=jf.edges.Fixed(jf.Transform.from_translation((shift, 0.0, 0.0))))
        one = alone.build()
        single = one.apparent(one.state(time=few), of=MARS, relative_to="probe", aberration=True)
        for name in ("position", "velocity", "acceleration", "light_time"):
            a, b_ = np.asarray(getattr(found, name)[i], float), np.asarray(getattr(single, name), float)
            assert np.abs(a - b_).max() <= 64 * np.finfo(dtype).eps * np.abs(b_).max()
