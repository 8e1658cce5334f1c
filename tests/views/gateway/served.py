"""`hapticd gateway haply` in a process of its own, and what a client says to it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import socket
import subprocess
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.daemon.running import HAPTICD
from tests.ports import free_port

PATIENCE_S = 30.0


class Served:
    """A gateway that clients can come to.

    Args:
        runtime: $HAPTICD_RUNTIME_DIR of the daemon.
        arguments: of the command besides the port.
    """

    def __init__(self, runtime: Path, *arguments: str) -> None:
        self.port = free_port()
        self.url = f"ws://127.0.0.1:{self.port}"
        self.log = runtime.parent / f"gateway-{self.port}"
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                [HAPTICD, "gateway", "haply", "--port", str(self.port), *arguments],
                env={**os.environ, "HAPTICD_RUNTIME_DIR": str(runtime)},
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )
        assert self.process.stdout is not None
        self.said = self.process.stdout.readline()
        assert self.url in self.said, self.log.read_text()

    def __enter__(self) -> Served:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.terminate()
        self.process.communicate(timeout=30)

    def client(self, **settings: Any) -> ClientConnection:
        """A connection as a program opens it."""
        return connect(self.url, **({"compression": None, "proxy": None} | settings))

    def deaf(self) -> Deaf:
        """A client that never reads what the gateway says."""
        return Deaf(self.port)

    def memory_kb(self) -> int:
        """Memory of its own; a client that is not read to the end costs 0.2 to 0.7 MB of it."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.findall(r"RssAnon:\s+(\d+)", status)[0])


class Deaf:
    """A connection without a library, which would read on its own.

    Args:
        port: of the gateway.
    """

    def __init__(self, port: int) -> None:
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        self._socket.connect(("127.0.0.1", port))
        asked = (
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        self._socket.sendall(asked.encode())
        self._socket.setblocking(False)
        self._left = b""

    def __enter__(self) -> Deaf:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def say(self, message: str) -> None:
        """Send a message over and over again, as long as it is taken off us at once."""
        text = message.encode()
        whole = bytes([0x81, 0x80 | 126]) + len(text).to_bytes(2, "big") + bytes(4) + text
        with contextlib.suppress(BlockingIOError):
            while True:
                self._left = self._left or whole
                self._left = self._left[self._socket.send(self._left) :]


def force(x: Any, y: Any = 0.0, z: Any = 0.0, key: str = "values", device: str = "default") -> str:
    """A message that asks for a force [N]."""
    command = {"set_cursor_force": {key: {"x": x, "y": y, "z": z}}}
    return json.dumps({"inverse3": [{"device_id": device, "commands": command}]})


PROBE = json.dumps({"inverse3": [{"device_id": "default", "commands": {"probe_position": {}}}]})


def told(client: ClientConnection) -> dict[str, Any]:
    """The next message of the gateway."""
    said: dict[str, Any] = json.loads(client.recv(PATIENCE_S))
    return said


def answer(client: ClientConnection, message: str | bytes = PROBE) -> dict[str, Any]:
    """The state that answers a message."""
    client.send(message)
    return told(client)


def position_m(said: dict[str, Any]) -> tuple[float, float, float]:
    """Where the device is."""
    at = said["inverse3"][0]["state"]["cursor_position"]
    return (at["x"], at["y"], at["z"])
