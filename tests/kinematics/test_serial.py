"""Long paths whose edges repeat, worked out by a scan: the same values and derivatives as the path taken frame by frame."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.kinematics.plan import PIECE, repeats


def rigid(rng):
    return jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))


def snake(rng, pattern, count):
    """A line of frames whose kinds of edges repeat: R turns, P slides, F is fixed."""
    b = jf.TreeBuilder(root="base")
    for i in range(count):
        kind = pattern[i % len(pattern)]
        if kind == "F":
            edge = jf.edges.Fixed(rigid(rng))
        else:
            edge = (jf.edges.Revolute if kind == "R" else jf.edges.Prismatic)(axis=rng.normal(size=3), placement=rigid(rng))
        b.add(f"{i}", parent=f"{i - 1}" if i else "base", edge=edge)
    return b.build()


def parts(motion):
    return [motion.transform.rotation.to_matrix(), motion.transform.translation, *jax.tree.leaves((motion.velocity, motion.acceleration))]


def given(rng, tree, dtype, batch=()):
    return [jnp.asarray(rng.normal(size=(*batch, tree.nv)), dtype) for _ in range(3)]


def ask(tree, of, relative_to="base"):
    return lambda q, qd, qdd: parts(tree.motion(tree.state(q=q, qd=qd, qdd=qdd), of=of, relative_to=relative_to))


def scans(function, *arguments):
    return str(jax.make_jaxpr(function)(*arguments)).count("scan[")


@pytest.mark.parametrize(("pattern", "count"), [("R", 31), ("RFP", 47)])
def test_motions_along_repeating_paths(pattern, count, rng, dtype):
    tree = snake(rng, pattern, count)
    state = given(rng, tree, dtype)
    tip = ask(tree, str(count - 1))
    assert scans(tip, *state) == 1
    made = jax.jit(tip)(*state)
    held = tree.state(**dict(zip(("q", "qd", "qdd"), state, strict=True)))
    wanted = parts(tree.world_motions(held)[tree.names.index(str(count - 1))])  # one frame after the other, unrolled
    for a, b in zip(made, wanted, strict=True):
        np.testing.assert_allclose(a, b, atol=(1e-11 if dtype == np.float64 else 2e-3) * max(1.0, float(np.abs(b).max())))


@pytest.mark.float64
def test_every_kind_of_batch_and_the_way_back(rng, dtype):
    tree = snake(rng, "R", 30)
    state = given(rng, tree, dtype, (2, 3))
    tip = ask(tree, "29")
    native = jax.jit(tip)(*state)
    mapped = jax.jit(jax.vmap(jax.vmap(tip)))(*state)
    bound = 1e-11
    for i, (a, m) in enumerate(zip(native, mapped, strict=True)):
        np.testing.assert_allclose(a, m, atol=bound * max(1.0, float(np.abs(m).max())))
        one = jax.jit(tip)(*(x[1, 2] for x in state))[i]
        np.testing.assert_allclose(a[1, 2], one, atol=bound * max(1.0, float(np.abs(one).max())))
    backward = jax.jit(ask(tree, "base", "29"))(*state)
    turn, place = native[:2]
    np.testing.assert_allclose(backward[0], jnp.swapaxes(turn, -1, -2), atol=bound)
    here = -jnp.einsum("...ji,...j->...i", turn, place, precision="highest")
    np.testing.assert_allclose(backward[1], here, atol=bound * float(np.abs(here).max()))


@pytest.mark.slow
@pytest.mark.float64
def test_both_sides_of_an_ancestor(rng, dtype):
    b = jf.TreeBuilder(root="base")
    for side in "ab":
        for i in range(22):
            edge = jf.edges.Revolute(axis=rng.normal(size=3), placement=rigid(rng))
            b.add(f"{side}{i}", parent=f"{side}{i - 1}" if i else "base", edge=edge)
    tree = b.build()
    state = given(rng, tree, dtype)
    across = ask(tree, "b21", "a21")
    assert scans(across, *state) == 2
    held = tree.state(**dict(zip(("q", "qd", "qdd"), state, strict=True)))
    wanted = parts(tree.motion(held, of="base", relative_to="a21") @ tree.motion(held, of="b21", relative_to="base"))
    for a, b in zip(jax.jit(across)(*state), wanted, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-11 * max(1.0, float(np.abs(b).max())))


@pytest.mark.slow
@pytest.mark.float64
def test_first_and_second_derivatives_through_the_scan(rng):
    tree = snake(rng, "RP", 26)
    state = given(rng, tree, np.float64)
    step = given(rng, tree, np.float64)

    def along(s, change):
        q, qd, qdd = (a + s * b for a, b in zip(state, step, strict=True))
        moved = tree.with_edge("7", tree.edge("7").replace(placement=jf.Transform.from_translation(change) @ tree.edge("7").placement))
        found = moved.motion(moved.state(q=q, qd=qd, qdd=qdd), of="25", relative_to="base")
        return sum(jnp.sum(x * jnp.cos(jnp.arange(x.size)).reshape(x.shape)) for x in parts(found)) / 100

    assert scans(along, 0.0, jnp.zeros(3)) == 1
    gradient = jax.jit(jax.grad(along, (0, 1)))
    by_time, by_place = gradient(0.0, jnp.zeros(3))
    h, value = 1e-5, jax.jit(along)
    assert np.isclose(by_time, (value(h, jnp.zeros(3)) - value(-h, jnp.zeros(3))) / (2 * h), rtol=1e-7)
    for i in range(3):
        ends = [value(0.0, s * h * jnp.eye(3)[i]) for s in (1, -1)]
        assert np.isclose(by_place[i], (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-6)
    second = jax.jit(jax.grad(jax.grad(along)))(0.0, jnp.zeros(3))
    ends = [gradient(s * h, jnp.zeros(3))[0] for s in (1, -1)]
    assert np.isclose(second, (ends[0] - ends[1]) / (2 * h), rtol=1e-6)


def test_programs_do_not_grow_with_the_path(rng, dtype):
    def size(count):
        tree = snake(rng, "R", count)
        return len(str(jax.make_jaxpr(ask(tree, str(count - 1)))(*given(rng, tree, dtype))))

    # What is listed for each edge are numbers: places and columns.
    assert size(200) < 1.3 * size(50)


def test_which_paths_repeat(rng):
    for pattern, count, wanted in (("R", 31, 5), ("RFP", 47, 5), ("F", 40, None), ("R", 12, None)):
        tree = snake(rng, pattern, count)
        found = repeats(tree.topology, list(range(1, count + 1)), PIECE[2])
        if wanted is None:
            assert found is None
        else:
            assert found.pieces == count // len(found.groups)
            assert sum(kind != "F" for kind in (pattern * 10)[: len(found.groups)]) <= wanted
    irregular = jf.TreeBuilder(root="base")
    for i in range(30):
        kind = jf.edges.Revolute if i % 7 and i % 11 else jf.edges.Prismatic
        irregular.add(f"{i}", parent=f"{i - 1}" if i else "base", edge=kind(axis=(0, 0, 1)))
    assert repeats(irregular.build().topology, list(range(1, 31)), PIECE[2]) is None
