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

TO_THE_LETTER: dict[str, Any] = {**LITERAL, "plateaus": "literal", "contact_loss": "ignored", "rule": "signed"}
"""Nothing but eqs. 7 to 10: equal energies break the window, a lost contact ends no cycle, the damping may fall."""

PRINTED_OBSERVER: dict[str, Any] = {**TDPA_AS_PUBLISHED, "observer": "printed"}
"""The same with eq. 2 as printed: force and velocity of the same instant."""

CREDIT_ENDS_S = 1.0
"""When the passive stretch ends [s]."""

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
        grip: mass, damping and spring of the hand, where it has any.
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
    grip: dict[str, Any] = field(default_factory=dict)
    lifted: bool = False

    def text(self) -> str:
        """The configuration file."""
        force = {"profile": "constant", "newton": self.hand_n, **self.hand}
        tables: dict[str, Any] = {
            "device": {"options": {**self.device, "hand": {**self.grip, "force": force}}},
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
    keys = {"hand_n": -5.0, **keys}
    return PaperScenario(name, figure, title, duration_s, wall, device=device, lifted=True, **keys)


def _omega(name: str, figure: str, title: str, stiffness_n_per_m: float, **keys: Any) -> PaperScenario:
    """The paper's experiments: the omega.7 model at rest at the wall, pressed with 3 N."""
    return PaperScenario(name, figure, title, 6.0, {"stiffness_n_per_m": stiffness_n_per_m}, **keys)


def _credit(name: str, title: str, drop_m: float, **keys: Any) -> PaperScenario:
    """A wall of 12 kN/m whose own damping holds it for a second and then is gone; the hand then presses twice as hard.

    The wall's damping is more than kT/2, so that nothing is generated in that second and no law has anything to learn.
    """
    hand = {"profile": "step", "from_newton": -3.0, "at_s": CREDIT_ENDS_S}
    wall = {
        "stiffness_n_per_m": 12e3,
        "damping_n_s_per_m": 60.0,
        "changes": [{"at_s": CREDIT_ENDS_S, "damping_n_s_per_m": 0.0}],
    }
    device = {"initial_position_m": drop_m}
    return PaperScenario(name, "text", title, 6.0, wall, device=device, hand_n=-6.0, hand=hand, **keys)


def _moving(name: str, title: str, stiffness_n_per_m: float, **keys: Any) -> PaperScenario:
    """A hand of 5 N s/m and 200 N/m that presses with 3 N and draws back with 1 N, once a second."""
    hand = {"profile": "press-and-release", "release_newton": 1.0, "period_s": 1.0}
    grip = {"damping_n_s_per_m": 5.0, "stiffness_n_per_m": 200.0}
    device = {"initial_position_m": 0.005}
    wall = {"stiffness_n_per_m": stiffness_n_per_m}
    return PaperScenario(name, "title", title, 10.0, wall, device=device, hand=hand, grip=grip, **keys)


_ACTIVE_WALL = {"changes": [{"at_s": 0.2, "damping_n_s_per_m": -1.0}]}
_ACTIVE_DEVICE = {"changes": [{"at_s": 0.2, "viscous_n_s_per_m": -1.0}]}
_DROP = {"initial_position_m": 0.005}
_NOISY: dict[str, Any] = {"noise_m": 2e-6}
_THROWN: dict[str, Any] = {"initial_velocity_m_per_s": -0.2}

SCENARIOS: dict[str, PaperScenario] = {
    scenario.name: scenario
    for scenario in (
        _bare(
            "fig1", "Fig. 1", "0.5 kg thrown at a wall of 3 kN/m, no law", 0.2, device=_THROWN, hand_n=0.0, law="none"
        ),
        _bare("fig3", "Fig. 3", "0.5 kg at a wall of 3 kN/m, no law", law="none"),
        _bare("fig6-set1", "Fig. 6 a-c", "set 1, energy cycles on an undamped mass"),
        _bare("fig6-set1-drop", "Fig. 6 a-c", "set 1, dropped from 5 mm", device=_DROP),
        _bare("fig6-total", "eq. 6", "set 1, the damping counts what it dissipates itself (E_tot)", params=LITERAL),
        _bare("fig6-start", "eq. 8", "set 1, the sum of eq. 8 from the start", params={**PRINTED, "sum": "start"}),
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
        *(
            _omega(f"fig9-{k}-off", "Fig. 9", f"{k} kN/m, 3.03 N: no whole number of counts", k * 1e3, hand_n=-3.03)
            for k in (12, 18, 20)
        ),
        _omega(
            "fig10", "Fig. 10", "12 kN/m, TDPA unbounded, exact observer", 12e3, law="tdpa", params=TDPA_AS_PUBLISHED
        ),
        _omega(
            "fig10-printed",
            "Fig. 10",
            "12 kN/m, TDPA unbounded, observer as printed in eq. 2",
            12e3,
            law="tdpa",
            params=PRINTED_OBSERVER,
        ),
        _omega("fig10-bounded", "Fig. 10", "12 kN/m, TDPA with the bounds of a fair baseline", 12e3, law="tdpa"),
        _omega("fig9-18-continuous", "eq. 16", "18 kN/m, a sensor without steps", 18e3, device={"resolution_m": 0.0}),
        _omega("fig9-20-continuous", "eq. 16", "20 kN/m, a sensor without steps", 20e3, device={"resolution_m": 0.0}),
        _credit("credit", "energy cycles after a passive stretch, struck from 10 mm", 0.01),
        _credit("credit-none", "energy cycles after a stretch that dissipates hardly anything", 0.0),
        _credit("credit-tdpa", "bounded TDPA after a passive stretch, struck from 10 mm", 0.01, law="tdpa"),
        _credit("credit-tdpa-none", "bounded TDPA after a stretch that dissipates hardly anything", 0.0, law="tdpa"),
        _moving("moving-4-none", "a moving hand at 4 kN/m, no law", 4e3, law="none"),
        _moving("moving-4", "a moving hand at 4 kN/m, energy cycles", 4e3),
        _moving("moving-12", "a moving hand at 12 kN/m, energy cycles", 12e3),
        _moving("moving-20", "a moving hand at 20 kN/m, energy cycles", 20e3),
        _moving("moving-12-ring", "a moving hand at 12 kN/m, ring-damping", 12e3, law="ring-damping"),
        _moving("moving-20-ring", "a moving hand at 20 kN/m, ring-damping", 20e3, law="ring-damping"),
        _moving(
            "moving-12-tdpa",
            "a moving hand at 12 kN/m, TDPA unbounded, exact observer",
            12e3,
            law="tdpa",
            params=TDPA_AS_PUBLISHED,
        ),
    )
}
"""In the order of the paper."""
