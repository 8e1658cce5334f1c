"""An ODrive that is not there. What it hears and says is read and written by cantools, from a DBC file of 0.6.10."""

from __future__ import annotations

import importlib.util
from functools import cache
from pathlib import Path
from typing import Any

import cantools.database

from tests.drivers.motors.bench import Controller
from tests.drivers.motors.shaft import Shaft
from tests.drivers.motors.wire import Frames

IDLE, CLOSED_LOOP = 1, 8
WATCHDOG, UNDER_VOLTAGE = 0x01000000, 0x200


@cache
def dbc() -> Any:
    """The messages of axes 0 to 7; the package `odrive-can` carries the file."""
    found = importlib.util.find_spec("odrive_can")
    assert found is not None
    assert found.submodule_search_locations
    text = (Path(found.submodule_search_locations[0]) / "dbc" / "odrive-cansimple-0.6.10.dbc").read_text()
    # Its numbers with decimals are floats: SIG_VALTYPE_ says so for all axes.
    return cantools.database.load_string(text, "dbc", strict=False)


class OdriveController(Controller):
    """One ODrive of address 0 to 7, with its messages set up as docs/odrive.md says.

    Attributes:
        state, error: as in its heartbeat.
        watchdog_s: 0: off.
        heartbeat_ms, estimates_ms: 0: off.
        voltage_v: of its supply.
        mode: control mode and input mode.
    """

    def __init__(self, address: int, shaft: Shaft) -> None:
        super().__init__(address, shaft)
        self.state = IDLE
        self.error = 0
        self.watchdog_s = 0.02
        self.heartbeat_ms = 10
        self.estimates_ms = 1
        self.voltage_v = 24.0
        self.mode = (3, 1)  # position control, as delivered
        self.turns: float | None = None  # instead of the encoder's
        self._torque_n_m = 0.0
        self._fed_s = 0.0
        self._told = 0
        self._prepares = 0

    @property
    def torque_n_m(self) -> float:
        return self._torque_n_m if self.follows else 0.0

    @property
    def follows(self) -> bool:
        return self.state == CLOSED_LOOP

    def restart(self) -> None:
        """Switch it off and on."""
        self.state, self.error, self.mode, self._torque_n_m = IDLE, 0, (3, 1), 0.0

    def break_down(self, error: int) -> None:
        self.state, self.error = IDLE, error

    def is_tick(self, identifier: int) -> bool:
        return identifier == self.address << 5 | 0x0E

    def pass_time(self, duration_s: float) -> None:
        if self._prepares:
            self._prepares -= 1
            if not self._prepares:
                self.state, self._fed_s = CLOSED_LOOP, 0.0
        if self.state == CLOSED_LOOP:
            if self.voltage_v < 10.0:
                self.break_down(UNDER_VOLTAGE)
            self._fed_s += duration_s
            if 0.0 < self.watchdog_s <= self._fed_s:
                self.break_down(WATCHDOG)

    def hear(self, identifier: int, data: bytes) -> Frames:
        if identifier >> 5 != self.address or self.deaf:
            return []
        message = dbc().get_message_by_frame_id(identifier)
        said = message.decode(data.ljust(message.length, b"\0"), decode_choices=False)
        match message.name.partition("_")[2]:
            case "Set_Input_Torque":
                self._torque_n_m = said["Input_Torque"]
                self._fed_s = 0.0
            case "Set_Controller_Mode":
                self.mode = said["Control_Mode"], said["Input_Mode"]
            case "Clear_Errors":
                self.error = 0
            case "Set_Axis_State" if said["Axis_Requested_State"] == CLOSED_LOOP:
                if not self.error and self.voltage_v >= 10.0:
                    assert self.mode == (1, 1), "a torque would be taken for a place"
                    self._prepares = self.preparing
                    if not self.preparing:
                        self.state, self._fed_s = CLOSED_LOOP, 0.0
            case "Set_Axis_State":
                self._prepares = 0
                self.state = said["Axis_Requested_State"]
            case other:
                raise AssertionError(f"nothing of that is needed: {other}")
        return []

    def tell(self) -> Frames:
        frames: Frames = []
        self._told += 1
        if self.heartbeat_ms and self._told % self.heartbeat_ms == 0:
            values: dict[str, float] = {
                "Axis_Error": self.error,
                "Axis_State": self.state,
                "Procedure_Result": 0,
                "Trajectory_Done_Flag": 0,
            }
            frames.append(self._frame("Heartbeat", values))
            frames.append(self._frame("Get_Bus_Voltage_Current", {"Bus_Voltage": self.voltage_v, "Bus_Current": 0.1}))
            frames.append(self._frame("Get_Temperature", {"FET_Temperature": 31.0, "Motor_Temperature": 29.0}))
        if self.estimates_ms and self._told % self.estimates_ms == 0:
            turns = self.shaft.turns if self.turns is None else self.turns
            values = {"Pos_Estimate": turns, "Vel_Estimate": self.shaft.turns_per_s}
            frames.append(self._frame("Get_Encoder_Estimates", values))
        return frames

    def _frame(self, name: str, values: dict[str, float]) -> tuple[int, bytes]:
        message = dbc().get_message_by_name(f"Axis{self.address}_{name}")
        return message.frame_id, bytes(message.encode(values))
