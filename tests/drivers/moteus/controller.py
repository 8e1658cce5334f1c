"""A moteus controller that is not there. What it hears and says is read and written by the maker's own package."""

from __future__ import annotations

import io
import math
from typing import Any

from moteus import multiplex as mp
from moteus.protocol import Mode, Register, Writer, parse_registers

from tests.drivers.motors.bench import Controller
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import Frames

COUNTS_PER_TURN = 16384
SERIAL = (0x11, 0x22, -0x33)


class MoteusController(Controller):
    """One controller, its encoder at the middle of the travel of its shaft when it was switched on.

    Attributes:
        mode, fault: as its registers.
        home_state: 0 to 2, by which another encoder has told it where it is.
        wakes_at_home: whether such an encoder does so when it is switched on.
        has_counter: its firmware counts milliseconds.
        voltage_v: of its supply; below 10 V it gives up.
        commands: every register that the last command has set.
    """

    def __init__(self, address: int, shaft: Shaft) -> None:
        super().__init__(address, shaft)
        self.mode: int = Mode.STOPPED
        self.fault = 0
        self.home_state = 2
        self.wakes_at_home = False
        self.milliseconds = 1000.0
        self.has_counter = True
        self.voltage_v = 24.0
        self.commands: dict[int, Any] = {}
        self.position: float | None = None  # instead of the encoder's
        self._zero = 0.0
        self._torque_n_m = 0.0
        self._left_s = math.inf

    @property
    def torque_n_m(self) -> float:
        return self._torque_n_m if self.follows else 0.0

    @property
    def follows(self) -> bool:
        return bool(self.mode == Mode.POSITION)

    def restart(self) -> None:
        """Switch it off and on: it has stopped, and has forgotten how often its shaft has turned."""
        self.mode, self.fault, self.milliseconds = Mode.STOPPED, 0, 0.0
        self.home_state = 2 if self.wakes_at_home else 1
        self._zero = math.floor(self.shaft.turns + 0.5)

    def break_down(self, fault: int) -> None:
        self.mode, self.fault = Mode.FAULT, fault

    def is_tick(self, identifier: int) -> bool:
        return identifier & 0x7F == self.address

    def pass_time(self, duration_s: float) -> None:
        self.milliseconds += 1e3 * duration_s
        if self.voltage_v < 10.0 and self.mode == Mode.POSITION:
            self.break_down(40)
        if self.mode == Mode.POSITION:
            self._left_s -= duration_s
            if self._left_s <= 0.0:
                self.mode = Mode.TIMEOUT

    def hear(self, identifier: int, data: bytes) -> Frames:
        if identifier & 0x7F != self.address or self.deaf:
            return []
        said = parse_registers(data)
        assert not said.errors
        assert not said.response
        if said.command:
            self._obey(said.command)
        if not identifier & 0x8000:
            return []
        return [(self.address << 8 | (identifier >> 8 & 0x7F), self._answer(said.query))]

    def _obey(self, command: dict[int, Any]) -> None:
        self.commands = command
        if Register.SET_OUTPUT_EXACT in command:
            self._zero = self.shaft.turns - command[Register.SET_OUTPUT_EXACT]
            self.home_state = 2
        if Register.MODE not in command:
            return
        mode = int(command[Register.MODE])
        if mode in (Mode.STOPPED, Mode.BRAKE):
            self.mode, self.fault, self._torque_n_m = mode, 0, 0.0
        elif mode == Mode.POSITION and self.mode not in (Mode.FAULT, Mode.TIMEOUT):
            # All that would give a torque but the one that is meant.
            assert math.isnan(command[Register.COMMAND_POSITION])
            assert command[Register.COMMAND_KP_SCALE] == command[Register.COMMAND_KD_SCALE] == 0.0
            assert command[Register.COMMAND_ILIMIT_SCALE] == command[Register.COMMAND_VELOCITY] == 0.0
            if self.preparing:
                self.preparing -= 1
                self.mode = 3
            else:
                self.mode = Mode.POSITION
            most_n_m = command[Register.COMMAND_POSITION_MAX_TORQUE]
            torque_n_m = command[Register.COMMAND_FEEDFORWARD_TORQUE]
            self._torque_n_m = max(-most_n_m, min(most_n_m, torque_n_m))
            self._left_s = command[Register.COMMAND_TIMEOUT]

    def _answer(self, query: list[tuple[int, int]]) -> bytes:
        buffer = io.BytesIO()
        writer = Writer(buffer)
        for first, resolutions in _runs(query):
            if first == Register.MILLISECOND_COUNTER and not self.has_counter:
                buffer.write(bytes((0x31, first, 1)))  # cannot be read
                continue
            combiner = mp.WriteCombiner(writer, 0x20, first, resolutions)
            for at, resolution in enumerate(resolutions):
                assert combiner.maybe_write()
                self._write(writer, first + at, resolution)
        data = buffer.getvalue()
        size = next(size for size in (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64) if size >= len(data))
        return data.ljust(size, b"\x50")

    def _write(self, writer: Any, register: int, resolution: int) -> None:
        match register:
            case Register.POSITION:
                counted = round(self.shaft.turns * COUNTS_PER_TURN) / COUNTS_PER_TURN - self._zero
                writer.write_position(counted if self.position is None else self.position, resolution)
            case Register.VELOCITY:
                writer.write_velocity(self.shaft.turns_per_s, resolution)
            case Register.TORQUE:
                writer.write_torque(self.torque_n_m, resolution)
            case Register.VOLTAGE:
                writer.write_voltage(self.voltage_v, resolution)
            case Register.TEMPERATURE:
                writer.write_temperature(31.0, resolution)
            case _:
                writer.write_int(self._number(register), resolution)

    def _number(self, register: int) -> float:
        return {
            Register.MODE: self.mode,
            Register.FAULT: self.fault,
            Register.HOME_STATE: self.home_state,
            Register.FIRMWARE_VERSION: 0x010B,
            Register.MILLISECOND_COUNTER: self.milliseconds,
            **{Register.SERIAL_NUMBER1 + word: SERIAL[word] for word in range(3)},
        }[register]


def _runs(query: list[tuple[int, int]]) -> list[tuple[int, list[int]]]:
    """First register and resolutions of each run without a gap."""
    runs: list[tuple[int, list[int]]] = []
    for register, resolution in sorted(query):
        if runs and register == runs[-1][0] + len(runs[-1][1]):
            runs[-1][1].append(resolution)
        else:
            runs.append((register, [resolution]))
    return runs
