"""The viewer's server: pages and their web sockets, on the first free port from a given one on.

Requests from pages of another server are refused; see `guard`.
"""

from __future__ import annotations

import errno
import http
import logging
import os
import socket
import threading
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from pteron.errors import DataError, shorten
from pteron.viewer.guard import is_local_address, refusal

if TYPE_CHECKING:
    from websockets.http11 import Request, Response
    from websockets.sync.server import ServerConnection

_PORTS_TRIED = 100
"""Number of ports that are tried in turn."""

_LAST_PORT = 65535
"""The greatest port number."""

_NOT_OURS = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
"""Error numbers for an address that does not belong to this machine."""

_LARGEST = (100 << 20) + (1 << 16)
"""Largest message, bytes: a file with a motion."""

_FRAMES = "frame-ancestors 'self' " + " ".join(
    f"{scheme}://{name}:*"
    for scheme in ("http", "https")
    for name in ("localhost", "127.0.0.1", "[::1]")
)
"""Who may show the page in a frame: servers of this machine, as a notebook's."""

_GONE = 2.0
"""Time, s, for which closing waits for a tab that does not answer."""


class PageHandler(Protocol):
    """A page with a socket, through which messages go both ways."""

    def page(self) -> str:
        """Return the page, HTML."""

    def open_tab(self, tab: Tab) -> None:
        """Send a new tab its contents."""

    def close_tab(self, tab: Tab) -> None:
        """Forget a tab that is closed."""

    def handle_message(self, tab: Tab, message: str | bytes) -> None:
        """Handle a message from a tab."""


class Tab:
    """A connected page; of unsent messages of one kind only the last is sent."""

    def __init__(self, connection: ServerConnection) -> None:
        self._connection = connection
        self._messages: dict[str, str] = {}
        self._wake = threading.Condition()
        self._over = False
        self._thread = threading.Thread(target=self._run, name="pteron tab", daemon=True)
        self._thread.start()

    def send(self, kind: str, message: str) -> None:
        """Queue a message to be sent."""
        with self._wake:
            self._messages[kind] = message
            self._wake.notify()

    def close(self) -> None:
        """Stop sending messages."""
        with self._wake:
            self._over = True
            self._wake.notify()

    def _run(self) -> None:
        """Run the thread: send queued messages until the tab is closed."""
        from websockets.exceptions import ConnectionClosed

        while True:
            with self._wake:
                while not self._messages and not self._over:
                    self._wake.wait()
                if self._over:
                    return
                messages, self._messages = self._messages, {}
            try:
                for message in messages.values():
                    self._connection.send(message)
            except ConnectionClosed:
                return


class Server:
    """A running server of pages by their paths; `port` is its port."""

    def __init__(
        self, host: str, port: int, handlers: Mapping[str, PageHandler | Callable[[], str]]
    ) -> None:
        """Start the server on the first free port from `port` on, or if it is 0 on any."""
        from websockets.sync.server import serve

        self._handlers, self._host, self._here = handlers, host, is_local_address(host)
        logger = logging.getLogger("pteron.viewer.server")
        logger.addFilter(_is_significant)
        free = free_port(host, port)
        family = socket.getaddrinfo(host or None, free, type=socket.SOCK_STREAM)[0][0]
        self._server = serve(
            self._handle,
            sock=socket.create_server((host, free), family=family),
            process_request=self._answer,
            compression=None,
            max_size=_LARGEST,
            close_timeout=_GONE,
            logger=logger,
            server_header=None,
        )
        self.port = int(self._server.socket.getsockname()[1])
        self._tabs = set[Any]()
        self._thread = threading.Thread(
            target=self._server.serve_forever, name="pteron server", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Close all connections and stop the server."""
        self._server.shutdown()
        for connection in list(self._tabs):
            connection.close(1001)
        self._thread.join()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the HTTP response to a request; None for a web socket, whose handshake goes on."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        reason = refusal(self._host, self._here, hosts, origins)
        if reason is not None:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"Refused: {reason}.\n")
        if getattr(request, "method", "GET") != "GET":  # old websockets refuses others itself
            only = "Only GET is answered.\n"
            response = connection.respond(http.HTTPStatus.METHOD_NOT_ALLOWED, only)
            response.headers["Allow"] = "GET"
            return response
        path = request.path.partition("?")[0]
        handler = self._handlers.get(path)
        if handler is None:
            hint = f"No page here; try {next(iter(self._handlers))}\n"
            return connection.respond(http.HTTPStatus.NOT_FOUND, hint)
        if "Upgrade" in request.headers:
            return None
        response = connection.respond(
            http.HTTPStatus.OK, handler() if callable(handler) else handler.page()
        )
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = "text/html; charset=utf-8"
        response.headers["Cache-Control"] = "no-store"
        response.headers["Content-Security-Policy"] = _FRAMES
        return response

    def _handle(self, connection: ServerConnection) -> None:
        """Handle a web socket: open a tab, pass its messages on, and close it at the end."""
        from websockets.exceptions import ConnectionClosed

        assert connection.request is not None
        handler = self._handlers[connection.request.path.partition("?")[0]]
        if callable(handler):
            return
        self._tabs.add(connection)
        tab = Tab(connection)
        handler.open_tab(tab)
        try:
            for message in connection:
                handler.handle_message(tab, message)
        except ConnectionClosed:
            pass
        finally:
            handler.close_tab(tab)
            tab.close()
            self._tabs.discard(connection)


def free_port(host: str, port: int) -> int:
    """Return the first free port of a host, from a port on; 0 means any."""
    if not 0 <= port <= _LAST_PORT:
        raise DataError(
            f"port: {shorten(port)} given, a whole number from 0 to {_LAST_PORT} expected"
        )
    try:
        addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        raise DataError(
            f"host: {shorten(host)} is no address; give 127.0.0.1 for this machine alone, or "
            "0.0.0.0 for all who can reach it"
        ) from None
    if port == 0:
        return 0
    tried = range(port, min(port + _PORTS_TRIED, _LAST_PORT + 1))
    for candidate in tried:
        if all(_is_free(family, address[0], candidate) for family, *_, address in addresses):
            return candidate
    reason = f"none of {port} to {tried[-1]} is free" if len(tried) > 1 else f"{port} is taken"
    raise DataError(f"port: {reason}; give another --port")


def _is_free(family: int, address: Any, port: int) -> bool:
    """Return whether a port is free; an address of another machine raises a `DataError`."""
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
                    f"host: {shorten(address)} is no address of this machine; give 127.0.0.1 for "
                    "it alone, or 0.0.0.0 for all who can reach it"
                ) from None
            return False
    return True


def _is_significant(record: logging.LogRecord) -> bool:
    """Return whether a log record matters: browsers open connections they do not use."""
    return record.levelno >= logging.ERROR and record.getMessage() != "opening handshake failed"
