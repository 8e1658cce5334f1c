"""A law on the simulated device: a hand presses a wall, and the outcome is a word."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import tomlkit

from hapticd.config.loading import LoadedConfig, parse
from hapticd.offline.model_choice import fitted
from hapticd.offline.run import Played, play


@dataclass(frozen=True, slots=True)
class Press:
    """What became of a press.

    Attributes:
        outcome: "settled", "still, but out of place", "keeps moving" or "diverged"; "stopped" where the daemon would
            have stopped, for example since the law failed; "runs" where the hand never comes to rest.
        fault: why the daemon would have stopped; None when it would not.
        run: every tick: `run.x_m`, `run.force_n`, `run.energy_j` and more.
    """

    outcome: str
    fault: str | None
    run: Played = field(repr=False)


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
) -> Press:
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

    Raises:
        ConfigError: a law, a parameter or a value that a configuration could not have.
        DriverError: the device cannot be stepped at this rate.
    """
    hand = {"force": {"profile": "constant", "newton": hand_n}}
    tables = {
        "loop": {"rate_hz": rate_hz},
        "device": {"options": {"initial_position_m": start_m, "hand": hand, **(device or {})}},
        "scene": {"walls": [{"stiffness_n_per_m": stiffness_n_per_m}]},
        "controller": {"law": law, "params": dict(params or {})},
    }
    return _simulated(parse(tomlkit.dumps(tables), "press"), duration_s)


def _simulated(config: LoadedConfig, duration_s: float) -> Press:
    run = play(fitted(config), duration_s)
    return Press(run.verdict, run.fault, run)
