"""Faults of a moteus controller: what each means, and what to do."""

from __future__ import annotations

from hapticd_drivers.moteus.registers import FAULTED, STOPPED, TIMED_OUT

FAULTS = {
    32: "its encoder saw no magnet while it was calibrated: check magnet and distance, then moteus_tool --calibrate",
    33: "its motor driver gave up, mostly since the supply fell: check supply and wires",
    34: "the supply rose over servo.max_voltage, as when a handle that is pushed drives the motor: a supply that takes "
    "current back, or servo.flux_brake_margin_voltage",
    35: "its encoder makes no sense: check magnet and cable",
    36: "the motor was never calibrated: moteus_tool --calibrate",
    37: "its firmware was too slow",
    38: "it is too hot: let it cool, and use less force",
    39: "the shaft is outside servopos.position_min and position_max: set both to nan",
    40: "the supply is too low",
    41: "its configuration was changed",
    42: "no encoder for commutation: check motor_position",
    43: "no encoder for the output: check motor_position",
    44: "its transistors could not be switched on: check the supply",
    45: "a stop position was commanded, which is none of hapticd's",
    46: "its firmware broke its own timing",
    47: "servo.bemf_feedforward is set: set it to 0",
    48: "servopos.position_min or position_max cannot be: set both to nan",
}
"""By value of register FAULT, where MODE is 1."""


def stopped_text(mode: int, fault: int, silence_ms: float) -> str:
    """Why a controller follows no torque.

    Args:
        mode: value of register MODE.
        fault: value of register FAULT.
        silence_ms: its watchdog [ms].
    """
    if mode == FAULTED:
        return FAULTS.get(fault, f"fault {fault}: moteus's register reference says what that is")
    if mode == TIMED_OUT:
        return f"its watchdog heard no command for {silence_ms:g} ms"
    if mode == STOPPED:
        return "it has stopped, as when it was switched off and on, or another program told it to"
    return (
        f"it is in mode {mode} and follows no torque: look at its motor supply and its firmware's settings, and for "
        "another program on the bus that commands it"
    )
