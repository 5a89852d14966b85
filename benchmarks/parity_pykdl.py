"""Compare the value types with a live PyKDL on fresh random inputs: ``python benchmarks/parity_pykdl.py [count] [seed]``.

Needs PyKDL (Debian: python3-pykdl) importable from the Python that runs this; leaves with a message where it is not. Prints one line
a function: the largest difference over the largest number, and fails if one is above 1e-12.
"""

import sys
from pathlib import Path

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from tests.spatial.golden import PYKDL as OURS  # noqa: E402

LIMIT = 1e-12


class Live:
    """Inputs and outputs of PyKDL as the golden files write them."""

    def __init__(self, kdl):
        self.kdl = kdl

    def vector(self, v):
        """Return a vector of PyKDL."""
        return self.kdl.Vector(*map(float, v))

    def rotation(self, m):
        """Return a rotation of PyKDL."""
        return self.kdl.Rotation(*map(float, np.ravel(m)))

    def frame(self, f):
        """Return a frame of PyKDL."""
        return self.kdl.Frame(self.rotation(f["M"]), self.vector(f["p"]))

    def twist(self, t):
        """Return a twist of PyKDL."""
        return self.kdl.Twist(self.vector(t["vel"]), self.vector(t["rot"]))

    def wrench(self, w):
        """Return a wrench of PyKDL."""
        return self.kdl.Wrench(self.vector(w["force"]), self.vector(w["torque"]))

    def plain(self, x):
        """Return a value of PyKDL as arrays."""
        kdl = self.kdl
        if isinstance(x, kdl.Vector):
            return np.array([x[i] for i in range(3)])
        if isinstance(x, kdl.Rotation):
            return np.array([[x[i, j] for j in range(3)] for i in range(3)])
        if isinstance(x, kdl.Frame):
            return {"M": self.plain(x.M), "p": self.plain(x.p)}
        if isinstance(x, kdl.Twist):
            return {"vel": self.plain(x.vel), "rot": self.plain(x.rot)}
        if isinstance(x, kdl.Wrench):
            return {"force": self.plain(x.force), "torque": self.plain(x.torque)}
        return np.asarray(x, float)

    def table(self):
        """Return {function: (kinds of inputs, PyKDL's answer)}."""
        kdl, v, r, f, t = self.kdl, self.vector, self.rotation, self.frame, self.twist

        def integrated(F, t_, freq):
            pose = f(F)
            pose.Integrate(t(t_), freq)
            return pose

        return {
            "Vector.cross": ({"a": "v", "b": "v"}, lambda a, b: v(a) * v(b)),
            "Vector.Norm": ({"a": "v"}, lambda a: v(a).Norm()),
            "dot.vector": ({"a": "v", "b": "v"}, lambda a, b: kdl.dot(v(a), v(b))),
            "Rotation.Rot": ({"axis": "v", "angle": "s"}, lambda axis, angle: kdl.Rotation.Rot(v(axis), angle)),
            "Rotation.RPY": ({"r": "s", "p": "s", "y": "s"}, lambda r, p, y: kdl.Rotation.RPY(r, p, y)),
            "Rotation.EulerZYX": ({"z": "s", "y": "s", "x": "s"}, lambda z, y, x: kdl.Rotation.EulerZYX(z, y, x)),
            "Rotation.EulerZYZ": ({"z1": "s", "y": "s", "z2": "s"}, lambda z1, y, z2: kdl.Rotation.EulerZYZ(z1, y, z2)),
            "Rotation.GetRPY": ({"R": "R"}, lambda R: r(R).GetRPY()),
            "Rotation.GetEulerZYX": ({"R": "R"}, lambda R: r(R).GetEulerZYX()),
            "Rotation.GetEulerZYZ": ({"R": "R"}, lambda R: r(R).GetEulerZYZ()),
            "Rotation.GetQuaternion": ({"R": "R"}, lambda R: r(R).GetQuaternion()),
            "Rotation.GetRot": ({"R": "R"}, lambda R: r(R).GetRot()),
            "Rotation.mul": ({"A": "R", "B": "R"}, lambda A, B: r(A) * r(B)),
            "Rotation.mul_vector": ({"R": "R", "v": "v"}, lambda R, v: r(R) * self.vector(v)),
            "Rotation.Inverse": ({"R": "R"}, lambda R: r(R).Inverse()),
            "Frame.mul": ({"A": "F", "B": "F"}, lambda A, B: f(A) * f(B)),
            "Frame.Inverse": ({"F": "F"}, lambda F: f(F).Inverse()),
            "Frame.mul_vector": ({"F": "F", "v": "v"}, lambda F, v: f(F) * self.vector(v)),
            "Frame.mul_twist": ({"F": "F", "t": "T"}, lambda F, t: f(F) * self.twist(t)),
            "Frame.mul_wrench": ({"F": "F", "w": "W"}, lambda F, w: f(F) * self.wrench(w)),
            "Frame.Integrate": ({"F": "F", "t": "T", "freq": "p"}, lambda F, t, freq: integrated(F, t, freq)),
            "Frame.DH": ({"a": "s", "alpha": "s", "d": "s", "theta": "s"}, lambda a, alpha, d, theta: kdl.Frame.DH(a, alpha, d, theta)),
            "Frame.DH_Craig1989": (
                {"a": "s", "alpha": "s", "d": "s", "theta": "s"},
                lambda a, alpha, d, theta: kdl.Frame.DH_Craig1989(a, alpha, d, theta),
            ),
            "diff.rotation": ({"a": "R", "b": "R", "dt": "p"}, lambda a, b, dt: kdl.diff(r(a), r(b), dt)),
            "diff.frame": ({"a": "F", "b": "F", "dt": "p"}, lambda a, b, dt: kdl.diff(f(a), f(b), dt)),
            "addDelta.frame": ({"F": "F", "t": "T", "dt": "p"}, lambda F, t, dt: kdl.addDelta(f(F), self.twist(t), dt)),
            "addDelta.rotation": ({"R": "R", "w": "v", "dt": "p"}, lambda R, w, dt: kdl.addDelta(r(R), v(w), dt)),
            "Twist.RefPoint": ({"t": "T", "v": "v"}, lambda t, v: self.twist(t).RefPoint(self.vector(v))),
            "Wrench.RefPoint": ({"w": "W", "v": "v"}, lambda w, v: self.wrench(w).RefPoint(self.vector(v))),
            "dot.twist_wrench": ({"t": "T", "w": "W"}, lambda t, w: kdl.dot(self.twist(t), self.wrench(w))),
        }


def fresh(kind, rng):
    """Return one random input of a kind, as the golden files write it."""
    if kind == "s":
        return float(rng.uniform(-3, 3))
    if kind == "p":
        return float(rng.uniform(0.1, 3))
    if kind == "v":
        return rng.normal(size=3)
    if kind == "R":
        q, upper = np.linalg.qr(rng.normal(size=(3, 3)))
        q = q * np.sign(np.diag(upper))
        return q * np.sign(np.linalg.det(q))
    names = {"F": {"M": "R", "p": "v"}, "T": {"vel": "v", "rot": "v"}, "W": {"force": "v", "torque": "v"}}[kind]
    return {name: fresh(part, rng) for name, part in names.items()}


def difference(name, ours, theirs):
    """Return the largest difference over 1 + the largest number; Euler angles wrap."""
    a, b = (np.concatenate([np.ravel(np.asarray(x, float)) for x in jax.tree.leaves(tree)]) for tree in (ours, theirs))
    gap = a - b
    if name.startswith("Rotation.GetE") or name == "Rotation.GetRPY":
        gap -= 2 * np.pi * np.round(gap / (2 * np.pi))
    return float(np.abs(gap).max() / (1 + np.abs(b).max()))


def main():
    """Run the comparison; return the exit code."""
    try:
        import PyKDL
    except ImportError:
        print("PyKDL is not installed for this Python (Debian: python3-pykdl); nothing compared")
        return 0
    count, seed = (int(a) for a in (*sys.argv[1:], *("200", "0")[len(sys.argv) - 1 :]))
    live, rng, failed = Live(PyKDL), np.random.default_rng(seed), 0
    for name, (kinds, theirs) in live.table().items():
        inputs = [{key: fresh(kind, rng) for key, kind in kinds.items()} for _ in range(count)]
        batch = jax.tree.map(lambda *leaves: np.stack(leaves), *inputs)
        ours = jax.jit(jax.vmap(lambda given, name=name: OURS[name](**given)))(batch)
        worst = max(
            difference(name, jax.tree.map(lambda x, i=i: x[i], ours), live.plain(theirs(**given))) for i, given in enumerate(inputs)
        )
        failed += worst > LIMIT
        print(f"{name:24s} {count} cases  {worst:.1e}{'  DIFFERS' if worst > LIMIT else ''}")
    print(f"{failed} of {len(live.table())} functions differ by more than {LIMIT}")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
