"""Hands that press and hold still: random devices, and the omega7 model and the paper's from many starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd import plugins
from hapticd.config.walls import WallChange, WallConfig
from hapticd.law import LawParams
from hapticd.offline.felt import WINDOW_S, felt_index
from hapticd.offline.outcome import Criterion, Outcome
from hapticd.offline.presses import aimed, judge
from hapticd.simulation.batch import Batch, BatchResult, Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.robustness.devices import DURATION_S, Device, draw
from hapticd_studies.robustness.readings import params_on
from hapticd_studies.transparency.devices import MAX_FORCE_N
from hapticd_studies.transparency.runs import columns_of

Array = npt.NDArray[np.float64]

NOISE_M = 4e-6
QUIET_COUNTS = 2.0
"""Still, as strictly as a sensor can tell: less than this from peak to peak."""

OMEGA_S = 4.0
WALLS_N_PER_M = (12e3, 18e3, 20e3)
FORCES_N = (1.0, 3.0, 6.0)
HIGHEST_M = 0.010

_MASS_SHARES = (0.0, 0.01, 0.02, 0.04, 0.07, 0.11, 0.16, 0.22, 0.3, 0.4, 0.5, 0.65, 0.8)  # of m / T
_LEAKS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
_DAMPERS = (5.0, 10.0, 20.0, 35.0, 50.0, 80.0)


@dataclass(frozen=True, slots=True)
class Start:
    """The omega7 model, or the paper's simulation, before a wall.

    Attributes:
        device: with its hand.
        wall: before it.
        max_force_n: the guard's limit [N].
    """

    device: SimulationOptions
    wall: WallConfig
    max_force_n: float

    def point(self, params: LawParams, criterion: Criterion) -> Point:
        """The loop under a law."""
        return aimed(Point(self.device, self.wall, params, 1e-3, self.max_force_n), criterion)


# Random devices


@lru_cache(maxsize=65536)
def noisy(seed: int, index: int) -> Device:
    """The device of a seed and an index, undelayed, with a sensor whose noise is 4 um."""
    device = draw(seed, index)
    options = device.options.model_copy(update={"force_delay_samples": 0, "noise_m": NOISE_M, "seed": index + 1})
    return replace(device, options=options)


def at_rest(devices: Sequence[Device], law: LawSpec, criterion: Criterion, threads: int | None) -> list[list[float]]:
    """Of each device whether it is held, and whether its rest spans less than two counts."""
    params = [params_on(law, device) for device in devices]
    points, result = _pressed(devices, law.law, params, criterion, threads)
    held = judge(criterion, points, result) == Outcome.SETTLED
    counts = np.array([device.options.resolution_m for device in devices])
    return _rows(held, result.peak_to_peak_m < QUIET_COUNTS * counts)


def holdable(devices: Sequence[Device], criterion: Criterion, threads: int | None) -> list[list[float]]:
    """Whether some constant damper of many holds each device."""
    law = plugins.law("damper")
    found = np.zeros(len(devices), dtype=bool)
    for units, multiples in ((_per_mass, _MASS_SHARES), (_per_leak, _LEAKS)):
        for multiple in multiples:
            left = np.flatnonzero(~found)
            chosen = [devices[int(at)] for at in left]
            if not chosen:
                break
            params = [law.Params(damping_n_s_per_m=multiple * units(device)) for device in chosen]
            points, result = _pressed(chosen, law, params, criterion, threads)
            found[left] = judge(criterion, points, result) == Outcome.SETTLED
    return [[float(each)] for each in found]


def _per_mass(device: Device) -> float:
    return device.mass_kg / device.period_s


def _per_leak(device: Device) -> float:
    return 0.5 * device.stiffness_n_per_m * device.period_s


def _pressed(
    devices: Sequence[Device], law: Any, params: Sequence[LawParams], criterion: Criterion, threads: int | None
) -> tuple[list[Point], BatchResult]:
    points = [device.point(each, criterion) for device, each in zip(devices, params, strict=True)]
    return points, Batch(law, points, DURATION_S, criterion.window_s, ledger=False).run(threads)


# Known devices


def omega_starts(each: int) -> list[Start]:
    """The omega7 model at three walls under three forces, from `each` starts up to 10 mm above the wall."""
    return [
        Start(_omega(force_n, HIGHEST_M * at / max(1, each - 1)), WallConfig(stiffness_n_per_m=k), MAX_FORCE_N)
        for k in WALLS_N_PER_M
        for force_n in FORCES_N
        for at in range(each)
    ]


def paper_starts() -> list[Start]:
    """Fig. 6: 0.5 kg without damping at 3 kN/m; alone, and with -1 N s/m in device or wall from 0.2 s on."""
    device = SimulationOptions.model_validate(
        {"model": "paper-simulation", "hand": {"force": {"profile": "constant", "newton": -5.0}}}
    )
    active = SimulationOptions.model_validate({"changes": [{"at_s": 0.2, "viscous_n_s_per_m": -1.0}]}).changes
    wall = WallConfig(stiffness_n_per_m=3e3)
    active_wall = WallConfig(stiffness_n_per_m=3e3, changes=(WallChange(at_s=0.2, damping_n_s_per_m=-1.0),))
    return [
        Start(each.model_copy(update={"initial_position_m": from_m}), before, np.inf)
        for from_m in (0.0, 0.005)
        for each, before in (
            (device, wall),
            (device.model_copy(update={"changes": active}), wall),
            (device, active_wall),
        )
    ]


def felt_at_rest(starts: Sequence[Start], law: LawSpec, criterion: Criterion, threads: int | None) -> list[list[float]]:
    """Of each start whether it is held, and the felt index of its last second."""
    return _felt(starts, law.law, law.params, criterion, threads)


def least_felt(starts: Sequence[Start], criterion: Criterion, threads: int | None) -> list[list[float]]:
    """Whether some constant damper of six holds each start, and the least felt index of those that do."""
    law = plugins.law("damper")
    runs = [_felt(starts, law, law.Params(damping_n_s_per_m=each), criterion, threads) for each in _DAMPERS]
    table = np.array(runs)
    felt = np.where(table[:, :, 0] > 0.0, table[:, :, 1], np.inf)
    return _rows(table[:, :, 0].max(axis=0), felt.min(axis=0))


def _felt(
    starts: Sequence[Start], law: Any, params: LawParams, criterion: Criterion, threads: int | None
) -> list[list[float]]:
    points = [start.point(params, criterion) for start in starts]
    batch = Batch(law, points, OMEGA_S, criterion.window_s, trace_every=1, ledger=False)
    result = batch.run(threads)
    last = round(WINDOW_S / 1e-3)
    felt = [felt_index(columns_of(result, at)[0][-last:], 1e-3) for at in range(len(starts))]
    return _rows(judge(criterion, points, result) == Outcome.SETTLED, np.array(felt))


def _rows(*columns: npt.NDArray[Any]) -> list[list[float]]:
    return [[float(value) for value in row] for row in zip(*columns, strict=True)]


def _omega(force_n: float, from_m: float) -> SimulationOptions:
    hand = {"force": {"profile": "constant", "newton": -force_n}}
    return SimulationOptions.model_validate({"model": "omega7", "initial_position_m": from_m, "hand": hand})
