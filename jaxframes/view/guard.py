"""Who may speak to a page's server: requests whose Host and Origin are the server's own, exactly.

A browser lets any web site send requests to servers on the reader's own machine. What stops it from reading the answers is that the
site's Origin is another one; what stops a name that suddenly points to this machine (DNS rebinding) is that the Host is that name.
"""

import http
from collections.abc import Sequence
from typing import Any

from websockets.datastructures import Headers
from websockets.http11 import Request, Response


def hosts_of(host: str, port: int) -> tuple[str, ...]:
    """Return what the Host of a request to a server may be."""
    shown = f"[{host}]" if ":" in host else host
    return tuple(dict.fromkeys(f"{name}:{port}" for name in (shown, "127.0.0.1", "localhost")))


def refusal(request: Request, hosts: Sequence[str], *, opens_socket: bool) -> Response | None:
    """Return the answer to a request that is refused, or None for one that is welcome.

    Args:
        request: The request.
        hosts: What its Host may be: host and port.
        opens_socket: Whether it asks for a WebSocket, which needs an Origin; a page that is typed in has none.
    """
    host = request.headers.get_all("Host")
    if len(host) != 1 or host[0] not in hosts:
        return answer(http.HTTPStatus.MISDIRECTED_REQUEST, b"This server does not answer to that host.\n")
    origin = request.headers.get_all("Origin")
    if (origin or opens_socket) and origin != [f"http://{host[0]}"]:
        return answer(http.HTTPStatus.FORBIDDEN, b"This server answers to its own page only.\n")
    return None


def opens_socket(request: Request) -> bool:
    """Return whether a request asks for a WebSocket."""
    return any("websocket" in value.lower() for value in request.headers.get_all("Upgrade"))


def answer(status: http.HTTPStatus, body: bytes, kind: str = "text/plain; charset=utf-8", **extra: str) -> Response:
    """Return an answer that no browser keeps, guesses about, or tells others of."""
    headers: dict[str, Any] = {
        "Content-Type": kind,
        "Content-Length": str(len(body)),
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "Connection": "close",
        **{name.replace("_", "-"): value for name, value in extra.items()},
    }
    return Response(status.value, status.phrase, Headers(headers), body)
