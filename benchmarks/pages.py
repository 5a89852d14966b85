"""The targets of the graph page, measured in headless Chromium: opening, numbers, updates, drawing, sizes, closing.

Run: ``python benchmarks/pages.py [--chromium PROGRAM]`` (needs Chromium and the packages of the extras ``dev`` and ``view``).
"""

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

import jaxframes as jf
from jaxframes.view.page_text import parts

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from tests.view.conftest import FLAGS, HERE, until
from tests.view.trees import fleet, large, row

TARGET = "{:58s} {:>12s}   asked: {}"


def line(what: str, value: str, asked: str) -> None:
    print(TARGET.format(what, value, asked), flush=True)


def milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.0f} ms"


def opening(page, handle) -> tuple[float, float]:
    """Return when the tree was there, and when its numbers were, in seconds after the address was entered."""
    page.goto("about:blank")
    begun = time.perf_counter()
    page.goto(handle.url)
    until(page, "Number(document.body.dataset.trees) > 0")
    tree = time.perf_counter() - begun
    until(page, "Number(document.body.dataset.motions) > 0", 120)
    return tree, time.perf_counter() - begun


def updates(page, handle, tree, state, count: int = 7) -> float:
    """Return the median time from a call of ``update`` until the page shows it."""
    found = []
    for i in range(count):
        seen = int(page.evaluate("document.body.dataset.motions"))
        new = state.replace(q=state.q + 0.01 * (i + 1))
        begun = time.perf_counter()
        handle.update(state=new)
        until(page, f"Number(document.body.dataset.motions) > {seen}")
        found.append(time.perf_counter() - begun)
    return float(np.median(found))


def drawing(page, rows: int) -> float:
    """Return the median time of a picture while panning with about so many pills open, in milliseconds of the page's own clock."""
    opened = page.evaluate(
        """rows => { children.forEach((k, i) => { if (k.length && allRows().length < rows) { open.add(i); few.set(i, 1e9); } });
        layout(); fit(true); return allRows().length; }""",
        rows,
    )
    page.wait_for_timeout(600)
    found = page.evaluate(
        """async () => { const times = []; for (let i = 0; i < 15; i++) { view.x += 3; draw();
        await new Promise((next) => requestAnimationFrame(() => requestAnimationFrame(next)));
        times.push(Number(document.body.dataset.painting)); } return times; }"""
    )
    print(f"  ({opened} pills shown)")
    return float(np.median(found))


def smallest_text(page) -> float:
    """Return the height of the smallest text of the first look, in pixels."""
    return min(
        page.evaluate("13 * view.zoom"),
        page.evaluate("Math.min(...[...document.querySelectorAll('body *')].map((e) => parseFloat(getComputedStyle(e).fontSize)))"),
    )


def measured(page, name: str, tree, state, opens: str, shows: str) -> None:
    begun = time.perf_counter()
    handle = jf.show_frames_graph(tree, state, port=0)
    line(f"{name}: the call returns", milliseconds(time.perf_counter() - begun), "at once")
    first_tree, first = opening(page, handle)
    line(f"{name}: tree shown, first time", milliseconds(first_tree), "500 ms")
    line(f"{name}: numbers shown, first time in the process", milliseconds(first), "2 000 ms (attachables or not)")
    line(f"{name}: smallest text of the first look", f"{smallest_text(page):.1f} px", "10 px")
    _, again = opening(page, handle)
    line(f"{name}: open, numbers shown, values compiled", milliseconds(again), opens)
    line(f"{name}: update", milliseconds(updates(page, handle, tree, state)), shows)
    begun = time.perf_counter()
    handle.close()
    closed = time.perf_counter() - begun
    with jf.show_frames_graph(tree, state, port=handle.port):
        line(f"{name}: close, and the port bound again", milliseconds(closed), "100 ms, at once")


def worst_pair(page, tree, state, rng, count: int = 12) -> float:
    """Return the largest difference of a page's pairs from ``tree.motion``, relative to the largest number of each."""
    worst = 0.0
    for _ in range(count):
        of, relative_to = (str(name) for name in rng.choice(tree.names, 2, replace=False))
        found = np.array(page.evaluate("([a, b]) => frames.pair(a, b)", [of, relative_to]), float)
        expected = row(tree.motion(state, of=of, relative_to=relative_to))
        found[:4] *= np.sign(found[:4] @ expected[:4])
        worst = max(worst, float(np.abs(found - expected).max() / max(1.0, np.abs(expected).max())))
    return worst


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    options = parser.parse_args()
    if not options.chromium:
        sys.exit("no Chromium: apt-get install chromium, or name it with --chromium")
    from playwright.sync_api import sync_playwright

    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(0)
    requests: list[str] = []
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=options.chromium, headless=True, args=FLAGS)
        context = browser.new_context(viewport={"width": 1400, "height": 860})
        context.on("request", lambda request: requests.append(request.url))
        page = context.new_page()
        small, small_state = large(rng, 200, every=0)
        measured(page, "200 frames", small, small_state, "500 ms", "50 ms")
        big, big_state = large(rng)
        measured(page, "5 000 frames, 250 attachable", big, big_state, "1 000 ms", "100 ms")
        robots, robots_state = fleet(rng)
        measured(page, "312 robots of 14 links", robots, robots_state, "1 000 ms", "100 ms")

        sixty, sixty_state = large(rng, 60)
        jf.to_html(sixty, Path(folder) / "sixty.html", state=sixty_state)
        line("the page without data", f"{len(parts()[0].encode()) / 1e3:.1f} kB", "40 kB")
        line("to_html of 60 frames", f"{(Path(folder) / 'sixty.html').stat().st_size / 1e3:.1f} kB", "60 kB")
        jf.to_html(big, Path(folder) / "big.html", state=big_state)
        page.goto((Path(folder) / "big.html").as_uri())
        until(page, "Number(document.body.dataset.motions) > 0")
        line("a picture while panning, 500 pills", f"{drawing(page, 500):.1f} ms", "16 ms")
        line("a picture while panning, 5 000 pills", f"{drawing(page, 5000):.1f} ms", "33 ms")
        jf.to_html(small, Path(folder) / "small.html", state=small_state)
        page.goto((Path(folder) / "small.html").as_uri())
        until(page, "Number(document.body.dataset.motions) > 0")
        line("pairs in the page against tree.motion, worst of 12", f"{worst_pair(page, small, small_state, rng):.1e}", "1e-12")
        line("requests that leave this machine", str(sum(not url.startswith(HERE) for url in requests)), "0")
        browser.close()


if __name__ == "__main__":
    main()
