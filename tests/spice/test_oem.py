"""Orbit ephemeris messages against CSPICE: the same states as an SPK of type 9 or 13."""

import numpy as np
import pytest

import jaxframes as jf
from tests.io.test_oem import HEAD, SECONDS, text
from tests.spice import orbits


@pytest.mark.float64
@pytest.mark.parametrize(("method", "kind", "degree"), [("LAGRANGE", 9, 7), ("LAGRANGE", 9, 3), ("HERMITE", 13, 3)])
def test_a_message_is_what_cspice_makes_of_the_same_states(tmp_path, cspice, method, kind, degree):
    """Positions and velocities of the edge against an SPK of type 9 or 13 with these states."""
    start = jf.Epoch.from_utc("2026-03-01T00:00:00")
    oem = jf.load_oem(HEAD + text(INTERPOLATION=method, INTERPOLATION_DEGREE=degree))
    path = orbits.nodes(tmp_path / "x.bsp", kind, orbits.LEO, SECONDS, degree, origin=float(start.et))
    cspice.furnsh(str(path))
    times = start + np.linspace(0.5, 599.5, 41)
    b = jf.TreeBuilder(root="earth")
    oem.add_to(b, "craft", parent="earth")
    tree = b.build()
    motion = tree.motion(tree.state(time=times), of="craft", relative_to="earth")
    want = np.array([cspice.spkez(-77, t, "J2000", "NONE", 399)[0] for t in np.asarray(times.et)]) * 1e3
    # The middle of the window is CSPICE's only inside: near the ends both take the same states.
    np.testing.assert_allclose(motion.transform.translation, want[:, :3], atol=2e-6)
    if kind == 13:
        np.testing.assert_allclose(motion.velocity.linear, want[:, 3:], atol=2e-8)
