"""A law on the simulated device: a hand presses a wall, and the outcome is a word."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hapticd.offline.run import Run
from hapticd.offline.simulate import simulate
from hapticd.testing.law_scenario import pressed


def press(
    law: str,
    params: Mapping[str, Any] | None = None,
    *,
    stiffness_n_per_m: float = 12e3,
    hand_n: float = -3.0,
    start_m: float = 0.0,
    duration_s: float = 3.0,
    rate_hz: float = 1000.0,
    device: Mapping[str, Any] | None = None,
) -> Run:
    """Press a wall with a constant force and say what became of it; the tick is the daemon's, the device simulated.

    Args:
        law: what a configuration calls it: an installed name or `package.module`.
        params: its parameters that differ from the defaults, the keys of [controller.params].
        stiffness_n_per_m: of the wall [N/m].
        hand_n: force of the hand, negative presses [N].
        start_m: where the device starts, > 0 outside the wall [m].
        duration_s: simulated time [s].
        rate_hz: ticks a second [Hz].
        device: more keys of [device.options], such as `{"model": "falcon", "force_delay_samples": 1}`.

    Returns:
        The run: `settled`, `outcome`, `fault`, and every tick.

    Raises:
        ConfigError: a law, a parameter or a value that a configuration could not have.
        DriverError: the device cannot be stepped at this rate.
    """
    loaded = pressed(
        law,
        params,
        stiffness_n_per_m=stiffness_n_per_m,
        hand_n=hand_n,
        start_m=start_m,
        rate_hz=rate_hz,
        device=device,
    )
    return simulate(loaded, duration_s)
