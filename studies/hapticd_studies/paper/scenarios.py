"""The paper's simulations and experiments as configurations that anybody can run with `hapticd simulate`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import tomlkit

from hapticd.config.loading import LoadedConfig, parse

TDPA_AS_PUBLISHED: dict[str, Any] = {"damping_cap_n_s_per_m": 0.0, "min_speed_m_per_s": 0.0, "reset": "never"}
"""Time-domain passivity control without any bound."""

PRINTED: dict[str, Any] = {"force_delay": "none", "small_leaks": 0.0}
"""Energy cycles without what the print does not have: no delay is identified, small cycles are cycles."""

LITERAL: dict[str, Any] = {**PRINTED, "work": "total", "cap": "none"}
"""The same with the energy that the paper plots, E_tot of the whole wall force, and no bound on the damping."""

NO_WINDOW: dict[str, Any] = {"window": 1}
"""Every change of sign of the power ends a cycle."""


@dataclass(frozen=True, slots=True)
class PaperScenario:
    """One run.

    Attributes:
        name: also the name of its file.
        figure: what of the paper it stands for.
        title: what is simulated, for people.
        duration_s: how long [s].
        wall: keys of the wall.
        law: the law.
        params: its parameters that differ from the defaults.
        device: keys of the device that differ from the defaults.
        hand_n: force of the hand at the end, < 0 presses [N].
        hand: keys of the hand's force, where it is not constant.
        lifted: whether force and speed limits are lifted, as in a simulation.
    """

    name: str
    figure: str
    title: str
    duration_s: float
    wall: dict[str, Any]
    law: str = "energy-cycle"
    params: dict[str, Any] = field(default_factory=dict)
    device: dict[str, Any] = field(default_factory=dict)
    hand_n: float = -3.0
    hand: dict[str, Any] = field(default_factory=dict)
    lifted: bool = False

    def text(self) -> str:
        """The configuration file."""
        force = {"profile": "constant", "newton": self.hand_n, **self.hand}
        tables: dict[str, Any] = {
            "device": {"options": {**self.device, "hand": {"force": force}}},
            "scene": {"walls": [self.wall]},
            "controller": {"law": self.law, **({"params": self.params} if self.params else {})},
        }
        if self.lifted:
            tables["safety"] = {"profile": "simulation"}
        head = f"# {self.figure[:1].upper()}{self.figure[1:]}: {self.title}.\n"
        head += f"#     hapticd simulate --config {self.name}.toml --duration {self.duration_s:g} --output run.csv\n\n"
        return head + tomlkit.dumps(tables)

    def load(self) -> LoadedConfig:
        """The configuration, checked as any other."""
        return parse(self.text(), f"{self.name}.toml")

    @property
    def stiffness_n_per_m(self) -> float:
        """The wall's stiffness [N/m]."""
        return float(self.wall["stiffness_n_per_m"])

    @property
    def balance_m(self) -> float:
        """Where hand and wall balance, < 0 inside [m]."""
        return self.hand_n / self.stiffness_n_per_m


def _bare(name: str, figure: str, title: str, duration_s: float = 3.0, **keys: Any) -> PaperScenario:
    """The paper's simulations: 0.5 kg with nothing that dissipates, a wall of 3 kN/m, pressed with 5 N."""
    device = {"model": "paper-simulation", **keys.pop("device", {})}
    wall = {"stiffness_n_per_m": 3000.0, **keys.pop("wall", {})}
    return PaperScenario(name, figure, title, duration_s, wall, device=device, hand_n=-5.0, lifted=True, **keys)


def _omega(name: str, figure: str, title: str, stiffness_n_per_m: float, **keys: Any) -> PaperScenario:
    """The paper's experiments: the omega.7 model at rest at the wall, pressed with 3 N."""
    return PaperScenario(name, figure, title, 6.0, {"stiffness_n_per_m": stiffness_n_per_m}, **keys)


def _credit(name: str, title: str, wall: dict[str, Any], **keys: Any) -> PaperScenario:
    """A wall of 12 kN/m, struck from 10 mm, that may dissipate for a second; then the hand presses twice as hard."""
    hand = {"profile": "step", "from_newton": -3.0, "at_s": 1.0}
    device = {"initial_position_m": 0.01}
    wall = {"stiffness_n_per_m": 12e3, **wall}
    return PaperScenario(name, "text", title, 6.0, wall, device=device, hand_n=-6.0, hand=hand, **keys)


_PASSIVE = {"damping_n_s_per_m": 30.0, "changes": [{"at_s": 1.0, "damping_n_s_per_m": 0.0}]}
_ACTIVE_WALL = {"changes": [{"at_s": 0.2, "damping_n_s_per_m": -1.0}]}
_ACTIVE_DEVICE = {"changes": [{"at_s": 0.2, "viscous_n_s_per_m": -1.0}]}
_DROP = {"initial_position_m": 0.005}
_NOISY: dict[str, Any] = {"noise_m": 2e-6}

SCENARIOS: dict[str, PaperScenario] = {
    scenario.name: scenario
    for scenario in (
        _bare("fig3", "Fig. 3", "0.5 kg at a wall of 3 kN/m, no law", law="none"),
        _bare("fig6-set1", "Fig. 6 a-c", "set 1, energy cycles on an undamped mass"),
        _bare("fig6-set1-drop", "Fig. 6 a-c", "set 1, dropped from 5 mm", device=_DROP),
        _bare("fig6-set2-wall", "Fig. 6 d-f", "set 2, from 0.2 s on the wall has -1 N s/m", wall=_ACTIVE_WALL),
        _bare("fig6-set2-device", "Fig. 6 d-f", "set 2, from 0.2 s on the device has -1 N s/m", device=_ACTIVE_DEVICE),
        _bare(
            "fig6-set2-device-drop",
            "Fig. 6 d-f",
            "set 2, active device, dropped from 5 mm",
            device={**_DROP, **_ACTIVE_DEVICE},
        ),
        _omega(
            "fig7",
            "Fig. 7",
            "12 kN/m, 5 N, sensor noise of 2 um, energy cycles without the time window",
            12e3,
            params=NO_WINDOW,
            device=_NOISY,
            hand_n=-5.0,
        ),
        _omega(
            "fig7-literal",
            "Fig. 7",
            "12 kN/m, 5 N, sensor noise of 2 um, E_tot and no cap, without the time window",
            12e3,
            params={**LITERAL, **NO_WINDOW},
            device=_NOISY,
            hand_n=-5.0,
        ),
        _omega(
            "fig7-literal-window",
            "Fig. 7",
            "12 kN/m, 5 N, sensor noise of 2 um, E_tot and no cap, with the time window",
            12e3,
            params=LITERAL,
            device=_NOISY,
            hand_n=-5.0,
        ),
        _omega("fig8", "Fig. 8", "12 kN/m, no law", 12e3, law="none"),
        _omega("fig9-12", "Fig. 9 a, d, g, j", "12 kN/m, energy cycles", 12e3),
        _omega("fig9-18", "Fig. 9 b, e, h, k", "18 kN/m, energy cycles", 18e3),
        _omega("fig9-20", "Fig. 9 c, f, i, l", "20 kN/m, energy cycles", 20e3),
        _omega("fig10", "Fig. 10", "12 kN/m, TDPA as published", 12e3, law="tdpa", params=TDPA_AS_PUBLISHED),
        _omega("fig10-bounded", "Fig. 10", "12 kN/m, TDPA with the bounds of a fair baseline", 12e3, law="tdpa"),
        _omega("fig9-18-continuous", "eq. 16", "18 kN/m, a sensor without steps", 18e3, device={"resolution_m": 0.0}),
        _omega("fig9-20-continuous", "eq. 16", "20 kN/m, a sensor without steps", 20e3, device={"resolution_m": 0.0}),
        _credit("credit", "energy cycles after a passive stretch", _PASSIVE),
        _credit("credit-none", "energy cycles without one", {}),
        _credit("credit-tdpa", "bounded TDPA after a passive stretch", _PASSIVE, law="tdpa"),
        _credit("credit-tdpa-none", "bounded TDPA without one", {}, law="tdpa"),
    )
}
"""In the order of the paper."""
