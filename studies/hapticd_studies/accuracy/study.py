"""All measurements of `hapticd study accuracy`, one after the other."""

from __future__ import annotations

from collections.abc import Callable

from hapticd.config.loading import LoadedConfig
from hapticd.offline.rehearsal import simulation_options
from hapticd_studies.accuracy.continuous import bounce_of, measure_bounce, stiff
from hapticd_studies.accuracy.control import ESTIMATORS, RATES_HZ, measure_rates, measure_velocity, measure_windows
from hapticd_studies.accuracy.cost import ROUNDS, single_precision_ratio
from hapticd_studies.accuracy.model import measure_model
from hapticd_studies.accuracy.report import AccuracyReport
from hapticd_studies.accuracy.settings import settings_of
from hapticd_studies.accuracy.telemetry import BATCHES, measure_batches
from hapticd_studies.accuracy.traps import traps

CYCLES_S = 5.0
"""How long detectors of cycles watch, so that there are some to see [s]."""


def study(loaded: LoadedConfig, duration_s: float, below_m: float, progress: Callable[[str], object]) -> AccuracyReport:
    """Measure everything.

    Args:
        loaded: a configuration for a simulated device.
        duration_s: simulated time of each run [s].
        below_m: error of the position that the choice is made for [m].
        progress: told what is being done, about `steps` times.
    """
    return AccuracyReport(
        name=str(loaded.path),
        duration_s=duration_s,
        below_m=below_m,
        model=measure_model(loaded, duration_s, progress),
        single_ratio=single_precision_ratio(),
        traps=traps(),
        bounces=measure_bounce(bounce_of(loaded)) if stiff(loaded) else (),
        rates=measure_rates(loaded, duration_s, progress),
        velocities=measure_velocity(loaded, duration_s, progress),
        windows=measure_windows(loaded, CYCLES_S, progress),
        batches=measure_batches(loaded, progress),
    )


def steps(loaded: LoadedConfig) -> int:
    """How often `study` tells its progress, about."""
    settings = len(list(settings_of(simulation_options(loaded))))
    return settings + ROUNDS + len(RATES_HZ) + len(ESTIMATORS) + 1 + 3 * len(BATCHES)
