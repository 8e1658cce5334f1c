"""The places of the study: device, hand, wall and law over many decades, each from its seed and index alone."""

from __future__ import annotations

import math
import re
from dataclasses import asdict, dataclass, fields, replace
from random import Random
from typing import Any

from pydantic import ValidationError

from hapticd.config.walls import WallConfig
from hapticd.errors import ConfigError
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.boundaries import spring_limit

RATES_HZ = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5)
"""Place after place takes the next one, so that places whose indices differ by a multiple of them share a rate."""

DELAYS = {0: 40, 1: 20, 2: 8, 3: 6, 4: 5, 5: 5, 8: 4, 12: 4, 20: 3, 40: 2, 70: 1, 100: 2}
"""Samples of delay, and how often each is drawn."""

LAWS = ("none", "energy-cycle", "tdpa", "energy-cycle:cap=known-mass")
"""Laws, one a place, in turn; the last knows mass and delay."""

DRAWN = (
    "wall 1e-3-1e8 N/m, half of them with damping of 1e-4-1e4 N s/m; mass 1e-6-1e3 kg; viscous friction 0 or 1e-4-1e4 "
    "N s/m, 1 in 20 negative; 1 in 5 held by a spring of 1e-3-1e6 N/m; 1 Hz-100 kHz; 0-100 samples of delay; position "
    "continuous or in steps of 1e-12-1e-3 m; hand force 0 or 1e-9-1e6 N; 1 in 4 with an actuator that saturates at "
    "1e-3-1e6 N; 3 in 10 start up to 1 m above the wall; speeds 0, 1e-9-10 m/s, or down to 5e-324 m/s; 1 in 3 with a "
    "wall beside the limit of stability"
)

_STIFFNESS = (-3, 8)
_MASS = (-6, 3)
_DAMPING = (-4, 4)


@dataclass(frozen=True, slots=True)
class LoopCase:
    """One device before one wall.

    Attributes:
        stiffness_n_per_m, wall_damping_n_s_per_m: the wall.
        mass_kg, viscous_n_s_per_m, hand_stiffness_n_per_m: what moves, what brakes it, and the spring of the hand.
        rate_hz: loop rate [Hz].
        force_delay_samples, resolution_m, max_force_n: actuator and sensor of the device, 0: continuous, no limit.
        hand_n: force of the hand, negative presses [N].
        initial_position_m, initial_velocity_m_per_s: the start.
        law: one of `LAWS`.
    """

    stiffness_n_per_m: float = 1000.0
    wall_damping_n_s_per_m: float = 0.0
    mass_kg: float = 0.25
    viscous_n_s_per_m: float = 0.0
    hand_stiffness_n_per_m: float = 0.0
    rate_hz: float = 1000.0
    force_delay_samples: int = 0
    resolution_m: float = 0.0
    max_force_n: float = 0.0
    hand_n: float = 0.0
    initial_position_m: float = 0.0
    initial_velocity_m_per_s: float = 0.0
    law: str = "none"

    @property
    def period_s(self) -> float:
        """Time between ticks [s]."""
        return 1.0 / self.rate_hz

    def options(self, linear: bool = False) -> SimulationOptions:
        """The device as the model takes it, as a linear one on request.

        Raises:
            ValidationError: the model refuses a value.
        """
        return SimulationOptions.model_validate(
            {
                "mass_kg": self.mass_kg,
                "viscous_n_s_per_m": self.viscous_n_s_per_m,
                "force_delay_samples": self.force_delay_samples,
                "resolution_m": 0.0 if linear else self.resolution_m,
                "max_force_n": 0.0 if linear else self.max_force_n,
                "initial_position_m": self.initial_position_m,
                "initial_velocity_m_per_s": self.initial_velocity_m_per_s,
                "hand": {
                    "force": {"profile": "constant", "newton": self.hand_n},
                    "stiffness_n_per_m": self.hand_stiffness_n_per_m,
                },
            }
        )

    def wall(self) -> WallConfig:
        """The wall."""
        return WallConfig(stiffness_n_per_m=self.stiffness_n_per_m, damping_n_s_per_m=self.wall_damping_n_s_per_m)

    def law_params(self) -> tuple[str, dict[str, Any]]:
        """The law's name and its parameters, where they differ from the defaults."""
        name, _, told = self.law.partition(":")
        if not told:
            return name, {}
        delay = "none" if self.force_delay_samples == 0 else "one-sample"
        return name, {"cap": "known-mass", "mass_kg": self.mass_kg, "force_delay": delay}

    def words(self) -> str:
        """As `--point` takes it: whatever differs from the defaults."""
        return ",".join(
            f"{field.name}={value if isinstance(value, str) else repr(value)}"
            for field in fields(self)
            if (value := getattr(self, field.name)) != field.default
        )

    def figures(self) -> dict[str, Any]:
        """For a file of results."""
        return asdict(self)


def place_of(text: str) -> LoopCase:
    """The place of `SEED:INDEX`, or of `NAME=VALUE,...`.

    Raises:
        ConfigError: it is neither.
    """
    if found := re.fullmatch(r"(\d{1,18}):(\d{1,12})", text):
        return draw(int(found[1]), int(found[2]))
    kinds: dict[str, type[Any]] = {name: type(value) for name, value in asdict(LoopCase()).items()}
    values: dict[str, Any] = {}
    for part in filter(None, text.split(",")):
        name, equals, value = part.partition("=")
        if not equals or name.strip() not in kinds:
            raise ConfigError(f"--point {text}: {part}: must be SEED:INDEX, or NAME=VALUE,... of {', '.join(kinds)}")
        try:
            values[name.strip()] = kinds[name.strip()](value.strip())
        except ValueError:
            raise ConfigError(f"--point {text}: {part}: is not a number") from None
    place = LoopCase(**values)
    if not 0.1 <= place.rate_hz <= 1e6:
        raise ConfigError(f"--point {text}: rate_hz = {place.rate_hz:g}: must be from 0.1 to 1e6")
    if place.law not in LAWS:
        raise ConfigError(f"--point {text}: law = {place.law}: must be one of {', '.join(LAWS)}")
    try:
        place.wall()
    except ValidationError as error:
        raise ConfigError(f"--point {text}: {refusal(error)}") from None
    return place


def refusal(error: ValueError) -> str:
    """Which parameter was refused and which limit it has, in a line."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors()[0]
    return f"{'.'.join(map(str, first['loc']))} = {first['input']}: {first['msg']}"


def draw(seed: int, index: int) -> LoopCase:
    """The place of a seed and an index; decades of stiffness and mass take turns, so that none is left out."""
    source = Random(f"hapticd extremes {seed}:{index}")
    round_, at_rate = divmod(index, len(RATES_HZ))
    law = LAWS[round_ % len(LAWS)]
    cell, at_mass = divmod(round_ // len(LAWS), _MASS[1] - _MASS[0])
    at_stiffness = cell % (_STIFFNESS[1] - _STIFFNESS[0])

    def decades(low: float, high: float) -> float:
        return float(10.0 ** (low + (high - low) * source.random()))

    def chosen(share: float, value: float) -> float:
        return value if source.random() < share else 0.0

    # Every number is drawn whether it is used or not: a change of one share then leaves all other numbers alone.
    stiffness = decades(_STIFFNESS[0] + at_stiffness, _STIFFNESS[0] + at_stiffness + 1)
    viscous = chosen(0.85, decades(*_DAMPING))
    speed = chosen(0.5, decades(-9, 1)) or chosen(0.5, max(5e-324, decades(-323.3, -300)))
    place = LoopCase(
        stiffness_n_per_m=stiffness,
        wall_damping_n_s_per_m=chosen(0.5, decades(*_DAMPING)),
        mass_kg=decades(_MASS[0] + at_mass, _MASS[0] + at_mass + 1),
        viscous_n_s_per_m=-viscous if source.random() < 0.05 else viscous,
        hand_stiffness_n_per_m=chosen(0.2, decades(-3, 6)),
        rate_hz=RATES_HZ[at_rate],
        force_delay_samples=source.choices(list(DELAYS), list(DELAYS.values()))[0],
        resolution_m=chosen(0.6, decades(-12, -3)),
        max_force_n=chosen(0.25, decades(-3, 6)),
        hand_n=-chosen(0.8, decades(-9, 6)),
        initial_position_m=chosen(0.3, decades(-12, 0)),
        initial_velocity_m_per_s=-speed,
        law=law,
    )
    share, off, side = source.random(), decades(-9, 0), source.choice((-1.0, 1.0))
    if share < 1.0 / 3.0:
        beside = _limit(place) * (1.0 + side * min(off, 0.9))
        if 10.0 ** _STIFFNESS[0] <= beside <= 10.0 ** _STIFFNESS[1]:
            place = replace(place, stiffness_n_per_m=beside)
    return place


def _limit(place: LoopCase) -> float:
    """About where the linear loop stops being stable; exactly there for a spring alone, d = 0 or 1 [N/m]."""
    period_s, delay = place.period_s, place.force_delay_samples
    if (
        place.viscous_n_s_per_m > 0.0
        and delay < 2
        and not (place.wall_damping_n_s_per_m or place.hand_stiffness_n_per_m)
    ):
        return spring_limit(place.mass_kg, place.viscous_n_s_per_m, period_s, delay)
    damping = max(0.0, place.viscous_n_s_per_m) + place.wall_damping_n_s_per_m
    return min(damping / ((0.5 + delay) * period_s), place.mass_kg / (math.pi * period_s * period_s * (1 + delay) ** 2))
