"""Derivatives by geometry: of poses and motions by joint values, rates and every parameter, against finite differences; long chains."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.kinematics import plan
from jaxframes.kinematics.plan import MAX_UNROLLED, SPAN


def rigid(rng):
    return jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3))


def arm(rng, joints):
    """Turns and slides with mounts in between."""
    b = jf.TreeBuilder()
    for i in range(joints):
        kind = jf.edges.Prismatic if i % 4 == 3 else jf.edges.Revolute
        b.add(f"j{i}", parent=f"m{i - 1}" if i else "world", edge=kind(axis=rng.normal(size=3), placement=rigid(rng)))
        b.add(f"m{i}", parent=f"j{i}", edge=jf.edges.Fixed(rigid(rng)))
    return b.build()


def numbers(tree, q, of, relative_to):
    motion = tree.motion(tree.state(q=q[0], qd=q[1], qdd=q[2]), of=of, relative_to=relative_to)
    matrix = motion.transform.rotation.to_matrix().reshape(-1)
    rest = (motion.transform.translation, *jax.tree.leaves((motion.velocity, motion.acceleration)))
    return jnp.concatenate([matrix, *rest])


@pytest.mark.float64
@pytest.mark.parametrize("joints", [3, pytest.param(9, marks=pytest.mark.slow)])
def test_first_and_second_derivatives_by_the_state(rng, joints):
    tree = arm(rng, joints)
    q, step = rng.normal(size=(2, 3, joints))

    def along(s):
        return numbers(tree, q + s * step, f"m{joints - 1}", "m0")

    value, first, second = (jax.jit(f) for f in (along, jax.jacfwd(along), jax.jacfwd(jax.jacrev(along))))
    h = 1e-5
    scale = 1 + np.abs(first(0.0)).max()
    assert np.allclose(first(0.0), (value(h) - value(-h)) / (2 * h), atol=1e-8 * scale)
    assert np.allclose(second(0.0), (first(h) - first(-h)) / (2 * h), atol=1e-7 * (1 + np.abs(second(0.0)).max()))


@pytest.mark.float64
def test_derivatives_by_every_parameter(rng):
    tree = arm(rng, 4)
    q = rng.normal(size=(3, 4))

    def along(s, change):
        placed = [e.placement for e in (tree.edge("j1"), tree.edge("j3"))]
        turn = jf.Rotation.from_rotation_vector(change[0] * s)
        made = tree
        for name, old in zip(("j1", "j3"), placed, strict=True):
            pose = jf.Transform(turn @ old.rotation, old.translation + change[1] * s)
            axis = jf.Rotation.from_rotation_vector(change[2] * s) @ tree.edge(name).axis
            made = made.with_edge(name, made.edge(name).replace(placement=pose, axis=axis))
        return numbers(made, q, "m3", "world")

    change = rng.normal(size=(3, 3))
    value = jax.jit(lambda s: along(s, change))
    forward, reverse = (jax.jit(lambda s, d=d: d(lambda x: along(x, change))(s)) for d in (jax.jacfwd, jax.jacrev))
    h = 1e-5
    expected = (value(h) - value(-h)) / (2 * h)
    assert np.allclose(forward(0.0), expected, atol=1e-7)
    assert np.allclose(reverse(0.0), forward(0.0), atol=1e-12)


def chain(rng, count, branch_every=0):
    b = jf.TreeBuilder()
    for i in range(count):
        parent = "world" if i == 0 else f"{i - 1}"
        if branch_every and i % branch_every == 0 and i:
            parent = f"{rng.integers(i)}"
        pose = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), 0.1 * rng.normal(size=3))
        b.add(f"{i}", parent=parent, edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=pose))
    return b.build()


@pytest.mark.parametrize("branch_every", [0, 7])
def test_deep_trees_in_segments_agree_with_plain_recursion(rng, dtype, branch_every):
    tree = chain(rng, MAX_UNROLLED + 1 + 2 * SPAN + 3, branch_every)
    q = rng.normal(size=(2, tree.nq))
    world = jax.jit(lambda q: tree.world_transforms(tree.state(q=q)))(jnp.asarray(q, dtype))
    matrix = np.tile(np.eye(4), (2, len(tree.names), 1, 1))
    for i, name in enumerate(tree.names[1:], 1):
        edge = tree.edge(name)
        joint = np.asarray(jf.Rotation.from_axis_angle(np.asarray(edge.axis), q[:, i - 1, None][:, 0]).to_matrix(), np.float64)
        turn = np.tile(np.eye(4), (2, 1, 1))
        turn[:, :3, :3] = joint
        matrix[:, i] = matrix[:, tree.topology.parents[i]] @ np.asarray(edge.placement.to_matrix(), np.float64) @ turn
    atol = 1e-11 if dtype == np.float64 else 2e-3
    assert np.allclose(world.translation, matrix[..., :3, 3], atol=atol)
    assert np.allclose(world.rotation.to_matrix(), matrix[..., :3, :3], atol=atol)


def test_plans_cover_every_frame_once_and_keep_parents(rng):
    for count in (1, 2, 40, 400):
        parents = np.array([-1, *(int(rng.integers(max(0, i - 3), i)) for i in range(1, count))])
        stages = plan.staged(parents)
        listed = np.concatenate([level.frames for level in stages.levels])
        assert sorted(listed) == list(range(count))
        starts = stages.levels[-1].frames[stages.starts]
        for above, level in zip((None, *stages.levels), stages.levels, strict=False):
            for i, frame in enumerate(level.frames):
                if level.above is not None:
                    assert above.frames[level.above[i]] == parents[frame]
                elif parents[frame] >= 0:
                    assert starts[level.start[i] - 1] == parents[frame]


def test_the_way_is_explained(rng):
    assert "unrolled" in arm(rng, 3).explain()
    assert "in segments" in chain(rng, MAX_UNROLLED + 1).explain()
    assert "composed one after another" in arm(rng, 3).explain(of="m2", relative_to="j0")
    assert "in 2 pieces of up to 5 moving edges" in arm(rng, 10).explain(of="m9", relative_to="world")
    assert "by a scan over 13 alike pieces of 5 edges" in chain(rng, 65).explain(of="64", relative_to="world")
