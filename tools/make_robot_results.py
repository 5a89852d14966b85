"""Make the results of Pinocchio that the always-run tests compare with: needs the extra ``robots`` (package ``pin``).

``python tools/make_robot_results.py`` writes tests/data/robots/pinocchio.npz from the URDF files beside it.
"""

import sys
from pathlib import Path

import jax
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

import jaxframes as jf  # noqa: E402
from tests.pinocchio_oracle import Robot  # noqa: E402

FOLDER = ROOT / "tests" / "data" / "robots"
STATES = 2


def main() -> None:
    """Write the results."""
    rng, found = np.random.default_rng(20260301), {}
    for path in sorted(FOLDER.glob("*.urdf")):
        tree, robot, rows, jacobians = jf.load_urdf(path), Robot(path), [], []
        places = np.asarray(tree.random(jax.random.key(len(rows)), (STATES,)))
        values = np.stack([places, *rng.normal(size=(2, STATES, tree.nq))]).astype(np.float32).astype(np.float64)
        for q, qd, qdd in values.swapaxes(0, 1):
            named = [dict(zip(tree.joint_names, map(float, row), strict=True)) for row in (q, qd, qdd)]
            parts = robot.motions(tree.names, *named)
            rows.append(np.concatenate([part.reshape(len(tree.names), -1) for part in parts], -1))
            jacobians.append(robot.jacobian(tree.names[-1], tree.joint_names, *named))
        for name, value in zip(("q", "qd", "qdd"), values, strict=True):
            found[f"{path.stem}/{name}"] = value
        found[f"{path.stem}/motion"], found[f"{path.stem}/jacobian"] = np.array(rows), np.array(jacobians)
    np.savez_compressed(FOLDER / "pinocchio.npz", **found)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
