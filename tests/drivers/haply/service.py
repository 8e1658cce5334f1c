"""An Inverse service that is not there: the public message shapes over a real WebSocket, and a cursor that moves."""

from __future__ import annotations

import json
import math
import threading
import time
from typing import Any, Self

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import Server, ServerConnection, serve

from tests.drivers.urgent import be_urgent

TICK_S = 0.001
STEP_S = 50e-6


class Cursor:
    """A mass that forces and a hand push, in three axes.

    Attributes:
        force_n: the force of the last message that had one; it acts until the next message.
        hand_n: of the hand.
    """

    def __init__(self) -> None:
        self.x_m = [0.0, 0.0, 0.0]
        self.v_m_per_s = [0.0, 0.0, 0.0]
        self.force_n = [0.0, 0.0, 0.0]
        self.hand_n = [0.0, 0.0, 0.0]
        self.mass_kg = 0.1
        self.viscous_n_s_per_m = 1.0
        self.coulomb_n = 0.02

    def advance(self) -> None:
        for axis in range(3):
            for _ in range(round(TICK_S / STEP_S)):
                v = self.v_m_per_s[axis]
                push_n = self.force_n[axis] + self.hand_n[axis]
                if v == 0.0 and abs(push_n) <= self.coulomb_n:
                    break
                drag_n = math.copysign(self.coulomb_n, v or push_n) + self.viscous_n_s_per_m * v
                after = v + (push_n - drag_n) / self.mass_kg * STEP_S
                self.v_m_per_s[axis] = 0.0 if v * after < 0.0 else after
                self.x_m[axis] += self.v_m_per_s[axis] * STEP_S


class FakeService:
    """The service, on a port of its own.

    One inventory when a client comes; then one state for each of its messages, and none unasked unless it is told to. A
    force is applied once: a message without one ends it. A millisecond passes with each message, so that load on this
    computer means nothing to the cursor.

    Attributes:
        cursor: of the one device.
        device: its name; "" when none is plugged in.
        mute: it takes messages and says nothing.
        spoil: the next messages go out as this text.
        unasked: so many states more follow the next answer.
        messages: that have come.
        peak_n: largest force that has come since this was set to 0.
        accepts: how it calls a force; all that the public pages name.
    """

    def __init__(self, port: int = 0) -> None:
        self.cursor = Cursor()
        self.device = "049D"
        self.mute = False
        self.spoil: list[str] = []
        self.unasked = 0
        self.messages = 0
        self.peak_n = 0.0
        self.accepts: tuple[str, ...] = ("vector", "values")
        self.buttons = {"a": False, "b": True, "c": False}
        self.lock = threading.RLock()
        self._server: Server = serve(self._talk, "127.0.0.1", port, compression=None)
        self.port: int = self._server.socket.getsockname()[1]
        self.url = f"ws://127.0.0.1:{self.port}"
        self._clients: list[ServerConnection] = []
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End it, as a crash would."""
        self._server.shutdown()
        for client in self._clients:
            client.close_socket()
        self._thread.join(5.0)
        end_s = time.monotonic() + 5.0
        while self._clients and time.monotonic() < end_s:
            time.sleep(0.005)

    def _talk(self, client: ServerConnection) -> None:
        self._clients.append(client)
        be_urgent()
        try:
            with self.lock:
                first = self._said(first=True)
            client.send(first)
            for message in client:
                with self.lock:
                    self.cursor.advance()  # under the force before: the next one acts from now on
                    self._obey(json.loads(message))
                    self.messages += 1
                    answer = self.spoil.pop(0) if self.spoil else self._said(first=False)
                    unasked, self.unasked = self.unasked, 0
                if not self.mute:
                    for _ in range(1 + unasked):
                        client.send(answer)
        except (ConnectionClosed, OSError):
            pass
        finally:
            self._clients.remove(client)

    def _obey(self, said: dict[str, Any]) -> None:
        self.cursor.force_n = [0.0, 0.0, 0.0]
        for entry in said.get("inverse3", []):
            if entry["device_id"] == self.device:
                command = entry.get("commands", {}).get("set_cursor_force", {})
                for key in self.accepts:
                    if key in command:
                        self.cursor.force_n = [float(command[key][axis]) for axis in "xyz"]
                        self.peak_n = max(self.peak_n, math.hypot(*self.cursor.force_n))

    def _said(self, first: bool) -> str:
        def vector(values: list[float]) -> dict[str, float]:
            return dict(zip("xyz", values, strict=True))

        state = {"cursor_position": vector(self.cursor.x_m), "cursor_velocity": vector(self.cursor.v_m_per_s)}
        device: dict[str, Any] = {"device_id": self.device, "state": state, "status": {}}
        if first:
            device["config"] = {"handedness": "right"}
        grip = {"orientation": {"w": 0.5**0.5, "x": 0.0, "y": 0.0, "z": 0.5**0.5}, "buttons": self.buttons}
        return json.dumps(
            {
                "session_id": 7,
                "inverse3": [device] if self.device else [],
                "wireless_verse_grip": [{"device_id": "61548", "state": grip}],
            }
        )
