"""The server of a live page: one listening thread, two addresses, nothing else (the extra ``view``)."""

import contextlib
import http
import socket
import threading
from collections.abc import Callable
from typing import Any

from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from jaxframes.errors import FrameError
from jaxframes.view import guard
from jaxframes.view.clients import Client, Shown, quiet
from jaxframes.view.page_text import live_page, parts

LONGEST_MESSAGE = 4096
"""Bytes that a page may send in one message: a button's number or an instant's."""


class Server:
    """A listening socket, and the readers of what is shown."""

    def __init__(self, host: str, port: int, shown: Shown, hear: Callable[[str | bytes, Client], None]):
        self._shown, self._hear = shown, hear
        listening = listen(host, port)
        self.host, self.port = host, listening.getsockname()[1]
        self._hosts = guard.hosts_of(host, self.port)
        self.url = f"http://{self._hosts[0]}/"
        self._connections: set[ServerConnection] = set()
        self._closing = threading.Lock()
        self._server = serve(
            self._live,
            sock=listening,
            origins=[f"http://{name}" for name in self._hosts],  # pyright: ignore[reportArgumentType]
            process_request=self._answer,
            compression=None,
            max_size=LONGEST_MESSAGE,
            logger=quiet,
            close_timeout=0.05,
        )
        self._thread = threading.Thread(target=self._server.serve_forever, name="jaxframes page", daemon=True)
        self._thread.start()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for the page, and let through one for the socket."""
        live = request.path == "/live"
        refused = guard.refusal(request, self._hosts, opens_socket=live or guard.opens_socket(request))
        if refused is not None or live:
            return refused
        if request.path != "/":
            return guard.answer(http.HTTPStatus.NOT_FOUND, b"There is nothing here.\n")
        policy = f"{parts()[1]}; connect-src ws://{request.headers['Host']}; frame-ancestors 'none'"
        headers = {"Content_Security_Policy": policy, "Cross_Origin_Opener_Policy": "same-origin", "X_Frame_Options": "DENY"}
        return guard.answer(http.HTTPStatus.OK, live_page().encode(), "text/html; charset=utf-8", **headers)

    def _live(self, connection: ServerConnection) -> None:
        self._connections.add(connection)
        try:
            Client(connection, self._shown).serve(self._hear)
        finally:
            self._connections.discard(connection)

    def close(self) -> None:
        """Stop listening and let go of all readers; the port can be bound again at once. Twice is fine."""
        with self._closing:
            self._shown.close()
            self._server.shutdown()
            for connection in list(self._connections):
                abort(connection)
            if self._thread is not threading.current_thread():
                self._thread.join(5)


def abort(connection: Any) -> None:
    """End a connection without waiting for the other side."""
    with contextlib.suppress(OSError):  # it may have ended by itself
        connection.socket.shutdown(socket.SHUT_RDWR)


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens (FrameError where the address is taken or cannot be listened at)."""
    if not isinstance(port, int) or isinstance(port, bool) or not 0 <= port <= 65535:
        raise FrameError(f"port={port!r}: a port is a whole number from 0, any free one, to 65535")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except OSError as problem:
        if problem.errno in (98, 48, 10048):
            raise FrameError(f"port {port} of {host} is taken; port=0 picks a free one") from problem
        raise FrameError(f"cannot listen at port {port} of {host}: {problem.strerror or problem}") from problem
