"""Every kind of query on whatever device JAX finds: values, time a sample, share of the copy bandwidth, compile times, peers.

Run: ``PYTHONPATH=. python benchmarks/accelerator.py [--small] [--batches 1e4 1e6 1e8] [--dtype float32 float64] [--json FILE]``. It needs
jax and numpy beside the checkout and nothing else; jaxlie, brax and MJX do the same work where they are installed, and a line names those
that are not. ``--small`` is for a CPU in continuous integration: an arm of three joints, 1 000 frames and one batch.

Values are compared with the CPU's for the same inputs. The unit is one ulp (the spacing of floating-point numbers) at the largest component
of the result vector that a number belongs to, so that a component that happens to be near zero does not count as wrong; the worst of all
samples is printed for each part of a result, in the order value, rate, acceleration and rotation before translation. Where the device is a
CPU itself, float64 is compared with the same operations run one by one (``jax.disable_jit``), and float32 with float64. The exit code is 1
if a number is not finite or farther off than the bound of its part, which the queries below name.

The time a sample is the median of several runs with the inputs on the device; each run is waited for, so small batches show what a call
costs. The share is what a query must read and write (inputs and results) over its time, as a part of what a copy of a large array reads and
writes; small batches stay in caches and may exceed it.
"""

import argparse
import json
import math
import shlex
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import jaxframes as jf

FIRST, LAST = 12_822_000, 13_311_000  # epochs of 2026, in units of 64 s past J2000: integers below 2**24, so that float32 holds them
MEMORY_SHARE = 0.4
ASSUMED_MEMORY = 4e9
Inputs = tuple[Any, ...]


@dataclass(frozen=True)
class Query:
    """What is measured.

    Attributes:
        name: How it is printed.
        function: Of a batch of inputs; returns arrays.
        inputs: Makes a batch, of (key, count, dtype); traceable.
        bounds: For each array of the result: how many ulp it may be off. Sums of some hundred roundings, of which an accelerator may do
            each in another way: about four times what a CPU differs by from itself (see above), in the worse of both dtypes.
        axes: How many trailing axes make one vector (2: one matrix).
        units: What a sample counts as: its frames.
    """

    name: str
    function: Callable[..., Any]
    inputs: Callable[[Any, int, Any], Inputs]
    bounds: tuple[float, ...]
    axes: int = 1
    units: int = 1


class Program(NamedTuple):
    """A compiled query and the seconds that tracing with lowering, and compiling, took."""

    run: Callable[..., Any]
    lowering: float
    compiling: float


# --- what is asked -----------------------------------------------------------------------------------------------------------


def arm(joints: int) -> jf.FrameTree:
    """Return an arm of revolute joints with random placements."""
    rng, b = np.random.default_rng(1), jf.TreeBuilder()
    for i in range(joints):
        placement = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3) * 0.3)
        b.add(f"link{i}", parent=f"link{i - 1}" if i else "world", edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=placement))
    return b.build()


def weighted(values: Any) -> jax.Array:
    """Return a quadratic loss whose every number counts differently."""
    return sum(jnp.sum(x**2 * jnp.arange(1, x.shape[-1] + 1, dtype=x.dtype)) for x in jax.tree.leaves(values))


def joint_values(count: int, parts: int) -> Callable[[Any, int, Any], Inputs]:
    """Return a maker of coordinates, or of coordinates, rates and accelerations."""

    def make(key: Any, batch: int, dtype: Any) -> Inputs:
        return tuple(jax.random.uniform(k, (batch, count), dtype, -1.5, 1.5) for k in jax.random.split(key, parts))

    return make


def epochs(key: Any, batch: int, dtype: Any) -> Inputs:
    """Return instants spread over 2026."""
    coarse, fine = jax.random.split(key)
    steps = jax.random.randint(coarse, (batch,), FIRST, LAST, jnp.int32).astype(dtype)
    return (jf.Epoch.from_parts(steps * 64, jax.random.uniform(fine, (batch,), dtype, -32, 32)),)


def robot_queries(tree: jf.FrameTree) -> Iterator[Query]:
    """Yield the queries of an arm."""
    pair: Any = {"of": tree.names[-1], "relative_to": tree.root}
    pose = lambda q: tree.transform(tree.state(q=q), **pair)
    motion = lambda q, qd, qdd: tree.motion(tree.state(q=q, qd=qd, qdd=qdd), **pair)
    one, three = joint_values(tree.nq, 1), joint_values(tree.nq, 3)
    yield Query("pose", pose, one, (32, 64))
    yield Query("pose, velocity, acceleration", motion, three, (32, 64, 128, 256, 256, 256))
    yield Query("all frames", lambda q: tree.world_transforms(tree.state(q=q)), one, (32, 64))
    yield Query("Jacobian", lambda q: tree.jacobian(tree.state(q=q), **pair), one, (64,), axes=2)
    yield Query("gradient of a pose loss", jax.vmap(jax.grad(lambda q: weighted(pose(q)))), one, (512,))
    by_state = jax.grad(lambda *state: weighted(motion(*state)), argnums=(0, 1, 2))
    yield Query("gradient of a motion loss", jax.vmap(by_state), three, (512, 512, 512))


def sky_queries(dtype: Any) -> Iterator[Query]:
    """Yield the queries of tables, and of light time from the Moon to a station on the Earth."""
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    for name, parent in {"emb": "ssb", "earth": "emb", "moon": "earth", "itrf93": "earth"}.items():
        b.add(name, parent=parent, edge=tables[name])
    site = jf.Transform.from_geodetic(math.radians(40.43), math.radians(-4.25), 865.0)
    b.add("station", parent="itrf93", edge=jf.edges.Fixed(site))
    tree = b.build().astype(dtype)
    moon, itrf93 = tree.edge("moon"), tree.edge("itrf93")

    def look(time: jf.Epoch) -> Any:
        found = tree.apparent(tree.state(time=time), of="moon", relative_to="station")
        return found.position, found.velocity, found.acceleration

    yield Query("DE440 table, Moon", lambda t: moon.evaluate(t, 2), epochs, (8, 16, 8))
    # The Earth's angular acceleration is what is left of terms some hundred times larger.
    yield Query("ITRF93 table", lambda t: itrf93.evaluate(t, 2), epochs, (64, 8, 16_384))
    # Both ends are counted from the Solar System barycentre: one ulp there is 512 at the distance of the Moon.
    yield Query("light time, Moon from station", look, epochs, (4096, 512, 64))


def frames_query(branches: int, depth: int, dtype: Any) -> Query:
    """Return the query for all frames of a large tree: branches of revolute joints below one root."""
    rng, b = np.random.default_rng(0), jf.TreeBuilder()
    mounts = [jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3)) for _ in range(20)]
    edges = [jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=mount).astype(dtype) for i, mount in enumerate(mounts)]
    for i in range(branches):
        for d in range(depth):
            b.add(f"{i}/{d}", parent=f"{i}/{d - 1}" if d else "world", edge=edges[(i + d) % 20])
    tree = b.build()
    name = f"{branches * depth} frames"
    return Query(name, lambda q: tree.world_transforms(tree.state(q=q)), joint_values(tree.nq, 1), (64, 256), units=tree.nq)


# --- measuring ---------------------------------------------------------------------------------------------------------------


def median_seconds(run: Callable[[], Any]) -> float:
    """Return the median of several runs after one to warm up; fewer where they take long."""
    jax.block_until_ready(run())
    seconds: list[float] = []
    while len(seconds) < 3 or (len(seconds) < 15 and sum(seconds) < 1.5):
        start = time.perf_counter()
        jax.block_until_ready(run())
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def size_of(values: Any) -> int:
    """Return the bytes of arrays or of their shapes."""
    return sum(math.prod(x.shape) * x.dtype.itemsize for x in jax.tree.leaves(values))


def ulps(found: Any, reference: Any, axes: int) -> list[float]:
    """Return how far each array is off, in ulp of the largest component of the vector; infinite where a number is not finite."""
    worst = []
    for mine, other in zip(jax.tree.leaves(found), jax.tree.leaves(reference), strict=True):
        a, b = np.asarray(mine, np.float64), np.asarray(other, np.float64)
        largest = np.abs(b).max(tuple(range(-axes, 0)), keepdims=True).astype(mine.dtype)
        off = float((np.abs(a - b) / np.spacing(largest).astype(np.float64)).max())
        worst.append(off if np.isfinite(a).all() and math.isfinite(off) else math.inf)
    return worst


def peer_programs(tree: jf.FrameTree) -> Iterator[tuple[str, str, Callable[[], Callable[..., Any]]]]:
    """Yield (peer's package, query that does the same, how to make its function of a batch of coordinates)."""
    yield "jaxlie", "pose", lambda: jax.vmap(jaxlie_pose(tree))
    yield "jaxlie", "gradient of a pose loss", lambda: jax.vmap(jax.grad(lambda q, pose=jaxlie_pose(tree): weighted(pose(q))))
    yield "brax", "all frames", lambda: brax_frames(tree)
    yield "mujoco-mjx", "all frames", lambda: mjx_frames(tree)


def chain(tree: jf.FrameTree) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return (quaternion wxyz, translation, axis) of every joint."""
    edges = [tree.edge(name) for name in tree.names[1:]]
    return [tuple(np.asarray(x) for x in (e.placement.rotation.wxyz, e.placement.translation, e.axis)) for e in edges]


def jaxlie_pose(tree: jf.FrameTree) -> Callable[[jax.Array], Any]:
    """Return the arm's tip in jaxlie: one sample."""
    import jaxlie

    def pose(q: jax.Array) -> Any:
        here = None
        for i, (wxyz, translation, axis) in enumerate(chain(tree)):
            mount = jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(jnp.asarray(wxyz)), jnp.asarray(translation))
            here = mount if here is None else here @ mount
            here = here @ jaxlie.SE3.from_rotation(jaxlie.SO3.exp(q[i] * axis))
        return here.rotation().wxyz, here.translation()

    return pose


def mjcf(tree: jf.FrameTree) -> str:
    """Return the arm as MuJoCo XML."""
    words = lambda numbers: " ".join(repr(float(x)) for x in numbers)
    text = ""
    for wxyz, translation, axis in chain(tree):
        text += f'<body pos="{words(translation)}" quat="{words(wxyz)}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        text += f'<joint type="hinge" axis="{words(axis)}"/>'
    return f"<mujoco><worldbody>{text}{'</body>' * tree.nq}</worldbody></mujoco>"


def recast(values: Any, dtype: Any) -> Any:
    """Return the floats of a pytree in another dtype."""
    change = lambda x: x.astype(dtype) if hasattr(x, "dtype") and jnp.issubdtype(x.dtype, jnp.floating) else x
    return jax.tree.map(change, values)


def brax_frames(tree: jf.FrameTree) -> Callable[[jax.Array], Any]:
    """Return the poses of all links in brax: a batch."""
    from brax import kinematics  # pyright: ignore[reportMissingImports]
    from brax.io import mjcf as reader  # pyright: ignore[reportMissingImports]

    system = recast(reader.loads(mjcf(tree)), tree.dtype)

    def one(q: jax.Array) -> Any:
        poses = kinematics.forward(system, q, jnp.zeros_like(q))[0]
        return poses.rot, poses.pos

    return jax.vmap(one)


def mjx_frames(tree: jf.FrameTree) -> Callable[[jax.Array], Any]:
    """Return the poses of all bodies in MJX: a batch."""
    import mujoco
    from mujoco import mjx  # pyright: ignore[reportAttributeAccessIssue]

    device = mjx.put_model(mujoco.MjModel.from_xml_string(mjcf(tree)))
    model, rest = recast(device, tree.dtype), recast(mjx.make_data(device), tree.dtype)

    def one(q: jax.Array) -> Any:
        found = mjx.kinematics(model, rest.replace(qpos=q))
        return found.xquat, found.xpos

    return jax.vmap(one)


class Bench:
    """One run: its device and options, the programs compiled so far, and what was found."""

    def __init__(self, options: argparse.Namespace):
        self.options, self.device, self.cpu = options, jax.devices()[0], jax.devices("cpu")[0]
        self.on_cpu = self.device.platform == "cpu"
        self.memory = (self.device.memory_stats() or {}).get("bytes_limit", ASSUMED_MEMORY)
        self.batches: list[int] = options.batches or ([1024] if options.small else [10**k for k in range(4, 7 if self.on_cpu else 9)])
        self.checked = 1024 if options.small else 2000
        self.arm = arm(3 if options.small else 7)
        self.programs: dict[Any, Program] = {}
        self.found: dict[str, Any] = {
            "device": f"{self.device.device_kind} ({self.device.platform})",
            "jax": jax.__version__,
            "command": shlex.join(["python", "benchmarks/accelerator.py", *sys.argv[1:]]),
            "values compared with": "the same operations one by one (float64), float64 (float32)" if self.on_cpu else "the CPU",
            **{kind: [] for kind in ("values", "times", "peers", "skipped")},
        }
        bandwidth_bytes = 32_000_000 if options.small else 256_000_000
        self.bandwidth = self.found["copy bytes/s"] = self.copy_bandwidth(bandwidth_bytes)
        print(f"jaxframes on {self.found['device']}, jax {jax.__version__}, {time.strftime('%Y-%m-%d')}")
        print(f"repeat it: PYTHONPATH=. {self.found['command']}")
        print(f"values: {self.checked} samples compared with {self.found['values compared with']}; ulp of each vector's largest component")
        print(f"copy: {bandwidth_bytes / 1e6:.0f} MB read and written at {self.bandwidth / 1e9:.1f} GB/s", flush=True)

    def copy_bandwidth(self, size: int) -> float:
        """Return bytes read and written a second by a pass over a large array."""
        x = jnp.ones(size // 4, jnp.float32)
        run = jax.jit(lambda x: x + 1).lower(x).compile()
        return 2 * size / median_seconds(lambda: run(x))

    def queries(self, dtype: Any) -> list[Query]:
        """Return all queries in a dtype, the large tree last."""
        large = (100, 10) if self.options.small else (10_000, 10)
        return [*robot_queries(self.arm.astype(dtype)), *sky_queries(dtype), frames_query(*large, dtype)]

    def program(self, query: Query, inputs: Inputs, dtype: Any, device: Any) -> Program:
        """Return a query compiled for inputs on a device, kept for the next time."""
        key = (query.name, np.dtype(dtype).name, jax.tree.leaves(inputs)[0].shape, device)
        if key not in self.programs:
            with jax.default_device(device):
                start = time.perf_counter()
                lowered = jax.jit(query.function).lower(*inputs)
                middle = time.perf_counter()
                self.programs[key] = Program(lowered.compile(), middle - start, time.perf_counter() - middle)
        return self.programs[key]

    def evaluate(self, query: Query, dtype: Any, device: Any) -> Any:
        """Return a query's values for the inputs that all comparisons share: float32 holds them."""
        with jax.default_device(self.cpu):
            inputs = query.inputs(jax.random.key(2), 1 if query.units > 1 else self.checked, jnp.float32)
            inputs = jax.tree.map(lambda x: x.astype(dtype), inputs)
        inputs = jax.device_put(inputs, device)
        return jax.device_get(self.program(query, inputs, dtype, device).run(*inputs))

    def one_by_one(self, query: Query, dtype: Any) -> Any:
        """Return the same values by running every operation by itself."""
        inputs = query.inputs(jax.random.key(2), 1 if query.units > 1 else self.checked, jnp.float32)
        with jax.disable_jit():
            return query.function(*jax.tree.map(lambda x: x.astype(dtype), inputs))

    def compare(self, query: Query, wide: Query, dtype: Any) -> str:
        """Compare values with the reference, keep how far they are off, and return it as text."""
        values = self.evaluate(query, dtype, self.device)
        if not self.on_cpu:
            reference = self.evaluate(query, dtype, self.cpu)
        elif dtype == np.float64:
            reference = self.one_by_one(query, dtype)
        else:
            reference = self.evaluate(wide, np.float64, self.device)
        off = ulps(values, reference, query.axes)
        record = {"query": query.name, "dtype": np.dtype(dtype).name, "ulp": off, "bounds": list(query.bounds)}
        record["within"] = len(off) == len(query.bounds) and all(x <= bound for x, bound in zip(off, query.bounds, strict=True))
        self.found["values"].append(record)
        return "/".join(f"{x:.0f}" for x in off) + ("" if record["within"] else f" BEYOND {'/'.join(f'{x:g}' for x in query.bounds)}")

    def inputs(self, query: Query, batch: int, dtype: Any) -> Inputs:
        """Return a batch made on the device."""
        return jax.jit(lambda key: query.inputs(key, batch, dtype))(jax.random.key(0))

    def timed(self, query: Query, batch: int, dtype: Any) -> dict[str, Any] | None:
        """Time a query at a batch and keep the figures; None, with the reason kept, where the device has too little memory."""
        shapes = jax.eval_shape(lambda key: query.inputs(key, batch, dtype), jax.random.key(0))
        moved = size_of(shapes) + size_of(jax.eval_shape(query.function, *shapes))
        label = {"query": query.name, "dtype": np.dtype(dtype).name, "batch": batch}
        if moved > MEMORY_SHARE * self.memory:
            self.skip(label, f"inputs and results of {moved / 1e9:.1f} GB are more than {MEMORY_SHARE:.0%} of {self.memory / 1e9:.1f} GB")
            return None
        try:
            inputs = self.inputs(query, batch, dtype)
            made = self.program(query, inputs, dtype, self.device)
            seconds = median_seconds(lambda: made.run(*inputs))
        except jax.errors.JaxRuntimeError as error:
            if "RESOURCE_EXHAUSTED" not in str(error):
                raise
            self.skip(label, "the device's memory does not hold what it needs on the way")
            return None
        times = {"ns": seconds / batch / query.units * 1e9, "share": moved / seconds / self.bandwidth, "bytes": moved}
        found = {**label, **times, "lowering s": made.lowering, "compiling s": made.compiling}
        self.found["times"].append(found)
        return found

    def skip(self, label: dict[str, Any], why: str) -> None:
        """Keep and print why a batch is left out."""
        self.found["skipped"].append({**label, "why": why})
        print(f"  without {label['query']} at {label['batch']:.0e}: {why}", flush=True)

    def table(self, dtype: Any) -> None:
        """Print all rows of a dtype."""
        columns = "".join(f"{f'{batch:.0e}'.replace('e+0', 'e') + ': ns, share':>18s}" for batch in self.batches)
        print(f"\n{np.dtype(dtype).name:30s} {'lowering':>8s} {'compiling':>9s}{columns}  ulp off")
        for query, wide in zip(self.queries(dtype), self.queries(np.float64), strict=True):
            off = self.compare(query, wide, dtype)
            large = query.units > 1
            batches = ([1] if self.options.small else [1, 10] if self.on_cpu else [1, 100]) if large else self.batches
            rows = [self.timed(query, batch, dtype) for batch in batches]
            last = next((row for row in reversed(rows) if row), {"lowering s": math.nan, "compiling s": math.nan})
            cells = "".join(f"{row['ns']:12.5g} {row['share']:4.0%}" + " " if row else f"{'-':>18s}" for row in rows)
            if large:
                print(f"{'a frame, at batches ' + ' and '.join(map(str, batches)) + ':':30s}")
            print(f"{query.name:30s} {last['lowering s']:6.2f} s {last['compiling s']:7.2f} s{cells}  {off}", flush=True)

    def peers(self, dtype: Any) -> None:
        """Time the peers that are installed, each against the query that does the same work at the same batch."""
        tree = self.arm.astype(dtype)
        ours = {query.name: query for query in robot_queries(tree)}
        batch = min(max(self.batches), 16_384 if self.on_cpu else 1_000_000)
        for package, same, make in peer_programs(tree):
            if package == "mujoco-mjx" and self.on_cpu and jax.__version_info__ < (0, 11):
                print("  without MJX: under this jax it compiles for minutes on a CPU")
                continue
            try:
                rival = Query(f"{package}, {same}", make(), ours[same].inputs, ())
                inputs = self.inputs(rival, batch, dtype)
                made, mine = (self.program(q, inputs, dtype, self.device) for q in (rival, ours[same]))
                theirs, own = (median_seconds(lambda p=p: p.run(*inputs)) / batch * 1e9 for p in (made, mine))
            except ImportError:
                print(f"  without {package}: pip install {package} to have it in the table")
                continue
            except Exception as error:  # a peer that fails with this jax is not our failure
                print(f"  without {package}, {same}: {type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}")
                continue
            apart = jax.tree.map(lambda a, b: float(jnp.abs(a[..., -1, :] - b[..., -1, :]).max()), made.run(*inputs), mine.run(*inputs))
            record = {"peer": package, "query": same, "dtype": np.dtype(dtype).name, "batch": batch, "ns": theirs, "our ns": own}
            self.found["peers"].append({**record, "compiling s": made.compiling})
            print(f"  {same} in {package}, batch {batch}: {theirs:.4g} ns a sample, {theirs / own:.1f} times ours; {apart}", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print all tables and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    count = lambda text: int(float(text))
    parser.add_argument("--small", action="store_true", help="tiny: for continuous integration on a CPU")
    parser.add_argument("--batches", type=count, nargs="+", help="default: 1e4 to 1e8 by tens, to 1e6 on a CPU")
    parser.add_argument("--dtype", nargs="+", choices=("float64", "float32"), default=["float64", "float32"])
    parser.add_argument("--json", type=Path, help="write all figures there")
    parser.add_argument("--no-peers", action="store_true", help="leave jaxlie, brax and MJX out")
    options = parser.parse_args(arguments)
    jax.config.update("jax_enable_x64", True)
    bench = Bench(options)
    for name in options.dtype:
        bench.table(np.dtype(name).type)
        if not options.no_peers:
            bench.peers(np.dtype(name).type)
    wrong = [f"{record['query']} in {record['dtype']}" for record in bench.found["values"] if not record["within"]]
    if options.json:
        options.json.write_text(json.dumps(bench.found, indent=1))
    print("\nall values are within their bounds" if not wrong else f"\nbeyond their bounds: {', '.join(wrong)}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
