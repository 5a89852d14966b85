"""The live page: what the handle, the buttons and the slider do, in headless Chromium, and how the server ends."""

import json
import socket
import subprocess
import sys
import threading
import time
import urllib.request

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import jaxframes as jf
from tests.view.conftest import click, ready, shown, until
from tests.view.trees import every_kind, large, row

pytestmark = pytest.mark.float64


@pytest.fixture
def scene():
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute(limits=(-2.0, 2.0)))
    b.add("hand", parent="arm", edge=jf.edges.Fixed(jf.Transform.from_translation((1.0, 0.0, 0.0))))
    b.add("table", parent="world", edge=jf.edges.Fixed())
    b.add("box", parent="table", edge=jf.edges.Attachable())
    return b.build()


@pytest.fixture
def live(reader):
    """Serves a tree and opens its page."""
    handles = []

    def go(*arguments, **options):
        handle = jf.show_frames_graph(*arguments, port=0, **options)
        handles.append(handle)
        page = reader.open()
        page.goto(handle.url)
        ready(page)
        return handle, page

    reader.log.expected = ("WebSocket connection to",)  # a page that outlives its server tries again
    yield go
    for handle in handles:
        handle.close()


def pair(page, of, relative_to):
    return np.array(page.evaluate("([a, b]) => frames.pair(a, b)", [of, relative_to]), float)


def agrees(page, tree, state, of, relative_to):
    found, expected = pair(page, of, relative_to), row(tree.motion(state, of=of, relative_to=relative_to))
    found[:4] *= np.sign(found[:4] @ expected[:4])
    return np.abs(found - expected).max() <= 1e-12 * max(1.0, np.abs(expected).max())


def test_an_update_keeps_the_selection_and_the_view(live, scene):
    handle, page = live(scene, scene.state(q=[0.1]))
    click(page, "hand")
    click(page, "world")
    page.mouse.move(300, 400)
    page.mouse.wheel(0, -200)
    before = shown(page)
    state = scene.state(q=[0.7], qd=[1.0])
    handle.update(state=state)
    until(page, "Number(document.body.dataset.motions) > 1")
    after = shown(page)
    assert after["view"] == before["view"]
    assert (after["chosen"], after["observer"]) == ("hand", "world")
    assert agrees(page, scene, state, "hand", "world")
    assert f"{np.cos(0.7):.9g}" in page.inner_text("#panel")


def test_a_reattached_frame_glides_to_its_new_parent(live, scene):
    handle, page = live(scene)
    page.wait_for_timeout(500)
    start, view = page.evaluate("places.get(4)"), shown(page)["view"]
    click(page, "box")
    state = scene.attach(scene.state(q=[0.4]), "box", "hand", keep="world")
    handle.update(state=state)
    until(page, "Number(document.body.dataset.trees) > 1")
    assert shown(page)["parents"][4] == 2
    way = np.array(page.evaluate("[0, 0.25, 0.5, 0.75, 1].map((part) => placeNow(4, changedAt + part * GLIDE))"))
    assert way[0].tolist() == start  # from where it was, step by step, to its new place
    assert (np.diff(np.linalg.norm(way - way[0], axis=1)) > 5).all()
    assert way[-1].tolist() == page.evaluate("places.get(4)")
    until(page, "performance.now() - changedAt > GLIDE + 60")
    assert shown(page)["view"] == view
    assert shown(page)["chosen"] == "box"
    until(page, "numbers !== null")
    assert agrees(page, scene, state, "box", "world")


def test_another_tree_takes_the_place_of_the_first(live, scene):
    handle, page = live(scene)
    click(page, "hand")
    b = jf.TreeBuilder(root="world")
    b.add("new", parent="world", edge=jf.edges.Fixed())
    b.add("arm", parent="new", edge=jf.edges.Revolute())
    b.add("hand", parent="arm", edge=jf.edges.Fixed())
    handle.update(tree=b.build())
    until(page, "tree.names.length === 4 && numbers !== null")
    assert shown(page)["chosen"] == "hand"
    assert {"new", "arm", "hand"} <= set(shown(page)["rows"])


def test_buttons_call_back_and_what_they_raise_is_shown(live, scene):
    calls = []

    def break_down(page):
        raise ValueError("no <b>cells</b> left")

    def turn(page):
        calls.append(threading.current_thread())
        page.update(state=scene.state(q=[1.0]))

    handle, page = live(scene, buttons=[jf.Button("Turn", turn), ("Break", break_down)])
    page.get_by_role("button", name="Break").click()
    until(page, "!document.getElementById('said').hidden")
    assert "ValueError: no <b>cells</b> left" in page.inner_text("#said")
    page.get_by_role("button", name="Turn").click()
    until(page, "Number(document.body.dataset.motions) > 1")
    assert agrees(page, scene, scene.state(q=[1.0]), "hand", "world")
    assert len(calls) == 1
    page.get_by_role("button", name="Break").click()  # and it goes on after that
    page.get_by_role("button", name="Turn").click()
    until(page, "document.getElementById('live').className === 'on'")
    assert handle.port


def test_a_slider_asks_the_server(live, scene):
    asked = []

    def at(t):
        asked.append(t)
        return scene.attach(scene.state(q=[t]), "box", "hand") if t > 1.0 else scene.state(q=[t])

    _, page = live(scene, states=at, times=np.linspace(0.0, 1.5, 16))
    page.focus("#slider")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    until(page, "document.getElementById('when').textContent === '0.5 s' && Number(document.body.dataset.motions) > 1")
    until(page, "asked === null && wish === null")
    assert agrees(page, scene, at(0.5), "hand", "world")
    page.click("#play")
    until(page, "document.getElementById('play').textContent === 'Play' && asked === null && wish === null")
    assert page.inner_text("#when") == "1.5 s"
    until(page, "tree.parents[4] === 2 && numbers !== null")
    assert agrees(page, scene, at(1.5), "box", "world")
    assert set(asked) <= set(np.linspace(0.0, 1.5, 16)) | {0.5, 1.5}


def test_health_follows(live, scene):
    handle, page = live(scene)
    handle.update(state=scene.state(q=[3.0]))
    until(page, "tree.health[1] !== undefined")
    assert "outside its limits" in page.evaluate("tree.health[1][0]")
    handle.update(state=scene.state(q=[0.0]))
    until(page, "tree.health[1] === undefined")


def test_two_readers_and_two_servers_at_once(live, reader, scene, rng):
    tree, state = every_kind(rng)
    first, page = live(scene)
    second, other = live(tree, state)
    also = reader.open()
    also.goto(first.url)
    ready(also)
    first.update(state=scene.state(q=[0.9]))
    for one in (page, also):
        until(one, "Number(document.body.dataset.motions) > 1")
        assert agrees(one, scene, scene.state(q=[0.9]), "hand", "world")
    assert first.port != second.port
    assert agrees(other, tree, state, "ball", "screw")


def test_a_page_comes_back_to_a_server_that_was_started_again(live, reader, scene):
    handle, page = live(scene)
    handle.close()
    until(page, "document.getElementById('live').className === ''")
    with jf.show_frames_graph(scene, scene.state(q=[1.1]), port=handle.port):
        until(page, "document.getElementById('live').className === 'on' && numbers !== null")
        until(page, "Math.abs(frames.pair('arm', 'world')[3] - Math.sin(0.55)) < 1e-12")


@pytest.mark.parametrize("count", [200, 5000])
def test_large_trees_are_live(live, rng, count):
    tree, state = large(rng, count)
    handle, page = live(tree, state)
    begun = time.perf_counter()
    seen = int(page.evaluate("document.body.dataset.motions"))
    handle.update(state=state.replace(q=state.q + 0.5))
    until(page, f"Number(document.body.dataset.motions) > {seen}")
    print(f"{count} frames: update shown after {1e3 * (time.perf_counter() - begun):.0f} ms")
    joint = tree.frame_of(tree.joint_names[0])
    before = page.evaluate("i => Array.from(numbers.subarray(19 * i, 19 * i + 19))", tree.topology.index(joint))
    q = np.array(state.q)
    q[:1] += 0.25
    handle.update(state=state.replace(q=q))  # one joint moves: rows that did not change are not sent
    until(page, f"Number(document.body.dataset.motions) > {seen + 1}")
    assert page.evaluate("i => Array.from(numbers.subarray(19 * i, 19 * i + 19))", tree.topology.index(joint)) != before


def test_only_rows_that_changed_are_sent(scene):
    with jf.show_frames_graph(scene, port=0) as handle, connect(handle.url.replace("http", "ws") + "live", origin=handle.url[:-1]) as line:
        assert "tree" in json.loads(line.recv(5))
        whole = np.frombuffer(line.recv(5))
        assert whole[0] == -1
        assert len(whole) == 1 + 5 * 19
        while "health" not in json.loads(line.recv(5)):
            pass
        handle.update(state=scene.state(q=[0.5]))
        part = np.frombuffer(line.recv(5))
        assert part[0] == 1
        assert len(part) == 20


def test_messages_that_are_none_of_a_pages_are_survived(scene):
    pressed = []
    with jf.show_frames_graph(scene, port=0, buttons=[("go", pressed.append)]) as handle:
        with connect(handle.url.replace("http", "ws") + "live", origin=handle.url[:-1]) as line:
            for message in ("{", "[]", "3", '{"button": 7}', '{"button": true}', '{"time": 0}', '{"x": 1}', b"\x00\xff"):
                line.send(message)
            line.send('{"button": 0}')
            said = 0
            while not pressed or said < 8:
                message = line.recv(5)
                said += isinstance(message, str) and "said" in json.loads(message)
            assert said == 8
        with connect(handle.url.replace("http", "ws") + "live", origin=handle.url[:-1]) as line:
            line.send("x" * 100_000)
            with pytest.raises(ConnectionClosed):
                [line.recv(5) for _ in range(10)]
        assert pressed == [handle]  # and nothing was pressed by it


def test_a_taken_port_is_an_error_that_names_the_remedy(scene):
    with jf.show_frames_graph(scene, port=0) as handle:
        with pytest.raises(jf.FrameError, match=rf"port {handle.port} of 127.0.0.1 is taken; port=0 picks a free one"):
            jf.show_frames_graph(scene, port=handle.port)
        port = handle.port
    with jf.show_frames_graph(scene, port=port) as again:  # bound again at once
        assert again.port == port


def test_closing_leaves_no_thread_and_a_closed_page_says_so(live, scene):
    before = set(threading.enumerate())
    handle, _ = live(scene)
    begun = time.perf_counter()
    handle.close()
    handle.close()
    print(f"closed in {1e3 * (time.perf_counter() - begun):.1f} ms")
    end = time.monotonic() + 10
    while left := [t for t in threading.enumerate() if t not in before and t.name.startswith("jaxframes")]:
        assert time.monotonic() < end, left
        time.sleep(0.01)
    with pytest.raises(jf.FrameError, match="is closed"):
        handle.update(state=scene.state(q=[0.1]))
    assert "closed" in repr(handle)
    with socket.create_server(("127.0.0.1", handle.port)):
        pass


def test_the_interpreter_ends_with_a_page_open():
    program = """
import jaxframes as jf
b = jf.TreeBuilder(root="world"); b.add("arm", parent="world", edge=jf.edges.Revolute())
page = jf.show_frames_graph(b.build(), port=0); print(page.url)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.startswith("http://127.0.0.1:")
    assert done.stderr == ""


def test_the_handle_in_a_notebook_is_the_static_page(scene):
    with jf.show_frames_graph(scene, port=0, title="Cell") as handle:
        text = handle._repr_html_()
    assert text.startswith('<iframe sandbox="allow-scripts" srcdoc="')
    assert "127.0.0.1" not in text


def test_a_browser_is_opened_only_if_asked(scene, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    with jf.show_frames_graph(scene, port=0):
        assert opened == []
    with jf.show_frames_graph(scene, port=0, launch_client=True) as handle:
        assert opened == [handle.url]


def test_a_bad_option_is_refused_before_anything_listens(scene):
    for options, word in (
        ({"coloring": "rainbow"}, "valency"),
        ({"label_map": {"hnd": "x"}}, "Did you mean 'hand'"),
        ({"label_map": {99: "x"}}, "0 to 4"),
        ({"chains": [("hand", "hnd")]}, "hnd"),
        ({"chains": ["hand"]}, "pairs"),
        ({"buttons": ["go"]}, "buttons takes"),
        ({"times": [1.0]}, "times need states"),
        ({"states": lambda t: None}, "times=epochs"),
        ({"states": lambda t: 3, "times": [0.0]}, "found int"),
        ({"states": scene.state(), "times": [0.0]}, "one axis"),
        ({"state": scene.state(q=[[0.1], [0.2]])}, r"state\[0\]"),
        ({"state": 3}, "found int"),
        ({"port": -1}, "port=-1"),
    ):
        with pytest.raises(jf.FrameError, match=word):
            jf.show_frames_graph(scene, **{"port": 0, **options})


def test_a_missing_package_is_an_error_that_names_the_extra(scene, monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets.sync.server", None)
    with pytest.raises(jf.FrameError, match=r"pip install 'jaxframes\[view\]'"):
        jf.show_frames_graph(scene, port=0)


def test_the_page_is_served_with_its_policy(scene):
    with jf.show_frames_graph(scene, port=0) as handle, urllib.request.urlopen(handle.url) as answer:
        policy = answer.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "frame-ancestors 'none'" in policy
        assert f"connect-src ws://127.0.0.1:{handle.port};" in policy
        assert "unsafe" not in policy
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert answer.headers["Cache-Control"] == "no-store"
        assert answer.headers["Referrer-Policy"] == "no-referrer"


def test_a_button_may_close_its_page(live, scene):
    done = threading.Event()

    def close(page):
        page.close()
        done.set()

    handle, page = live(scene, buttons=[("Close", close)])
    page.get_by_role("button", name="Close").click()
    until(page, "document.getElementById('live').className === ''")
    assert done.wait(10)
    with socket.create_server(("127.0.0.1", handle.port)):
        pass


def test_copying_gives_the_line_and_all_digits(live, scene):
    state = scene.state(q=[0.1], qd=[1 / 3])
    handle, page = live(scene, state)
    page.context.grant_permissions(["clipboard-read", "clipboard-write"], origin=handle.url[:-1])
    click(page, "hand")
    click(page, "world")
    page.get_by_role("button", name="Copy", exact=True).first.click()
    until(page, "document.body.innerText.includes('Copied')")
    assert page.evaluate("navigator.clipboard.readText()") == 'tree.motion(state, of="hand", relative_to="world")'
    page.get_by_role("button", name="Copy numbers").first.click()
    until(page, "navigator.clipboard.readText().then((text) => text.startsWith('{'))")
    copied = json.loads(page.evaluate("navigator.clipboard.readText()"))
    motion = scene.motion(state, of="hand", relative_to="world")
    np.testing.assert_allclose(copied["velocity"], motion.velocity.linear, rtol=1e-15, atol=1e-15)
    np.testing.assert_allclose(copied["wxyz"], motion.transform.rotation.wxyz, rtol=1e-15, atol=1e-15)


def test_what_is_not_known_is_a_dash_and_never_zero(live):
    b = jf.TreeBuilder(root="world")
    b.add("craft", parent="world", edge=jf.edges.Prescribed(supports_accelerations=False))
    _, page = live(b.build())
    click(page, "craft")
    numbers = page.inner_text("#panel .numbers")
    assert numbers.count("\u2014") == 6


def test_frames_that_hang_on_themselves_are_shown_and_said(live):
    b = jf.TreeBuilder(root="world")
    for name in ("a", "b"):
        b.add(name, parent="world", edge=jf.edges.Attachable())
    tree = b.build()
    state = tree.state()
    state = state.replace(attachments=jf.Attachments(np.array([2, 1], np.int32), state.attachments.motion))
    _, page = live(tree, state)
    until(page, "Object.keys(tree.health).length > 0")
    assert set(shown(page)["rows"]) == {"world", "a", "b"}
    assert "cycle" in page.evaluate("Object.values(tree.health)[0][0]")
    click(page, "a")
    assert "\u2014" in page.inner_text("#panel .numbers")
