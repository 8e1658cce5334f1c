"""The ports that tests take: none that the kernel gives to a connection, no one twice."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.ports import free_port

TAKE = "from tests.ports import free_port; print(*(free_port() for _ in range(20)), flush=True); input()"


def test_no_two_tests_take_one_port_and_no_connection_gets_it() -> None:
    said: list[str] = []
    takers = [
        subprocess.Popen([sys.executable, "-c", TAKE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    try:
        for taker in takers:
            assert taker.stdout is not None
            said += taker.stdout.readline().split()
    finally:
        for taker in takers:
            taker.communicate("\n")
    ports = {free_port(), *map(int, said)}
    assert len(said) == 60
    assert len(ports) >= 60, "the one of this process may be one that they have given back"
    first, last = map(int, Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split())
    assert not [port for port in ports if first <= port <= last]
