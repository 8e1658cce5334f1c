"""Where the page is, and which requests are meant for it: those that name it, made by pages that came from it."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence

from hapticd.errors import ClientError


class Address:
    """The page's host and port.

    A page of any origin may ask this computer's loopback addresses for something, and a name that its owner lets point
    here makes it look like our own: so every request has to name us in `Host`, and a WebSocket also in `Origin`.

    Args:
        host: address of this computer to listen on; one, and no wildcard.
        port: TCP port.

    Raises:
        ClientError: the host is no such address.
    """

    def __init__(self, host: str, port: int) -> None:
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            raise ClientError(f"--host {host}: must be an address of this computer, such as 127.0.0.1") from None
        if address.is_unspecified:
            raise ClientError(f"--host {host}: name the one address of this computer that the page is to have")
        self.host = host
        self.port = port
        self.is_loopback = address.is_loopback
        shown = f"[{host}]" if address.version == 6 else host
        self._names = [f"{shown}:{port}", *([f"localhost:{port}"] if self.is_loopback else [])]
        if port == 80:
            self._names += [name.removesuffix(":80") for name in self._names]

    @property
    def url(self) -> str:
        """The page's address for people."""
        return f"http://{self._names[0]}/"

    @property
    def live(self) -> list[str]:
        """Where the page's WebSocket is, by each of its names."""
        return [f"ws://{name}" for name in self._names]

    def is_named(self, hosts: Sequence[str]) -> bool:
        """Whether these `Host` headers are one, and ours."""
        return len(hosts) == 1 and hosts[0].lower() in self._names

    def is_origin(self, hosts: Sequence[str], origins: Sequence[str]) -> bool:
        """Whether these `Origin` headers are one, and the page that the `Host` names."""
        return self.is_named(hosts) and list(origins) == [f"http://{hosts[0].lower()}"]
