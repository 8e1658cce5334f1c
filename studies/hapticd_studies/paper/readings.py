"""What the text of the paper leaves open: each reading of the method against 28 scenarios.

Four scenarios are the paper's own simulations; 24 are a device like the omega.7 whose own limit is 8 kN/m. A reading
passes a scenario when the position spans less than 0.05 mm at the end and rests where hand and wall balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hapticd.config.walls import WallConfig
from hapticd.offline.outcome import Outcome
from hapticd.simulation.batch import Point
from hapticd.simulation.options import SimulationOptions
from hapticd_studies.paper.runs import Array, Asked, Runs, law_named
from hapticd_studies.paper.scenarios import PRINTED

_BARE: dict[str, Any] = {"model": "paper-simulation", "hand": {"force": {"profile": "constant", "newton": -5.0}}}
_DEVICE: dict[str, Any] = {
    "mass_kg": 0.25,
    "viscous_n_s_per_m": 4.0,
    "resolution_m": 1e-5,
    "max_force_n": 12.0,
}
_WALLS_KN_PER_M = (8, 12, 18, 20, 25, 30)
_STARTS = ((1, 0), (3, 0), (6, 0), (3, 10))


@dataclass(frozen=True, slots=True)
class PaperReading:
    """One way to read the method.

    Attributes:
        name: what is chosen, in the words of the law's parameters.
        params: those parameters.
        velocity_samples: samples that the velocity spans.
        delay_samples: of the force, on the devices (the paper's simulations have none).
        own: whether it is a choice that the text leaves open; else a circumstance that the text does not give.
    """

    name: str
    params: dict[str, Any] = field(default_factory=dict)
    velocity_samples: int = 1
    delay_samples: int = 0
    own: bool = True


@dataclass(frozen=True, slots=True)
class ReadingTable:
    """All readings against all scenarios.

    Attributes:
        readings: the rows, those that change one choice first.
        scenarios: names of the columns.
        asked: what was run, row by row.
        single: how many rows change one choice only.
    """

    readings: Sequence[PaperReading]
    scenarios: Sequence[str]
    asked: Asked
    single: int

    @property
    def outcome(self) -> Array:
        """The verdicts, [reading, scenario]."""
        return self._shaped(self.asked.outcome)

    @property
    def peak_to_peak_m(self) -> Array:
        """The spans, [reading, scenario]; infinite where it diverged [m]."""
        return self._shaped(self.asked.peak_to_peak_m)

    @property
    def damping_n_s_per_m(self) -> Array:
        """The damping at the end, [reading, scenario]."""
        return self._shaped(self.asked.damping_n_s_per_m)

    @property
    def passed(self) -> Array:
        """How many scenarios each reading passes."""
        passed: Array = (self.outcome == Outcome.SETTLED).sum(axis=1)
        return passed

    def rest(self, row: int) -> str:
        """Medians over the scenarios that a reading passes: how many times the threshold is felt; span of the force."""
        passed = self.outcome[row] == Outcome.SETTLED
        if not passed.any():
            return "-"
        felt, chatter_n = (self._shaped(each)[row][passed] for each in (self.asked.felt, self.asked.chatter_n))
        return f"{np.median(felt):.2g}; {np.median(chatter_n):.2g} N"

    def failing(self, row: int) -> list[str]:
        """Scenarios in which a reading fails."""
        return [name for name, outcome in zip(self.scenarios, self.outcome[row], strict=True) if outcome]

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return {
            "scenarios": list(self.scenarios),
            "readings": [
                {
                    "reading": reading.name,
                    "params": reading.params,
                    "velocity_samples": reading.velocity_samples,
                    "delay_samples": reading.delay_samples,
                    "passed": int(passed),
                    "outcome": [Outcome(int(outcome)).words for outcome in outcomes],
                    "peak_to_peak_m": [float(span) if np.isfinite(span) else None for span in spans],
                    "damping_n_s_per_m": [float(damping) for damping in dampings],
                    "felt_index": [float(each) if np.isfinite(each) else None for each in felt],
                    "force_chatter_n": [float(each) if np.isfinite(each) else None for each in chatter],
                }
                for reading, passed, outcomes, spans, dampings, felt, chatter in zip(
                    self.readings,
                    self.passed,
                    self.outcome,
                    self.peak_to_peak_m,
                    self.damping_n_s_per_m,
                    self._shaped(self.asked.felt),
                    self._shaped(self.asked.chatter_n),
                    strict=True,
                )
            ],
        }

    def _shaped(self, values: Array) -> Array:
        shaped: Array = values.reshape(len(self.readings), len(self.scenarios))
        return shaped


def single_choices() -> list[PaperReading]:
    """The shipped default, and every option changed alone."""
    return [
        PaperReading("default"),
        PaperReading("work = total", {"work": "total"}),
        *(PaperReading(f"pairing = {name}", {"pairing": name}) for name in ("new-force", "power", "held-power")),
        PaperReading("sum = start", {"sum": "start"}),
        *(PaperReading(f"rule = {name}", {"rule": name}) for name in ("non-negative", "signed")),
        PaperReading("plateaus = literal", {"plateaus": "literal"}),
        PaperReading("contact_loss = ignored", {"contact_loss": "ignored"}),
        PaperReading("plateaus literal, contact loss ignored", {"plateaus": "literal", "contact_loss": "ignored"}),
        *(PaperReading(f"new_contact = {name}", {"new_contact": name}) for name in ("energy", "damping")),
        PaperReading("stored_energy = subtracted", {"stored_energy": "subtracted"}),
        PaperReading("min_travel_counts = 5", {"min_travel_counts": 5.0}),
        *(PaperReading(f"window = {size}", {"window": size}) for size in (1, 3, 5)),
        PaperReading("cap = none", {"cap": "none"}),
        PaperReading("cap = fixed 20", {"cap": "fixed", "cap_damping_n_s_per_m": 20.0}),
        PaperReading("cap = fixed 200", {"cap": "fixed", "cap_damping_n_s_per_m": 200.0}),
        PaperReading("wall_may_pull = false", {"wall_may_pull": False}),
        PaperReading("small_leaks = 0", {"small_leaks": 0.0}),
        *(PaperReading(f"force_delay = {name}", {"force_delay": name}) for name in ("none", "one-sample")),
        *(PaperReading(f"velocity over {count} samples", velocity_samples=count, own=False) for count in (2, 5, 20)),
        PaperReading("one sample of force delay", delay_samples=1, own=False),
    ]


def combined_choices() -> list[PaperReading]:
    """Energy, sum, rule and cap: the four choices that decide most, in every combination, without our additions.

    Then the pairings and the window of the print, as bare.
    """
    caps: dict[str, dict[str, Any]] = {"none": {"cap": "none"}, "200": {"cap": "fixed", "cap_damping_n_s_per_m": 200.0}}
    every = [
        PaperReading(
            f"{work}, {total}, {rule}, cap {cap}", {**PRINTED, "work": work, "sum": total, "rule": rule, **params}
        )
        for work in ("spring", "total")
        for total in ("cycle", "start")
        for rule in ("non-decreasing", "non-negative", "signed")
        for cap, params in caps.items()
    ]
    bare = {**PRINTED, "cap": "none"}
    return [
        *every,
        *(PaperReading(f"pairing = {name}, cap none", {**bare, "pairing": name}) for name in ("new-force", "power")),
        PaperReading("eq. 10 as printed, cap none", {**bare, "plateaus": "literal", "contact_loss": "ignored"}),
    ]


def ask(runs: Runs, quick: bool) -> ReadingTable:
    """Ask for the table; when quick, for the default and the energy alone."""
    single = single_choices()[:2] if quick else single_choices()
    readings = single + ([] if quick else combined_choices())
    scenarios = _scenarios()
    law = law_named("energy-cycle")
    points = []
    for reading in readings:
        params = law.Params.model_validate(reading.params)
        for _, device, wall, bare in scenarios:
            keys = device if bare else {**device, "force_delay_samples": reading.delay_samples}
            options = SimulationOptions.model_validate(keys)
            points.append(
                Point(
                    options,
                    WallConfig.model_validate(wall),
                    params,
                    max_force_n=options.max_force_n or np.inf,
                    velocity_samples=reading.velocity_samples,
                )
            )
    names = [name for name, _, _, _ in scenarios]
    return ReadingTable(readings, names, runs.ask("energy-cycle", points), len(single))


def _scenarios() -> list[tuple[str, dict[str, Any], dict[str, Any], bool]]:
    """Name, device, wall, and whether it is the paper's bare mass."""
    wall: dict[str, Any] = {"stiffness_n_per_m": 3000.0}
    active_wall = {**wall, "changes": [{"at_s": 0.2, "damping_n_s_per_m": -1.0}]}
    active = {**_BARE, "changes": [{"at_s": 0.2, "viscous_n_s_per_m": -1.0}]}
    found = [
        ("Fig. 6 set 1", _BARE, wall, True),
        ("Fig. 6 set 1, 5 mm drop", {**_BARE, "initial_position_m": 0.005}, wall, True),
        ("Fig. 6 set 2, wall", _BARE, active_wall, True),
        ("Fig. 6 set 2, device", active, wall, True),
    ]
    for stiffness in _WALLS_KN_PER_M:
        for newton, drop_mm in _STARTS:
            device = {
                **_DEVICE,
                "initial_position_m": 1e-3 * drop_mm,
                "hand": {"force": {"profile": "constant", "newton": -float(newton)}},
            }
            start = f"{newton} N" + (f", {drop_mm} mm drop" if drop_mm else "")
            found.append((f"{stiffness} kN/m, {start}", device, {"stiffness_n_per_m": 1e3 * stiffness}, False))
    return found
