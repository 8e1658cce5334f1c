"""Random devices in a light hand before a wall of 0.2 to 5 times what they hold by themselves, and what the hand does.

Each is drawn from its seed and its index alone, as those of the robustness study, so that any one can be replayed.
"""

from __future__ import annotations

import math
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
from hapticd_studies.draws import Draws, digits
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

OUT_OF_SAMPLE = (
    "as those of the same seed, but without actuator corner; one in three with a force that comes 0-2 samples late, "
    "any part of one, in place of whole samples; one in three flexible: 60-500 Hz with both ends free, 10-50 % of the "
    "mass behind the spring, damping ratio 0.5-5 %, one in four with its sensor at the handle; one in three both"
)
PARTS = ("fraction", "flexible", "both")
"""What devices out of sample have that the others have not, in turn."""


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
        part: one of `PARTS` where it is out of sample.
    """

    seed: int
    index: int
    kind: str
    options: SimulationOptions
    wall: WallConfig
    rate_hz: float
    own_n_per_m: float
    part: str = ""

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
        return self.options.force_delay_samples > 0 or self.options.force_delay_s >= self.period_s

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
            **self._bending(),
            "hand_mass_kg": hand.mass_kg,
            "hand_damping_n_s_per_m": hand.damping_n_s_per_m,
            "hand_stiffness_n_per_m": hand.stiffness_n_per_m,
            "rate_hz": self.rate_hz,
            "stiffness_n_per_m": self.stiffness_n_per_m,
            "share_of_own_limit": self.own_share,
            "leak_n_s_per_m": self.leak_n_s_per_m,
        }

    def _bending(self) -> dict[str, Any]:
        if not self.part:
            return {}
        flexible = self.options.flexible
        return {
            "part": self.part,
            "force_delay_s": self.options.force_delay_s,
            "flexible_hz": flexible.frequency_hz if flexible else math.nan,
            "handle_share": flexible.handle_share if flexible else math.nan,
            "damping_ratio": flexible.damping_ratio if flexible else math.nan,
            "sensor": flexible.sensor if flexible else "",
        }


@lru_cache(maxsize=65536)
def draw(seed: int, index: int) -> Held:
    """The device of a seed and an index; numbers have 4 digits, so that they can be read and typed."""
    source = Draws(f"hapticd transparency {seed}:{index}")
    rate_hz = source.logarithmic(500.0, 4000.0)
    period_s = LoopConfig(rate_hz=rate_hz).period_s
    mass_kg = source.logarithmic(0.02, 5.0)
    viscous = digits(mass_kg * source.uniform(4.0, 24.0))
    delay = source.randrange(3)
    options: dict[str, Any] = {
        "mass_kg": mass_kg,
        "viscous_n_s_per_m": viscous,
        "resolution_m": source.logarithmic(1e-6, 3e-5),
        "max_force_n": MAX_FORCE_N,
        "force_delay_samples": delay,
        "hand": {
            "mass_kg": source.even(0.0, 0.1),
            "damping_n_s_per_m": source.even(0.3, 1.5),
            "stiffness_n_per_m": source.even(40.0, 200.0),
        },
    }
    # Every number is drawn whether it is used or not: a change of one share then leaves all other numbers alone.
    lag, noise_m = digits(rate_hz * source.uniform(0.15, 0.6)), source.even(2e-7, 4e-6)
    lags, noisy = (source.random() < chance for chance in (1.0 / 3.0, 0.5))
    if lags:
        options["bandwidth_hz"] = lag
    if noisy:
        options |= {"noise_m": noise_m, "seed": index + 1}
    moving_kg, damping = mass_kg + options["hand"]["mass_kg"], viscous + options["hand"]["damping_n_s_per_m"]
    own = stable_limit(Loop(moving_kg, damping, period_s, delay_samples=delay))
    wanted = min(HARDEST * damper_peak(moving_kg, period_s, delay), own * source.logarithmic(0.2, 5.0))
    wall = WallConfig(stiffness_n_per_m=digits(wanted))
    kind = KINDS[index % len(KINDS)]
    return Held(seed, index, kind, SimulationOptions.model_validate(options), wall, rate_hz, own)


@lru_cache(maxsize=65536)
def draw_out_of_sample(seed: int, index: int) -> Held:
    """The device of `draw` with what no law was made for, from a generator of its own; its wall is drawn anew."""
    before = draw(seed, index)
    source = Draws(f"hapticd transparency out of sample {seed}:{index}")
    part = PARTS[index % len(PARTS)]
    late, share = source.uniform(0.0, 2.0), source.uniform(0.1, 0.5)
    hertz, ratio = source.logarithmic(60.0, 500.0), source.logarithmic(0.005, 0.05)
    sensor = "handle" if source.random() < 0.25 else "motor"
    more: dict[str, Any] = {"bandwidth_hz": 0.0}
    if part != "flexible":
        more |= {"force_delay_samples": 0, "force_delay_s": digits(late * before.period_s)}
    if part != "fraction":
        flexible = {"frequency_hz": hertz, "handle_share": digits(share), "damping_ratio": ratio, "sensor": sensor}
        more["flexible"] = flexible
    options = SimulationOptions.model_validate({**before.options.model_dump(exclude_unset=True), **more})
    hand = options.hand
    own = stable_limit(
        Loop(
            before.mass_kg,
            options.viscous_n_s_per_m,
            before.period_s,
            delay_samples=options.force_delay_samples,
            hand_n_s_per_m=hand.damping_n_s_per_m,
            late_s=options.force_delay_s,
            flexible=options.flexible,
            hand_kg=hand.mass_kg,
        )
    )
    delay = options.force_delay_samples + math.ceil(options.force_delay_s / before.period_s)
    most = HARDEST * damper_peak(before.mass_kg, before.period_s, delay)
    wall = WallConfig(stiffness_n_per_m=digits(min(most, own * source.logarithmic(0.2, 5.0))))
    return Held(seed, index, before.kind, options, wall, before.rate_hz, own, part)
