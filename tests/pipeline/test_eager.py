"""Outside of jit: the second call of a transformed query compiles nothing, also with another tree, and no tree is kept alive."""

import gc
import weakref

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from tests.compilations import compilations
from tests.pipeline.trees import queries, scene, total, turned


def arm():
    rng, b = np.random.default_rng(3), jf.TreeBuilder()
    for i in range(3):
        b.add(f"{i}", parent=f"{i - 1}" if i else "world", edge=jf.edges.Revolute(axis=np.eye(3)[i], placement=turned(rng)))
    return b.build()


TREE = arm()


def tip(tree, q):
    return tree.transform(tree.state(q=q), of="2", relative_to="world").translation


WAYS = {
    "grad": lambda q: jax.grad(lambda q: jnp.sum(tip(TREE, q)))(q),
    "vmap": lambda q: jax.vmap(lambda q: tip(TREE, q))(jnp.stack([q, q])),
    "jvp": lambda q: jax.jvp(lambda q: tip(TREE, q), (q,), (q,)),
    "jacfwd": lambda q: jax.jacfwd(lambda q: tip(TREE, q))(q),
    "hessian": lambda q: jax.hessian(lambda q: jnp.sum(tip(TREE, q)))(q),
    "vmap of grad": lambda q: jax.vmap(jax.grad(lambda q: jnp.sum(tip(TREE, q))))(jnp.stack([q, q])),
    "velocity": lambda q: jax.grad(lambda q: total(TREE.velocity(TREE.state(q=q, qd=q), of="2", relative_to="world")))(q),
    "all frames": lambda q: jax.grad(lambda q: total(TREE.world_transforms(TREE.state(q=q))))(q),
    "jacobian": lambda q: jax.grad(lambda q: total(TREE.jacobian(TREE.state(q=q), of="2", relative_to="world")))(q),
    "logarithm": lambda q: jax.grad(lambda q: total(jf.Transform(jf.Rotation.exp(q), q).log()))(q),
    "mount": lambda q: jax.grad(lambda x: jnp.sum(tip(TREE.with_values({"1.placement.translation": x}), q)))(q),
    "scan": lambda q: jax.lax.scan(_step, q, None, length=2)[0],
}


def _step(q, _):
    return q + 0.1 * tip(TREE, q), None


@pytest.mark.parametrize("name", WAYS)
def test_the_second_call_compiles_nothing(name, dtype):
    q = jnp.asarray([0.1, -0.2, 0.3], dtype)
    first = compilations(WAYS[name], q)
    assert first > 0 or name == "scan"
    assert compilations(WAYS[name], q + 0.1) == 0


def test_values_outside_of_jit_are_those_inside(dtype, tol):
    q = jnp.asarray([0.1, -0.2, 0.3], dtype)
    for name in ("grad", "jacfwd", "velocity", "mount", "logarithm"):
        np.testing.assert_allclose(WAYS[name](q), jax.jit(WAYS[name])(q), atol=10 * tol)


def test_ever_new_trees_compile_nothing_and_go(dtype):
    q = jnp.asarray([0.1, -0.2, 0.3], dtype)

    def step(i):
        mount = jf.Transform.from_translation(jnp.asarray([0.1 * i, 0.2, 0.3], dtype))
        tree = TREE.with_edge("1", TREE.edge("1").replace(placement=mount))
        return tree, jax.grad(lambda q: jnp.sum(tip(tree, q)))(q)

    step(1)
    assert compilations(lambda: [step(i)[1] for i in range(2, 5)]) == 0
    tree, _ = step(7)
    leaf = weakref.ref(tree.edge("1").placement.translation)
    del tree
    gc.collect()
    assert leaf() is None


def test_a_jitted_function_is_traced_once(dtype):
    traces = []

    @jax.jit
    def loss(tree, q):
        traces.append(1)
        return jnp.sum(tip(tree, q))

    for i in range(3):
        loss(TREE.with_values({"1.placement.translation": [0.1 * i, 0.0, 0.0]}), jnp.full(3, 0.1 * i, dtype))
    assert len(traces) == 1


@pytest.fixture
def only_new_garbage():
    """Keep what earlier tests left out of garbage collections: the leak checker collects at every trace, and walked all of it."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.float64
@pytest.mark.usefixtures("only_new_garbage")
@pytest.mark.parametrize("name", queries())
def test_nothing_leaks_and_checks_pass(name):
    query, q, t = queries()[name], jnp.asarray([0.3, 0.2]), jnp.asarray(100.0)
    gradient = jax.grad(lambda q, t: total(query(q, t)), (0, 1))
    for program, *arguments in ((query, q, t), (gradient, q, t), (jax.vmap(query, in_axes=(0, None)), q[None], t)):
        with jax.checking_leaks():
            traced = jax.jit(program).trace(*arguments)
            if program is query:
                traced.lower()
        with jax.enable_checks(True):
            jax.jit(lambda *given, program=program: program(*given)).trace(*arguments)


def test_what_primitives_keep_is_no_array():
    """Parameters hold shapes, topology and structure: hashable, equal by value."""
    tree, _ = scene()
    seen = []

    def walk(jaxpr):
        for equation in jaxpr.eqns:
            if equation.primitive.name in ("operation", "stage"):
                seen.append(equation)
                for value in equation.params.values():
                    hash(value)
                    assert not any(isinstance(leaf, (jax.Array, np.ndarray)) for leaf in jax.tree.leaves(value))
            for value in equation.params.values():
                if hasattr(value, "eqns"):
                    walk(value)
                elif hasattr(value, "jaxpr"):
                    walk(value.jaxpr)

    def trace():
        return jax.make_jaxpr(lambda q: tree.motion(tree.state(q=q, qd=q, qdd=q), of="camera", relative_to="craft"))(jnp.ones(2))

    one, other = trace(), trace()
    walk(one.jaxpr)
    assert seen
    kept = [[e.params for e in made.jaxpr.eqns if e.primitive.name == "operation"] for made in (one, other)]
    assert kept[0] == kept[1]
