"""Trees made of kernels, and frames placed by SPICE ids, against live CSPICE."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from tests.spice import made, orbits
from tests.spice.test_fixed_frames import FRAMES
from tests.spice.test_iau import PCK
from tests.spice.test_orientation import angles, matrices

SPAN = {"start": "2026-01-01", "stop": "2026-02-01"}
TIMES = 820497600.0 + 86400.0 * np.array([1.0, 9.0, 25.0])


@pytest.fixture(scope="module")
def everything(paths, tmp_path_factory):
    frames = tmp_path_factory.mktemp("fk") / "test.tf"
    frames.write_text(FRAMES)
    return [*paths, PCK, frames]


@pytest.fixture(scope="module")
def opened(everything):
    with jf.spice.Kernels(everything) as kernels:
        yield kernels


@pytest.fixture(scope="module")
def tree(opened):
    return opened.tree(bodies=["EARTH", 301, "SUN"], frames=["ITRF93", "IAU_MOON", "ECLIPJ2000", "MOON_TEST_ME"], **SPAN)


def test_names_parents_and_ids(tree):
    assert {name: tree.parent(name) for name in tree.names[1:]} == {
        "EARTH BARYCENTER": "SSB",
        "EARTH": "EARTH BARYCENTER",
        "MOON": "EARTH BARYCENTER",
        "SUN": "SSB",
        "ITRF93": "EARTH",
        "IAU_MOON": "MOON",
        "ECLIPJ2000": "SSB",
        # Fixed to axes of the Earth, but the Moon is its centre.
        "ITRF93 @ MOON": "MOON",
        "MOON_TEST_PA": "ITRF93 @ MOON",
        "MOON_TEST_ME": "MOON_TEST_PA",
    }
    ids = {name: (facts["spice_body"], facts["spice_frame"]) for name, facts in tree.properties.items()}
    assert ids["SSB"] == (0, 1)
    assert ids["ITRF93 @ MOON"] == (301, 13000)
    assert ids["MOON_TEST_ME"] == (301, 1400302)
    assert len(set(ids.values())) == len(tree.names)


@pytest.mark.float64
def test_any_frame_relative_to_any_other(tree, everything, cspice):
    for path in everything:
        cspice.furnsh(str(path))
    state = tree.state(time=TIMES)
    for of, body, base, center in (("IAU_MOON", "MOON", "ITRF93", "EARTH"), ("SUN", "SUN", "MOON_TEST_ME", "MOON")):
        motion = tree.motion(state, of=of, relative_to=base)
        states = np.array([cspice.spkezr(body, t, base, "NONE", center)[0] for t in TIMES]) * 1e3
        # The axes of the Moon and ITRF93 differ from CSPICE's by its rounding, 2e-11 rad.
        reach = np.linalg.norm(states[:, :3], axis=1).max()
        assert np.linalg.norm(motion.transform.translation - states[:, :3], axis=1).max() <= 3e-11 * reach + 1e-4
        assert (
            np.linalg.norm(motion.velocity.linear - states[:, 3:], axis=1).max()
            <= 1e-10 * np.linalg.norm(states[:, 3:], axis=1).max() + 1e-9
        )
        frame = "J2000" if of == "SUN" else of
        rotations, spins = zip(*(cspice.xf2rav(cspice.sxform(base, frame, t)) for t in TIMES), strict=True)
        assert angles(matrices(motion.transform.rotation.wxyz), np.array([m.T for m in rotations])).max() <= 1e-10
        assert np.abs(np.asarray(motion.velocity.angular) - np.array(spins)).max() <= 1e-16


def test_default_frames_by_the_rule(opened, paths):
    b = jf.TreeBuilder(root="ssb")
    assert b.add_spice(opened, body="EARTH", **SPAN) == "ITRF93"  # the association kernel is loaded
    assert b.add_spice(opened, body=399, frame=999999) == "ITRF93"
    assert b.add_spice(opened, body=3) == "EARTH BARYCENTER"
    assert b.add_spice(opened, body=0) == "ssb"
    assert b.add_spice(opened, body="MOON", **SPAN) == "IAU_MOON"
    assert b.add_spice(opened, body="MOON", frame=1) == "MOON"
    assert b.add_spice(opened, body="MOON", frame="J2000") == "MOON"
    assert b.names == ("ssb", "EARTH BARYCENTER", "EARTH", "ITRF93", "MOON", "IAU_MOON")
    assert b.build().properties["ITRF93"]["spice_frame"] == 13000
    with jf.spice.Kernels([p for p in paths if not p.endswith(".tf")] + [PCK]) as without:
        other = jf.TreeBuilder(root="SSB")
        assert other.add_spice(without, body="EARTH", **SPAN) == "IAU_EARTH"


@pytest.mark.parametrize("default", [999999, "999999", " 999999 ", np.int64(999999), None])
def test_the_default_frame_is_asked_for_by_number_and_by_text(opened, itrf93, default):
    b = jf.TreeBuilder(root="SSB")
    assert b.add_spice(opened, body="EARTH", frame=default, **SPAN) == "ITRF93"
    tables = jf.TreeBuilder(root="EARTH")
    assert tables.add_spice([itrf93], body="EARTH", frame=default) == "ITRF93"
    assert opened.tree(frames=[("EARTH", default)], **SPAN).names == ("SSB", "EARTH BARYCENTER", "EARTH", "ITRF93")


def test_one_body_or_frame_alone_and_pairs(opened, cspice, dtype):
    for one in ("MOON", 301, np.int32(301)):
        assert opened.tree(bodies=one, **SPAN).names == opened.tree(bodies=["MOON"], **SPAN).names == ("SSB", "EARTH BARYCENTER", "MOON")
    for one in ("ITRF93", 13000):
        assert opened.tree(frames=one, **SPAN).names == opened.tree(frames=["ITRF93"], **SPAN).names
    assert opened.tree(frames=("ITRF93", "ECLIPJ2000"), **SPAN).names[-2:] == ("ITRF93", "ECLIPJ2000")  # two frames, not a pair
    tree = opened.tree(bodies="SUN", frames=[("MOON", "ITRF93"), [301, None]], **SPAN)
    assert tree.names == ("SSB", "SUN", "EARTH BARYCENTER", "MOON", "ITRF93 @ MOON", "IAU_MOON")
    assert tree.properties["ITRF93 @ MOON"]["spice_body"] == 301
    found = tree.transform(tree.state(time=TIMES[0]), of="SUN", relative_to="ITRF93 @ MOON").translation
    states = np.array(cspice.spkezr("SUN", TIMES[0], "ITRF93", "NONE", "MOON")[0])[:3] * 1e3
    assert np.linalg.norm(np.asarray(found, float) - states) <= (1e-3 if dtype == np.float64 else 1e5)
    for role, bad in (("bodies", None), ("frames", 1.5), ("bodies", b"MOON")):
        with pytest.raises(errors.SpiceError, match=rf"^{role} = .*: give a name or an id, or a list of them"):
            opened.tree(**{role: bad})
    for bad in (("MOON",), ("MOON", "ITRF93", 1)):
        with pytest.raises(errors.SpiceError, match=r"or pairs \(body, frame\)"):
            opened.tree(frames=[bad])


def test_frames_that_the_user_added_are_found(opened, moon, itrf93, tmp_path):
    b = jf.TreeBuilder(root="middle")
    b.add("luna", parent="middle", edge=moon)
    b.add("ground", parent="middle", edge=itrf93)
    assert b.add_spice(opened, body=301, frame="J2000") == "luna"
    assert b.add_spice(opened, body=399, frame="ITRF93") == "ground"
    assert b.add_spice(opened, body=399, frame=1) == "middle"
    # No body on the Sun's way to the barycentre is there: it hangs on the root's body directly.
    assert b.add_spice(opened, body="SUN", frame="J2000", **SPAN) == "SUN"
    tree = b.build()
    assert tree.parent("SUN") == "middle"
    assert tree.edge("SUN").info.relative_id == 399
    copy = jf.TreeBuilder.from_tree(tree)
    assert copy.add_spice(opened, body="SUN", frame="J2000") == "SUN"


def test_from_tables_alone(opened, moon, itrf93, tmp_path):
    earth = opened.translation(target="EARTH", center="SSB", **SPAN)
    jf.spice.save(tmp_path / "t.npz", {"earth": earth, "moon": moon, "spin": itrf93, "mars": opened.orientation(frame="IAU_MARS")})
    tables = jf.spice.load(tmp_path / "t.npz")
    b = jf.TreeBuilder(root="SSB")
    assert b.add_spice(tables, body="MOON") == "MOON"
    assert b.add_spice(tables, body=399) == "ITRF93"
    assert b.add_spice(list(tables.values()), body="EARTH", frame=13000) == "ITRF93"
    tree = b.build()
    assert [tree.parent(n) for n in ("MOON", "ITRF93", "EARTH")] == ["EARTH", "EARTH", "SSB"]
    for body, frame, message in (
        ("VENUS", None, r"No table of 'VENUS' is among those given.*'MOON'"),
        ("MOON", "ITRF39", r"frame 'ITRF39'.*'ITRF93'"),
        ("MARS", None, r"'MARS' is among"),
        ("EARTH", "ECLIPJ2000", "No table orients frame ECLIPJ2000"),
    ):
        with pytest.raises(errors.NoPathError, match=message):
            b.add_spice(tables, body=body, frame=frame)
    with pytest.raises(errors.NoPathError, match=r"No frame of the tree is one that MOON \(301\) can hang on.*set_properties\('base'"):
        jf.TreeBuilder(root="base").add_spice(tables, body="MOON")
    with pytest.raises(errors.EdgeError, match=r"takes jf\.spice\.Kernels or tables"):
        b.add_spice("de440.bsp", body="MOON")


def test_a_name_that_is_taken(opened):
    b = jf.TreeBuilder(root="SSB")
    b.add("SUN", parent="SSB", edge=jf.edges.Prescribed())
    assert b.add_spice(opened, body="SUN", frame=1, **SPAN) == "SUN (10, 1)"


def test_a_root_with_other_inertial_axes(opened, cspice, dtype):
    b = jf.TreeBuilder(root="plane")
    b.set_properties("plane", {"spice_body": 0, "spice_frame": 17})
    b.add_spice(opened, body="SUN", frame="J2000", **SPAN)
    tree = b.build()
    assert tree.parent("SUN") == "SSB"
    found = tree.transform(tree.state(time=TIMES[0]), of="SUN", relative_to="plane").translation
    states = np.array(cspice.spkezr("SUN", TIMES[0], "ECLIPJ2000", "NONE", "SSB")[0])[:3] * 1e3
    assert np.linalg.norm(np.asarray(found, float) - states) <= (1e-5 if dtype == np.float64 else 500.0)


ARM = """KPL/FK
\\begindata
FRAME_TESTDECK = -77050
FRAME_-77050_NAME = 'TESTDECK'
FRAME_-77050_CLASS = 4
FRAME_-77050_CLASS_ID = -77050
FRAME_-77050_CENTER = -77
TKFRAME_-77050_RELATIVE = 'TESTCRAFT'
TKFRAME_-77050_SPEC = 'ANGLES'
TKFRAME_-77050_UNITS = 'DEGREES'
TKFRAME_-77050_ANGLES = ( 0, 90, 10 )
TKFRAME_-77050_AXES = ( 1, 2, 3 )
FRAME_TESTARM = -77100
FRAME_-77100_NAME = 'TESTARM'
FRAME_-77100_CLASS = 3
FRAME_-77100_CLASS_ID = -77100
FRAME_-77100_CENTER = -77
CK_-77100_SCLK = -77
CK_-77100_SPK = -77
\\begintext
"""


@pytest.mark.float64
@pytest.mark.parametrize("kind", [3, 5])
def test_an_arm_that_moves_on_a_spacecraft_that_turns(paths, tmp_path, cspice, rng, kind):
    origin, knots = 820497600.0, np.arange(0, 991, 10.0)
    (tmp_path / "arm.tf").write_text(ARM)
    craft = orbits.pointing(tmp_path / "craft.bc", 3, knots, *orbits.slew(knots)[:2])
    q, w, _ = orbits.slew(knots, 1e-3)
    handle, ticks, spice = cspice.ckopn(str(tmp_path / "arm.bc"), "test", 0), knots * 65536, q * np.array([1.0, -1, -1, -1])
    ends = (ticks[0], ticks[-1], -77100, "TESTDECK", True, "ARM")
    cspice.furnsh(orbits.clock(tmp_path, origin)[0])
    cspice.furnsh(str(tmp_path / "arm.tf"))
    if kind == 3:
        cspice.ckw03(handle, *ends, len(ticks), ticks, spice, w, 1, ticks[:1])
    else:
        cspice.ckw05(handle, 1, 7, *ends, ticks, spice, 1 / 65536, 1, ticks[:1])
    cspice.ckcls(handle)
    cdata = made.coefficients(rng, 10, 3, 5)
    spk = made.spk(tmp_path / "craft.bsp", [(2, -77, 399, "J2000", origin, origin + 1000, origin, 100.0, cdata)])
    files = [*orbits.clock(tmp_path, origin), tmp_path / "arm.tf", craft, tmp_path / "arm.bc", spk]
    tolerance = jf.spice.Tolerance(angle=1e-7) if kind == 5 else None
    with jf.spice.Kernels([*paths, *files]) as kernels:
        tree = kernels.tree(frames=["TESTARM"], start=origin, stop=origin + 990.0, ck="spice", tolerance=tolerance)
    assert [tree.parent(name) for name in ("TESTARM", "TESTDECK")] == ["TESTDECK", "TESTCRAFT"]
    for file in files:
        cspice.furnsh(str(file))
    times = origin + np.append(rng.integers(1, 989 * 64, 50) / 64, 960.0)
    motion = tree.motion(tree.state(time=times), of="TESTARM", relative_to="SSB")
    rotations, spins = zip(*(cspice.xf2rav(cspice.sxform("J2000", "TESTARM", t)) for t in times), strict=True)
    found = angles(matrices(motion.transform.rotation.wxyz), np.array([m.T for m in rotations])).max()
    assert found <= (1e-14 if kind == 3 else 1e-7)
    assert np.abs(np.asarray(motion.velocity.angular) - np.array(spins)).max() <= (1e-15 if kind == 3 else 1e-6)
