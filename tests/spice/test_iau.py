"""Text PCK orientations against live CSPICE, against mpmath at two-part time, and against their own derivatives."""

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.edges.base import Inputs
from tests.spice.test_orientation import angles, from_spice, matrices

PCK = Path(__file__).parents[1] / "data" / "iau_2015.tpc"
FRAMES = ("SUN", "MERCURY", "VENUS", "EARTH", "MOON", "MARS", "PHOBOS", "DEIMOS", "JUPITER", "IO", "EUROPA", "SATURN", "TITAN", "URANUS")
FRAMES += ("NEPTUNE", "TRITON", "PLUTO")
FAST = {"PHOBOS"}


@pytest.fixture(scope="module")
def pck():
    with jf.spice.Kernels(PCK) as opened:
        yield opened


@pytest.fixture(scope="module")
def edges(pck):
    return {name: pck.orientation(frame=f"IAU_{name}") for name in FRAMES}


@pytest.fixture
def loaded(cspice):
    cspice.furnsh(str(PCK))
    return cspice


@pytest.mark.parametrize("name", ["EARTH", "MOON", "MARS", "PHOBOS", "TRITON"])
def test_orientations_agree_with_sxform(edges, loaded, rng, name, dtype):
    times = rng.integers(-630_000_000, 950_000_000, 60).astype(float)
    q, w = edges[name].evaluate(times, order=1)
    rotation, rate = from_spice(loaded, times, frame=f"IAU_{name}")
    # CSPICE computes phase angles of 1e7 degrees without reduction: its rates carry 5e-11 rad of them for the fast Phobos.
    worst, spin = (5e-10 if name in FAST else 1e-10, 5e-16 if name in FAST else 1e-17) if dtype == np.float64 else (4e-6, 3e-10)
    assert angles(matrices(q), rotation).max() <= worst
    assert np.linalg.norm(np.asarray(w, float) - rate, axis=1).max() <= spin


def exact_angles(constants, body, hi, lo):
    """Right ascension, declination, prime meridian in rad, and their rates, in 40 digits, from the numbers of the text file."""
    m = mpmath.mp
    t = m.mpf(float(hi)) + m.mpf(float(lo))
    century, day = m.mpf(36525 * 86400), m.mpf(86400)
    system = body // 100 if 100 <= body <= 999 else body
    degree = int(constants.get(f"BODY{system}_MAX_PHASE_DEGREE", [1])[0])
    numbers = constants.get(f"BODY{system}_NUT_PREC_ANGLES", [])
    phases = [numbers[i : i + degree + 1] for i in range(0, len(numbers), degree + 1)]

    def polynomial(terms, unit):
        value = sum((m.mpf(c) * (t / unit) ** k for k, c in enumerate(terms)), m.mpf(0))
        rate = sum((k * m.mpf(c) * (t / unit) ** (k - 1) / unit for k, c in enumerate(terms) if k), m.mpf(0))
        return m.radians(value), m.radians(rate)

    out = []
    for item, unit, wave, slope in (
        ("RA", century, m.sin, m.cos),
        ("DEC", century, m.cos, lambda x: -m.sin(x)),
        ("PM", day, m.sin, m.cos),
    ):
        value, rate = polynomial(constants[f"BODY{body}_{'PM' if item == 'PM' else 'POLE_' + item}"], unit)
        for amplitude, terms in zip(constants.get(f"BODY{body}_NUT_PREC_{item}", []), phases, strict=False):
            angle, speed = polynomial(terms, century)
            value += m.radians(m.mpf(amplitude)) * wave(angle)
            rate += m.radians(m.mpf(amplitude)) * slope(angle) * speed
        out.append((value, rate))
    return out


def exact_pose(angles_and_rates):
    """The rotation matrix and the angular velocity in inertial axes, in 40 digits."""
    m = mpmath.mp
    (ra, dra), (dec, ddec), (w, dw) = angles_and_rates
    phi, theta = ra + m.pi / 2, m.pi / 2 - dec
    turn_z = lambda a: m.matrix([[m.cos(a), -m.sin(a), 0], [m.sin(a), m.cos(a), 0], [0, 0, 1]])
    turn_x = lambda a: m.matrix([[1, 0, 0], [0, m.cos(a), -m.sin(a)], [0, m.sin(a), m.cos(a)]])
    pose = turn_z(phi) * turn_x(theta) * turn_z(w)
    node = turn_z(phi) * m.matrix([1, 0, 0])
    pole = turn_z(phi) * turn_x(theta) * m.matrix([0, 0, 1])
    return pose, m.matrix([0, 0, 1]) * dra - node * ddec + pole * dw


def constants_of(text):
    found = {}
    for name, values in re.findall(r"(BODY\w+)\s*=\s*\(([^)]*)\)", text):
        found[name] = [float(v) for v in values.split()]
    return found


@pytest.mark.float64
@pytest.mark.parametrize(("name", "body"), [("EARTH", 399), ("MOON", 301), ("PHOBOS", 401), ("JUPITER", 599)])
def test_two_part_time_keeps_thirteen_digits(edges, rng, name, body):
    constants = constants_of(PCK.read_text())
    seconds = rng.uniform(-1.5e9, 2.5e9, 6)
    epochs = jf.Epoch.from_parts(seconds, rng.uniform(-1e-7, 1e-7, 6))
    q, w = edges[name].evaluate(epochs, order=1)
    with mpmath.workdps(40):
        for i in range(6):
            pose, spin = exact_pose(exact_angles(constants, body, epochs.hi[i], epochs.lo[i]))
            pose = np.array([[float(pose[j, k]) for k in range(3)] for j in range(3)])
            assert angles(matrices(q[i][None]), pose[None]).max() <= 1e-14
            assert np.abs(np.asarray(w[i]) - [float(x) for x in spin]).max() <= 1e-18


def test_rates_are_the_derivatives(edges, dtype):
    edge, times = edges["MARS"], jnp.asarray([0.0, 8.3e8], dtype)
    _, w, alpha = edge.evaluate(times)
    slopes = jax.vmap(jax.jacfwd(lambda t: jnp.concatenate(edge.evaluate(t, order=1))))(times)
    q = np.asarray(edge.evaluate(times, order=0)[0], float)
    qdot = np.asarray(slopes[:, :4], float)
    # 2 qdot q* is the angular velocity in the axes of the parent.
    vector = 2 * (q[:, :1] * qdot[:, 1:] - qdot[:, :1] * q[:, 1:] - np.cross(qdot[:, 1:], q[:, 1:]))
    eps = np.finfo(dtype).eps
    np.testing.assert_allclose(vector, np.asarray(w, float), atol=40 * eps * 7.1e-5)
    np.testing.assert_allclose(slopes[:, 4:], alpha, rtol=0, atol=60 * eps * float(jnp.abs(alpha).max()) + 1e-30)
    assert float(jnp.abs(alpha).max()) > 1e-18


def test_gradients_reach_the_numbers_of_the_model(edges, dtype):
    edge, t = edges["EARTH"], jnp.asarray(86400.0, dtype)
    x_of = lambda model: (jf.Rotation(model.evaluate(t, order=0)[0]) @ jnp.asarray([1.0, 0.0, 0.0], dtype))[0]
    slope = jax.grad(x_of)(edge).polynomials
    step = 1e-6 if dtype == np.float64 else 1e-3
    for row in (0, 2):
        moved = [x_of(edge.replace(polynomials=edge.polynomials.at[row, 0, 0].add(s))) for s in (step, -step)]
        np.testing.assert_allclose(slope[row, 0, 0], (moved[0] - moved[1]) / (2 * step), rtol=1e-8 if dtype == np.float64 else 3e-3)


def test_as_an_edge_of_a_tree_and_through_a_file(edges, tmp_path, dtype, tol):
    jf.spice.save(tmp_path / "iau.npz", {"mars": edges["MARS"], "sun": edges["SUN"]})
    again = jf.spice.load(tmp_path / "iau.npz")["mars"]
    assert again.info == edges["MARS"].info
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(edges["MARS"]), strict=True):
        np.testing.assert_array_equal(a, b)
    assert again.info.coverage == "every instant"
    for part in ("analytic model of a text PCK, 16 phase angles", "iau_2015.tpc sha256"):
        assert part in again.report()
    b = jf.TreeBuilder(root="mars")
    b.add("fixed", parent="mars", edge=again)
    tree = b.build()
    epoch = jf.Epoch.from_tdb("2026-03-01") + np.arange(3.0)
    q, w, _ = edges["MARS"].evaluate(epoch)
    motion = tree.motion(tree.state(time=epoch), of="fixed", relative_to="mars")
    np.testing.assert_allclose(motion.transform.rotation.wxyz, q, atol=tol)
    np.testing.assert_allclose(motion.velocity.angular, w, atol=tol * 1e-4)
    assert np.array_equal(tree.edge("fixed").coverage_code(epoch), [0, 0, 0])
    with pytest.raises(errors.MissingInputError, match="IAU model: IAU_MARS"):
        again.steps(Inputs(), 0)


@pytest.mark.float64
def test_a_model_with_an_epoch_and_axes_of_its_own(tmp_path, cspice):
    file = tmp_path / "body.tpc"
    file.write_text(
        "KPL/PCK\n\\begindata\nFRAME_TB = 1499999\nFRAME_1499999_NAME = 'TB'\nFRAME_1499999_CLASS = 2\n"
        "FRAME_1499999_CLASS_ID = 2099999\nFRAME_1499999_CENTER = 2099999\nBODY2099999_POLE_RA = ( 10. 1. -3. )\n"
        "BODY2099999_POLE_DEC = ( 20. 1. )\nBODY2099999_PM = ( 30. 100. 1e-7 )\nBODY2099999_CONSTANTS_JED_EPOCH = 2455607.694660\n"
        "BODY2099999_CONSTANTS_REF_FRAME = 17\n\\begintext\n"
    )
    with jf.spice.Kernels(file) as kernels:
        edge = kernels.orientation(frame="TB", relative_to="ECLIPJ2000")
    cspice.furnsh(str(file))
    times = np.array([-5e8, 0.0, 3.5e8, 9e8])
    q, w = edge.evaluate(times, order=1)
    rotation, rate = from_spice(cspice, times, "ECLIPJ2000", "TB")
    assert angles(matrices(q), rotation).max() <= 1e-10
    assert np.abs(np.asarray(w) - rate).max() <= 1e-17


@pytest.mark.parametrize(
    ("lines", "found"),
    [
        ("BODY499_PM = ( 1. 2. )", r"only in part: BODY499_POLE_RA, BODY499_POLE_DEC missing"),
        (
            "BODY499_POLE_RA=(1.) BODY499_POLE_DEC=(1.) BODY499_PM=(1. 2.) BODY499_NUT_PREC_PM=(1. 2.) BODY4_NUT_PREC_ANGLES=(1. 2.)",
            "2 phase",
        ),
        (
            "BODY499_POLE_RA=(1.) BODY499_POLE_DEC=(1.) BODY499_PM=(1. 2.) BODY499_NUT_PREC_PM=(1.) BODY4_NUT_PREC_ANGLES=(1. 2. 3.)",
            "3 numb",
        ),
    ],
)
def test_constants_that_do_not_fit(tmp_path, lines, found):
    file = tmp_path / "bad.tpc"
    file.write_text("KPL/PCK\n\\begindata\n" + lines.replace(") BODY", ")\nBODY") + "\n\\begintext\n")
    with jf.spice.Kernels(file) as kernels, pytest.raises(errors.BadKernelError, match=found):
        kernels.orientation(frame="IAU_MARS")
