"""Errors of an ODrive: what each bit means, and what to do."""

from __future__ import annotations

FAULTS = {
    0x00000001: "it is still starting",
    0x00000002: "its firmware broke down: update it, or ask the maker",
    0x00000004: "its firmware broke its own timing",
    0x00000008: "it does not know where the shaft is: check encoder and calibration",
    0x00000010: "its configuration cannot be: run its set-up anew",
    0x00000020: "its transistor driver gave up: check supply and motor wires",
    0x00000040: "an input is missing",
    0x00000100: "the supply is too high, as when a handle that is pushed drives the motor: add a brake resistor",
    0x00000200: "the supply is too low",
    0x00000400: "it draws too much from the supply: dc_max_positive_current",
    0x00000800: "it gives too much back to the supply: a brake resistor, or dc_max_negative_current",
    0x00001000: "the current ran away: check current_control_bandwidth and motor wires",
    0x00002000: "the motor is too hot: let it cool, and use less force",
    0x00004000: "it is too hot: let it cool, and use less force",
    0x00008000: "the handle is faster than vel_limit: raise it, hapticd has a limit of its own",
    0x00010000: "the shaft is beyond its position limits",
    0x00020000: "the torque needs more current than it allows: lower max_torque_n_m",
    0x01000000: "its watchdog heard no torque in time",
    0x02000000: "an emergency stop was asked for",
    0x04000000: "the motor spins without turning the encoder: check both, then calibrate the encoder",
    0x08000000: "its brake resistor is off: arm it, or restart",
    0x10000000: "a thermistor is not connected",
    0x40000000: "its calibration failed: calibrate motor and encoder in its own tool",
}
"""By bit of an error."""


def errors_text(error: int) -> str:
    """What an error is, bit by bit; "" for none."""
    texts = [FAULTS.get(1 << bit, f"error 0x{1 << bit:x}") for bit in range(32) if error >> bit & 1]
    return "; ".join(texts)
