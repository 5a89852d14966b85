"""Trees made of kernels, and frames placed by SPICE ids, against live CSPICE."""

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
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
    copy = tree.rebuild()
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
