"""The press that is repeated in every cell: a simulated device at one wall, from a configuration."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass

import tomlkit

from hapticd.config.file import table_of
from hapticd.config.loading import LoadedConfig
from hapticd.config.values import put
from hapticd.config.walls import WallConfig
from hapticd.errors import ConfigError
from hapticd.law import LawParams
from hapticd.offline.outcome import Criterion, coulomb_n
from hapticd.offline.presses import aimed, point_of
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.boundaries import Loop
from hapticd_studies.law_spec import toml_value


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
        return aimed(point, criterion)

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
            late_s=self.device.force_delay_s,
            flexible=self.device.flexible,
            hand_kg=hand.mass_kg,
        )


def scenario_of(loaded: LoadedConfig) -> PressScenario:
    """The press that a configuration describes.

    Raises:
        ConfigError: it is none, or none that the engine can repeat.
    """
    point = point_of(loaded)
    return PressScenario(point.device, point.wall, point.period_s, point.max_force_n, point.velocity_samples)


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
        data = table_of(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name}: not TOML: {error}") from None
    for one in given:
        short, equals, text_value = one.partition("=")
        if not equals or not short.strip():
            raise ConfigError(f"--set {one}: must be KEY=VALUE, as device.options.mass_kg=0.3")
        key, value = keys.get(short.strip(), short.strip()), toml_value(text_value)
        if key.endswith(".hand.force") and isinstance(value, int | float):
            value = {"profile": "constant", "newton": -float(value)}
        put(data, key, value, f"--set {one}")
    return tomlkit.dumps(data)
