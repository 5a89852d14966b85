"""A user's own edge families, made of public names: in trees, transformations, large trees and files."""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import EdgeError, MissingInputError
from tests.compilations import compilations

steps = jf.edges.steps
PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "extending.md"


@jf.edges.family(name="test.elevator", static=("floors",))
class Elevator(jf.edges.Edge):
    """A cage that rises along z by ``height * q ** floors`` and turns by q about z, two steps."""

    nq = nv = 1
    height: jax.Array
    placement: jf.Transform
    floors: int

    def steps(self, inputs, order):
        (q,), (qd,), (qdd,), (height,) = inputs.q, inputs.qd, inputs.qdd, inputs.components(self.height)
        n, up = self.floors, steps.V3(0.0, 0.0, 1.0)
        rate2 = n * (n - 1) * q ** (n - 2) * qd * qd + n * q ** (n - 1) * qdd
        rise = steps.Coordinate(height * q**n, height * n * q ** (n - 1) * qd, height * rate2)
        return steps.TranslationStep(up, rise, *inputs.pose(self.placement)), steps.RotationStep(up, steps.Coordinate(q, qd, qdd))


@jf.edges.family(name="test.carousel")
class Carousel(jf.edges.Edge):
    """A gondola on a circle about z, at a rate of its own since J2000: a motion given outright, a function of time."""

    needs_time = True
    radius: jax.Array
    rate: jax.Array

    def steps(self, inputs, order):
        (radius,), (rate,) = inputs.components(self.radius), inputs.components(self.rate)
        hi, lo = inputs.time
        sin, cos = steps.sin_cos(rate * (hi + lo))
        place = steps.V3(radius * cos, radius * sin, 0.0)
        rates = steps.V3(-place.y * rate, place.x * rate, 0.0)
        return (steps.Rigid(translation=place, linear=rates, linear2=place * (-rate * rate)),)


@jf.edges.family()
class Nameless(jf.edges.Edge):
    """A rise without a name for files."""

    height: jax.Array

    def steps(self, inputs, order):
        return (steps.Rigid(translation=steps.V3(0.0, 0.0, *inputs.components(self.height))),)


MOUNT = jf.Transform.from_translation((0.1, -0.2, 0.3))


def house():
    b = jf.TreeBuilder(root="ground")
    b.add("hinge", parent="ground", edge=jf.edges.Revolute((0, 1, 0), MOUNT))
    b.add("cage", parent="hinge", edge=Elevator(0.7, MOUNT, 3))
    b.add("arm", parent="cage", edge=jf.edges.Revolute((1, 0, 0), MOUNT))
    b.add("copy", parent="arm", edge=jf.edges.Mimic("cage", Elevator(0.2, MOUNT, 2), multiplier=-0.5, offset=0.3))
    return b.build()


TREE = house()
Q = np.array([0.3, 0.8, -0.4])


def expected_matrix(q):
    """The pose of ``copy`` in ``ground`` by hand."""
    rot = {"x": lambda a: [[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]}
    rot["y"] = lambda a: [[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]]
    rot["z"] = lambda a: [[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]]

    def pose(rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), translation=(0, 0, 0)):
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = rotation, translation
        return out

    mount, follower = pose(translation=(0.1, -0.2, 0.3)), -0.5 * q[1] + 0.3
    cage = pose(translation=(0, 0, 0.7 * q[1] ** 3)) @ pose(rot["z"](q[1]))
    copy = pose(translation=(0, 0, 0.2 * follower**2)) @ pose(rot["z"](follower))
    return mount @ pose(rot["y"](q[0])) @ mount @ cage @ mount @ pose(rot["x"](q[2])) @ mount @ copy


def matrix(q):
    return TREE.transform(TREE.state(q=q), of="copy", relative_to="ground").to_matrix()


def test_a_family_works_as_the_others_do(dtype, tol):
    np.testing.assert_allclose(matrix(Q.astype(dtype)), expected_matrix(Q), atol=10 * tol)
    assert TREE.joint_names == ("hinge", "cage", "arm")
    assert "elevator" in str(TREE)
    assert TREE.edge("cage").state_size == TREE.edge("cage").dof == 1


def test_rates_and_accelerations_are_the_derivatives_of_the_pose(dtype, tol):
    qd, qdd = np.array([0.5, -1.2, 0.7], dtype), np.array([0.2, 0.4, -0.9], dtype)
    place = lambda t: matrix(jnp.asarray(Q, dtype) + qd * t + qdd * t * t / 2)[:3, 3]
    rate = lambda t: jax.jvp(place, (t,), (jnp.ones_like(t),))[1]
    zero = jnp.zeros((), dtype)
    state = TREE.state(q=Q.astype(dtype), qd=qd, qdd=qdd)
    motion = TREE.motion(state, of="copy", relative_to="ground")
    np.testing.assert_allclose(motion.velocity.linear, rate(zero), atol=20 * tol)
    np.testing.assert_allclose(motion.acceleration.linear, jax.jvp(rate, (zero,), (jnp.ones_like(zero),))[1], atol=40 * tol)
    jacobian = TREE.jacobian(state, of="copy", relative_to="ground")
    np.testing.assert_allclose(jacobian @ qd, motion.velocity.as_vector(), atol=20 * tol)


def test_derivatives_by_its_numbers_and_batches_of_them(dtype):
    state = TREE.state(q=Q.astype(dtype))
    place = lambda height: TREE.with_values({"cage.height": height}).transform(state, of="copy", relative_to="ground").translation
    exact = jax.jacrev(place)(jnp.full(1, 0.7, dtype))[:, 0]
    h = 0.125  # the place is linear in the height
    np.testing.assert_allclose(exact, (place([0.7 + h]) - place([0.7 - h])) / (2 * h), atol=1e-12 if dtype == np.float64 else 1e-5)
    heights = jnp.linspace(0.1, 0.9, 5, dtype=dtype)[:, None]
    by_axes, by_vmap = place(heights), jax.vmap(place)(heights)
    np.testing.assert_allclose(by_axes, by_vmap, atol=1e-6)
    np.testing.assert_allclose(by_axes[2], place(heights[2]), atol=1e-6)


def test_one_program_for_all_numbers():
    state = TREE.state()
    place = jax.jit(lambda tree, state: tree.transform(state, of="copy", relative_to="ground").translation)
    place(TREE, state)
    other = TREE.with_edge("cage", Elevator(0.1, jf.Transform.identity(), 3))
    assert compilations(place, other, state) == 0
    with pytest.raises(EdgeError, match="its floors is 4 instead of 3"):
        TREE.with_edge("cage", Elevator(0.1, jf.Transform.identity(), 4))


def test_large_trees_by_level(rng, dtype, tol):
    b = jf.TreeBuilder(root="f0")
    kinds = (
        lambda: Elevator(rng.normal(), jf.Transform.from_translation(rng.normal(size=3)), 2),
        lambda: jf.edges.Revolute(rng.normal(size=3)),
        lambda: Carousel(rng.normal(), rng.normal()),
    )
    for i in range(1, 91):
        b.add(f"f{i}", parent=f"f{rng.integers(max(0, i - 12), i)}", edge=kinds[i % 3]())
    tree = b.build()
    assert "level" in tree.explain()
    state = tree.state(q=rng.normal(size=tree.nq).astype(dtype), qd=rng.normal(size=tree.nv).astype(dtype), time=1.5)
    together = jax.jit(lambda s: tree.world_motions(s))(state)
    for name in ("f90", "f89", "f88"):
        alone = tree.motion(state, of=name, relative_to="f0")
        row = tree.names.index(name)
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(a[row], b, atol=200 * tol * max(1.0, float(np.abs(b).max())))


def test_long_paths_with_functions_of_time(rng, dtype, tol):
    b = jf.TreeBuilder(root="f0")
    for i in range(1, 41):
        b.add(f"f{i}", parent=f"f{i - 1}", edge=Carousel(rng.normal(), rng.normal()) if i % 2 else jf.edges.Revolute((1, 0, 0)))
    tree = b.build()
    state = tree.state(q=rng.normal(size=tree.nq).astype(dtype), time=2.0)
    whole = tree.transform(state, of="f40", relative_to="f0").translation
    each = jax.jit(lambda s: [tree.transform(s, of=f"f{i}", relative_to=f"f{i - 1}").to_matrix() for i in range(1, 41)])(state)
    np.testing.assert_allclose(whole, np.linalg.multi_dot(each)[:3, 3], atol=100 * tol)


def test_a_function_of_time(dtype):
    b = jf.TreeBuilder()
    b.add("gondola", parent="world", edge=Carousel(5.0, 0.25))
    tree = b.build()
    motion = jax.vmap(lambda t: tree.motion(tree.state(time=t), of="gondola", relative_to="world"))(jnp.array([0.0, 2.0], dtype))
    angle = np.array([0.0, 0.5])
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    np.testing.assert_allclose(motion.transform.translation, 5 * circle, atol=1e-5)
    np.testing.assert_allclose(motion.acceleration.linear, -5 * 0.25**2 * circle, atol=1e-6)
    with pytest.raises(MissingInputError, match="carousel"):
        tree.transform(tree.state(), of="gondola", relative_to="world")
    assert tree.check(tree.state(time=0.0)) == ()


@pytest.mark.float64
def test_the_page_runs_as_written_and_its_family_has_twenty_lines():
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len([line for line in blocks[0].splitlines() if line.strip()]) <= 20
    scope = {"__name__": "tests.page_on_extending"}
    exec("\n".join(blocks), scope)
    tree, motion = scope["tree"], scope["motion"]
    height = 0.3 + 0.02 * (1 - np.cos(0.5))
    np.testing.assert_allclose(motion.transform.translation, [0.1, 0, height], rtol=1e-12)
    np.testing.assert_allclose(motion.velocity.linear, [0, 0, 0.02 * np.sin(0.5) * 100], rtol=1e-12)
    np.testing.assert_allclose(motion.acceleration.linear, [0, 0, 0.02 * np.cos(0.5) * 1e4], rtol=1e-12)
    np.testing.assert_allclose(scope["by_throw"], [1 - np.cos(0.5)], rtol=1e-12)
    assert scope["again"].topology == tree.topology


def test_what_is_no_family_is_refused_by_name():
    class Plain(Elevator):
        """Derived from a family, and not decorated."""

    b = jf.TreeBuilder()
    with pytest.raises(EdgeError, match=r"frame 'x': Plain is no edge family yet; decorate the class with @jf\.edges\.family\(\)"):
        b.add("x", parent="world", edge=Plain(0.7, MOUNT, 3))
    with pytest.raises(EdgeError, match="no edge family; derive it from"):
        jf.edges.family()(type("Loose", (), {}))
    with pytest.raises(EdgeError, match=r"a decorator without any is @family\(\)"):
        jf.edges.family(Plain)
    with pytest.raises(EdgeError, match="no field 'floor' to be static"):
        jf.edges.family(static=("floor",))(Plain)
    with pytest.raises(EdgeError, match="a field 'nq', which every edge has"):
        jf.edges.family()(type("Typed", (jf.edges.Edge,), {"__annotations__": {"nq": int}, "nq": 1}))
    with pytest.raises(EdgeError, match=r"'revolute' is the name of jaxframes\.edges\.axis_joints\.Revolute already"):
        jf.edges.family(name="revolute")(type("Mine", (jf.edges.Edge,), {}))
    with pytest.raises(EdgeError, match=r"Elevator\(height=...\) is a parameter, so it takes numbers or arrays, found 'high'"):
        Elevator("high", MOUNT, 3)


def test_a_family_defined_again_takes_the_place_of_the_one_before():
    def define():
        @jf.edges.family(name="test.again")
        class Again(jf.edges.Edge):
            height: jax.Array

        return Again

    assert define() is not define()


@jf.edges.family(static=("target",))
class Halfway(jf.edges.Edge):
    """A frame halfway between its parent and another frame: it reads that one's motion."""

    target: str

    @property
    def reads(self):
        return (jf.edges.Read(self.target, None),)

    def steps(self, inputs, order):
        seen = inputs.motions[0].motion
        return (steps.Rigid(translation=seen.translation * 0.5, linear=seen.linear * 0.5, linear2=seen.linear2 * 0.5),)


def test_a_family_that_reads_other_frames(dtype, tol):
    b = jf.TreeBuilder()
    b.add("gondola", parent="world", edge=Carousel(5.0, 0.25))
    b.add("middle", parent="world", edge=Halfway("gondola"))
    tree = b.build()
    state = tree.state(time=jnp.asarray(2.0, dtype))
    whole, half = (tree.motion(state, of=name, relative_to="world") for name in ("gondola", "middle"))
    np.testing.assert_allclose(half.transform.translation, whole.transform.translation / 2, atol=tol)
    np.testing.assert_allclose(half.velocity.linear, whole.velocity.linear / 2, atol=tol)
    np.testing.assert_allclose(half.acceleration.linear, whole.acceleration.linear / 2, atol=tol)
