"""A rig on USB for a test: the double of `hid_double`, built once, and what a test sees and does beside the driver."""

from __future__ import annotations

import contextlib
import os
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from hapticd.driver import Driver
from hapticd_drivers.rig.hid_rig import HidRig
from hapticd_drivers.rig.hid_rig_options import HidRigOptions
from tests.daemon.running import wait_until

PRELOAD = "libumockdev-preload.so.0"
"""What a process is started with that shall see the double; which one, it finds in UMOCKDEV_DIR at each call."""

KNOWS_HOME, HAS_HOME_SWITCH = 2, 1
SERIAL = "0042"

_HERE = Path(__file__).parent / "hid_double"
_FIRMWARE = Path(__file__).parents[3] / "drivers" / "firmware"


def build(directory: Path) -> Path:
    """Compile the double with the protocol core of the firmware in it."""
    command = ["pkg-config", "--cflags", "--libs", "umockdev-1.0"]
    flags = subprocess.run(command, capture_output=True, text=True, check=False)
    if flags.returncode:
        pytest.skip("no umockdev: sudo apt install umockdev libumockdev-dev pkg-config")
    core, host = _FIRMWARE / "protocol", _FIRMWARE / "host-rig"
    sources = [*_HERE.glob("*.c"), host / "host_rig.c", *core.glob("*.c")]
    program = directory / "hid_double"
    warnings = ["-std=gnu17", "-O2", "-g", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(
        ["cc", *warnings, f"-I{core}", f"-I{host}", *map(str, sources), *flags.stdout.split(), "-o", str(program)],
        check=True,
        env=_without_preload(),
    )
    return program


class Look(NamedTuple):
    """What an axis does: force of its motor [uN], place [m], speed [m/s]; and which message was the last to come."""

    force_un: int
    x_m: float
    v_m_per_s: float
    sequence: int


class HidDouble:
    """A rig on USB with a handle that moves; plugged in, at rest in the middle, with its home known.

    Args:
        program: the double.
        axes: 1 to 3.
        silence_ms: its watchdog; long, since a busy computer must not trip it where that is not the question.
    """

    def __init__(self, program: Path, axes: int = 1, silence_ms: float = 5000.0) -> None:
        self._process = subprocess.Popen(
            [str(program), str(axes)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=_without_preload()
        )
        self.environment = {"LD_PRELOAD": PRELOAD, "UMOCKDEV_DIR": self._answer()}
        self.set("silence_ms", silence_ms)
        self.set("capabilities", KNOWS_HOME)
        self.plug()

    def driver(self, period_s: float = 1e-3, **options: Any) -> HidRig:
        """A driver for this process, which has to run with the preload library.

        The rig answers at once, since nothing paces a test as the loop would.
        """
        assert PRELOAD in os.environ["LD_PRELOAD"]
        os.environ["UMOCKDEV_DIR"] = self.environment["UMOCKDEV_DIR"]
        return HidRig(HidRigOptions.model_validate({"sign_checked": True, "answer_after_us": 0, **options}), period_s)

    def close(self) -> None:
        """Away with it and its directory."""
        process = self._process
        with contextlib.suppress(BrokenPipeError):
            process.communicate("quit\n")

    def look(self, axis: int = 0) -> Look:
        force_un, x_m, v_m_per_s, sequence = self.tell(f"look {axis}").split()
        return Look(int(force_un), float(x_m), float(v_m_per_s), int(sequence))

    def set(self, what: str, value: float, axis: int = 0) -> None:
        """`x_m`, `hand_n`, `motor_sign`, `switch_m`, `silence_ms`, `capabilities`, `buttons` or `mute`.

        `frames`: from now on a millisecond passes with each message, so that load on this computer means nothing to it.
        """
        self.tell(f"set {what} {value!r} {axis}")

    def catch_up(self, driver: Driver[Any]) -> None:
        """Return when what the driver has sent last has come."""
        assert isinstance(driver, HidRig)
        talk = driver._talk
        assert talk is not None
        wait_until(lambda: self.look().sequence == talk._sequence - 1 & 0xFFFF, "the last message")

    def forces_un(self) -> list[int]:
        """The forces of the first axis that have come since the last call, in the order in which they came [uN]."""
        return [int(word) for word in self.tell("forces").split()]

    def peak_n(self) -> float:
        """The largest force of the first axis since the last call [N]."""
        return 1e-6 * int(self.tell("peak"))

    def send(self, report: bytes) -> None:
        """A report of any length to the computer."""
        self.tell(f"send {report.hex()}")

    def plug(self, serial: str = SERIAL) -> None:
        self.tell(f"plug {serial}")

    def tell(self, line: str) -> str:
        """`unplug`, `hold` (a write blocks from now on), `release`, `break FAULT AXIS DETAIL`, `mend`, `restart`."""
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        return self._answer()

    def _answer(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line.endswith("\n"), f"the double has ended: {self._process.wait()}"
        return line.strip()


def _without_preload() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name not in ("LD_PRELOAD", "UMOCKDEV_DIR")}
