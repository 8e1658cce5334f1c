"""Run a configuration: the front door to one run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hapticd.config.loading import LoadedConfig, load
from hapticd.offline.model_choice import fitted
from hapticd.offline.rehearsal import rehearse
from hapticd.offline.run import Run


def simulate(
    config: LoadedConfig | Path | str,
    duration_s: float = 2.0,
    *,
    take: Callable[[Any], object] | None = None,
    progress: Callable[[int], object] | None = None,
) -> Run:
    """Run a configuration on its simulated device, with the daemon's tick and the daemon's numbers to the last bit.

    Args:
        config: a configuration, its file, or its text.
        duration_s: simulated time [s].
        take: is given every row as it comes, for runs too long to keep; the run then keeps the last half second only.
        progress: hears now and then how many ticks are done.

    Raises:
        ConfigError: the configuration cannot be used or is not one for a simulated device, or the duration makes no
            sense.
        DriverError: the device cannot be stepped at this rate, or gave not even one sample.
    """
    loaded = config if isinstance(config, LoadedConfig) else load(config)
    return rehearse(fitted(loaded), duration_s, take=take, progress=progress)
