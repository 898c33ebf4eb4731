"""The viewer's server: viser, on the first free port from the one asked for.

It is closed to foreign pages, and opens no public tunnel.
"""

from __future__ import annotations

import errno
import io
import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import TYPE_CHECKING, Any

from pteron.errors import DataError, ModelError, shown
from pteron.extras import of_extra
from pteron.viewer.guard import guarded

if TYPE_CHECKING:
    import viser

_PORTS_TRIED = 100
"""Most ports that are tried in turn before the server is refused."""

_LAST_PORT = 65535
"""The largest port there is."""

_NOT_OURS = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
"""Error numbers for an address that is none of this machine's."""


def serve(host: str, port: int, label: str) -> viser.ViserServer:
    """Return a running server.

    `port` is the first that is tried, and 0 takes any that is free; `label` is the page's title.
    """
    package = of_extra("viewer", "viser", "the viewer needs viser")
    free = free_port(host, port)
    logging.getLogger("websockets.server").addFilter(_worth_telling)
    with _quiet(), guarded(host) as guards:
        server: viser.ViserServer = package.ViserServer(
            host=host, port=free, label=label, verbose=False
        )
    if not guards:
        stop(server)
        raise ModelError(
            f"viser {package.__version__} gives no hold to keep foreign pages out, so the viewer "
            'is not opened; pip install "viser==1.1.1"'
        )
    # Any page that a browser shows could ask for a tunnel to the world; there is to be none.
    refused: Any = server
    refused.request_share_url = _no_tunnel
    return server


def stop(server: viser.ViserServer) -> None:
    """Stop a server."""
    with _quiet():
        server.stop()


def free_port(host: str, port: int) -> int:
    """Return the first free port of a host from a given one on; 0 means any."""
    if not 0 <= port <= _LAST_PORT:
        raise DataError(
            f"port: {shown(port)} given, a whole number from 0 to {_LAST_PORT} expected"
        )
    try:
        addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise DataError(
            f"host: {shown(host)} is no address; give 127.0.0.1 for this machine alone, or 0.0.0.0 "
            "for all who can reach it"
        ) from None
    if port == 0:
        return 0
    tried = range(port, min(port + _PORTS_TRIED, _LAST_PORT + 1))
    for candidate in tried:
        if all(_is_free(family, address[0], candidate) for family, *_, address in addresses):
            return candidate
    told = f"none of {port} to {tried[-1]} is free" if len(tried) > 1 else f"{port} is taken"
    raise DataError(f"port: {told}; give another --port")


def _is_free(family: int, address: Any, port: int) -> bool:
    with socket.socket(family, socket.SOCK_STREAM) as tried:
        if os.name == "posix":  # elsewhere it would take a port that is in use
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind((address, port))
        except PermissionError:
            return False
        except OSError as error:
            if error.errno in _NOT_OURS:
                raise DataError(
                    f"host: {shown(address)} is no address of this machine; give 127.0.0.1 for it "
                    "alone, or 0.0.0.0 for all who can reach it"
                ) from None
            return False
    return True


def _worth_telling(record: logging.LogRecord) -> bool:
    """Say whether a line of the server's log is: browsers open connections that they do not use."""
    return record.getMessage() != "opening handshake failed"


def _no_tunnel(verbose: bool = True) -> None:
    """Refuse to publish the page."""


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep to itself what viser prints: standard output is for results."""
    with redirect_stdout(io.StringIO()):
        yield
