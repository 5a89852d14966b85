"""The peers of the robot benchmarks, those that are installed: Pinocchio in C++, and jaxlie, brax and MJX under JAX."""

import time
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import jaxframes as jf

SAMPLES = 4000
Rivals = dict[str, tuple[Any, int, float]]


def _missing(package: str) -> None:
    print(f"  without {package}: pip install {package} to have it in the table")


def pinocchio(path: Path, tip: str) -> dict[str, Rivals]:
    """Return Pinocchio's runs by name; empty where it is not installed."""
    try:
        import pinocchio as pin  # pyright: ignore[reportMissingImports]
    except ImportError:
        _missing("pin")
        return {}
    model = pin.buildModelFromUrdf(str(path))
    data, frame = model.createData(), model.getFrameId(tip)
    rng = np.random.default_rng(0)
    qs = [pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv) * 0.5) for _ in range(SAMPLES)]
    rates = [(rng.normal(size=model.nv), rng.normal(size=model.nv)) for _ in range(SAMPLES)]
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def pose() -> None:
        for q in qs:
            pin.forwardKinematics(model, data, q)

    def motion() -> None:
        for q, (v, a) in zip(qs, rates, strict=True):
            pin.forwardKinematics(model, data, q, v, a)

    def jacobian() -> None:
        for q in qs:
            pin.computeJointJacobians(model, data, q)
            pin.getFrameJacobian(model, data, frame, world)

    def derivatives() -> None:
        for q, (v, a) in zip(qs, rates, strict=True):
            pin.computeForwardKinematicsDerivatives(model, data, q, v, a)
            pin.getFrameAccelerationDerivatives(model, data, frame, world)

    empty = pin.Model()
    nothing, none = empty.createData(), np.zeros(0)

    def call() -> None:
        for _ in qs:
            pin.forwardKinematics(empty, nothing, none)

    def call_with_rates() -> None:
        for _ in qs:
            pin.forwardKinematics(empty, nothing, none, none, none)

    once, with_rates = (min(_seconds(f) for _ in range(9)) / SAMPLES * 1e9 for f in (call, call_with_rates))
    return {
        "pose": {"Pinocchio": (pose, SAMPLES, once)},
        "motion": {"Pinocchio": (motion, SAMPLES, with_rates)},
        "jacobian": {"Pinocchio": (jacobian, SAMPLES, 2 * once)},
        "derivatives": {"Pinocchio": (derivatives, SAMPLES, with_rates + once)},
    }


def _seconds(run: Any) -> float:
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def _chain(tree: jf.FrameTree, tip: str) -> list[tuple[np.ndarray, np.ndarray, np.ndarray | None, str]]:
    """Return (quaternion, translation, axis or None, kind) of every edge from the root to a tip."""
    found = []
    for frame in tree.topology.down_path(0, tree.topology.index(tip)):
        edge = tree.edge(tree.names[frame])
        placement = edge.transform if isinstance(edge, jf.edges.Fixed) else edge.placement
        kind = type(edge).__name__
        axis = None if kind == "Fixed" else np.asarray(edge.axis)
        found.append((np.asarray(placement.rotation.wxyz), np.asarray(placement.translation), axis, kind))
    return found


def _jaxlie_tip(tree: jf.FrameTree, tip: str) -> Any:
    import jaxlie

    edges = _chain(tree, tip)

    def pose(q: jax.Array) -> Any:
        here, i = jaxlie.SE3.identity(), 0
        for wxyz, translation, axis, kind in edges:
            here = here @ jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(jnp.asarray(wxyz)), jnp.asarray(translation))
            if axis is None:
                continue
            still = jnp.zeros(3)
            tangent = jnp.concatenate([still, q[i] * axis] if kind != "Prismatic" else [q[i] * axis, still])
            here, i = here @ jaxlie.SE3.exp(tangent), i + 1
        return here.rotation().wxyz, here.translation()

    return pose


def jaxlie_gradient(tree: jf.FrameTree, tip: str, batch: int) -> Rivals:
    """Return the gradient of the same loss through jaxlie; empty where it is not installed."""
    try:
        pose = _jaxlie_tip(tree, tip)
    except ImportError:
        _missing("jaxlie")
        return {}
    loss = lambda q: sum(jnp.sum(x**2 * jnp.arange(1, x.shape[-1] + 1, dtype=x.dtype)) for x in pose(q))
    return {"jaxlie": _run(jax.vmap(jax.grad(loss)), _joints(tree, min(batch, 16_384)))}


def jax_peers(tree: jf.FrameTree, tip: str, batch: int, with_mjx: bool) -> Rivals:
    """Return the tip pose by jaxlie, brax and MJX, those that are installed, each at a batch that suits it."""
    found: Rivals = {}
    try:
        found["jaxlie"] = _run(jax.vmap(_jaxlie_tip(tree, tip)), _joints(tree, min(batch, 16_384)))
    except ImportError:
        _missing("jaxlie")
    text = _mjcf(_chain(tree, tip))
    q = _joints(tree, min(batch, 8_192))
    try:
        from brax import kinematics  # pyright: ignore[reportMissingImports]
        from brax.io import mjcf  # pyright: ignore[reportMissingImports]

        system = mjcf.loads(text)
        joints = q[:, : system.q_size()].astype(system.init_q.dtype)
        found["brax"] = _run(jax.vmap(lambda x: kinematics.forward(system, x, jnp.zeros_like(x))[0]), joints)
    except ImportError:
        _missing("brax")
    if not with_mjx:
        return found
    try:
        import mujoco
        from mujoco import mjx  # pyright: ignore[reportAttributeAccessIssue]

        model = mujoco.MjModel.from_xml_string(text)
        device = mjx.put_model(model)
        rest = mjx.make_data(device)
        forward = jax.vmap(lambda x: (d := mjx.kinematics(device, rest.replace(qpos=x))) and (d.xpos, d.xquat))
        slow = jax.__version__ < "0.11"  # there it takes hundreds of microseconds a sample
        found["MJX"] = _run(forward, q[: 256 if slow else None, : model.nq].astype(rest.qpos.dtype))
    except ImportError:
        _missing("mujoco-mjx")
    return found


def _joints(tree: jf.FrameTree, batch: int) -> jax.Array:
    return jnp.asarray(np.random.default_rng(0).normal(size=(batch, tree.nq)) * 0.5)


def _run(function: Any, q: jax.Array) -> tuple[Any, int, float]:
    made = jax.jit(function).lower(q).compile()
    return (lambda: made(q)), len(q), 0.0


def _mjcf(edges: list[tuple[np.ndarray, np.ndarray, np.ndarray | None, str]]) -> str:
    """Return the chain as MuJoCo XML."""
    words = lambda numbers: " ".join(repr(float(x)) for x in numbers)
    text, close = "", ""
    for wxyz, translation, axis, kind in edges:
        text += f'<body pos="{words(translation)}" quat="{words(wxyz)}">'
        if axis is not None:
            text += '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
            text += f'<joint type="{"slide" if kind == "Prismatic" else "hinge"}" axis="{words(axis)}"/>'
        close += "</body>"
    return f"<mujoco><worldbody>{text}{close}</worldbody></mujoco>"
