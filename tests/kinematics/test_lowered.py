"""Programs of tree queries: every dot is of the highest precision, on every platform, and only CPU programs hold fences."""

import functools

import jax
import jax.numpy as jnp
import pytest

import jaxframes as jf
from tests.lowered import assert_highest_precision, products


def scene():
    b = jf.TreeBuilder(root="emb")
    tables = jf.spice.example_tables()
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("itrf93", parent="earth", edge=tables["itrf93"])
    b.add("craft", parent="earth", edge=jf.edges.Prescribed())
    b.add("arm", parent="craft", edge=jf.edges.Revolute(axis=(1, 2, 3)))
    b.add("slide", parent="arm", edge=jf.edges.Prismatic())
    b.add("load", parent="slide", edge=jf.edges.Attachable())
    return b.build()


QUERIES = {
    "motion": lambda t, s: t.motion(s, of="slide", relative_to="itrf93"),
    "through an attachable": lambda t, s: t.motion(s, of="load", relative_to="itrf93"),
    "world": lambda t, s: t.world_motions(s),
    "pairs": lambda t, s: t.transforms_between(s, of=["arm", "load"], relative_to=["itrf93"]),
    "jacobian": lambda t, s: t.jacobian(s, of="slide", relative_to="itrf93", expressed_in="craft"),
    "jacobian_dot": lambda t, s: t.jacobian_dot(s, of="slide", relative_to="itrf93"),
    "attach": lambda t, s: t.attach(s, "load", jnp.asarray(1, jnp.int32), keep="motion"),
    "gradient": lambda t, s: jax.grad(lambda q: jnp.sum(t.transform(s.replace(q=q), of="slide", relative_to="itrf93").translation))(s.q),
}


@pytest.mark.parametrize("name", QUERIES)
def test_every_dot_has_the_highest_precision_and_is_a_fence(name, dtype):
    tree = scene()
    ask = functools.partial(QUERIES[name], tree)
    state = tree.state(time=jf.Epoch.from_tdb("2026-05-01"))
    assert_highest_precision(ask, state)
    assert products(ask, state, platforms=("cpu",))
    for platform in ("cuda", "tpu"):  # no fence where none is needed
        assert not products(ask, state, platforms=(platform,))
