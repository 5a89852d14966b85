"""Errors of poses, velocities and accelerations in float32 and float64, by length scale, against 80-bit arithmetic.

Two scenes: an arm of seven joints whose links are L long, and two frames 3 m apart whose root is L away. Prints the table of
docs/float32.md. No peer: the oracle is the same motion worked out in NumPy's long double.
"""

import jax
import jax.numpy as jnp
import numpy as np

import jaxframes as jf

SAMPLES, JOINTS, APART = 2000, 7, 3.0
SCALES = {"robot": 1.0, "runway": 3e3, "low orbit": 7e6, "Moon": 4e8, "1 au": 1.5e11}
Long = np.longdouble


def arm(length, rng):
    """Return a tree of joints whose links have a length, and its axes and placements as they are in float32."""
    b, axes, places = jf.TreeBuilder(root="base"), rng.normal(size=(JOINTS, 3)), []
    for i in range(JOINTS):
        shift = rng.normal(size=3)
        shift = (shift * (length / np.linalg.norm(shift))).astype(np.float32)
        axis = np.eye(3)[np.argmax(np.abs(axes[i]))]
        axes[i] = axis
        places.append(shift)
        placement = jf.Transform.from_translation(np.asarray(shift, np.float64))
        b.add(f"{i}", parent=f"{i - 1}" if i else "base", edge=jf.edges.Revolute(axis=axis, placement=placement))
    return b.build(), axes, np.array(places)


def oracle(axes, places, q, qd, qdd):
    """Return rotation matrix, position, velocity, acceleration of the tip and its angular acceleration, in long double."""
    count = len(q)
    turn = np.broadcast_to(np.eye(3, dtype=Long), (count, 3, 3))
    place, speed, push, spin, bend = (np.zeros((count, 3), Long) for _ in range(5))
    rotate = lambda m, v: np.einsum("nij,nj->ni", m, np.broadcast_to(v, (count, 3)))
    for i in range(JOINTS):
        r = rotate(turn, places[i].astype(Long))
        push = push + np.cross(bend, r) + np.cross(spin, np.cross(spin, r))
        speed, place = speed + np.cross(spin, r), place + r
        axis = rotate(turn, axes[i].astype(Long))
        rate = axis * qd[:, i, None].astype(Long)
        bend = bend + axis * qdd[:, i, None].astype(Long) + np.cross(spin, rate)
        spin = spin + rate
        s, c = np.sin(q[:, i].astype(Long)), np.cos(q[:, i].astype(Long))
        k = axes[i].astype(Long)
        cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]], Long)
        joint = np.eye(3, dtype=Long) + s[:, None, None] * cross + (1 - c)[:, None, None] * (cross @ cross)
        turn = np.einsum("nij,njk->nik", turn, joint)
    return turn, place, speed, push, bend


def of_an_arm(length, dtype):
    """Return the worst errors of the tip: rad, and parts of the length for position, velocity and acceleration."""
    rng = np.random.default_rng(0)
    tree, axes, places = arm(length, rng)
    q, qd, qdd = (rng.normal(size=(SAMPLES, JOINTS)).astype(np.float32) for _ in range(3))
    tree = tree.astype(dtype)
    ask = jax.jit(lambda q, qd, qdd: tree.motion(tree.state(q=q, qd=qd, qdd=qdd), of=f"{JOINTS - 1}", relative_to="base"))
    motion = ask(*(jnp.asarray(x, dtype) for x in (q, qd, qdd)))
    turn, place, speed, push, _ = oracle(axes, places, q, qd, qdd)
    w, x, y, z = np.asarray(motion.transform.rotation.wxyz, np.float64).astype(Long).T
    columns = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
               [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
               [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]  # fmt: skip
    matrix = np.moveaxis(np.array(columns), -1, 0)
    rotation = np.sqrt(((matrix - turn) ** 2).sum((1, 2)) / 2).max()
    pairs = ((motion.transform.translation, place), (motion.velocity.linear, speed), (motion.acceleration.linear, push))
    return [float(rotation), *(float(np.abs(np.asarray(a).astype(Long) - b).max() / length) for a, b in pairs)]


def behind_a_root(length, dtype):
    """Return the error (m) of the distance between two frames 3 m apart, whose root is far away."""
    b = jf.TreeBuilder(root="root")
    b.add("far", parent="root", edge=jf.edges.Prescribed())
    b.add("a", parent="far", edge=jf.edges.Revolute(axis=(0, 0, 1)))
    b.add("b", parent="far", edge=jf.edges.Fixed(jf.Transform.from_translation((APART, 0.0, 0.0))))
    tree = b.build().astype(dtype)
    state = tree.set_motion(tree.state(q=[0.7]), "far", jf.Transform.from_translation((length, -length, length)))
    found = tree.transform(jax.tree.map(lambda x: jnp.asarray(x, dtype), state), of="b", relative_to="a").translation
    wanted = APART * np.array([np.cos(Long(np.dtype(dtype).type(0.7))), -np.sin(Long(np.dtype(dtype).type(0.7))), 0], Long)
    return float(np.abs(np.asarray(found).astype(Long) - wanted).max())


def main():
    """Print the table."""
    jax.config.update("jax_enable_x64", True)
    if np.finfo(Long).eps > 2e-19:
        raise SystemExit("NumPy's long double has no 64-bit mantissa on this machine: there is no oracle.")
    print(
        "| scale | L, m | dtype | tip: rotation, rad | position, L | velocity, L/s | acceleration, L/s2 | 3 m apart behind L: position, m |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name, length in SCALES.items():
        for dtype in (np.float32, np.float64):
            errors = [*of_an_arm(length, dtype), behind_a_root(length, dtype)]
            print(f"| {name} | {length:.1e} | {np.dtype(dtype).name} | " + " | ".join(f"{e:.1e}" for e in errors) + " |")


if __name__ == "__main__":
    main()
