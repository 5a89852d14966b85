"""Every kind of query on whatever device JAX finds: values, time a sample, share of the copy bandwidth, compile times, peers.

Run: ``PYTHONPATH=. python benchmarks/accelerator.py [--small] [--batches 1e4 1e6 1e8] [--dtype float32 float64] [--json FILE]``. It needs
jax and numpy beside the checkout and nothing else; jaxlie, brax and MJX do the same work where they are installed, and a line names those
that are not. ``--small`` is for a CPU in continuous integration, within a minute: one batch, an arm of two joints instead of seven, 1 000
frames instead of 100 000, and light from the Moon to the Earth's centre instead of a station.

Values are compared with the CPU's for the same inputs. The unit is one ulp (the spacing of floating-point numbers) at the largest component
of the result vector that a number belongs to, so that a component that happens to be near zero does not count as wrong; the worst of all
samples is printed for each part of a result, in the order value, rate, acceleration and rotation before translation. Where the device is a
CPU itself, float64 is compared with the same operations run one by one (``jax.disable_jit``), and float32 with float64. The exit code is 1
if a number is not finite or farther off than the bound of its part, which the queries below name.

The time a sample is the median of several runs with the inputs on the device; each run is waited for, so small batches show what a call
costs. The share is what a query must read and write (inputs and results) over its time, as a part of what a copy of a large array reads and
writes; small batches stay in caches and may exceed it. Lowering (with tracing) and compiling are those of the largest batch.
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
Inputs = Sequence[Any]


class Draw(NamedTuple):
    """An input: its shape without the batch, its range, and 0 or what whole numbers of the range are multiplied by."""

    shape: tuple[int, ...]
    low: float
    high: float
    unit: float = 0.0

    def spread(self, parts: Any) -> Any:
        """Return numbers of the range, of numbers from 0 to 1."""
        values = self.low + (self.high - self.low) * parts
        return values if not self.unit else values.astype(int).astype(values.dtype) * self.unit


@dataclass(frozen=True)
class Query:
    """What is measured.

    Attributes:
        name: How it is printed.
        function: Of a batch of inputs; returns arrays.
        inputs: How its inputs are drawn.
        bounds: For each array of the result: how many ulp it may be off. Sums of some hundred roundings, of which an accelerator may do
            each in another way: about four times what a CPU differs by from itself (see above), in the worse of both dtypes.
        axes: How many trailing axes make one vector (2: one matrix).
        units: What a sample counts as: its frames.
    """

    name: str
    function: Callable[..., Any]
    inputs: tuple[Draw, ...]
    bounds: tuple[float, ...]
    axes: int = 1
    units: int = 1


class Program(NamedTuple):
    """A compiled query, the seconds that tracing with lowering, and compiling, took, and the bytes of its inputs and results."""

    run: Callable[..., Any]
    lowering: float
    compiling: float
    bytes: int


class SkippedError(Exception):
    """A batch is left out; says why."""


# --- what is asked -----------------------------------------------------------------------------------------------------------


def arm(joints: int) -> jf.FrameTree:
    """Return an arm of revolute joints with random placements."""
    rng, b = np.random.default_rng(1), jf.TreeBuilder()
    for i in range(joints):
        placement = jf.Transform(jf.Rotation.from_rpy(*rng.normal(size=3)), rng.normal(size=3) * 0.3)
        b.add(f"link{i}", parent=f"link{i - 1}" if i else "world", edge=jf.edges.Revolute(axis=np.eye(3)[i % 3], placement=placement))
    return b.build()


def converted(tree: jf.FrameTree, dtype: Any) -> jf.FrameTree:
    """Return a tree in another dtype, converted by one program."""
    return jax.jit(lambda tree: tree.astype(dtype))(tree)


def weighted(values: Any) -> jax.Array:
    """Return a quadratic loss whose every number counts differently."""
    return sum(jnp.sum(x**2 * jnp.arange(1, x.shape[-1] + 1, dtype=x.dtype)) for x in jax.tree.leaves(values))


def coordinates(count: int, parts: int) -> tuple[Draw, ...]:
    """Return what makes coordinates, or coordinates, rates and accelerations."""
    return (Draw((count,), -1.5, 1.5),) * parts


EPOCHS = Draw((), FIRST, LAST, 64.0), Draw((), -32.0, 32.0)


def robot_queries(tree: jf.FrameTree) -> Iterator[Query]:
    """Yield the queries of an arm."""
    pair: Any = {"of": tree.names[-1], "relative_to": tree.root}
    pose = lambda q: tree.transform(tree.state(q=q), **pair)
    motion = lambda q, qd, qdd: tree.motion(tree.state(q=q, qd=qd, qdd=qdd), **pair)
    one, three = coordinates(tree.nq, 1), coordinates(tree.nq, 3)
    yield Query("pose", pose, one, (64, 64))
    yield Query("pose, velocity, acceleration", motion, three, (64, 64, 256, 256, 256, 512))
    yield Query("all frames", lambda q: tree.world_transforms(tree.state(q=q)), one, (64, 64))
    yield Query("Jacobian", lambda q: tree.jacobian(tree.state(q=q), **pair), one, (64,), axes=2)
    # A gradient whose parts nearly cancel is small, and counts in ulp of what is left.
    yield Query("gradient of a pose loss", jax.vmap(jax.grad(lambda q: weighted(pose(q)))), one, (1024,))
    by_state = jax.grad(lambda *state: weighted(motion(*state)), argnums=(0, 1, 2))
    yield Query("gradient of a motion loss", jax.vmap(by_state), three, (4096, 512, 512))


def sky_queries(dtype: Any, observer: str) -> Iterator[Query]:
    """Yield the queries of tables, and of light time from the Moon to an observer."""
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    for name, parent in {"emb": "ssb", "earth": "emb", "moon": "earth", "itrf93": "earth"}.items():
        b.add(name, parent=parent, edge=tables[name])
    site = jf.Transform.from_geodetic(math.radians(40.43), math.radians(-4.25), 865.0)
    b.add("station", parent="itrf93", edge=jf.edges.Fixed(site))
    tree = converted(b.build(), dtype)
    moon, itrf93 = tree.edge("moon"), tree.edge("itrf93")

    def look(*time: Any) -> Any:
        found = tree.apparent(tree.state(time=jf.Epoch.from_parts(*time)), of="moon", relative_to=observer)
        return found.position, found.velocity, found.acceleration

    yield Query("DE440 table, Moon", lambda *t: moon.evaluate(jf.Epoch.from_parts(*t), 2), EPOCHS, (16, 16, 16))
    # The Earth's angular acceleration is what is left of terms some hundred times larger.
    yield Query("ITRF93 table", lambda *t: itrf93.evaluate(jf.Epoch.from_parts(*t), 2), EPOCHS, (64, 16, 32_768))
    # Both ends are counted from the Solar System barycentre: one ulp there is 512 at the distance of the Moon.
    yield Query("light time", look, EPOCHS, (8192, 1024, 64))


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
    return Query(name, lambda q: tree.world_transforms(tree.state(q=q)), coordinates(tree.nq, 1), (64, 1024), units=tree.nq)


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
    yield "jaxlie", "gradient of a pose loss", lambda: jax.vmap(jax.grad(lambda q: weighted(jaxlie_pose(tree)(q))))
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
        self.arm = arm(2 if options.small else 7)
        self.programs: dict[Any, Program] = {}
        self.makers: dict[Any, Any] = {}
        self.made: dict[Any, list[Query]] = {}
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
        """Return all queries in a dtype, the large tree last; made once."""
        if dtype not in self.made:
            sky = sky_queries(dtype, "earth" if self.options.small else "station")
            large = frames_query(*((100, 10) if self.options.small else (10_000, 10)), dtype)
            self.made[dtype] = [*robot_queries(converted(self.arm, dtype)), *sky, large]
        return self.made[dtype]

    def inputs(self, query: Query, batch: int, dtype: Any) -> Inputs:
        """Return a batch made on the device."""

        def make() -> Inputs:
            keys = [jax.random.key(i, impl="unsafe_rbg") for i in range(len(query.inputs))]  # compiles faster than the default
            return tuple(d.spread(jax.random.uniform(k, (batch, *d.shape), dtype)) for d, k in zip(query.inputs, keys, strict=True))

        key = (query.inputs, batch, dtype)
        if key not in self.makers:
            self.makers[key] = jax.jit(make)
        return self.makers[key]()

    def program(self, query: Query, shapes: Inputs, dtype: Any, device: Any) -> Program:
        """Return a query compiled for a device, kept for the next time (SkippedError where its arrays take too much memory)."""
        key = (query.name, dtype, jax.tree.leaves(shapes)[0].shape, device)
        if key not in self.programs:
            with jax.default_device(device):
                start = time.perf_counter()
                traced = jax.jit(query.function).trace(*shapes)
                size = size_of(shapes) + size_of(traced.out_info)
                if size > MEMORY_SHARE * self.memory:
                    part = f"{MEMORY_SHARE:.0%} of {self.memory / 1e9:.3g} GB"
                    raise SkippedError(f"inputs and results of {size / 1e9:.3g} GB are more than {part}")
                lowered = traced.lower()
                middle = time.perf_counter()
                made = lowered.compile()
                self.programs[key] = Program(made, middle - start, time.perf_counter() - middle, size)
        return self.programs[key]

    def compare(self, query: Query, wide: Query, dtype: Any) -> str:
        """Compare values with the reference, keep how far they are off, and return it as text."""
        rng, count = np.random.default_rng(2), 1 if query.units > 1 else self.checked
        given = [d.spread(rng.random((count, *d.shape), np.float32)).astype(np.float32) for d in query.inputs]  # float64 holds these too

        def evaluate(query: Query, dtype: Any, device: Any) -> Any:
            inputs = [jax.device_put(x.astype(dtype), device) for x in given]
            return jax.device_get(self.program(query, inputs, dtype, device).run(*inputs))

        values = evaluate(query, dtype, self.device)
        if not self.on_cpu:
            reference = evaluate(query, dtype, self.cpu)
        elif dtype == np.float32:
            reference = evaluate(wide, np.float64, self.device)
        else:
            with jax.disable_jit():
                reference = query.function(*(jnp.asarray(x, dtype) for x in given))
        off = ulps(values, reference, query.axes)
        within = len(off) == len(query.bounds) and all(x <= bound for x, bound in zip(off, query.bounds, strict=True))
        record = {"query": query.name, "dtype": np.dtype(dtype).name, "ulp": off, "bounds": list(query.bounds), "within": within}
        self.found["values"].append(record)
        return "/".join(f"{x:.0f}" for x in off) + ("" if within else f" BEYOND {'/'.join(f'{x:g}' for x in query.bounds)}")

    def timed(self, query: Query, batch: int, dtype: Any) -> dict[str, Any] | None:
        """Time a query at a batch and keep the figures; None, with the reason printed and kept, where the device has too little memory."""
        label = {"query": query.name, "dtype": np.dtype(dtype).name, "batch": batch}
        try:
            made, seconds = self.run(query, batch, dtype)
        except SkippedError as why:
            self.found["skipped"].append({**label, "why": str(why)})
            print(f"  without {query.name} at {batch:g}: {why}", flush=True)
            return None
        times = {"ns": seconds / batch / query.units * 1e9, "share": made.bytes / seconds / self.bandwidth, "bytes": made.bytes}
        found = {**label, **times, "lowering s": made.lowering, "compiling s": made.compiling}
        self.found["times"].append(found)
        return found

    def run(self, query: Query, batch: int, dtype: Any) -> tuple[Program, float]:
        """Return a query's program for a batch and the median of its seconds (SkippedError where memory does not suffice)."""
        shapes = tuple(jax.ShapeDtypeStruct((batch, *d.shape), dtype) for d in query.inputs)
        try:
            made = self.program(query, shapes, dtype, self.device)
            inputs = self.inputs(query, batch, dtype)
            return made, median_seconds(lambda: made.run(*inputs))
        except jax.errors.JaxRuntimeError as error:
            if "RESOURCE_EXHAUSTED" not in str(error):
                raise
            raise SkippedError("the device's memory does not hold what is needed on the way") from error

    def table(self, dtype: Any) -> None:
        """Print all rows of a dtype."""
        columns = "".join(f"{f'{batch:g}: ns, share':>20s}" for batch in self.batches)
        print(f"\n{np.dtype(dtype).name:30s} lowering compiling{columns}   ulp off")
        for query, wide in zip(self.queries(dtype), self.queries(np.float64), strict=True):
            off = self.compare(query, wide, dtype)
            batches = self.batches
            if query.units > 1:
                batches = [1] if self.options.small else [1, 10] if self.on_cpu else [1, 100]
                print(f"time a frame, {' and '.join(map(str, batches))} at a time:")
            rows = [self.timed(query, batch, dtype) for batch in batches]
            spent = next((f"{r['lowering s']:6.2f} s {r['compiling s']:7.2f} s" for r in reversed(rows) if r), f"{'-':>8s} {'-':>9s}")
            cells = "".join(f"{row['ns']:14.5g} {row['share']:5.0%}" if row else f"{'-':>20s}" for row in rows)
            print(f"{query.name:30s} {spent}{cells}   {off}", flush=True)

    def peers(self, dtype: Any) -> None:
        """Time the peers that are installed, each against the query that does the same work at the same batch."""
        ours = {query.name: query for query in self.queries(dtype)}
        most = 16_384 if self.on_cpu else 1_000_000
        batch = max((b for b in self.batches if b <= most), default=min(self.batches))
        for package, same, make in peer_programs(converted(self.arm, dtype)):
            if package == "mujoco-mjx" and self.on_cpu and jax.__version_info__ < (0, 11):
                print("  without MJX: with this jax it compiles for minutes on a CPU")
                continue
            try:
                self.against(package, Query(f"{package}, {same}", make(), ours[same].inputs, ()), ours[same], batch, dtype)
            except ImportError:
                print(f"  without {package}: pip install {package} to have it in the table")
            except Exception as error:  # a peer that fails with this jax is no failure of ours
                print(f"  without {package}, {same}: {type(error).__name__}: {str(error).partition(chr(10))[0]}")

    def against(self, package: str, theirs: Query, ours: Query, batch: int, dtype: Any) -> None:
        """Time a peer and our query at a batch, print and keep the figures, and how far apart the values at the tip are."""
        inputs = self.inputs(ours, batch, dtype)
        programs = [self.program(query, inputs, dtype, self.device) for query in (theirs, ours)]
        ns, our_ns = (median_seconds(lambda run=made.run: run(*inputs)) / batch * 1e9 for made in programs)
        ends = [jax.tree.leaves(made.run(*inputs))[-1] for made in programs]  # after the rotation, whose sign is free
        if ends[0].ndim == 3:
            ends = [x[:, -1] for x in ends]
        apart = float(jnp.abs(ends[0] - ends[1]).max())
        record = {"peer": package, "query": ours.name, "dtype": np.dtype(dtype).name, "batch": batch, "ns": ns, "our ns": our_ns}
        self.found["peers"].append({**record, "compiling s": programs[0].compiling, "apart": apart})
        text = f"{ns:.4g} ns a sample, {ns / our_ns:.1f} times ours, compiled in {programs[0].compiling:.1f} s, values {apart:.0e} apart"
        print(f"  {ours.name} in {package}, batch {batch}: {text}", flush=True)


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
        if not options.no_peers and not (options.small and name != options.dtype[-1]):
            bench.peers(np.dtype(name).type)
    wrong = [f"{record['query']} in {record['dtype']}" for record in bench.found["values"] if not record["within"]]
    if options.json:
        options.json.write_text(json.dumps(bench.found, indent=1))
    print("\nall values are within their bounds" if not wrong else f"\nbeyond their bounds: {', '.join(wrong)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
