"""A headless Chromium for the tests of pages: every request is logged, and none may leave this machine."""

import os
import shutil
import time
from types import SimpleNamespace

import pytest

FLAGS = [
    *("--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"),
    *("--disable-sync", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
]
HERE = ("http://127.0.0.1:", "http://localhost:", "ws://127.0.0.1:", "ws://localhost:", "file:///", "about:", "data:", "blob:")


def missing(what):
    """Skip a test for want of a browser; where one must be there, as in CI, fail."""
    if os.environ.get("JAXFRAMES_BROWSER") == "required":
        pytest.fail(what)
    pytest.skip(what)


@pytest.fixture(scope="module")
def browser():
    """The browser; JAXFRAMES_BROWSER=required makes its absence a failure, JAXFRAMES_CHROMIUM names another program."""
    program = shutil.which(os.environ.get("JAXFRAMES_CHROMIUM", "chromium")) or shutil.which("chromium-browser")
    if program is None:
        missing("no Chromium: apt-get install chromium, or name it with JAXFRAMES_CHROMIUM")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("no playwright: pip install playwright")
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=program, headless=True, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def reader(browser):
    """Opens windows; afterwards no script has failed, no policy was broken, and no request has left this machine."""
    log = SimpleNamespace(requests=[], errors=[], contexts=[], expected=())

    def open_window(width=1400, height=860, **options):
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        log.contexts.append(context)
        context.on("request", lambda request: log.requests.append(request.url))
        context.on("weberror", lambda error: log.errors.append(str(error.error)))
        page = context.new_page()
        page.on("websocket", lambda socket: log.requests.append(socket.url))
        page.on("console", lambda line: log.errors.append(line.text) if line.type == "error" else None)
        return page

    yield SimpleNamespace(open=open_window, log=log)
    for context in log.contexts:
        context.close()
    assert log.requests or not log.contexts
    assert [url for url in log.requests if not url.startswith(HERE)] == []
    assert [error for error in log.errors if not any(text in error for text in log.expected)] == []


def until(page, script, seconds=30):
    """Wait for a script to answer yes; it goes through the debugger, which the page's policy does not stop."""
    end = time.monotonic() + seconds
    while not page.evaluate(script):
        assert time.monotonic() < end, script
        page.wait_for_timeout(5)


def ready(page):
    """Wait for a page's first numbers."""
    until(page, "Number(document.body.dataset.motions) > 0")


def click(page, name, **options):
    """Click a frame's pill."""
    page.mouse.click(*page.evaluate("name => frames.at(name)", name), **options)


def shown(page):
    """What a page shows: rows, view, selection."""
    return page.evaluate("frames.shown()")
