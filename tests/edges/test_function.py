"""Functions of time as edges: rates against 40 digits, transformations, precision of two-part time, and what is refused."""

import functools

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import EdgeError, MissingInputError, ShapeError
from jaxframes.view.local_motions import local_motions
from tests.compilations import compilations

Function = jf.edges.Function
AXIS, RATE, RADIUS = (0.3, -0.2, 0.5), 0.7, 2.5
TRACES = []


def whole(params, t):
    TRACES.append(1)
    swing = jf.Rotation.from_rotation_vector(params["axis"] * jnp.sin(params["rate"] * t))
    angle = params["rate"] * t
    return jf.Transform(swing, params["radius"] * jnp.stack([jnp.cos(angle), jnp.sin(angle), params["weights"][1, 0] * t * t]))


def turning(params, t):
    return jf.Rotation.from_axis_angle(params[0], params[1] * t)


def line(params, t):
    return params * t


def params():
    return {"axis": np.array(AXIS), "rate": RATE, "radius": RADIUS, "weights": np.arange(4.0).reshape(2, 2) / 10}


def make(since=None, **span):
    b = jf.TreeBuilder()
    b.add("craft", parent="world", edge=Function(whole, params(), since, **span))
    b.add("spin", parent="craft", edge=Function(turning, (np.array([0.0, 0.0, 1.0]), 0.5)))
    b.add("hinge", parent="spin", edge=jf.edges.Revolute((1, 0, 0), jf.Transform.from_translation((0.1, 0.2, 0.3))))
    b.add("cart", parent="world", edge=Function(line, np.array([1.0, 2.0, 3.0])))
    return b.build()


TREE = make()


def motion(tree, time, relative_to="world"):
    return tree.motion(tree.state(time=time), of="craft", relative_to=relative_to)


def close(a, b, rtol):
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        np.testing.assert_allclose(x, y, rtol=rtol, atol=rtol * max(1.0, float(np.abs(y).max())))


def exact_pose(t):
    """Quaternion and translation of ``whole`` in mpmath."""
    axis, angle = [mp.mpf(float(a)) for a in AXIS], mp.mpf(RATE) * t
    length = mp.sqrt(sum(a * a for a in axis))
    half = length * mp.sin(angle) / 2
    weight = mp.mpf(float(params()["weights"][1, 0]))
    turn = [mp.cos(half), *(a / length * mp.sin(half) for a in axis)]
    return turn, [mp.mpf(RADIUS) * x for x in (mp.cos(angle), mp.sin(angle), weight * t * t)]


def product(a, b):
    (w, x, y, z), (W, X, Y, Z) = a, b
    return w * W - x * X - y * Y - z * Z, w * X + x * W + y * Z - z * Y, w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W


@pytest.mark.float64
@pytest.mark.parametrize("seconds", [0.0, 1.3])
def test_rates_are_the_derivatives_to_forty_digits(seconds):
    found = TREE.motion(TREE.state(time=seconds), of="craft", relative_to="world")
    with mp.workdps(40):
        at = mp.mpf(seconds)
        q = [[mp.diff(lambda t, i=i: exact_pose(t)[0][i], at, n) for i in range(4)] for n in range(3)]
        p = [[float(mp.diff(lambda t, i=i: exact_pose(t)[1][i], at, n)) for i in range(3)] for n in range(3)]
        back = [q[0][0], *(-c for c in q[0][1:])]
        spins = [[float(2 * c) for c in product(q[n], back)[1:]] for n in (1, 2)]
    np.testing.assert_allclose(found.transform.rotation.wxyz, [float(c) for c in q[0]], atol=2e-15)
    np.testing.assert_allclose(found.transform.translation, p[0], atol=1e-15)
    np.testing.assert_allclose(found.velocity.angular, spins[0], atol=2e-15)
    np.testing.assert_allclose(found.velocity.linear, p[1], atol=2e-15)
    np.testing.assert_allclose(found.acceleration.angular, spins[1], atol=4e-15)
    np.testing.assert_allclose(found.acceleration.linear, p[2], atol=4e-15)


def test_rates_along_a_path_are_derivatives_of_the_pose(dtype, tol):
    def along(t):
        state = TREE.state(time=t, q={"hinge": 0.4 + 1.1 * t}, qd={"hinge": 1.1})
        return TREE.transform(state, of="hinge", relative_to="cart").translation

    zero = jnp.zeros((), dtype)
    state = TREE.state(time=zero, q={"hinge": 0.4}, qd={"hinge": 1.1})
    rate = jax.jit(lambda t: jax.jvp(along, (t,), (jnp.ones_like(t),))[1])(zero)
    np.testing.assert_allclose(TREE.velocity(state, of="hinge", relative_to="cart").linear, rate, atol=20 * tol)


def test_one_instant_a_batch_vmap_scan_and_blocks_agree(dtype, tol):
    times = jnp.linspace(-2.0, 3.0, 5, dtype=dtype)
    eager = [motion(TREE, t) for t in times]
    batch = motion(TREE, times)
    mapped = jax.vmap(lambda t: motion(TREE, t))(times)
    scanned = jax.jit(lambda times: jax.lax.scan(lambda c, t: (c, motion(TREE, t)), 0, times)[1])(times)
    many = motion(TREE, jnp.resize(times, 4100))  # more than a block, and no multiple of one
    for i in (0, 3):
        for found in (batch, mapped, scanned):
            close(jax.tree.map(lambda x, i=i: x[i], found), eager[i], 20 * tol)
        close(jax.tree.map(lambda x, i=i: x[4095 + i], many), eager[i], 20 * tol)


def test_derivatives_by_parameters_epoch_and_reference(dtype):
    def loss(tree, hi):
        return jnp.sum(motion(tree, jf.Epoch(hi, jnp.zeros_like(hi))).acceleration.as_vector() * jnp.arange(1.0, 7.0, dtype=dtype))

    hi = jnp.asarray(0.8, dtype)
    by_tree, by_time = jax.jit(jax.grad(loss, (0, 1)))(TREE, hi)
    forward = jax.jit(lambda tree: jax.jvp(lambda t: loss(t, hi), (TREE,), (tree,))[1])
    names = ("craft.params.axis", "craft.params.rate", "craft.params.radius", "craft.params.weights", "craft.since")
    h, rough = (1e-4, 1e-6) if dtype == np.float64 else (2e-2, 3e-3)
    value = jax.jit(loss)
    for name in names:
        step = np.ones(np.shape(TREE.get(name)), dtype) / 3
        if name.endswith("since"):
            step = np.array([1.0, 0.0], dtype)
        up, down = (value(TREE.with_values({name: TREE.get(name) + sign * h * step}), hi) for sign in (1, -1))
        slope = np.sum(np.asarray(by_tree.get(name)) * step)
        np.testing.assert_allclose(slope, (up - down) / (2 * h), rtol=rough, atol=rough)
        zeros = jax.tree.map(jnp.zeros_like, TREE)
        np.testing.assert_allclose(forward(zeros.with_values({name: step})), slope, rtol=100 * np.finfo(dtype).eps * 100)
    np.testing.assert_allclose(by_time, (value(TREE, hi + h) - value(TREE, hi - h)) / (2 * h), rtol=rough, atol=rough)


def test_a_gradient_through_a_scan_is_the_sum_of_gradients(dtype, tol):
    times = jnp.linspace(0.0, 1.0, 4, dtype=dtype)
    place = lambda rate, t: jnp.sum(motion(TREE.with_values({"craft.params.rate": rate}), t).velocity.linear)
    through = lambda rate: jax.lax.scan(lambda c, t: (c + place(rate, t), None), jnp.zeros((), dtype), times)[0]
    rate = jnp.full(1, RATE, dtype)
    one = jax.jit(jax.grad(place))
    np.testing.assert_allclose(jax.jit(jax.grad(through))(rate), sum(one(rate, t) for t in times), rtol=50 * tol)


def test_batches_of_parameters_broadcast(dtype, tol):
    rates, weights = jnp.linspace(0.2, 0.9, 3, dtype=dtype)[:, None], jnp.linspace(0, 1, 12, dtype=dtype).reshape(3, 2, 2)
    change = lambda i: {"craft.params.rate": rates[i], "craft.params.weights": weights[i], "cart.params": jnp.repeat(rates[i], 3, axis=-1)}
    times = jnp.asarray([[0.3], [1.1]], dtype)
    tree = TREE.with_values(change(slice(None)))
    assert tree.batch_shape == (3,)
    found = motion(tree, times, "cart")
    assert found.transform.translation.shape == (2, 3, 3)
    mapped = jax.vmap(lambda i: motion(TREE.with_values(change(i)), times[1, 0], "cart"))(jnp.arange(3))
    numbers = local_motions(tree, tree.state(time=times))
    for i in (0, 2):
        alone = motion(TREE.with_values(change(i)), times[1, 0], "cart")
        close(jax.tree.map(lambda x, i=i: x[1, i], found), alone, 20 * tol)
        close(jax.tree.map(lambda x, i=i: x[i], mapped), alone, 20 * tol)
    at = tree.names.index("craft")
    pose = tree.transform(tree.state(time=times), of="craft", relative_to="world")
    np.testing.assert_allclose(numbers[..., at, 4:7], pose.translation, rtol=20 * tol, atol=20 * tol)


def test_the_same_function_never_traces_again():
    state = TREE.state(time=0.5)
    ask = lambda tree: tree.motion(state, of="craft", relative_to="world")
    ask(TREE)
    before = len(TRACES)
    other = TREE.with_values({"craft.params.rate": 0.3})
    assert compilations(ask, other) == 0
    assert len(TRACES) == before
    make()  # another tree: the shape of what the function returns is asked for, and nothing else
    assert compilations(ask, make()) == 0


def test_time_is_counted_from_the_reference_in_two_parts(dtype):
    start = jf.Epoch.from_tdb("2026-03-01")
    tree = make(start)
    at = TREE.transform(TREE.state(time=1.3), of="craft", relative_to="world").translation
    found = tree.transform(tree.state(time=start + 1.3), of="craft", relative_to="world").translation
    np.testing.assert_allclose(found, at, rtol=0, atol=8 * float(np.finfo(dtype).eps) * RADIUS)
    narrow = tree.astype(np.float32)
    narrow_since = np.asarray(narrow.get("craft.since"), np.float64).sum()
    assert abs(narrow_since - float(start.et)) < 1e-5


def test_large_trees_by_level(rng, dtype, tol):
    b = jf.TreeBuilder()
    for i in range(24):
        edge = Function(line, rng.normal(size=3)) if i % 2 else Function(turning, (rng.normal(size=3), float(i)))
        b.add(f"f{i}", parent=f"f{i - 3}" if i > 2 else "world", edge=edge)
    tree = b.build()
    assert "by level" in tree.explain()
    state = tree.state(time=jnp.asarray([0.2, 0.4], dtype))
    together = tree.world_motions(state)
    for name in ("f22", "f23"):
        row = tree.names.index(name)
        close(jax.tree.map(lambda x, row=row: x[:, row], together), tree.motion(state, of=name, relative_to="world"), 1000 * tol)


def test_outside_its_span_everything_is_nan_with_a_code(dtype):
    tree = make(start=1.0, stop=jf.Epoch.from_et(2.0))
    state = tree.state(time=jnp.asarray([0.5, 1.0, 2.0, 2.5], dtype))
    np.testing.assert_array_equal(tree.coverage(state)["craft"], [-1, 0, 0, 1])
    found = tree.motion(state, of="craft", relative_to="world")
    for leaf in jax.tree.leaves(found):
        np.testing.assert_array_equal(np.isnan(np.asarray(leaf)).all(-1), [True, False, False, True])
    place = lambda t: tree.transform(tree.state(time=t), of="craft", relative_to="world").translation[2]
    assert np.isnan(jax.grad(place)(jnp.asarray(0.5, dtype)))
    assert np.isfinite(jax.grad(place)(jnp.asarray(1.5, dtype)))
    assert any("before the span" in line for line in tree.check(tree.state(time=0.0)))


def test_parameters_have_names_and_the_tree_says_what_the_edge_is():
    assert TREE.parameter_names("craft") == tuple(
        f"craft.{x}" for x in ("params.axis", "params.radius", "params.rate", "params.weights", "since")
    )
    assert "function whole" in str(TREE)
    assert TREE.get("craft.params.weights").shape == (2, 2)
    with pytest.raises(MissingInputError, match="function whole"):
        TREE.motion(TREE.state(), of="craft", relative_to="world")
    with pytest.raises(EdgeError, match=r"frame 'craft': .*function whole cannot be written.*jf\.edges\.family\(name=\.\.\.\)"):
        jf.to_json(TREE)


def number(params, t):
    return 3.0


REFUSED = [
    (lambda: Function("x"), EdgeError, "takes a function of"),
    (lambda: Function(number), ShapeError, r"number must return a jf.Transform, .*; found an array of shape \(\)"),
    (lambda: Function(lambda p, t: (t, t, t)), EdgeError, "found tuple; jnp.stack makes one array"),
    (lambda: Function(lambda p, t: jnp.zeros((2, 3))), ShapeError, r"an array of shape \(2, 3\) instead of \(3,\)"),
    (lambda: Function(lambda p, t: jf.Rotation(jnp.zeros(3))), ShapeError, r"wxyz of shape \(3,\) instead of \(4,\)"),
    (lambda: Function(lambda p, t: p["no"]), EdgeError, "fails for one instant"),
    (lambda: Function(line, "three"), EdgeError, "are numbers and arrays, found str"),
    (lambda: Function(line, np.ones(3), np.zeros(2)), EdgeError, "takes one epoch, found a batch"),
    (lambda: Function(line, np.ones(3), start=2.0, stop=1.0), EdgeError, "lies after its stop"),
    (lambda: Function(functools.partial(line, []), 1.0), EdgeError, "fails for one instant"),
    (lambda: jax.jit(lambda x: Function(lambda p, t: x * t).since)(np.ones(3)), EdgeError, "reads 'x', which is traced"),
    (
        lambda: motion(TREE.with_values({"craft.params.weights": np.ones((5, 3, 2))}), 0.0),
        ShapeError,
        r"takes a parameter \[\.\.\., 2, 2\]",
    ),
]


@pytest.mark.parametrize(("make", "error", "words"), REFUSED, ids=[words[:20] for _, _, words in REFUSED])
def test_what_is_wrong_is_said(make, error, words):
    with pytest.raises(error, match=words):
        make()
