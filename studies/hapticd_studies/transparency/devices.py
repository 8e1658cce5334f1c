"""Random devices in a light hand before a wall of 0.2 to 5 times what they hold by themselves, and what the hand does.

Each is drawn from its seed and its index alone, as those of the robustness study, so that any one can be replayed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from random import Random
from typing import Any

import tomlkit

from hapticd.config.models import LoopConfig
from hapticd.config.walls import WallConfig
from hapticd.law import LawParams
from hapticd.simulation.options import Change, Hand, RecordedForce, SimulationOptions
from hapticd_studies.boundaries import Loop, damper_peak, stable_limit
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.transparency.hands import KINDS, Movement, movement, options_of

MAX_FORCE_N = 12.0
HARDEST = 0.8
"""Walls are drawn up to this share of what the best sampled damper holds on the bare mass."""

DRAWN = (
    "mass 0.02-5 kg, viscous friction 4-24 /s of it, position steps of 1-30 um, 0.5-4 kHz, delay of 0, 1 or 2 samples, "
    "1 in 3 with an actuator corner at 0.15-0.6 of the rate, half with sensor noise of 0.2-4 um; a hand of up to "
    "0.1 kg, 0.3-1.5 N s/m and 40-200 N/m; wall of 0.2-5 times what device and hand hold by themselves, at "
    "most 0.8 of the damper peak; force limit 12 N"
)


@dataclass(frozen=True)
class Held:
    """A device in a hand before a wall.

    Attributes:
        seed, index: what it was drawn from.
        kind: what the hand does, by the index.
        options: device and hand, which gives no force yet.
        wall: the wall.
        rate_hz: loop rate [Hz].
        own_n_per_m: the stiffest wall that device and hand hold by themselves, without lag [N/m].
    """

    seed: int
    index: int
    kind: str
    options: SimulationOptions
    wall: WallConfig
    rate_hz: float
    own_n_per_m: float

    @property
    def name(self) -> str:
        """As `--replay` takes it."""
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
    def stiffness_n_per_m(self) -> float:
        """The wall's [N/m]."""
        return self.wall.stiffness_n_per_m

    @property
    def leak_n_s_per_m(self) -> float:
        """Damping that makes the sampled wall lossless, k T / 2 [N s/m]."""
        return 0.5 * self.stiffness_n_per_m * self.period_s

    @property
    def late(self) -> bool:
        """Whether its force comes one sample late or more."""
        return self.options.force_delay_samples > 0

    @property
    def own_share(self) -> float:
        """The wall as a multiple of what is held without a law."""
        return self.stiffness_n_per_m / self.own_n_per_m

    def movement(self, duration_s: float) -> Movement:
        """What the hand does, for at least this long."""
        hand = self.options.hand
        grip = {
            "hand_mass_kg": hand.mass_kg,
            "hand_damping_n_s_per_m": hand.damping_n_s_per_m,
            "hand_stiffness_n_per_m": hand.stiffness_n_per_m,
        }
        return movement(self.kind, Random(f"hapticd transparency hand {self.seed}:{self.index}"), duration_s, grip)

    def moved(self, duration_s: float) -> SimulationOptions:
        """The device under its moving hand."""
        found = self.movement(duration_s)
        changes = tuple(Change(**grip) for grip in found.grips)
        return self.pressed(options_of(found)["points"]).model_copy(update={"changes": changes})

    def pressed(self, points: list[tuple[float, float]], **start: float) -> SimulationOptions:
        """The device under a force over time, from another start."""
        hand: Hand = self.options.hand.model_copy(update={"force": RecordedForce(points=tuple(points))})
        return self.options.model_copy(update={"hand": hand, **start})

    def params(self, law: LawSpec) -> LawParams:
        """The parameters of a law here: what the maker of the device could know of its damping is given."""
        values = dict(law.values)
        fields, viscous = law.law.Params.model_fields, self.options.viscous_n_s_per_m
        if "device_damping_n_s_per_m" in fields:
            values.setdefault("device_damping_n_s_per_m", viscous)
        if "coupling_stiffness_n_per_m" in fields:  # as stiff as its rule allows, as the defaults are for 4.4 N s/m
            values.setdefault("coupling_stiffness_n_per_m", 1.5 * viscous / self.period_s)
            values.setdefault("coupling_damping_n_s_per_m", viscous / 4.4)
        params: LawParams = law.law.Params.model_validate(values)
        return params

    def config(self, law: str, duration_s: float) -> str:
        """A configuration that runs it, TOML."""
        found = self.movement(duration_s)
        options = self.options.model_dump(exclude_defaults=True, exclude={"model", "hand"})
        options["changes"] = found.grips
        hand = self.options.hand.model_dump(exclude_defaults=True, exclude={"force"})
        hand["force"] = options_of(found)
        return tomlkit.dumps(
            {
                "loop": {"rate_hz": self.rate_hz},
                "device": {"driver": "loopback", "options": {**options, "hand": hand}},
                "scene": {"walls": [self.wall.model_dump(exclude_defaults=True)]},
                "controller": {"law": law},
                "safety": {"max_force_n": MAX_FORCE_N},
            }
        )

    def figures(self) -> dict[str, Any]:
        """Its parameters as columns of a table."""
        options, hand = self.options, self.options.hand
        return {
            "hand": self.kind,
            "mass_kg": options.mass_kg,
            "viscous_n_s_per_m": options.viscous_n_s_per_m,
            "resolution_m": options.resolution_m,
            "noise_m": options.noise_m,
            "bandwidth_hz": options.bandwidth_hz,
            "force_delay_samples": options.force_delay_samples,
            "hand_mass_kg": hand.mass_kg,
            "hand_damping_n_s_per_m": hand.damping_n_s_per_m,
            "hand_stiffness_n_per_m": hand.stiffness_n_per_m,
            "rate_hz": self.rate_hz,
            "stiffness_n_per_m": self.stiffness_n_per_m,
            "share_of_own_limit": self.own_share,
            "leak_n_s_per_m": self.leak_n_s_per_m,
        }


@lru_cache(maxsize=65536)
def draw(seed: int, index: int) -> Held:
    """The device of a seed and an index; numbers have 4 digits, so that they can be read and typed."""
    source = Random(f"hapticd transparency {seed}:{index}")
    rate_hz = _logarithmic(source, 500.0, 4000.0)
    period_s = LoopConfig(rate_hz=rate_hz).period_s
    mass_kg = _logarithmic(source, 0.02, 5.0)
    viscous = _digits(mass_kg * source.uniform(4.0, 24.0))
    delay = source.randrange(3)
    options: dict[str, Any] = {
        "mass_kg": mass_kg,
        "viscous_n_s_per_m": viscous,
        "resolution_m": _logarithmic(source, 1e-6, 3e-5),
        "max_force_n": MAX_FORCE_N,
        "force_delay_samples": delay,
        "hand": {
            "mass_kg": _digits(source.uniform(0.0, 0.1)),
            "damping_n_s_per_m": _digits(source.uniform(0.3, 1.5)),
            "stiffness_n_per_m": _digits(source.uniform(40.0, 200.0)),
        },
    }
    # Every number is drawn whether it is used or not: a change of one share then leaves all other numbers alone.
    lag, noise_m = _digits(rate_hz * source.uniform(0.15, 0.6)), _digits(source.uniform(2e-7, 4e-6))
    lags, noisy = (source.random() < chance for chance in (1.0 / 3.0, 0.5))
    if lags:
        options["bandwidth_hz"] = lag
    if noisy:
        options |= {"noise_m": noise_m, "seed": index + 1}
    moving_kg, damping = mass_kg + options["hand"]["mass_kg"], viscous + options["hand"]["damping_n_s_per_m"]
    own = stable_limit(Loop(moving_kg, damping, period_s, delay_samples=delay))
    wanted = min(HARDEST * damper_peak(moving_kg, period_s, delay), own * _logarithmic(source, 0.2, 5.0))
    wall = WallConfig(stiffness_n_per_m=_digits(wanted))
    kind = KINDS[index % len(KINDS)]
    return Held(seed, index, kind, SimulationOptions.model_validate(options), wall, rate_hz, own)


def _logarithmic(source: Random, low: float, high: float) -> float:
    return _digits(low * (high / low) ** source.random())


def _digits(value: float) -> float:
    return float(f"{value:.4g}")
