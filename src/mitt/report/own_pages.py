"""The viewer's server answers its own page alone: no other page in the same browser reads it.

A browser lets any page open a websocket to any address, the machine's own included. It says in
``Origin`` which page asks; the server compares that with the address by which it was reached. That
address has to be one of the machine itself: a name that somebody else has pointed at it is none.
"""

import ipaddress
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response


@contextmanager
def own_pages_alone() -> Iterator[None]:
    """Let servers that start within the block answer their own pages, and programs, alone.

    Viser takes no function that looks at a request, so its own is wrapped as it starts.
    """
    serve = websocket_server.serve

    def guarded(*given: Any, process_request: Any, **named: Any) -> Any:  # noqa: ANN401 (as serve)
        def answered(connection: ServerConnection, request: Request) -> Response | None:
            host, origin = (request.headers.get(x) for x in ("Host", "Origin"))
            if not may_ask(host, origin):
                return connection.respond(403, "this page may not look here\n")
            answer: Response | None = process_request(connection, request)
            return answer

        return serve(*given, process_request=answered, **named)

    websocket_server.serve = guarded  # type: ignore[assignment,misc]  # it is called alike
    try:
        yield
    finally:
        websocket_server.serve = serve  # type: ignore[misc]  # a class


def may_ask(host: str | None, origin: str | None) -> bool:
    """Say whether a request may be answered.

    Args:
        host: The address by which the server was reached, as ``127.0.0.1:8080``.
        origin: The page that asks, as ``http://127.0.0.1:8080``; None where no page does.
    """
    if host is None or not _is_this_machine(host):
        return False
    return origin is None or origin.lower() == f"http://{host.lower()}"


def _is_this_machine(host: str) -> bool:
    """Say whether an address is one that only the machine itself can have: a number, its name."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    own = socket.gethostname().lower()
    if name in ("localhost", own, own.partition(".")[0], f"{own}.local"):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
