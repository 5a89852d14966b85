"""The live graph page: ``jf.show_frames_graph`` serves it, the handle changes it, buttons call back (the extra ``view``)."""

import json
import threading
import time
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from jaxframes.errors import FrameError, MissingExtraError, ShapeError
from jaxframes.model.state import State
from jaxframes.tree import FrameTree
from jaxframes.view.at_exit import close_with_program
from jaxframes.view.graph_data import Instants, Looks, States, health_of, instants_of, numbers_of
from jaxframes.view.looks import Chains, LabelMap, one_instant
from jaxframes.view.page_text import safe_json
from jaxframes.view.static import first_state, to_html

if TYPE_CHECKING:
    from jaxframes.view.clients import Client

PORT = 29623
Callback = Callable[["FramesGraph"], Any]


@dataclass(frozen=True)
class Button:
    """A button at the top of a live page.

    Attributes:
        label: What stands on it.
        callback: What a click calls, with the page's handle; one runs at a time, in a thread of its own.
    """

    label: str
    callback: Callback


class FramesGraph:
    """A live page of a tree; ``jf.show_frames_graph`` makes one. Its methods may be called from any thread.

    Attributes:
        url: Where the page is.
        port: The port that it listens at.
    """

    def __init__(self, tree: FrameTree, state: State, looks: Looks, buttons: Sequence[Button], instants: Instants | None):
        self._tree, self._state, self._looks, self._buttons, self._instants = tree, state, looks, tuple(buttons), instants
        self._changing, self._running = threading.RLock(), threading.Lock()
        self._version, self._at, self._closed, self._failed = 0, 0, False, False
        self._wake = threading.Event()
        self._of_tree = looks.of_tree(tree, [button.label for button in self._buttons])
        self._in_state = looks.in_state(tree, state)

    def _listen(self, host: str, port: int) -> None:
        from jaxframes.view.clients import Shown
        from jaxframes.view.server import Server

        self._shown = Shown()
        self._shown.put(tree=self._told())
        self._server = Server(host, port, self._shown, self._hear)
        self.url, self.port = self._server.url, self._server.port
        worker = threading.Thread(target=self._work, name="jaxframes page numbers", daemon=True)
        worker.start()
        close_with_program(self, worker)
        self._wake.set()

    def update(self, tree: FrameTree | None = None, state: State | None = None) -> None:
        """Show another tree, another state, or both; selection, pan, zoom and what is open stay.

        Args:
            tree: The new tree. Default: the present one.
            state: The new state, one instant. Default: the present one, or the neutral state of a new tree of another topology.

        Raises:
            FrameError: The page is closed.
            ShapeError: The state is a batch, or not one of the tree.
        """
        with self._changing:
            if self._closed:
                raise FrameError(f"the page at {self.url} is closed; jf.show_frames_graph opens another")
            if (tree is not None and state is None and tree.topology == self._tree.topology) or (tree is None and state is None):
                state = self._state
            self._set(self._tree if tree is None else tree, state, None)

    def _set(self, tree: FrameTree, state: State | None, at: int | None) -> None:
        """Show a tree in a state: what hangs on what first if that changed, then numbers; what is wrong follows."""
        state = one_instant(tree, state)
        same = tree is self._tree
        of_tree = self._of_tree if same else self._looks.of_tree(tree, [button.label for button in self._buttons])
        in_state = self._looks.in_state(tree, state)
        numbers = numbers_of(tree, state)
        changed = not same or in_state != self._in_state
        self._tree, self._state, self._of_tree, self._in_state = tree, state, of_tree, in_state
        self._version += 1
        shown: dict[str, Any] = {"numbers": numbers}
        if at is not None:
            self._at = at
            shown["times"] = {"times": self._times()}
        if changed:
            shown |= {"tree": self._told(), "health": None}
        if self._failed:
            self._failed, shown["said"] = False, None
        self._shown.put(**shown)
        self._wake.set()

    def _told(self) -> str:
        """Return the message that shows the present tree."""
        return safe_json({"tree": self._of_tree | self._in_state | {"times": self._times()}})

    def _times(self) -> dict[str, Any] | None:
        return None if self._instants is None else {"labels": list(self._instants.labels), "at": self._at}

    def _work(self) -> None:
        """Work out the first numbers, and after every change what ``tree.check`` finds: neither is waited for."""
        while self._wake.wait() and not self._closed:
            self._wake.clear()
            with self._changing:
                tree, state, version = self._tree, self._state, self._version
            try:
                if version == 0:
                    numbers = numbers_of(tree, state)
                    with self._changing:
                        if self._version == 0:
                            self._shown.put(numbers=numbers)
                health, notes = health_of(tree, state)
            except Exception as problem:  # whatever a user's edge raises is shown, and the page stays
                self._failed = True
                self._shown.put(said={"said": f"Numbers of this tree: {type(problem).__name__}: {problem}"})
                continue
            with self._changing:
                if version == self._version:
                    self._shown.put(health={"health": health, "notes": notes})
            time.sleep(0.2)

    def _hear(self, message: str | bytes, client: "Client") -> None:
        """Do what a reader asks for; whatever goes wrong is logged and shown."""
        from jaxframes.view.clients import quiet

        try:
            asked = json.loads(message)
            if not isinstance(asked, dict):
                raise FrameError("a page sends an object")
            if "button" in asked:
                self._press(asked["button"])
            elif "time" in asked:
                self._go_to(asked["time"])
            else:
                raise FrameError("a page sends the number of a button or of an instant")
        except Exception as problem:  # a callback may raise anything, and the page stays
            quiet.warning("a page's message failed: %r", message, exc_info=True)
            client.tell(said=f"{type(problem).__name__}: {problem}")
        finally:
            client.tell(answered=True)

    def _press(self, which: Any) -> None:
        if not isinstance(which, int) or isinstance(which, bool) or not 0 <= which < len(self._buttons):
            raise FrameError(f"there is no button {which!r}")
        button = self._buttons[which]
        with self._running:
            try:
                button.callback(self)
            except Exception as problem:
                problem.add_note(f"in the callback of button {button.label!r}")
                raise

    def _go_to(self, index: Any) -> None:
        if self._instants is None or not isinstance(index, int) or isinstance(index, bool):
            raise FrameError(f"there is no instant {index!r}")
        state = self._instants.state(index)
        with self._changing:
            if not self._closed:
                self._set(self._tree, state, index)

    def close(self) -> None:
        """Close the page and free its port; a second call does nothing."""
        with self._changing:
            if self._closed:
                return
            self._closed = True
        self._wake.set()
        self._server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<FramesGraph of {len(self._tree.names)} frames at {self.url}{', closed' if self._closed else ''}>"

    def _repr_html_(self) -> str:
        """Return the page as it is now, as a file would hold it: a notebook keeps it, and needs no server to show it again."""
        with self._changing:
            looks = {"label_map": self._looks.label_map, "title": self._looks.title, "chains": self._looks.chains}
            page = to_html(self._tree, state=self._state, coloring=self._looks.coloring, **looks)
        return page._repr_html_()


def show_frames_graph(
    tree: FrameTree,
    state: State | None = None,
    *,
    port: int = PORT,
    host: str = "127.0.0.1",
    label_map: LabelMap | None = None,
    title: str = "Frame layer",
    buttons: Sequence[Button | tuple[str, Callback]] = (),
    coloring: str = "type",
    chains: Chains = False,
    states: States | None = None,
    times: Any = None,
    launch_client: bool = False,
) -> FramesGraph:
    """Serve a tree as a live page and return its handle at once: kdFlex's ``showFramesGraph``.

    The page folds large trees, searches, shows the path to the root on a click and the motion of a pair on two, and follows
    ``page.update``. It answers to its own address only: no other web site can read it or press its buttons. Every user of this machine
    can. It ends with ``page.close()``, at the end of a ``with`` block, or with the program.

    Args:
        tree: The tree.
        state: What the numbers are of. Default: the neutral state, ``tree.state()``.
        port: Port to listen at; 0 picks a free one.
        host: Address to listen at. Another one than the default shows the page to the network, unencrypted.
        label_map: What to write on frames, by their names or numbers. Default: their names.
        title: Title of the page.
        buttons: ``jf.Button`` or pairs (label, callback). A callback gets the handle; what it raises is shown in the page.
        coloring: ``"type"`` colours by the kind of the edge, ``"valency"`` by how many edges meet.
        chains: What dashed arcs connect, as in ``jf.to_html``.
        states: For a slider: a function of one instant that returns its state, or a batch of states with one axis.
        times: The instants of the slider, as in ``jf.to_html``.
        launch_client: Whether to open a browser.

    Returns:
        The handle: ``url``, ``port``, ``update(tree, state)``, ``close()``; a context manager.

    Raises:
        MissingExtraError: The extra ``view`` is not installed.
        FrameError: The port is taken, or an option has a value that it does not take.
        UnknownFrameError: A label or a chain names no frame.

    Example:
        >>> import jaxframes as jf
        >>> b = jf.TreeBuilder(root="world")
        >>> b.add("arm", parent="world", edge=jf.edges.Revolute(axis=(0, 0, 1)))
        >>> tree = b.build()
        >>> with jf.show_frames_graph(tree, port=0) as page:
        ...     page.update(state=tree.state(q=[0.5]))
    """
    require_websockets()
    looks = Looks(label_map, title, coloring, chains)
    instants = instants_of(states, times)
    if tree.batch_shape:
        raise ShapeError(f"the tree holds a batch of numbers, shape {tree.batch_shape}, and a page shows one tree")
    page = FramesGraph(tree, first_state(tree, state, instants), looks, [_button(one) for one in buttons], instants)
    page._listen(host, port)
    if launch_client:
        webbrowser.open(page.url)
    return page


def require_websockets() -> None:
    """Raise MissingExtraError where there is nothing to serve pages with."""
    try:
        import websockets.sync.server  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("a live page needs the package 'websockets': pip install 'jaxframes[view]'") from error


def _button(given: Any) -> Button:
    label, callback = (given.label, given.callback) if isinstance(given, Button) else given if isinstance(given, tuple) else (None, None)
    if not isinstance(label, str) or not callable(callback):
        raise FrameError(f"buttons takes jf.Button(label, callback) or pairs of these, found {given!r}")
    return Button(label, callback)
