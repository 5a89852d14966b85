"""Orbit ephemeris messages: read by hand-written rules of the standard, against CSPICE on the same states, written and read again."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxframes as jf
from jaxframes.errors import EdgeError, FormatError, FrameError
from tests.spice import orbits

HEAD = "CCSDS_OEM_VERS = 2.0\nCOMMENT made for a test\nCREATION_DATE = 2026-03-01T00:00:00\nORIGINATOR = TEST\n"
FACTS = {
    "OBJECT_NAME": "SAT A",
    "OBJECT_ID": "2026-001A",
    "CENTER_NAME": "EARTH",
    "REF_FRAME": "EME2000",
    "TIME_SYSTEM": "UTC",
    "START_TIME": "2026-03-01T00:00:00.000",
    "STOP_TIME": "2026-03-01T00:10:00.000",
}
SECONDS = np.arange(0.0, 601.0, 60.0)


def states(seconds=SECONDS):
    """Position and velocity of a low orbit, km and km/s."""
    r, v, _ = orbits.two_body(orbits.LEO, np.asarray(seconds))
    return np.concatenate([r, v], 1) / 1e3


def rows(seconds=SECONDS):
    lines = []
    for t, state in zip(seconds, states(seconds), strict=True):
        lines.append(f"2026-03-01T00:{int(t) // 60:02d}:{t % 60:06.3f} " + " ".join(map(repr, state.tolist())))
    return "\n".join(lines) + "\n"


def text(body=None, **changes):
    facts = {key: value for key, value in {**FACTS, **changes}.items() if value is not None}
    return "META_START\n" + "".join(f"{key} = {value}\n" for key, value in facts.items()) + "META_STOP\n" + (body or rows())


def test_what_is_read(dtype):
    oem = jf.load_oem(HEAD + text(INTERPOLATION="LAGRANGE", INTERPOLATION_DEGREE=5))
    assert oem.header["ORIGINATOR"] == "TEST"
    assert oem.comments == ("made for a test",)
    (segment,) = oem.segments
    assert segment.metadata["REF_FRAME"] == "EME2000"
    np.testing.assert_array_equal(segment.positions, states()[:, :3] * 1000)
    np.testing.assert_array_equal(segment.velocities, states()[:, 3:] * 1000)
    np.testing.assert_allclose(segment.times - jf.Epoch.from_utc("2026-03-01"), SECONDS, atol=1e-6)
    edge = oem.edge("SAT A")
    assert (edge.method, edge.points) == ("lagrange", 6)
    assert oem.edge("2026-001A", method="hermite").velocities is not None
    path_text = HEAD + text()
    assert jf.load_oem(path_text).edge().method == "hermite"


def test_useable_span_and_scales(tmp_path):
    """States outside of the useable span serve to interpolate; the edge does not cover them."""
    path = tmp_path / "x.oem"
    path.write_text(HEAD + text(USEABLE_START_TIME="2026-03-01T00:01:30", USEABLE_STOP_TIME="2026-03-01T00:08:00", TIME_SYSTEM="TAI"))
    edge = jf.load_oem(path).edge()
    start = jf.Epoch.from_tai("2026-03-01T00:00:00")
    assert list(np.asarray(edge.coverage_code(start + np.array([60.0, 89.0, 91.0, 479.0, 481.0])))) == [-1, -1, 0, 0, 1]
    b = jf.TreeBuilder()
    b.add("craft", parent="world", edge=edge)
    tree = jf.from_json(jf.to_json(b.build()))
    found = tree.transform(tree.state(time=start + np.array([60.0, 120.0, 600.0])), of="craft", relative_to="world").translation
    assert np.isnan(found[::2]).all()
    np.testing.assert_allclose(found[1], states()[2, :3] * 1000, rtol=1e-6)
    gps = jf.load_oem(HEAD + text(TIME_SYSTEM="GPS")).segments[0].times[0]
    assert abs(float(gps - jf.Epoch.from_tai("2026-03-01T00:00:19"))) < 1e-6


@pytest.mark.float64
def test_segments_that_meet_are_one_edge_with_a_break():
    """At a manoeuvre the velocity jumps: each side is interpolated by itself, and the later state counts."""
    first = text(rows(SECONDS[:6]), STOP_TIME="2026-03-01T00:05:00")
    later = [row.split() for row in rows(SECONDS[5:]).splitlines()]
    kicked = "\n".join(" ".join([*row[:4], repr(float(row[4]) + 0.01 * i), *row[5:]]) for i, row in enumerate(later)) + "\n"
    second = text(kicked, START_TIME="2026-03-01T00:05:00")
    oem = jf.load_oem(HEAD + first + second)
    edge, start = oem.edge(), jf.Epoch.from_utc("2026-03-01")
    assert edge.grid.times.shape[0] == 12
    apart = [segment.edge() for segment in oem.segments]
    for t, part in ((120.5, apart[0]), (299.0, apart[0]), (301.0, apart[1]), (599.0, apart[1])):
        b = jf.TreeBuilder()
        b.add("whole", parent="world", edge=edge)
        b.add("part", parent="world", edge=part)
        tree = b.build()
        assert not np.any(tree.transform(tree.state(time=start + t), of="part", relative_to="whole").translation)
    gap = text(rows(SECONDS[6:]), START_TIME="2026-03-01T00:06:00")
    with pytest.raises(
        EdgeError, match=r"segments 0 and 1 of SAT A do not meet: one is useable to 2026-03-01T00:06:09.*both need a state there"
    ):
        jf.load_oem(HEAD + first + gap).edge()
    other = jf.load_oem(HEAD + first + second.replace("EME2000", "TEME"))
    with pytest.raises(EdgeError, match="have the REF_FRAME EME2000 and TEME: make an edge of each"):
        other.edge()


@pytest.mark.float64
def test_written_and_read_again():
    """Any edge over time as a message: numbers of states come back to the last digit, times to the nanosecond."""
    moon, start = jf.spice.example_tables()["moon"], jf.Epoch.from_utc("2026-03-01")
    times = start + 3600.0 * np.arange(30)
    segment = jf.OemSegment.from_edge(moon, times, name="MOON", identifier="301", center="EARTH", frame="ICRF", scale="TDB")
    oem = jf.Oem.from_segments([segment], originator="TEST", created="2026-03-01T00:00:00")
    again = jf.load_oem(oem.to_text())
    np.testing.assert_allclose(again.segments[0].positions, segment.positions, rtol=3e-16)
    np.testing.assert_allclose(again.segments[0].velocities, moon.evaluate(times, 1)[1], rtol=3e-16)
    assert np.abs(again.segments[0].times - times).max() < 1e-9
    assert jf.load_oem(again.to_text()).to_text() == again.to_text()
    assert again.header["CREATION_DATE"] == "2026-03-01T00:00:00"
    with pytest.raises(EdgeError, match="does not cover instant 1 of 2"):
        jf.OemSegment.from_edge(moon, start + jnp.array([0.0, 4e7]), name="M", identifier="M", center="EARTH", frame="ICRF")


def test_accelerations_and_covariances():
    a = " 0.001 -0.002 0.003"
    body = "".join(line + a + "\n" for line in rows().splitlines())
    triangle = "\n".join(" ".join(str(1 + i + 10 * j) for j in range(i + 1)) for i in range(6))
    head, then = "EPOCH = 2026-03-01T00:01:00\nCOV_REF_FRAME = RTN", "EPOCH = 2026-03-01T00:02:00"
    covariance = f"COVARIANCE_START\n{head}\n{triangle}\n{then}\n{triangle}\nCOVARIANCE_STOP\n"
    oem = jf.load_oem(HEAD + text(body + covariance))
    (segment,) = oem.segments
    np.testing.assert_allclose(segment.accelerations, np.tile([1.0, -2.0, 3.0], (11, 1)))
    assert segment.edge().accelerations is not None  # quintic
    first, second = segment.covariances
    assert (first.frame, second.frame) == ("RTN", "RTN")
    np.testing.assert_allclose(first.matrix, first.matrix.T)
    np.testing.assert_allclose(first.matrix[5], (6 + 10 * np.arange(6)) * 1e6)
    again = jf.load_oem(oem.to_text()).segments[0]
    np.testing.assert_allclose(again.covariances[1].matrix, second.matrix, rtol=1e-15)


def test_where_it_is_hung_is_checked():
    oem = jf.load_oem(HEAD + text())
    for properties, words in (
        ({"spice_body": 499, "spice_frame": 1}, r"relative to EARTH \(399\), and 'here' is body 499"),
        ({"spice_body": 399, "spice_frame": 13000}, "in EME2000, and 'here' has the axes of SPICE frame 13000"),
    ):
        b = jf.TreeBuilder(root="world")
        b.add("here", parent="world", edge=jf.edges.Fixed(), properties=properties)
        with pytest.raises(FrameError, match=words):
            oem.add_to(b, "craft", parent="here")
    b = jf.TreeBuilder(root="mars")
    with pytest.raises(FrameError, match=r"'mars' is body \d+"):
        oem.add_to(b, "craft", parent="mars")
    with pytest.raises(FrameError, match=r"no object 'SAT B'\. Did you mean 'SAT A'"):
        oem.edge("SAT B")


@pytest.mark.parametrize(
    ("change", "words"),
    {
        "no mark": (lambda t: t[5:], "line 1: a message of this kind starts with CCSDS_OEM_VERS"),
        "version": (lambda t: t.replace("= 2.0", "= 9.0"), "version 9.0 of the format is not one of 1.0, 2.0, 3.0"),
        "unknown keyword": (
            lambda t: t.replace("CENTER_NAME", "CENTRE_NAME"),
            "line 8: 'CENTRE_NAME' is no keyword.*Did you mean 'CENTER_NAME'",
        ),
        "missing": (lambda t: t.replace("OBJECT_ID = 2026-001A\n", ""), "the metadata needs OBJECT_ID"),
        "twice": (lambda t: t.replace("META_STOP", "OBJECT_ID = X\nMETA_STOP"), "OBJECT_ID is given twice"),
        "empty": (lambda t: t.replace("= EARTH", "="), "CENTER_NAME has no value"),
        "scale": (lambda t: t.replace("= UTC", "= UT1"), "the time system 'UT1' is not known"),
        "a number": (lambda t: t[:-3] + "x\n", "'.*x' in .* is no number"),
        "too large": (lambda t: t.rsplit(" ", 1)[0] + " 1e999\n", "beyond what a float holds"),
        "columns": (lambda t: t.rsplit(" ", 1)[0] + "\n", "an instant and 6 numbers, or 9 with accelerations"),
        "order": (lambda t: t.replace("T00:03:00", "T00:01:30"), "state 3, at 2026-03-01T00:01:30.* is not after the one before"),
        "outside": (lambda t: t.replace("STOP_TIME = 2026-03-01T00:10", "STOP_TIME = 2026-03-01T00:09"), "are outside of"),
        "spans": (lambda t: t.replace("META_STOP", "USEABLE_START_TIME = 2026-03-02\nMETA_STOP"), "do not lie within each other"),
        "date": (lambda t: t.replace("2026-03-01T00:10:00.000\n", "2026-13-01T00:10:00\n"), "'2026-13-01T00:10:00' is no UTC date"),
        "no states": (lambda t: t[: t.index("META_STOP")] + "META_STOP\n", "a segment needs states"),
        "no segment": (lambda t: t[: t.index("META_START")], "META_START is missing"),
        "covariance": (lambda t: t + "COVARIANCE_START\nEPOCH = 2026-03-01\n1\n1 2\n1 2\n1\n1\n1\nCOVARIANCE_STOP\n", "a lower triangle"),
        "cut off": (lambda t: t + "COVARIANCE_START\nEPOCH = 2026-03-01\n1\n", "the message ends too early"),
    }.values(),
)
def test_what_is_wrong_is_said_with_its_line(change, words):
    with pytest.raises(FormatError, match=rf"the text given, line \d+: (.|\n)*{words.removeprefix('line 1: ').removeprefix('line 8: ')}"):
        jf.load_oem(change(HEAD + text()))


def test_what_is_recommended_and_not_made_is_said(tmp_path):
    oem = jf.load_oem(HEAD + text(INTERPOLATION="HERMITE", INTERPOLATION_DEGREE=7))
    with pytest.raises(EdgeError, match="recommends HERMITE of degree 7, which is not made here; say what to take instead"):
        oem.edge()
    assert oem.edge(method="lagrange", points=8).points == 8
    with pytest.raises(FormatError, match="cannot be read: No such file"):
        jf.load_oem(tmp_path / "none.oem")
    with pytest.raises(FormatError, match="a path or text is needed, found int"):
        jf.load_oem(5)
