"""Programs of tree queries: no dot of lower precision on any platform, and only CPU programs hold stages and polynomials."""

import functools
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

import jaxframes as jf
from jaxframes.kinematics import unrolled as whole
from tests.lowered import assert_highest_precision, stages

PANDA = Path(__file__).resolve().parent.parent / "data/robots/panda.urdf"


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
def test_only_cpu_programs_hold_what_cpus_need(name, dtype):
    tree = scene()
    ask = functools.partial(QUERIES[name], tree)
    state = tree.state(time=jf.Epoch.from_tdb("2026-05-01"))
    assert_highest_precision(ask, state)
    assert stages(ask, state, platforms=("cpu",))
    for platform in ("cuda", "tpu"):
        text = jax.jit(ask).trace(state).lower(lowering_platforms=(platform,)).as_text()
        assert "inlineable" not in text
        assert "round_nearest_even" not in text, "sine and cosine are the platform's own"
        assert "stablehlo.while" not in text or name in ("jacobian_dot", "through an attachable"), "batches are not cut into blocks"


def test_large_batches_are_cut_into_blocks_on_a_cpu_alone():
    tree = jf.load_urdf(PANDA)
    q = jnp.zeros((whole.BLOCK * 3 + 7, tree.nq))
    ask = lambda q: tree.world_transforms(tree.state(q=q))
    for platform, loops in (("cpu", True), ("cuda", False), ("tpu", False)):
        text = jax.jit(ask).trace(q).lower(lowering_platforms=(platform,)).as_text()
        assert ("stablehlo.while" in text) == loops
