"""Closed by construction: who is refused, and names that stay data, live and in a file."""

import itertools
import re
import socket
import time

import pytest

import jaxframes as jf
from tests.view.conftest import ready, shown, until
from tests.view.hostile import LINES, NAMES, TEXTS, TURNED

pytestmark = pytest.mark.float64


def ask(port, path="/", upgrade=False, method="GET", **headers):
    """The status of an answer to a request written by hand; a header may have several values."""
    lines = [f"{method} {path} HTTP/1.1"]
    if upgrade:
        headers |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        headers["Sec-WebSocket-Key"] = "dGhlIHNhbXBsZSBub25jZQ=="
    for name, values in headers.items():
        lines += [f"{name}: {value}" for value in ([values] if isinstance(values, str) else values)]
    with socket.create_connection(("127.0.0.1", port), timeout=10) as line:
        line.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        found = line.recv(400)
    return int(found.split()[1]) if found else None


def refused_strangers(port, path):
    """What a server answers to whom it should not answer: nothing else than a refusal."""
    own = f"127.0.0.1:{port}"
    for host in (
        "evil.example",
        f"evil.example:{port}",
        "127.0.0.1",
        f"127.0.0.1:{port + 1}",
        f"127.0.0.1.evil.example:{port}",
        own.upper() + ".",
    ):
        assert ask(port, Host=host) == 421, host
        assert ask(port, path, upgrade=True, Host=host, Origin=f"http://{host}") == 421, host
    assert ask(port, Host=[own, own]) == 421
    assert ask(port, Host=[own, "evil.example"]) == 421
    assert ask(port) == 421
    for origin in (
        "http://evil.example",
        "null",
        f"https://{own}",
        f"http://{own}.evil.example",
        "http://127.0.0.1",
        f"http://localhost:{port}",
    ):
        assert ask(port, path, upgrade=True, Host=own, Origin=origin) == 403, origin
        assert ask(port, Host=own, Origin=origin) == 403, origin
    assert ask(port, path, upgrade=True, Host=own) == 403
    assert ask(port, path, upgrade=True, Host=own, Origin=[f"http://{own}"] * 2) == 403
    assert ask(port, Host=own) == 200
    assert ask(port, Host=f"localhost:{port}") == 200
    assert ask(port, path, upgrade=True, Host=own, Origin=f"http://{own}") == 101
    assert ask(port, path, upgrade=True, Host=f"localhost:{port}", Origin=f"http://localhost:{port}") == 101


@pytest.fixture
def scene():
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute())
    return b.build()


def test_strangers_are_refused(scene):
    with jf.show_frames_graph(scene, port=0) as handle:
        refused_strangers(handle.port, "/live")
        own = f"127.0.0.1:{handle.port}"
        assert ask(handle.port, "/page.js", Host=own) == 404
        assert ask(handle.port, "/../etc/passwd", Host=own) == 404
        assert ask(handle.port, "/?x=1", Host=own) == 404
        assert ask(handle.port, "/live", Host=own) == 403
        assert ask(handle.port, upgrade=True, Host=own, Origin="http://evil.example") == 403
        assert ask(handle.port, method="POST", Host=own) in (None, 400, 405)
        assert ask(handle.port, Host=own) == 200


def test_another_local_page_can_neither_read_nor_frame_it(scene, reader):
    """A page of another server on this machine: it is this machine's browser that asks, with an Origin of its own."""
    with jf.show_frames_graph(scene, port=0) as handle, jf.show_frames_graph(scene, port=0) as other:
        reader.log.expected = ("",)
        page = reader.open(bypass_csp=True)
        page.goto(other.url)
        ready(page)
        tried = """async (url) => {
            const found = {};
            try { await fetch(url); found.fetched = true; } catch { found.fetched = false; }
            found.socket = await new Promise((done) => {
                const line = new WebSocket(url.replace("http", "ws") + "live");
                line.onopen = () => done(true);
                line.onerror = () => done(false);
            });
            return found;
        }"""
        assert page.evaluate(tried, handle.url) == {"fetched": False, "socket": False}
        page.evaluate("url => { const f = document.createElement('iframe'); f.src = url; document.body.append(f); }", handle.url)
        end = time.monotonic() + 20
        while not page.frames[1].url.startswith("chrome-error:"):  # refused by the browser, as the page's policy asks
            assert time.monotonic() < end
            page.wait_for_timeout(20)
        assert page.frames[1].evaluate("document.body === null || document.body.dataset.trees === undefined")


def test_a_script_put_in_on_purpose_does_not_run(scene, reader):
    reader.log.expected = ("Content Security Policy", "violates")
    with jf.show_frames_graph(scene, port=0) as handle, socket.create_server(("127.0.0.1", 0)) as trap:
        trap.settimeout(0.5)
        page = reader.open()
        page.goto(handle.url)
        ready(page)
        put = "text => document.body.insertAdjacentHTML('beforeend', text)"
        page.evaluate(put, f"<img src=http://127.0.0.1:{trap.getsockname()[1]}/x onerror=window.stung=1>")
        page.evaluate(put, "<a id=trap onclick=window.stung=1>x</a>")
        page.evaluate("document.getElementById('trap').click()")
        with pytest.raises(TimeoutError):
            trap.accept()  # the image was not fetched
        assert page.evaluate("window.stung") is None


def hostile_tree():
    """Hostile texts as names of frames and joints, with labels, chains, edges that name others, a title and buttons."""
    b = jf.TreeBuilder(root=NAMES[0])
    for before, name in itertools.pairwise(NAMES):
        b.add(name, parent=before, edge=jf.edges.Revolute(), joint="joint " + name)
    b.add("follower", parent=NAMES[0], edge=jf.edges.Mimic("joint " + NAMES[2], jf.edges.Revolute()))
    b.add("box", parent=NAMES[0], edge=jf.edges.Attachable(candidates=NAMES[:3]))
    tree = b.build()
    looks = {
        "label_map": dict(zip(NAMES, TEXTS[:1:-1], strict=True)),
        "chains": [(NAMES[1], NAMES[4]), (NAMES[10], NAMES[0])],
    }
    return tree, looks


def tried_everywhere(page, tree):
    """Hover and choose every frame, look at it in every mode; nothing may run."""
    ready(page)
    page.click("#expand")
    for mode in ("outline", "tree"):
        page.select_option("#mode", mode)
        page.wait_for_timeout(400)
        for name in shown(page)["rows"]:
            page.evaluate("name => { showRow(tree.names.indexOf(name)); showTip(tree.names.indexOf(name), 50, 50); }", name)
            page.evaluate("name => choose(tree.names.indexOf(name), 0)", name)
    assert len(shown(page)["rows"]) == len(tree.names)
    page.fill("#search", NAMES[1])
    assert shown(page)["hits"] == [NAMES[2], NAMES[1]] or NAMES[1] in shown(page)["hits"]
    page.evaluate("name => choose(tree.names.indexOf(name), -1)", NAMES[2])
    assert page.inner_text("#panel h2") == NAMES[2]
    code = page.inner_text("#panel code >> nth=0")
    assert eval(re.search(r"of=(\".*?[^\\]\"), relative_to", code, re.DOTALL).group(1)) == NAMES[2]
    page.wait_for_timeout(100)
    assert page.evaluate("window.stung") is None
    assert page.locator("img, svg, script:not(#data), iframe").count() == 1  # the page's own script


def test_hostile_names_are_data_in_a_file(reader, tmp_path):
    tree, looks = hostile_tree()
    for i, title in enumerate(NAMES[:5]):
        jf.to_html(tree, tmp_path / f"{i}.html", title=title, **looks)
        page = reader.open()
        page.goto((tmp_path / f"{i}.html").as_uri())
        assert page.title() == title
        if i == 0:
            tried_everywhere(page, tree)
        ready(page)
        assert page.evaluate("window.stung") is None


def test_hostile_names_are_data_live(reader):
    tree, looks = hostile_tree()

    def fail(page):
        raise ValueError(NAMES[2])

    buttons = [(text, fail) for text in TEXTS]
    with jf.show_frames_graph(
        tree, port=0, title=NAMES[2], buttons=buttons, states=lambda t: tree.state(), times=list(TEXTS), **looks
    ) as handle:
        page = reader.open()
        page.goto(handle.url)
        tried_everywhere(page, tree)
        page.locator("#buttons button").nth(2).click()
        until(page, "!document.getElementById('said').hidden")
        assert NAMES[2] in page.inner_text("#said")
        page.focus("#slider")
        page.keyboard.press("ArrowRight")
        until(page, "asked === null && wish === null")
        page.wait_for_timeout(200)
        assert page.evaluate("window.stung") is None


def test_marks_that_turn_text_round_are_visible_in_pills_and_escaped_in_code(reader, tmp_path):
    tree, _ = hostile_tree()
    jf.to_html(tree, tmp_path / "t.html", label_map={NAMES[8]: TURNED, NAMES[7]: LINES})
    page = reader.open()
    page.goto((tmp_path / "t.html").as_uri())
    ready(page)
    for name in NAMES[7:9]:
        assert "\u00b7" in page.evaluate("name => pillText(tree.names.indexOf(name))", name)
    assert page.evaluate("name => pythonText(name)", TURNED) == '"\\u202egnirts desrever\\u202c"'
    assert len(page.evaluate("name => pillText(tree.names.indexOf(name))", NAMES[10])) == 32
