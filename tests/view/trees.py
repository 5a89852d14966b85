"""Trees that pages are tried on: every kind of edge, a fleet of robots, and a large random tree with attachable frames."""

import numpy as np

import jaxframes as jf
from tests.random_trees import unit

ROBOTS = "tests/data/robots"


def row(motion):
    """The 19 numbers of a Motion in the order of ``local_motions``."""
    t, v, a = motion.transform, motion.velocity, motion.acceleration
    parts = (t.rotation.wxyz, t.translation, v.angular, v.linear, a.angular, a.linear)
    return np.concatenate([np.asarray(part, np.float64) for part in parts])


def mount(rng):
    return jf.Transform(jf.Rotation.from_quaternion_wxyz(unit(rng, 4)), rng.normal(size=3) + 0)


def every_kind(rng):
    """A small tree with an edge of every family, and a state in which everything moves."""
    e = jf.edges
    joints = {
        "revolute": e.Revolute(rng.normal(size=3), mount(rng)),
        "continuous": e.Continuous(rng.normal(size=3), mount(rng)),
        "prismatic": e.Prismatic(rng.normal(size=3), mount(rng)),
        "screw": e.Screw(rng.normal(size=3), 0.3, mount(rng)),
        "cylindrical": e.Cylindrical(rng.normal(size=3), mount(rng)),
        "universal": e.Universal(mount(rng)),
        "spherical": e.Spherical(mount(rng)),
        "prismatic_spherical": e.PrismaticSpherical(mount(rng)),
        "prismatic_universal": e.PrismaticUniversal(mount(rng)),
        "planar": e.Planar(rng.normal(size=3), mount(rng)),
        "ball": e.Ball(mount(rng)),
        "free": e.Free(mount(rng)),
        "virtual": e.Virtual(2, mount(rng)),
        "follower": e.Mimic("revolute", e.Revolute(rng.normal(size=3), mount(rng)), multiplier=-1.5, offset=0.2),
        "movable": e.Movable(mount(rng)),
        "prescribed": e.Prescribed(),
        "mount": e.Fixed(mount(rng)),
        "box": e.Attachable(mount(rng)),
    }
    b = jf.TreeBuilder(root="world")
    parent = "world"
    for i, (name, edge) in enumerate(joints.items()):
        b.add(name, parent=parent, edge=edge)
        parent = name if i % 3 else "world"
    tree = b.build()
    state = tree.state(q=rng.normal(size=tree.nq) + 0.1, qd=rng.normal(size=tree.nv), qdd=rng.normal(size=tree.nv))
    for name in ("prescribed", "movable"):
        numbers = rng.normal(size=(4, 3)) + 0
        state = tree.set_motion(state, name, mount(rng), jf.SpatialVelocity(*numbers[:2]), jf.SpatialAcceleration(*numbers[2:]))
    return tree, state


def fleet(rng, count=312):
    """Robots of 14 links below one root, each with a finger that follows the other."""
    robot = jf.load_urdf(f"{ROBOTS}/panda.urdf")
    b = jf.TreeBuilder(root="hall")
    for i in range(count):
        b.include(robot, parent="hall", prefix=f"r{i}/")
    tree = b.build()
    return tree, tree.state(q=rng.normal(size=tree.nq), qd=rng.normal(size=tree.nv), qdd=rng.normal(size=tree.nv))


def large(rng, count=5000, every=20):
    """A random tree of many kinds of joints; every twentieth frame is attachable."""
    e = jf.edges
    kinds = [
        lambda: e.Fixed(jf.Transform.from_translation(rng.normal(size=3) + 0)),
        *(lambda kind=kind: kind(rng.normal(size=3)) for kind in (e.Revolute, e.Prismatic, e.Screw, e.Cylindrical, e.Planar)),
        *(lambda kind=kind: kind(mount(rng)) for kind in (e.Ball, e.Free, e.Universal, e.Spherical, e.Movable)),
    ]
    b = jf.TreeBuilder(root="f0")
    for i in range(1, count):
        parent = f"f{rng.integers(max(0, i - 60), i)}"
        loose = every and i % every == 0
        edge = e.Attachable(candidates=(parent, "f0", "f1")) if loose else kinds[rng.integers(len(kinds))]()
        b.add(f"f{i}", parent=parent, edge=edge)
    tree = b.build()
    return tree, tree.state(q=rng.normal(size=tree.nq) + 0.1, qd=rng.normal(size=tree.nv), qdd=rng.normal(size=tree.nv))
