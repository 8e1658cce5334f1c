"""TCP ports for what a test starts: none that the kernel gives to a connection, none that another test has just taken.

A port that was asked of the kernel and given back is free for any connection of any other test until it is bound
again: a flood of 1500 connections beside it takes one port in twenty of those that the kernel chooses from.
"""

from __future__ import annotations

import atexit
import itertools
import socket
from collections import deque
from pathlib import Path

_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
_MOST_HELD = 100

_held: deque[socket.socket] = deque()
"""The numbers of the newest ports, each held as one of UDP, so that no other process of tests takes it."""


def free_port() -> int:
    """A port that nothing listens on, at any address of this computer."""
    first, last = map(int, _RANGE.read_text().split())
    for port in itertools.chain(range(first - 1, 1024, -1), range(last + 1, 1 << 16), range(first, last + 1)):
        number = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            number.bind(("127.0.0.1", port))
            socket.create_server(("0.0.0.0", port)).close()
        except OSError:
            number.close()
            continue
        _held.append(number)
        if len(_held) > _MOST_HELD:
            _held.popleft().close()
        return port
    raise AssertionError("no port is free")


@atexit.register
def _let_go() -> None:
    """Close what is held, of which Python would complain."""
    while _held:
        _held.pop().close()
