"""The press that is repeated in every cell: a simulated device at one wall, from a configuration."""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import tomlkit

from hapticd.config.loading import LoadedConfig
from hapticd.config.models import WallConfig
from hapticd.errors import ConfigError
from hapticd.law import LawParams
from hapticd.offline.law_spec import toml_value
from hapticd.offline.verdict import Criterion, balance_m, coulomb_n, pressing_n
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.boundaries import Loop


@dataclass(frozen=True, slots=True)
class PressScenario:
    """One press.

    Attributes:
        device: the device model, hand included.
        wall: the wall.
        period_s: time between ticks [s].
        max_force_n: the guard's limit [N].
        velocity_samples: samples that the velocity difference spans.
    """

    device: SimulationOptions
    wall: WallConfig
    period_s: float
    max_force_n: float
    velocity_samples: int

    def point(self, params: LawParams, criterion: Criterion) -> Point:
        """The press under a law, with the place where it should settle."""
        point = Point(self.device, self.wall, params, self.period_s, self.max_force_n, self.velocity_samples)
        return replace(point, target_m=balance_m(point), band_m=criterion.place_limit_m(point))

    def loop(self) -> Loop:
        """What the analytic limits depend on."""
        hand = self.device.hand
        return Loop(
            mass_kg=self.device.mass_kg + hand.mass_kg,
            viscous_n_s_per_m=self.device.viscous_n_s_per_m,
            period_s=self.period_s,
            wall_damping_n_s_per_m=self.wall.damping_n_s_per_m,
            delay_samples=self.device.force_delay_samples,
            coulomb_n=coulomb_n(self.device),
            resolution_m=self.device.resolution_m,
            hand_n_per_m=hand.stiffness_n_per_m,
            hand_n_s_per_m=hand.damping_n_s_per_m,
        )


def scenario_of(loaded: LoadedConfig) -> PressScenario:
    """The press that a configuration describes.

    Raises:
        ConfigError: it is none, or none that the engine can repeat.
    """
    name, config, device = loaded.path, loaded.config, loaded.options
    if not isinstance(device, SimulationOptions):
        raise ConfigError(f'{name}: device.driver = "{config.device.driver}": only a simulated device, try "loopback"')
    if len(config.scene.walls) != 1:
        raise ConfigError(f"{name}: scene.walls: has {len(config.scene.walls)} walls; a map needs one")
    if config.velocity.estimator != "difference":
        raise ConfigError(f'{name}: velocity.estimator = "{config.velocity.estimator}": a map needs "difference"')
    if not pressing_n(device) > 0.0:
        raise ConfigError(
            f"{name}: device.options.hand.force: must come to rest at a press (newton < 0; constant, step or ramp): "
            "a map asks where the device settles"
        )
    if device.initial_position_m < 0.0:
        raise ConfigError(
            f"{name}: device.options.initial_position_m = {device.initial_position_m:g}: must be 0 or more: inside the "
            "wall the daemon ramps the force up, which the engine of a map leaves out"
        )
    limit_n = math.inf
    if config.safety.profile != "simulation":
        limits = (config.safety.max_force_n, config.safety.max_axis_force_n, device.max_force_n or math.inf)
        limit_n = min(limit for limit in limits if limit is not None)
    return PressScenario(device, config.scene.walls[0], config.loop.period_s, limit_n, config.velocity.samples)


def changing(scenario: PressScenario) -> set[str]:
    """The keys that the press itself changes over time, so that a map over them would mean nothing."""
    wall = {f"scene.walls[0].{key}" for one in scenario.wall.changes for key in one.model_dump(exclude_none=True)}
    keys = {key for change in scenario.device.changes for key in change.values()}
    return wall | {f"device.options.{'hand.' if k.startswith('hand_') else ''}{k.removeprefix('hand_')}" for k in keys}


def with_values(text: str, name: str, given: Sequence[str], keys: dict[str, str]) -> str:
    """The text of a configuration with some values replaced.

    Args:
        text: TOML.
        name: what to call it in errors.
        given: `device.options.mass_kg=0.3`, or a short name of `keys`.
        keys: short names of keys.

    Raises:
        ConfigError: it is no assignment, or there is no such place.
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: not TOML: {error}") from None
    for one in given:
        key, equals, value = one.partition("=")
        if not equals or not re.fullmatch(r"[A-Za-z0-9_-]+(\[\d+\]|\.[A-Za-z0-9_-]+)*", key.strip()):
            raise ConfigError(f"--set {one}: must be KEY=VALUE, as device.options.mass_kg=0.3")
        path = keys.get(key.strip(), key.strip())
        _put(data, path, toml_value(value), one)
    return tomlkit.dumps(data)


def _put(data: dict[str, Any], path: str, value: Any, given: str) -> None:
    steps: list[str | int] = [
        int(step[1:-1]) if step.startswith("[") else step for step in re.findall(r"\[\d+\]|[A-Za-z0-9_-]+", path)
    ]
    if path.endswith(".hand.force") and isinstance(value, int | float):
        value = {"profile": "constant", "newton": -float(value)}
    place: Any = data
    try:
        for step, after in itertools.pairwise(steps):
            if isinstance(place, dict):
                place = place.setdefault(step, [] if isinstance(after, int) else {})
            else:
                place = place[step]
        place[steps[-1]] = value
    except (TypeError, KeyError, IndexError):
        raise ConfigError(f"--set {given}: the configuration has no such place") from None
