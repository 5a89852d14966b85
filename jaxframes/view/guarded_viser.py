"""viser behind the Host and Origin guard: by itself it answers to any host and any origin (the extra ``view``).

viser makes its server by ``websockets.asyncio.server.serve``. While it starts, that function puts the guard before viser's own answer
to requests. Then the server is asked as a stranger would ask; one that does not refuse is stopped at once, so no version of viser can
serve unguarded.
"""

import contextlib
import io
import socket
import threading
from typing import Any

import viser
import websockets.asyncio.server as underlying

from jaxframes.errors import FrameError
from jaxframes.view import guard
from jaxframes.view.server import listen

_starting = threading.Lock()


def start(host: str, port: int, title: str) -> Any:
    """Return a running ``viser.ViserServer`` that answers to its own page only.

    Raises:
        FrameError: The port is taken, or viser cannot be guarded.
    """
    listen(host, port).close()  # says clearly what is wrong with the address; viser would take the next port
    with _starting, _quiet():
        own = underlying.serve
        underlying.serve = _guarded(own, host)
        try:
            server = viser.ViserServer(host=host, port=port, label=title, verbose=False)
        finally:
            underlying.serve = own
    server.request_share_url = lambda verbose=True: None  # its way to an outside host
    if port and server.get_port() != port:
        stop(server)
        raise FrameError(f"port {port} of {host} is taken; port=0 picks a free one")
    if not _refuses_strangers(host, server.get_port()):
        stop(server)
        raise FrameError(f"viser {viser.__version__} answers strangers in spite of the guard, so it is not served; install viser 1.1.1")
    return server


def stop(server: Any) -> None:
    """Stop a server."""
    with _quiet():
        server.stop()


def _guarded(serve: Any, host: str) -> Any:
    """Return ``serve`` with the guard before the answer to every request."""

    def guarded(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            hosts = guard.hosts_of(host, connection.local_address[1])
            upgrades = guard.opens_socket(request)
            refused = guard.refusal(request, hosts, opens_socket=upgrades)
            if refused is not None or process_request is None:
                return refused
            found = process_request(connection, request)
            if found is not None:
                for name, value in _headers(request.headers["Host"]).items():
                    found.headers[name] = value
            return found

        return serve(*arguments, process_request=answer, **options)

    return guarded


def _headers(host: str) -> dict[str, str]:
    """Return what viser's page may do: run its own script and speak to its own server; nobody may frame it."""
    own = f"'self' ws://{host} data: blob:"
    script = "'self' 'unsafe-inline' 'unsafe-eval' blob:"
    policy = f"default-src {own}; script-src {script}; style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'"
    return {
        "Content-Security-Policy": f"{policy}; frame-ancestors 'none'",
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cache-Control": "no-store",
    }


def _refuses_strangers(host: str, port: int) -> bool:
    """Return whether a server refuses a foreign host, and a socket without an origin."""
    own = guard.hosts_of(host, port)[0]
    upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
    stranger = _status(host, port, f"GET / HTTP/1.1\r\nHost: stranger.invalid:{port}\r\n\r\n")
    foreign = _status(host, port, f"GET / HTTP/1.1\r\nHost: {own}\r\n{upgrade}Origin: http://stranger.invalid\r\n\r\n")
    nameless = _status(host, port, f"GET / HTTP/1.1\r\nHost: {own}\r\n{upgrade}\r\n")
    return (stranger, foreign, nameless) == (b"421", b"403", b"403")


def _status(host: str, port: int, request: str) -> bytes:
    reached = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    with socket.create_connection((reached, port), timeout=10) as line:
        line.sendall(request.encode())
        return line.recv(64).split(b" ")[1]


@contextlib.contextmanager
def _quiet() -> Any:
    """Keep viser's banner off the terminal."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
