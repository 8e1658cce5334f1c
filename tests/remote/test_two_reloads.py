"""Ticks that the process which hears clients comes too late for, after its list was taken and given back."""

from __future__ import annotations

import os
import socket
import tempfile
from pathlib import Path
from typing import Any

import pytest

from hapticd import plugins
from hapticd.config.loading import LoadedConfig, parse
from hapticd.config.ports import port_limits
from hapticd.loop.memory import ANSWERED, REQUESTS, SUPERVISOR_BEAT
from hapticd.remote import process
from hapticd.remote.settings import RemoteSettings
from hapticd.supervisor.reload import switch_request
from hapticd.version import __version__
from tests.loop.clock import Clock
from tests.loop.started import Started
from tests.loop.test_watching import LAW, TOOL

OTHERS = "".join(f'[[scene.forces]]\nname = "{name}"\nmax_force_n = 1.0\n' for name in ("field", "wind"))


class Told:
    """In the place of the socket that tells of each tick."""

    subscribed = True

    def __init__(self, *_: object) -> None:
        self.maps: list[dict[str, Any]] = []
        self.send = self.maps.append

    def admit(self, _ring: object) -> None:
        """Who may hear it is of no matter here."""

    def close(self) -> None:
        """Nothing to let go of."""


def settings_of(config: LoadedConfig, directory: Path) -> RemoteSettings:
    rate_hz = config.config.loop.rate_hz
    ports = tuple(port_limits(config.config.scene))
    return RemoteSettings(
        __version__, str(directory), None, None, None, 1.0, rate_hz, ("x",), False, 0, ports, (), False
    )


def test_what_a_tick_had_of_another_list_is_told_of_no_port(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ended with an IndexError, or told a port's client of what another one had done."""
    monkeypatch.setattr(process, "StateSocket", Told)
    started = Started(Clock(monkeypatch), text=LAW + TOOL)
    started.shared.words[SUPERVISOR_BEAT] = 1 << 62
    started.loop.requests.know("none", plugins.law("none"))
    longer = parse(LAW + OTHERS + TOOL, "longer")
    with tempfile.TemporaryDirectory(prefix="hapticd-") as directory, socket.socket() as channel:
        server = process.RemoteServer(
            channel, settings_of(started.config, Path(directory)), os.dup(started.shared.descriptor)
        )
        switched: list[int] = []

        def each_tick(number: int) -> None:
            words = started.shared.words
            if number == 20:
                started.shared.post(switch_request(started.config, longer))
            if number == 50:
                started.shared.post(switch_request(longer, started.config))
            if number > 20 and words[ANSWERED] == words[REQUESTS] > len(switched):
                switched.append(number)

        started.run(each_tick, 90)
        server._tell()
        server.close()
    assert isinstance(server._state, Told)
    had = {told["seq"]: list(told["ports"]) for told in server._state.maps}
    assert had.keys() > set(range(switched[0] + 15, switched[1] + 15)), "ticks of both lists"
    assert had == {seq: ["tool"] if seq >= switched[1] else [] for seq in had}
