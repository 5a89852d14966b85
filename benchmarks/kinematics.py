"""Robot kinematics against Pinocchio, jaxlie, brax and MJX on the same machine in the same run, printed as ratios.

Run: ``python benchmarks/kinematics.py [--batch N] [--talos talos_full_v2.urdf]``. Peers that are not installed are left out with a line
that names the package (``pin``, ``jaxlie``, ``brax``, ``mujoco-mjx``). Pinocchio runs on one thread, called sample by sample from Python;
the same call on a model without joints is subtracted, so that its C++ alone is counted.

Results of many frames are large: most of their time goes into memory that is new to the process (docs/performance.md). glibc's huge pages
halve it: ``GLIBC_TUNABLES=glibc.malloc.hugetlb=1 python benchmarks/kinematics.py``.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import _robot_peers as peers
import jax
import jax.numpy as jnp
import numpy as np
from _timing import compiled, interleaved, nanoseconds

import jaxframes as jf

PANDA = Path(__file__).resolve().parent.parent / "tests/data/robots/panda.urdf"
TIP = "panda_leftfinger"


def weighted(values: Any) -> jax.Array:
    """Return a quadratic loss whose every number counts differently."""
    return sum(jnp.sum(x**2 * jnp.arange(1, x.shape[-1] + 1, dtype=x.dtype)) for x in jax.tree.leaves(values))


class Robot:
    """A robot's queries between its root and one of its frames."""

    def __init__(self, tree: jf.FrameTree, tip: str, batch: int, dtype: Any):
        self.tree, self.pair = tree.astype(dtype), {"of": tip, "relative_to": tree.root}
        rng = np.random.default_rng(0)
        self.q, self.qd, self.qdd = (jnp.asarray(rng.normal(size=(batch, n)) * 0.5, dtype) for n in (tree.nq, tree.nv, tree.nv))

    def pose(self, q: jax.Array) -> jf.Transform:
        return self.tree.transform(self.tree.state(q=q), **self.pair)

    def world(self, q: jax.Array) -> jf.Transform:
        return self.tree.world_transforms(self.tree.state(q=q))

    def motion(self, q: jax.Array, qd: jax.Array, qdd: jax.Array) -> jf.Motion:
        return self.tree.motion(self.tree.state(q=q, qd=qd, qdd=qdd), **self.pair)

    def jacobian(self, q: jax.Array) -> jax.Array:
        return self.tree.jacobian(self.tree.state(q=q), **self.pair)

    def pose_gradient(self, q: jax.Array) -> jax.Array:
        return jax.grad(lambda q: weighted(self.pose(q)))(q)

    def motion_gradient(self, *state: jax.Array) -> Any:
        return jax.grad(lambda *s: weighted(self.motion(*s)), argnums=(0, 1, 2))(*state)


def row(
    what: str, ours: Callable[..., Any], arguments: tuple, samples: int, rivals: dict[str, tuple[Callable[[], Any], int, float]]
) -> float:
    """Time ours and its rivals in turn and print one line; a rival is (run, its samples, nanoseconds a sample to subtract)."""
    made, seconds = compiled(ours, *arguments)
    runs = interleaved({"": lambda: made(*arguments), **{name: run for name, (run, _, _) in rivals.items()}}, 15)
    mine = nanoseconds(runs[""], samples)[0]
    text = ", ".join(f"{(nanoseconds(runs[name], count)[0] - spent) / mine:.1f}x {name}" for name, (_, count, spent) in rivals.items())
    size = sum(" = " in line for line in made.as_text().splitlines())
    print(f"{what:58s} {mine:8.1f} ns a sample, compiled in {seconds:4.1f} s ({size} instructions)   {text}", flush=True)
    return mine


def panda(batch: int, with_mjx: bool) -> None:
    for dtype in (np.float64, np.float32):
        robot = Robot(jf.load_urdf(PANDA), TIP, batch, dtype)
        name = np.dtype(dtype).name
        pin = peers.pinocchio(PANDA, TIP)
        q, qd, qdd = robot.q, robot.qd, robot.qdd
        forward = row(f"Panda tip pose, {name}", robot.pose, (q,), batch, pin.get("pose", {}))
        if dtype == np.float32:
            row(f"Panda tip pose + velocity + acceleration, {name}", robot.motion, (q, qd, qdd), batch, pin.get("motion", {}))
            continue
        row("the same", robot.pose, (q,), batch, peers.jax_peers(robot.tree, TIP, batch, with_mjx))
        row("Panda all poses as [B, n, 4] and [B, n, 3]", robot.world, (q,), batch, pin.get("pose", {}))
        row("Panda tip pose + velocity + acceleration", robot.motion, (q, qd, qdd), batch, pin.get("motion", {}))
        row("Panda tip Jacobian", robot.jacobian, (q,), batch, pin.get("jacobian", {}))
        spent = row("gradient of a pose loss", robot.pose_gradient, (q,), batch, peers.jaxlie_gradient(robot.tree, TIP, batch))
        print(f"{'':58s} {spent / forward:8.2f} times the pose itself")
        row("gradient of a loss on the motion by q, qd, qdd", robot.motion_gradient, (q, qd, qdd), batch, pin.get("derivatives", {}))


def long_motion(what: str, tree: jf.FrameTree, tip: str, batch: int) -> None:
    """Time the gradient of a loss on a motion against the motion itself."""
    robot = Robot(tree, tip, batch, np.float64)
    state = robot.q, robot.qd, robot.qdd
    forward = row(f"{what}: motion", robot.motion, state, batch, {})
    spent = row(f"{what}: gradient of a loss on it", robot.motion_gradient, state, batch, {})
    print(f"{'':58s} {spent / forward:8.2f} times the motion itself")


def serial(joints: int) -> jf.FrameTree:
    """Return a chain of revolute joints with random placements."""
    rng, b = np.random.default_rng(1), jf.TreeBuilder()
    for i in range(joints):
        placement = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3) * 0.1)
        b.add(f"{i}", parent=f"{i - 1}" if i else "world", edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=placement))
    return b.build()


def dispatch() -> None:
    """Time one sample: the call of a ready program, and a step of a loop."""
    tree = jf.load_urdf(PANDA)
    state = tree.state()
    empty = jax.jit(lambda tree, state: state.q)
    query = jax.jit(lambda tree, state: tree.transform(state, of=TIP, relative_to=tree.root))
    runs = {
        "an empty program": lambda: empty(tree, state),
        "a jitted query": lambda: query(tree, state),
        "an eager query": lambda: tree.transform(state, of=TIP, relative_to=tree.root),
    }
    many = {name: (lambda run=run: [run() for _ in range(2000)][-1]) for name, run in runs.items()}
    found = {name: nanoseconds(seconds, 2000)[0] for name, seconds in interleaved(many, 9).items()}
    for name, ns in found.items():
        print(f"{'one sample, ' + name:58s} {ns / 1e3:8.2f} us, {ns / found['an empty program']:.2f} times the empty one")

    def step(carry: jax.Array, _: None) -> tuple[jax.Array, None]:
        tip = tree.transform(tree.state(q=carry), of=TIP, relative_to=tree.root)
        return carry + 1e-3 * tip.translation[0], None

    loop, _ = compiled(lambda q: jax.lax.scan(step, q, None, length=10_000)[0], state.q)
    ns = nanoseconds(interleaved({"": lambda: loop(state.q)}, 9)[""], 10_000)[0]
    print(f"{'one step of lax.scan with the tip pose':58s} {ns / 1e3:8.2f} us")


def main() -> None:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--batch", type=int, default=65_536)
    parser.add_argument("--talos", type=Path, help="URDF of Talos (package example-robot-data: talos_data/robots/talos_full_v2.urdf)")
    parser.add_argument("--no-mjx", action="store_true", help="leave MJX out: under jax 0.10 it compiles for minutes")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"jax {jax.__version__}, batch {options.batch}, {time.strftime('%Y-%m-%d')}")
    panda(options.batch, not options.no_mjx)
    if options.talos:
        tree = jf.load_urdf(options.talos)
        robot = Robot(tree, "arm_left_7_link", options.batch, np.float64)
        rival = peers.pinocchio(options.talos, "arm_left_7_link").get("pose", {})
        row(f"Talos ({tree.nq} coordinates, {len(tree.names)} frames) all poses", robot.world, (robot.q,), options.batch, rival)
        long_motion("Talos's left hand", tree, "arm_left_7_link", options.batch // 4)
    long_motion("chain of 60 joints", serial(60), "59", options.batch // 4)
    dispatch()


if __name__ == "__main__":
    main()
