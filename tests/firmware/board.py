"""The serial rig without a rig: the built firmware on a simulated processor (simulator/), its serial line on a pty.

    with Board(build(directory), directory / "port", pace="steps") as board:
        port = serial.Serial(str(board.port), exclusive=True, timeout=0)

Protocol and safety are proven here, latency is not: simulated time is not the machine's.
"""

from __future__ import annotations

import select
import subprocess
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Literal

import pytest

from tests.firmware.tools import FIRMWARE, HERE, need, run

ANSWER_S = 60.0  # a loaded machine is slow, a dead board is dead for ever

Pace = Literal["real", "frames", "patient", "steps"]
Kind = Literal["uno", "hapkit"]
KINDS: tuple[Kind, ...] = ("uno", "hapkit")


@dataclass(frozen=True, slots=True)
class Built:
    """What a board is made of: what is fastened to its pins, the program that simulates, and the firmware."""

    kind: Kind
    program: Path
    firmware: Path
    size: str


@dataclass(frozen=True, slots=True)
class BoardState:
    """The truth about the rig, which no protocol tells.

    Attributes:
        time_us: simulated time since the board began, through resets and unplugging [us].
        position_m, velocity_m_per_s: of the handle.
        motor_n: force that the motor exerts on the handle, from the pins of the processor [N].
        counts: what the sensor has shown; the firmware counts from where it was switched on.
        resets: how often the processor was reset by itself since it was plugged in.
    """

    time_us: float
    position_m: float
    velocity_m_per_s: float
    motor_n: float
    counts: int
    resets: int


def build(directory: Path, kind: Kind = "uno", firmware: Path = FIRMWARE) -> Built:
    """Compile the firmware with its own Makefile and the simulator with the host's compiler.

    Args:
        directory: where the results go.
        kind: which board.
        firmware: the sources.
    """
    need("avr-gcc", "make", "gcc")
    if not Path("/usr/include/simavr/sim_avr.h").exists():
        pytest.skip("needs libsimavr-dev")
    made = run("make", "-C", firmware / "serial-rig", f"BOARD={kind}", f"BUILD={directory}")
    program = directory / "board"
    sources = sorted((HERE / "simulator").glob("*.c"))
    run("gcc", "-O2", "-Wall", "-Wextra", "-Werror", *sources, "-o", program, "-lsimavr", "-lutil", "-lm")
    return Built(kind, program, directory / f"{kind}.elf", made[made.index("AVR Memory Usage") :])


class Board:
    """A rig that is plugged in.

    Args:
        built: what `build` made.
        port: a path for the serial port; exists while the rig is plugged in.
        pace: how simulated time passes. "real": with the clock, slower on a machine that is late. "frames": 1 ms for
            each frame that the host sends, and with the clock after 0.3 s without any, so that a driver's tick and a
            millisecond of the rig are the same whatever the load. "patient": the same, after 30 s, for one that never
            falls silent but may wait for its processor. "steps": only by `run`.
    """

    def __init__(self, built: Built, port: Path, pace: Pace = "real") -> None:
        self.kind = built.kind
        self.port = port
        self._process = subprocess.Popen(
            [built.program, built.kind, built.firmware, pace, port],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert self._answer() == "ready"
        except BaseException:
            self.stop()
            raise

    def __enter__(self) -> Board:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """End the board: to the host the rig has been pulled out for good."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.terminate()
        self._process.wait(ANSWER_S)
        self.port.unlink(missing_ok=True)

    def run(self, us: float, written: int = 0) -> int:
        """Let simulated time pass, whatever the pace.

        Args:
            us: how much [us].
            written: how many bytes the host has written since the rig was plugged in; they are waited for.

        Returns:
            How many bytes the rig has sent since then; they may still be on their way through the pty.
        """
        return int(self._ask(f"run {us} {written}"))

    def hand(self, newton: float) -> None:
        """Push the handle with a constant force [N]; positive towards larger positions."""
        self._do(f"hand {newton}")

    def grip(self, stiffness_n_per_m: float, damping_n_s_per_m: float, rest_m: float) -> None:
        """Hold the handle as a spring and a damper do, resting at a position; all 0: let go."""
        self._do(f"grip {stiffness_n_per_m} {damping_n_s_per_m} {rest_m}")

    def plant(self, mass_kg: float, damping_n_s_per_m: float) -> None:
        """What the handle weighs, and how viscous it runs (0.1 kg and 1 N s/m before)."""
        self._do(f"plant {mass_kg} {damping_n_s_per_m}")

    def place(self, position_m: float) -> None:
        """Put the handle somewhere without its sensor turning, as if the rig had been switched on there."""
        self._do(f"place {position_m}")

    def reverse_motor(self, reversed_: bool) -> None:
        """Exchange the motor's wires."""
        self._do(f"reversed {int(reversed_)}")

    def break_sensor(self, broken: bool) -> None:
        """Cut the wire of the encoder's channel B, or of the angle sensor's output."""
        self._do(f"broken-wire {int(broken)}")

    def misalign_encoder(self, phase_error_deg: float) -> None:
        """Let channel B come later than a quarter of a period after channel A [deg, below 90 either way]."""
        self._do(f"phase-error {phase_error_deg}")

    def turn_magnet(self, counts: int) -> None:
        """Turn the angle sensor's magnet on its shaft, as one does that comes loose."""
        self._do(f"magnet {counts}")

    def bend_sensor(self, share: float) -> None:
        """Let the angle sensor's voltage rise unevenly: its slope varies by this share over half a turn."""
        self._do(f"bend {share}")

    def press(self, button: bool) -> None:
        """Press or release the button."""
        self._do(f"button {int(button)}")

    def ttl(self, high: bool) -> None:
        """Drive the TTL input."""
        self._do(f"ttl {int(high)}")

    def syncs(self) -> int:
        """How often the sync output has turned since the rig was switched on."""
        return int(self._ask("syncs"))

    def hang(self) -> None:
        """Send the program into a loop that never looks at the processor's own watchdog."""
        self._do("hang")

    def unplug(self) -> None:
        """Pull the cable: the port vanishes and the processor is without power."""
        self._do("unplug")

    def plug(self) -> None:
        """Put the cable back: the same port appears, behind it a processor just switched on."""
        self._do("plug")

    def state(self) -> BoardState:
        """The truth at this moment."""
        time, position, velocity, motor, counts, resets = self._ask("state").split()
        return BoardState(float(time), float(position), float(velocity), float(motor), int(counts), int(resets))

    def _do(self, command: str) -> None:
        answer = self._ask(command)
        assert answer == "ok", answer

    def _ask(self, command: str) -> str:
        stdin = self._process.stdin
        assert stdin is not None
        stdin.write(command + "\n")
        stdin.flush()
        return self._answer()

    def _answer(self) -> str:
        stdout: IO[str] | None = self._process.stdout
        assert stdout is not None
        ready, _, _ = select.select([stdout], [], [], ANSWER_S)
        assert ready, f"the board has said nothing for {ANSWER_S} s"
        line = stdout.readline()
        assert line, f"the board has ended with status {self._process.wait(ANSWER_S)}"
        return line.strip()
