"""The 3-D page: poses and distances, meshes from one folder only, the guard before viser, and the page in headless Chromium."""

import socket
import sys
import threading
import time

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.view import guarded_viser
from jaxframes.view.distances import WIDE, Scaling, default_range, logarithmic, merged, ranges_of
from jaxframes.view.graph_data import numbers_of
from jaxframes.view.looks import parents_of
from jaxframes.view.meshes import shapes_of
from jaxframes.view.poses import poses_from
from tests.view.conftest import until
from tests.view.hostile import NAMES, TEXTS
from tests.view.test_guard import refused_strangers
from tests.view.trees import every_kind

pytestmark = pytest.mark.float64


@pytest.fixture
def arm():
    b = jf.TreeBuilder(root="base")
    b.add("link", parent="base", edge=jf.edges.Revolute(axis=(0, 0, 1), limits=(-2.0, 2.0)))
    b.add("tip", parent="link", edge=jf.edges.Fixed(jf.Transform.from_translation((1.0, 0.0, 0.5))))
    return b.build()


def earth_and_moon():
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    for name, parent in (("emb", "ssb"), ("earth", "emb"), ("moon", "earth"), ("itrf93", "earth")):
        b.add(name, parent=parent, edge=tables[name])
    b.add("station", parent="itrf93", edge=jf.edges.Fixed(jf.Transform.from_geodetic(0.7, -0.07, 865.0)))
    b.add("dish", parent="station", edge=jf.edges.Fixed(jf.Transform.from_translation((0.0, 0.0, 20.0))))
    tree = b.build()
    return tree, tree.state(time=jf.Epoch.from_tdb("2026-03-01T00:00:00") + np.linspace(0.0, 20 * 86400.0, 12))


def test_poses_are_those_of_a_query_from_any_observer(rng):
    tree, state = every_kind(rng)
    for observer in ("world", "screw", "free"):
        rotations, positions = poses_from(parents_of(tree, state)[0], numbers_of(tree, state), tree.topology.index(observer))
        for i, name in enumerate(tree.names):
            expected = tree.transform(state, of=name, relative_to=observer)
            np.testing.assert_allclose(positions[i], expected.translation, atol=1e-12)
            assert abs(abs(float(rotations[i] @ np.asarray(expected.rotation.wxyz))) - 1) < 1e-12


def test_metres_survive_at_astronomical_distances():
    tree, states = earth_and_moon()
    parents, numbers = parents_of(tree, states[0])[0], numbers_of(tree, states[0])
    _, positions = poses_from(parents, numbers, tree.topology.index("station"))
    np.testing.assert_allclose(positions[tree.topology.index("dish")], [0.0, 0.0, 20.0], atol=1e-9)
    places, shown = Scaling(20.0).places(positions)
    np.testing.assert_allclose(np.float32(places[tree.topology.index("dish")]), [0.0, 0.0, WIDE], rtol=1e-6)
    assert shown[tree.topology.index("dish")]
    assert not shown[tree.topology.index("moon")]


def test_ranges_come_from_the_gaps():
    tree, states = earth_and_moon()
    _, positions = poses_from(parents_of(tree, states[0])[0], numbers_of(tree, states[0]), tree.topology.index("earth"))
    ranges = ranges_of(positions, tree.names)
    assert [one.text.split("out to ")[1] for one in ranges] == ["dish", "moon", "ssb"]
    assert default_range(ranges).text.endswith("moon")
    assert ranges_of(np.zeros((3, 3)), "abc")[0].metres == 1.0
    logs = logarithmic(positions)
    places, shown = logs.places(positions)
    assert shown.all()
    away = np.linalg.norm(places, axis=1)
    assert np.array_equal(np.argsort(away, kind="stable"), np.argsort(np.linalg.norm(positions, axis=1), kind="stable"))
    np.testing.assert_allclose(away.max(), WIDE)


def test_unknown_places_are_hidden():
    places, shown = Scaling(1.0).places(np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    assert shown.tolist() == [True, False, True]
    assert np.isfinite(places).all()


def test_labels_of_frames_at_one_place_merge():
    places = np.array([[0.0, 0, 0], [1e-4, 0, 0], [0, 1e-4, 0], [0, 0, 1e-4], [0, 0, 0], [1.0, 0, 0]])
    assert merged(places, np.ones(6, bool), "abcdef") == [(0, "a, b, c +2"), (5, "f")]
    assert merged(places, np.arange(6) > 4, "abcdef") == [(5, "f")]


# --- meshes -----------------------------------------------------------------------------------------------------------------


def robot(visual):
    return jf.load_urdf(f"<robot name='r'><link name='base'><visual>{visual}</visual></link></robot>")


def test_meshes_are_read_below_the_folder(tmp_path):
    import trimesh

    (tmp_path / "pack" / "meshes").mkdir(parents=True)
    trimesh.creation.box(extents=(1, 2, 3)).export(tmp_path / "pack" / "meshes" / "box.stl")
    mesh = "<geometry><mesh filename='package://pack/meshes/box.stl' scale='2 2 2'/></geometry>"
    mesh = "<origin xyz='1 0 0' rpy='0 0 1.5707963267948966'/>" + mesh
    for root in (tmp_path, tmp_path / "pack"):
        (shape,) = shapes_of(robot(mesh), root)
        np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), [4, 2, 6], atol=1e-5)
        np.testing.assert_allclose(shape.vertices.mean(0), [1, 0, 0], atol=1e-5)


@pytest.mark.parametrize(
    ("visual", "size"),
    [("<box size='1 2 3'/>", [1, 2, 3]), ("<cylinder radius='1' length='4'/>", [2, 2, 4]), ("<sphere radius='2'/>", [4, 4, 4])],
)
def test_simple_shapes_need_no_file(visual, size, tmp_path):
    (shape,) = shapes_of(robot(f"<geometry>{visual}</geometry>"), tmp_path)
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), size, rtol=0.02)


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("http://127.0.0.1:9/x.stl", "http://"),
        ("file:///etc/passwd", "file://"),
        ("package://../secret.stl", "outside the folder"),
        ("/etc/passwd", "outside the folder"),
        ("package://pack/none.stl", "is not below"),
        ("package://pack/link.stl", "outside the folder"),
        ("package://pack/notes.txt", "no mesh that is read"),
        ("package://pack/broken.stl", "cannot be read"),
    ],
)
def test_what_is_no_file_below_the_folder_is_refused(address, words, tmp_path):
    root = tmp_path / "root"
    (root / "pack").mkdir(parents=True)
    (tmp_path / "secret.stl").write_text("solid x")
    (root / "pack" / "link.stl").symlink_to(tmp_path / "secret.stl")
    (root / "pack" / "notes.txt").write_text("x")
    (root / "pack" / "broken.stl").write_bytes(b"\x00" * 10)
    with pytest.raises(jf.FrameError, match=words):
        shapes_of(robot(f"<geometry><mesh filename='{address}'/></geometry>"), root)


def test_a_tree_without_visuals_and_a_folder_that_is_none(arm, tmp_path):
    with pytest.raises(jf.FrameError, match="has none"):
        shapes_of(arm, tmp_path)
    with pytest.raises(jf.FrameError, match="no such folder"):
        shapes_of(arm, tmp_path / "none")


# --- the guard ----------------------------------------------------------------------------------------------------------------


def test_strangers_are_refused(arm):
    with jf.show_frames_3d(arm, port=0) as handle:
        refused_strangers(handle.port, "/")


def test_a_viser_that_goes_round_the_guard_is_not_served(arm, monkeypatch):
    """An update of viser that no longer serves by the function that is guarded."""
    monkeypatch.setattr(guarded_viser, "_guarded", lambda serve, host: serve)
    before = set(threading.enumerate())
    with pytest.raises(jf.FrameError, match=r"viser .* answers strangers in spite of the guard"):
        jf.show_frames_3d(arm, port=0)
    end = time.monotonic() + 10
    while [t for t in threading.enumerate() if t not in before and "ThreadPool" not in t.name]:
        assert time.monotonic() < end
        time.sleep(0.02)


def test_the_function_is_put_back(arm):
    import websockets.asyncio.server as underlying

    own = underlying.serve
    with jf.show_frames_3d(arm, port=0):
        assert underlying.serve is own


def test_nobody_is_asked_for_a_public_address(arm, monkeypatch):
    handle = jf.show_frames_3d(arm, port=0)
    with handle:
        monkeypatch.setattr("viser._viser.ViserTunnel", None)  # calling it would fail
        assert handle._server.request_share_url() is None


def test_a_taken_port_and_one_that_is_free_again(arm, capfd):
    with jf.show_frames_3d(arm, port=0) as handle:
        with pytest.raises(jf.FrameError, match=rf"port {handle.port} of 127.0.0.1 is taken; port=0 picks a free one"):
            jf.show_frames_3d(arm, port=handle.port)
        port = handle.port
    handle.close()
    with socket.create_server(("127.0.0.1", port)):
        pass
    with pytest.raises(jf.FrameError, match="is closed"):
        handle.show(0)
    assert "closed" in repr(handle)
    assert "viser" not in capfd.readouterr().out  # no banner


def test_bad_options_are_refused(arm, monkeypatch):
    for options, words in (
        ({"focus": "tpi"}, "tip"),
        ({"trails": "tip"}, "sequence"),
        ({"trails": ["tpi"]}, "tip"),
        ({"bodies": {"tip": -1.0}}, "positive"),
        ({"bodies": {"tpi": 1.0}}, "tip"),
        ({"distances": "near"}, "logarithmic"),
        ({"label_map": {"tpi": "x"}}, "tip"),
        ({"states": lambda t: None}, "times=epochs"),
    ):
        with pytest.raises(jf.FrameError, match=words):
            jf.show_frames_3d(arm, port=0, **options)
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(jf.FrameError, match=r"pip install 'jaxframes\[view\]'"):
        jf.show_frames_3d(arm, port=0)


# --- in the browser -------------------------------------------------------------------------------------------------------------


def opened(reader, address):
    reader.log.expected = ("WebGL", "GPU stall", "favicon", "WebSocket connection to")
    page = reader.open(1100, 750)
    page.goto(address)
    page.wait_for_selector("canvas", timeout=60_000)
    return page


def test_joints_have_sliders_that_start_where_the_state_is(arm, reader):
    with jf.show_frames_3d(arm, arm.state(q=[0.75]), port=0, title="Arm") as handle:
        page = opened(reader, handle.url)
        page.get_by_text("Joints").wait_for(timeout=60_000)
        until(page, "[...document.querySelectorAll('input')].some(i => i.value === '0.75')")
        before = np.array(handle._scene._axes.batched_positions)
        box = page.locator("input", has_not_text="x").filter(visible=True)
        for i in range(box.count()):
            if box.nth(i).input_value() == "0.75":
                box.nth(i).fill("1.25")
                box.nth(i).press("Enter")
                break
        end = time.monotonic() + 20
        while np.allclose(before, handle._scene._axes.batched_positions):
            assert time.monotonic() < end
            page.wait_for_timeout(20)
        expected = np.asarray(arm.transform(arm.state(q=[1.25]), of="tip", relative_to="base").translation)
        found = handle._scene._axes.batched_positions[2]
        np.testing.assert_allclose(found / np.linalg.norm(found), expected / np.linalg.norm(expected), atol=2e-3)


def test_a_mission_plays_and_is_recorded(reader, tmp_path):
    tree, states = earth_and_moon()
    bodies = {"earth": 6.378e6, "moon": 1.737e6}
    with jf.show_frames_3d(tree, states, focus="earth", trails=["moon"], bodies=bodies, port=0) as handle:
        page = opened(reader, handle.url)
        page.get_by_role("button", name="Play").click(timeout=60_000)
        end = time.monotonic() + 30
        while handle._step < 11:
            assert time.monotonic() < end
            page.wait_for_timeout(20)
        handle.show(0)
        handle.record(tmp_path / "mission.html")
        with pytest.raises(jf.FrameError, match="positive"):
            handle.record(tmp_path / "mission.html", steps_a_second=0)
        page.close()
    page = opened(reader, (tmp_path / "mission.html").as_uri())
    page.wait_for_timeout(1500)


def test_hostile_names_are_data_in_3d(reader):
    b = jf.TreeBuilder(root=NAMES[0])
    for i, name in enumerate(NAMES[1:]):
        b.add(name, parent=NAMES[0], edge=jf.edges.Revolute(placement=jf.Transform.from_translation((np.cos(i), np.sin(i), 0.1 * i))))
    tree = b.build()
    with jf.show_frames_3d(tree, port=0, title=NAMES[2], label_map=dict(zip(NAMES, TEXTS[:1:-1], strict=True))) as handle:
        page = opened(reader, handle.url)
        page.get_by_text("Joints").wait_for(timeout=60_000)
        page.wait_for_timeout(2000)
        assert page.evaluate("window.stung") is None


def test_states_of_one_instant_can_be_updated(arm):
    with jf.show_frames_3d(arm, port=0, distances="logarithmic") as handle:
        before = np.array(handle._scene._axes.batched_positions)
        handle.update(arm.state(q=[1.0]))
        assert not np.allclose(before, handle._scene._axes.batched_positions)
        assert len(handle._scene._texts) == 2
    with jf.show_frames_3d(arm, lambda t: arm.state(q=[t]), times=[0.0, 0.5], port=0) as handle:
        with pytest.raises(jf.FrameError, match="show"):
            handle.update(arm.state())
        with pytest.raises(jf.FrameError, match="there are 2"):
            handle.show(2)
