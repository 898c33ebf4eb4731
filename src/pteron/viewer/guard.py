"""A guard of the viewer's server against requests of foreign pages (DNS rebinding).

A browser lets any page open a socket to any server, and the owner of a name can make it point at
127.0.0.1, so that a foreign page seems one of this machine's. Both show in a request: in its
headers `Origin` and `Host`.
"""

from __future__ import annotations

import http
import ipaddress
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

    _Answer = Callable[[ServerConnection, Request], Response | None]

_SERVES = threading.Lock()
"""Held while a server starts under the guard: one at a time."""


def is_here(host: str) -> bool:
    """Say whether only this machine can reach a host's address."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    return bool(host) and all(_is_loopback(str(address[0])) for *_, address in found)


def refusal(host: str, here: bool, hosts: list[str], origins: list[str]) -> str | None:
    """Return why a request is refused, None if it is not.

    `hosts` and `origins` are the request's headers; programs that are no browsers send no `Origin`.
    If only this machine can reach the address, it is asked for by a name of this machine; a wider
    one may have names that nobody here knows.
    """
    if len(hosts) != 1 or len(origins) > 1:
        return "one Host and at most one Origin expected"
    asked = hosts[0].lower()
    name = _name(asked)
    if here and not (name in ("localhost", host.lower()) or _is_loopback(name)):
        return "this page is for this machine alone, and was asked for by another name"
    # Tunnels may change the port, of both alike, and some add TLS.
    if any(origin.lower() not in (f"http://{asked}", f"https://{asked}") for origin in origins):
        return "the page of another server asked for it"
    return None


@contextmanager
def guarded(host: str) -> Iterator[list[str]]:
    """Let no server that viser starts within answer a request that is refused.

    viser hands no hook on to the server of websockets that it starts, so that
    `websockets.asyncio.server.serve` is another function as long. The list that is yielded holds
    the hosts that were guarded: it is empty if viser went another way.
    """
    from websockets.asyncio import server

    guards: list[str] = []
    here = is_here(host)

    def serve(*arguments: Any, process_request: _Answer, **options: Any) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            reason = refusal(host, here, hosts, origins)
            if reason is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"Refused: {reason}.\n")
            return process_request(connection, request)

        guards.append(host)
        return plain(*arguments, process_request=answer, **options)

    with _SERVES:
        plain = server.serve
        server.serve = serve  # type: ignore[misc,assignment]
        try:
            yield guards
        finally:
            server.serve = plain  # type: ignore[misc]


def _name(asked: str) -> str:
    """Return the name or address in a header `Host`, without its port."""
    if asked.startswith("["):
        return asked[1:].partition("]")[0]
    return asked.partition(":")[0]


def _is_loopback(name: str) -> bool:
    try:
        return ipaddress.ip_address(name.partition("%")[0]).is_loopback
    except ValueError:
        return False
