"""Frames placed by SPICE ids from tables and from kernels: default frames, ways along tables, names, and failures that leave nothing."""

import dataclasses

import numpy as np
import pytest

import jaxframes as jf
from jaxframes import errors
from jaxframes.tables.naif_ids import CENTERS, INERTIAL, NAMES

SPAN = {"start": "2026-01-01", "stop": "2026-02-01"}
TIME = 820497600.0 + 86400.0


def test_what_spice_has_built_in(cspice):
    known = {int(i): int(cspice.frinfo(int(i))[0]) for kind in (2, 3, 4, 5, 6) for i in cspice.bltfrm(kind)}
    assert known == CENTERS
    assert {i: cspice.frmnam(i) for i in range(1, len(INERTIAL) + 1)} == dict(enumerate(INERTIAL, 1))
    assert {name: cspice.bods2c(name) for name in NAMES} == NAMES


@pytest.mark.parametrize("known", [True, False])
def test_the_default_frame_from_tables_does_not_depend_on_their_age(known):
    tables = jf.spice.example_tables()
    old = {name: t.replace(info=dataclasses.replace(t.info, center=t.info.center if known else None)) for name, t in tables.items()}
    for body in ("EARTH", 399):
        builder = jf.TreeBuilder(root="SSB")
        assert builder.add_spice(old, body=body) == "ITRF93"
        assert builder.build().properties["ITRF93"]["spice_body"] == 399
    builder = jf.TreeBuilder(root="SSB")
    assert builder.add_spice(old, body="MOON", frame="ITRF93") == "ITRF93 @ MOON"
    assert builder.add_spice(old, body="MOON") == "MOON"


def test_shipped_tables_say_what_they_belong_to_and_how_good_they_are():
    tables = jf.spice.example_tables()
    assert tables["itrf93"].info.center == 399
    for table in tables.values():
        assert len(table.info.measured) == 3


def test_tables_may_come_alone_and_take_no_options():
    table = jf.spice.example_tables()["emb"]
    builder = jf.TreeBuilder(root="SSB")
    name = builder.add_spice(table, body="EARTH BARYCENTER")
    assert builder.build().edge(name).info == table.info
    assert builder.add_spice([table], body=3) == name
    with pytest.raises(errors.EdgeError, match="found list"):
        builder.add_spice([], body=3)
    with pytest.raises(errors.EdgeError, match=r"start=\) is for kernels"):
        builder.add_spice([table], body=3, start="2026-01-01")


@pytest.fixture(scope="module")
def links(kernels):
    """Tables that make two ways from the Moon: by the Earth, which leads nowhere, and by the barycentre."""
    make = lambda of, by: kernels.translation(target=of, center=by, **SPAN)
    return {
        "moon<-earth": make("MOON", "EARTH"),
        "moon<-emb": make("MOON", "EARTH BARYCENTER"),
        "emb<-ssb": make("EARTH BARYCENTER", "SSB"),
        "sun<-ssb": make("SUN", "SSB"),
    }


@pytest.mark.parametrize("turned", [False, True])
def test_a_way_is_searched_along_all_tables(links, turned, cspice, dtype):
    builder = jf.TreeBuilder(root="SSB")
    assert builder.add_spice(list(links.values())[:: -1 if turned else 1], body="MOON") == "MOON"
    tree = builder.build()
    assert tree.parent("MOON") == "EARTH BARYCENTER"
    found = tree.transform(tree.state(time=TIME), of="MOON", relative_to="SSB").translation
    reference = np.array(cspice.spkezr("MOON", TIME, "J2000", "NONE", "SSB")[0][:3]) * 1e3
    assert np.linalg.norm(np.asarray(found, float) - reference) <= (1e-3 if dtype == np.float64 else 5e4)


def test_the_nearest_body_that_is_there_is_taken(links):
    builder = jf.TreeBuilder(root="EARTH")
    assert builder.add_spice(links, body="MOON") == "MOON"
    assert builder.build().parent("MOON") == "EARTH"


def test_names_that_a_body_goes_by(links):
    for name in ("EMB", "emb", "EARTH-MOON BARYCENTER", "Earth Moon  Barycenter", "EARTH_BARYCENTER", "3", 3):
        builder = jf.TreeBuilder(root="SSB")
        assert builder.add_spice(links, body=name) == "EARTH BARYCENTER", name
    for root in ("SSB", "SOLAR SYSTEM BARYCENTER", "solar_system_barycenter"):
        builder = jf.TreeBuilder(root=root)
        builder.add_spice(links, body="SUN")
        assert builder.build().parent("SUN") == root


def test_a_failure_leaves_nothing_behind(links, itrf93):
    builder = jf.TreeBuilder(root="SSB")
    with pytest.raises(errors.NoPathError, match="No table orients frame GALACTIC"):
        builder.add_spice({**links, "itrf93": itrf93}, body="MOON", frame="GALACTIC")
    assert builder.names == ("SSB",)
    builder.add_spice(links, body="SUN")
    with pytest.raises(errors.NoPathError, match=r"No table of 'EARTH' is among those given: none of body 399 from 0"):
        builder.add_spice({**links, "itrf93": itrf93}, body="EARTH")
    assert builder.names == ("SSB", "SUN")


def test_a_known_frame_must_cover_the_span_asked_for(kernels):
    builder = jf.TreeBuilder(root="SSB")
    assert builder.add_spice(kernels, body="MOON", frame="J2000", **SPAN) == "MOON"
    assert builder.add_spice(kernels, body="MOON", frame=1) == "MOON"
    assert builder.add_spice(kernels, body="MOON", frame=1, start="2026-01-05", stop="2026-01-06") == "MOON"
    names = builder.names
    for start, stop in (("2026-01-05", "2026-03-01"), ("2025-12-01", None), (None, "2027-01-01")):
        with pytest.raises(errors.CoverageError, match=r"frame 'MOON' is in the tree already, with a table that covers 2026-01-01"):
            builder.add_spice(kernels, body="MOON", frame=1, start=start, stop=stop)
    # The frame is new, what it hangs on is not.
    with pytest.raises(errors.CoverageError, match=r"frame 'EARTH BARYCENTER' is in the tree already"):
        builder.add_spice(kernels, body="EARTH", frame=1, start="2026-01-05", stop="2026-03-01")
    assert builder.names == names


def test_loaded_tables_are_a_dict_that_a_builder_takes(links, itrf93, tmp_path):
    jf.spice.save(tmp_path / "links.npz", {**links, "itrf93": itrf93})
    loaded = jf.spice.load(tmp_path / "links.npz")
    assert type(loaded) is dict
    assert list(loaded) == [*links, "itrf93"]
    for source in (loaded, list(loaded.values()), tuple(loaded.values())):
        builder = jf.TreeBuilder(root="SSB")
        assert builder.add_spice(source, body="MOON", frame="ITRF93") == "ITRF93 @ MOON"
        assert builder.names == ("SSB", "EARTH BARYCENTER", "MOON", "ITRF93 @ MOON")
    alone = jf.TreeBuilder(root="EARTH")
    assert alone.add_spice(loaded["moon<-earth"], body="MOON", frame="J2000") == "MOON"


@pytest.mark.parametrize("nothing", [{}, [], (), "MOON", 301, None])
def test_what_holds_no_tables_is_refused(nothing):
    with pytest.raises(errors.EdgeError, match=r"add_spice takes jf\.spice\.Kernels or tables made by them, found"):
        jf.TreeBuilder(root="SSB").add_spice(nothing, body="MOON")


def hung(parent, name, table, **properties):
    """The tree of a table below a frame of a Solar System tree."""
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    b.add("emb", parent="ssb", edge=tables["emb"])
    b.add("earth", parent="emb", edge=tables["earth"])
    b.add("body", parent="earth", edge=jf.edges.Fixed())
    b.add(name, parent=parent, edge=tables[table], properties=properties)
    return b


@pytest.mark.parametrize(
    ("parent", "table", "said"),
    [
        (
            "ssb",
            "moon",
            r"frame 'x': its table is MOON from EARTH in J2000, and it hangs on 'ssb', which is body SSB \(0\) and SPICE frame 1, as ",
        ),
        (
            "emb",
            "moon",
            r"hangs on 'emb', which is body EARTH BARYCENTER \(3\) and SPICE frame 1, as its own table says: hang it on the frame",
        ),
        ("earth", "earth", r"hangs on 'earth', which is body EARTH \(399\)"),
    ],
)
def test_a_table_below_another_frame_than_it_starts_from_is_named(parent, table, said):
    with pytest.warns(errors.FrameWarning, match=said):
        tree = hung(parent, "x", table).build()
    assert [s for s in tree.check(tree.state(time=8.3e8)) if "its table is" in s]
    told = hung(parent, "x", table, spice_check=False).build()
    assert told.check(told.state(time=8.3e8)) == ()


def test_tables_where_they_belong_are_not_named():
    """Below frames that say nothing of themselves too, until another table says something else of them."""
    for parent, table in (("earth", "moon"), ("body", "moon"), ("body", "itrf93"), ("earth", "itrf93"), ("ssb", "sun")):
        tree = hung(parent, "x", table).build()
        assert tree.check(tree.state(time=8.3e8)) == ()
    b = hung("body", "x", "moon")
    b.add("y", parent="body", edge=jf.spice.example_tables()["sun"])
    with pytest.warns(errors.FrameWarning, match=r"frame 'y': its table is SUN from SSB .* as the table of 'x' says"):
        b.build()
    b = jf.TreeBuilder(root="anywhere")
    b.set_properties("anywhere", {"spice_body": 301, "spice_frame": 1})
    b.add("y", parent="anywhere", edge=jf.spice.example_tables()["moon"])
    with pytest.warns(errors.FrameWarning, match=r"which is body MOON \(301\) and SPICE frame 1, as its properties say"):
        b.build()
