"""A guard of the viewer's server against requests of foreign pages (DNS rebinding).

A browser lets any page open a socket to any server, and the owner of a name can make it point at
127.0.0.1, so that a foreign page seems one of this machine's. Both show in a request: in its
headers `Origin` and `Host`.
"""

from __future__ import annotations

import ipaddress
import socket


def is_local_address(host: str) -> bool:
    """Return whether a host's address is reachable from this machine only."""
    try:
        addresses = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return False
    return bool(host) and all(_is_loopback(str(address[0])) for *_, address in addresses)


def refusal(host: str, here: bool, hosts: list[str], origins: list[str]) -> str | None:
    """Return why a request is refused, a sentence; None if it is accepted.

    `host` is the address or name at which the viewer is served, and `here` whether only this
    machine can reach it: the request's host must then be that name, localhost or a loopback
    address; an address that others reach may have any name. `hosts` and `origins` are the values of
    the request's headers `Host` and `Origin`; only browsers send an `Origin`.
    """
    if len(hosts) != 1 or len(origins) > 1:
        return "one Host and at most one Origin expected"
    requested_host = hosts[0].lower()
    name = _name(requested_host)
    if here and not (name in ("localhost", host.lower()) or _is_loopback(name)):
        return "this page is for this machine alone, and was asked for by another name"
    # Tunnels may change the port, of both alike, and some add TLS.
    if any(
        origin.lower() not in (f"http://{requested_host}", f"https://{requested_host}")
        for origin in origins
    ):
        return "the page of another server asked for it"
    return None


def _name(header: str) -> str:
    """Return the name or address in a header `Host`, without its port."""
    if header.startswith("["):
        return header[1:].partition("]")[0]
    return header.partition(":")[0]


def _is_loopback(name: str) -> bool:
    """Return whether a name is an address of the loopback interface."""
    try:
        return ipaddress.ip_address(name.partition("%")[0]).is_loopback
    except ValueError:
        return False
