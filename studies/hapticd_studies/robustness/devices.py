"""Random devices, hands and walls: each is drawn from its seed and its index alone, so that any one can be replayed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import tomlkit

from hapticd.config.models import LoopConfig
from hapticd.config.walls import WallChange, WallConfig
from hapticd.law import LawParams
from hapticd.offline.outcome import Criterion
from hapticd.offline.presses import aimed
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.boundaries import damper_peak
from hapticd_studies.draws import Draws, digits

DURATION_S = 6.0
MAX_FORCE_N = 12.0
WITHIN_REACH = 0.8
"""A device is within reach of damping below this share of the damper peak, and of the force limit."""

DRAWN = (
    "mass 0.15-0.5 kg, viscous friction 1-6 N s/m, position steps of 1-30 um, wall 4-30 kN/m, 0.5-4 kHz, constant hand "
    "force 0.5-8 N of a limit of 12 N, 4 in 10 start at the wall and the others up to 15 mm above it, 3 in 10 held by "
    "a hand (up to 0.1 kg, 0.5-4 N s/m, up to 200 N/m), 2 in 10 with Coulomb friction of 0.02-0.3 N, 3 in 10 with one "
    "sample of force delay that no law is told of, 2 in 10 against a wall that stiffens half-way from 0.3-0.8 of it"
)


@dataclass(frozen=True, slots=True)
class Device:
    """A device in a hand before a wall.

    Attributes:
        seed, index: what it was drawn from.
        options: the device and its hand.
        wall: the wall.
        rate_hz: loop rate [Hz].
    """

    seed: int
    index: int
    options: SimulationOptions
    wall: WallConfig
    rate_hz: float

    @property
    def name(self) -> str:
        """As `--only` takes it."""
        return f"{self.seed}:{self.index}"

    @property
    def period_s(self) -> float:
        """Time between ticks, as the daemon rounds it [s]."""
        return LoopConfig(rate_hz=self.rate_hz).period_s

    @property
    def mass_kg(self) -> float:
        """What moves, hand included [kg]."""
        return self.options.mass_kg + self.options.hand.mass_kg

    @property
    def delayed(self) -> bool:
        """Whether its force comes one sample late."""
        return self.options.force_delay_samples > 0

    @property
    def stiffness_n_per_m(self) -> float:
        """The wall at its stiffest, which is at the end [N/m]."""
        last = self.wall.changes[-1].stiffness_n_per_m if self.wall.changes else None
        return self.wall.stiffness_n_per_m if last is None else last

    @property
    def last_change_s(self) -> float:
        """When the wall stiffens; 0 when it does not [s]."""
        return self.wall.changes[-1].at_s if self.wall.changes else 0.0

    @property
    def hand_n(self) -> float:
        """How hard the hand presses [N]."""
        return -float(getattr(self.options.hand.force, "newton", math.nan))

    @property
    def peak_share(self) -> float:
        """Stiffness as a share of the most that any wall damping holds on a bare mass."""
        return self.stiffness_n_per_m / damper_peak(self.mass_kg, self.period_s, self.options.force_delay_samples)

    @property
    def force_share(self) -> float:
        """Hand force as a share of the force limit."""
        return self.hand_n / MAX_FORCE_N

    @property
    def within_reach(self) -> bool:
        """Whether damping could hold it with something to spare."""
        return self.peak_share < WITHIN_REACH and self.force_share < WITHIN_REACH

    def point(self, params: LawParams, criterion: Criterion) -> Point:
        """The loop under a law, with the place where it should settle."""
        return aimed(Point(self.options, self.wall, params, self.period_s, MAX_FORCE_N), criterion)

    def config(self, law: str, params: dict[str, Any]) -> str:
        """A configuration that runs it, TOML."""
        options = self.options.model_dump(exclude_defaults=True, exclude={"model", "hand"})
        hand = self.options.hand.model_dump(exclude_defaults=True, exclude={"force"})
        hand["force"] = {"profile": "constant", "newton": -self.hand_n}
        wall = self.wall.model_dump(exclude_defaults=True)
        wall["changes"] = [change.model_dump(exclude_none=True) for change in self.wall.changes]
        return tomlkit.dumps(
            {
                "loop": {"rate_hz": self.rate_hz},
                "device": {"driver": "loopback", "options": {**options, "hand": hand}},
                "scene": {"walls": [wall]},
                "controller": {"law": law, "params": params},
                "safety": {"max_force_n": MAX_FORCE_N},
            }
        )

    def figures(self) -> dict[str, float | int]:
        """Its parameters as columns of a table."""
        options, hand = self.options, self.options.hand
        return {
            "mass_kg": options.mass_kg,
            "viscous_n_s_per_m": options.viscous_n_s_per_m,
            "coulomb_n": options.coulomb_n,
            "resolution_m": options.resolution_m,
            "force_delay_samples": options.force_delay_samples,
            "initial_position_m": options.initial_position_m,
            "hand_force_n": self.hand_n,
            "hand_mass_kg": hand.mass_kg,
            "hand_damping_n_s_per_m": hand.damping_n_s_per_m,
            "hand_stiffness_n_per_m": hand.stiffness_n_per_m,
            "rate_hz": self.rate_hz,
            "stiffness_at_start_n_per_m": self.wall.stiffness_n_per_m,
            "stiffness_n_per_m": self.stiffness_n_per_m,
            "share_of_damper_peak": self.peak_share,
            "share_of_force_limit": self.force_share,
        }


@lru_cache(maxsize=65536)
def draw(seed: int, index: int) -> Device:
    """The device of a seed and an index; numbers have 4 digits, so that they can be read and typed."""
    source = Draws(f"hapticd robustness {seed}:{index}")
    uniform, logarithmic = source.even, source.logarithmic
    # Every number is drawn whether it is used or not: a change of one share then leaves all other numbers alone.
    rate_hz, stiffness = logarithmic(500.0, 4000.0), logarithmic(4e3, 3e4)
    options: dict[str, Any] = {
        "mass_kg": uniform(0.15, 0.5),
        "viscous_n_s_per_m": uniform(1.0, 6.0),
        "resolution_m": logarithmic(1e-6, 3e-5),
        "max_force_n": MAX_FORCE_N,
    }
    hand: dict[str, Any] = {"force": {"profile": "constant", "newton": -uniform(0.5, 8.0)}}
    drop_m, held = (
        uniform(0.0, 0.015),
        {
            "mass_kg": uniform(0.0, 0.1),
            "damping_n_s_per_m": uniform(0.5, 4.0),
            "stiffness_n_per_m": uniform(0.0, 200.0),
        },
    )
    coulomb_n, softer = uniform(0.02, 0.3), uniform(0.3, 0.8)
    drops, is_held, rubs, late, stiffens = (source.random() < share for share in (0.6, 0.3, 0.2, 0.3, 0.2))
    if drops:
        options["initial_position_m"] = drop_m
    if is_held:
        hand |= held
    if rubs:
        options["coulomb_n"] = coulomb_n
    if late:
        options["force_delay_samples"] = 1
    wall = WallConfig(stiffness_n_per_m=stiffness)
    if stiffens:
        change = WallChange(at_s=DURATION_S / 2.0, stiffness_n_per_m=stiffness)
        wall = WallConfig(stiffness_n_per_m=digits(softer * stiffness), changes=(change,))
    return Device(seed, index, SimulationOptions.model_validate({**options, "hand": hand}), wall, rate_hz)
