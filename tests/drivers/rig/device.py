"""A rig on a pseudo-terminal: the firmware's own protocol core, a handle that moves, and a line that can be spoilt."""

from __future__ import annotations

import contextlib
import ctypes
import os
import pty
import re
import select
import shutil
import subprocess
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from hapticd_drivers.rig import messages
from hapticd_drivers.rig.frames import FrameReader, framed
from hapticd_drivers.rig.serial_rig import SerialRig
from tests.drivers.urgent import be_urgent

FIRMWARE = Path(__file__).parents[3] / "drivers" / "firmware"
COUNT_M = 7669904e-12
HALF_TRAVEL_M = 6500 * COUNT_M
PATIENCE_S = 30.0

_STEP_US = 50
_TICK_US = 1000
_SIZE = 65536

Spoiler = Callable[[bytes], bytes]
"""What becomes of the bytes of a line."""


def build(directory: Path) -> ctypes.CDLL:
    """The protocol core as a library."""
    assert shutil.which("make")
    done = subprocess.run(
        ["make", "-C", FIRMWARE / "host-rig", f"BUILD={directory}"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    core = ctypes.CDLL(str(directory / "librig.so"))
    core.host_rig_new.restype = ctypes.c_void_p
    core.host_rig_read.restype = ctypes.c_size_t
    core.host_rig_description.restype = ctypes.c_void_p
    core.host_rig_force.restype = ctypes.c_int32
    return core


class Plant:
    """A handle of one axis between two stops, pushed by motor and hand.

    Attributes:
        position_m, velocity_m_per_s: of the handle; 0 is the middle of the travel.
        hand_n: constant force of the hand [N].
        motor: what the motor does with 1 N: -1 is a reversed one, 0 one without supply.
        friction_n: Coulomb friction [N].
    """

    def __init__(self) -> None:
        self.position_m = 0.01
        self.velocity_m_per_s = 0.0
        self.hand_n = 0.0
        self.motor = 1.0
        self.friction_n = 0.05
        self.mass_kg = 0.1
        self.damping_n_s_per_m = 1.0

    def advance(self, motor_n: float, dt_s: float) -> None:
        push_n = self.motor * motor_n + self.hand_n
        speed = self.velocity_m_per_s
        if speed == 0.0 and abs(push_n) <= self.friction_n:
            return
        drag_n = self.friction_n if (speed or push_n) > 0.0 else -self.friction_n
        after = speed + (push_n - drag_n - self.damping_n_s_per_m * speed) / self.mass_kg * dt_s
        self.velocity_m_per_s = 0.0 if speed * after < 0.0 else after
        self.position_m += self.velocity_m_per_s * dt_s
        if abs(self.position_m) > HALF_TRAVEL_M:
            self.position_m = max(-HALF_TRAVEL_M, min(HALF_TRAVEL_M, self.position_m))
            self.velocity_m_per_s = 0.0


class Rig:
    """A rig that is plugged in.

    Args:
        core: what `build` made.
        port: a path for its serial port, the same whenever it is plugged in.
        pace: "frames": 1 ms passes for each frame that comes, so that load on this computer means nothing to the
            rig; "real": time passes.

    Attributes:
        plant: its handle; change it under `lock`.
        switch_at_m: the home switch is closed below.
        down, up: spoil the line, to the rig and from it.
        heard: sequence number of the last message that was sent to it, spoilt or not; -1 before the first.
        spoke: something was sent from it after that.
        peak_n: largest force of its motor since `watch_force` [N].
        pushed_us: how long its motor has pushed since then [us of the rig].
    """

    def __init__(self, core: ctypes.CDLL, port: Path, pace: Literal["frames", "real"] = "frames") -> None:
        self.port = port
        self.lock = threading.RLock()
        self.plant = Plant()
        self.switch_at_m = -0.5 * HALF_TRAVEL_M
        self.down: Spoiler = bytes
        self.up: Spoiler = bytes
        self.heard = -1
        self.spoke = False
        self.peak_n = 0.0
        self.pushed_us = 0
        self._core = core
        self._pace = pace
        self._listener = FrameReader()
        self._rig = ctypes.c_void_p(core.host_rig_new(1))
        self._now_us = 0
        self._real_us = 0
        self._power_up_m = self.plant.position_m
        self._fds: tuple[int, int] | None = None
        self._thread: threading.Thread | None = None
        self.plug()

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()
        self._core.host_rig_free(self._rig)

    def plug(self) -> None:
        """Switch it on and put its cable in."""
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self._fds = master, slave
        with self.lock:
            self._core.host_rig_restart(self._rig)
            self._now_us = 0
            self._real_us = time.monotonic_ns() // 1000
            self._power_up_m = self.plant.position_m
        self._thread = threading.Thread(target=self._serve, args=(master,), daemon=True)
        self._thread.start()
        self.port.unlink(missing_ok=True)
        self.port.symlink_to(os.ttyname(slave))

    def unplug(self) -> None:
        """Pull its cable, and its power with it."""
        if self._fds is None:
            return
        self.port.unlink(missing_ok=True)
        master, slave = self._fds
        self._fds = None
        assert self._thread is not None
        self._thread.join(10.0)
        os.close(master)
        os.close(slave)

    def restart(self) -> None:
        """Switch it off and on again, with the cable in."""
        with self.lock:
            self._core.host_rig_restart(self._rig)
            self._now_us = 0
            self._power_up_m = self.plant.position_m

    def describe(self, offset: int, value: int) -> None:
        """Change a byte of its description."""
        address = self._core.host_rig_description(self._rig)
        ctypes.c_uint8.from_address(address + offset).value = value

    def set_home(self, count: int = 0) -> None:
        """What a calibration has told it, some time ago."""
        with self.lock:
            for message in (messages.hello(0), messages.set_home(1, 0, count)):
                frame = framed(message)
                self._core.host_rig_write(self._rig, frame, len(frame))
            self._core.host_rig_read(self._rig, ctypes.create_string_buffer(_SIZE), _SIZE)

    def break_down(self, fault: int, axis: int, detail: int) -> None:
        with self.lock:
            self._core.host_rig_break(self._rig, fault, axis, detail)
            self._core.host_rig_clock(self._rig, self._now_us & 0xFFFFFFFF)

    def mend(self) -> None:
        with self.lock:
            self._core.host_rig_mend(self._rig)

    @property
    def counts(self) -> int:
        """What its encoder has counted since it was switched on."""
        return round((self.plant.position_m - self._power_up_m) / COUNT_M)

    @property
    def force_n(self) -> float:
        """What its motor is told [N]."""
        with self.lock:
            return 1e-6 * float(self._core.host_rig_force(self._rig, 0))

    def watch_force(self) -> None:
        """Begin to look at what its motor does."""
        with self.lock:
            self.peak_n, self.pushed_us = 0.0, 0

    def wait_for(self, driver: SerialRig) -> Rig:
        """Return when all that a driver has sent has come, and what it caused is there for the driver to read."""
        talk = driver._talk
        end_s = time.monotonic() + PATIENCE_S
        while talk is not None and self._fds is not None:
            with self.lock:
                if self.heard == talk._sequence - 1 & 0xFFFF:
                    break
            assert time.monotonic() < end_s, "the rig has not heard the driver"
            time.sleep(0.0001)
        if talk is not None and talk.unanswered and self.spoke and self._fds is not None:
            select.select([self._fds[1]], [], [], PATIENCE_S)
        return self

    def pass_time(self, us: int) -> None:
        """Let time pass without a frame."""
        with self.lock:
            self._advance(us)

    def _serve(self, master: int) -> None:
        buffer = ctypes.create_string_buffer(_SIZE)
        be_urgent()
        while self._fds is not None:
            select.select([master], [], [], 0.0005 if self._pace == "real" else 0.02)
            with self.lock, contextlib.suppress(BlockingIOError):
                if self._pace == "real":
                    now_us = time.monotonic_ns() // 1000
                    self._advance(min(now_us - self._real_us, 10_000))
                    self._real_us = now_us
                self._talk(master, buffer)

    def _talk(self, master: int, buffer: ctypes.Array[ctypes.c_char]) -> None:
        try:
            data = os.read(master, 4096)
        except BlockingIOError:
            data = b""
        heard = self._listener.feed(data)
        for piece in re.findall(rb"[^\0]*\0|[^\0]+$", self.down(data)) if data else ():
            self._core.host_rig_write(self._rig, piece, len(piece))
            if piece.endswith(b"\0") and self._pace == "frames":
                self._advance(_TICK_US)
        size = self._core.host_rig_read(self._rig, buffer, _SIZE)
        said = self.up(buffer.raw[:size]) if size else b""
        if said:
            os.write(master, said)
        if heard:
            self.heard = int.from_bytes(heard[-1][2:4], "little")
            self.spoke = bool(said)

    def _advance(self, us: int) -> None:
        core, rig, plant = self._core, self._rig, self.plant
        for _ in range(0, us, _STEP_US):
            force_n = 1e-6 * core.host_rig_force(rig, 0)
            self.peak_n = max(self.peak_n, abs(force_n))
            self.pushed_us += _STEP_US if force_n else 0
            plant.advance(force_n, 1e-6 * _STEP_US)
            self._now_us += _STEP_US
            core.host_rig_set_position(rig, 0, self.counts)
            core.host_rig_set_home_switch(rig, plant.position_m < self.switch_at_m)
            core.host_rig_clock(rig, self._now_us & 0xFFFFFFFF)
