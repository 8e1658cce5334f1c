"""Claims that rest on the paper's simulations: Figs. 1, 3 and 6, and the observer that measures them."""

from __future__ import annotations

import numpy as np

from hapticd.offline.outcome import Outcome
from hapticd_studies.paper.claims import Claim, Evidence
from hapticd_studies.paper.recording import Array, Recording

_SET_1 = ("fig6-set1", "fig6-set1-drop")
_SET_2 = ("fig6-set2-wall", "fig6-set2-device", "fig6-set2-device-drop")
_MORE_J = 1e-6
"""What a cycle gives beyond what it took that counts as none [J]."""


def claims(evidence: Evidence) -> list[Claim]:
    """All of them."""
    return [
        _hysteresis(evidence),
        _observer(evidence),
        _leak(evidence),
        _converges(evidence, "fig6-set1", "Fig. 6 a-c", "The undamped wall of 3 kN/m converges", _SET_1),
        _later_cycles(evidence),
        _converges(
            evidence, "fig6-set2", "Fig. 6 d-f", "It converges too with -1 N s/m in the loop from 0.2 s on", _SET_2
        ),
    ]


def _hysteresis(evidence: Evidence) -> Claim:
    run = evidence.runs["fig1"]
    area_j = _loop_j(run)
    scenario, mass_kg = run.scenario, run.options.mass_kg
    speed = abs(run.options.initial_velocity_m_per_s)
    swing = np.sqrt(scenario.stiffness_n_per_m / mass_kg)
    # kT/2 times the integral of v^2 over half a swing
    predicted_j = 0.25 * np.pi * scenario.stiffness_n_per_m * run.period_s * speed**2 / swing
    gained_j = 0.5 * mass_kg * (float(run.v_m_per_s[-1]) ** 2 - speed**2)
    return Claim(
        "loop",
        "Fig. 1",
        "Under the zero-order hold the release runs above the press: the loop's area is what the wall generates",
        "fig1",
        f"area of force over displacement {area_j * 1e3:.3g} mJ, theory for the hold {predicted_j * 1e3:.3g} mJ; the "
        f"mass leaves with {gained_j * 1e3:.3g} mJ more than it came with",
        bool(abs(area_j / predicted_j - 1.0) < 0.1 and abs(gained_j / area_j - 1.0) < 0.01),
    )


def _loop_j(run: Recording) -> float:
    """Area of the loop of held force over true displacement, > 0 where the release is above the press [J]."""
    return float((run.force_n[:-1] * np.diff(run.x_m)).sum())


def _observer(evidence: Evidence) -> Claim:
    run = evidence.runs["fig3"]
    printed_j = -float((run.force_n * run.velocity()).sum()) * run.period_s
    exact_j = float(run.flow_j().sum())
    return Claim(
        "observer",
        "eq. 2",
        "The observer of eq. 2, force times velocity of the same instant, shows the energy that the wall generates",
        "fig3",
        f"after {run.ticks * run.period_s:g} s {printed_j * 1e3:+.3g} mJ as printed; {exact_j * 1e3:+.3g} mJ by force "
        "times the displacement under it, which a hold makes exact",
        exact_j < 0.0 and abs(printed_j / exact_j - 1.0) < 0.2,
        "The force of an instant acts after it. Paired with the motion before it a spring seems to take kT/2 of "
        "damping where it gives as much. All energies here, and the TDPA called exact, pair a force with the motion "
        "that it acts on.",
    )


def _leak(evidence: Evidence) -> Claim:
    run = evidence.runs["fig3"]
    ends_j = run.energy_j[run.cycle_ends(2)]
    falls = int((np.diff(ends_j, prepend=0.0) < 0.0).sum())
    held = np.concatenate(([False], run.in_contact[:-1]))
    damping = run.generated_j / float((run.velocity()[held] ** 2).sum() * run.period_s)
    predicted = 0.5 * run.scenario.stiffness_n_per_m * run.period_s
    return Claim(
        "leak",
        "Fig. 3",
        "Without a controller each release returns more energy than its press has stored",
        "fig3",
        f"energy falls at {falls} of {len(ends_j)} cycle ends; what is generated equals a damping of "
        f"-{damping:.3f} N s/m, theory -kT/2 = -{predicted:g}",
        falls == len(ends_j) and abs(damping / predicted - 1.0) < 0.01,
    )


def _converges(evidence: Evidence, key: str, source: str, text: str, names: tuple[str, ...]) -> Claim:
    parts = []
    for name in names:
        figures = evidence.figures[name]
        when = "never" if figures.settled_s is None else f"{figures.settled_s:.2f} s, {figures.cycles_to_settle} cycles"
        parts.append(f"{name}: {when}, {figures.damping_n_s_per_m:.1f} N s/m, {figures.rest}")
    return Claim(
        key,
        source,
        text,
        ", ".join(names),
        "settled after " + "; ".join(parts),
        all(evidence.figures[name].outcome == Outcome.SETTLED.words for name in names),
        "Hand force and start are not stated; -5 N from the wall and from 5 mm."
        + (" Nor is it where the -1 N s/m acts: both places are tried." if key == "fig6-set2" else ""),
    )


def _later_cycles(evidence: Evidence) -> Claim:
    falls, cycles, worst_j = 0, 0, 0.0
    for name in _SET_1:
        fallen_j = _falls_j(evidence.runs[name])
        cycles += fallen_j.size
        falls += int((fallen_j > _MORE_J).sum())
        worst_j = max(worst_j, float(fallen_j.max(initial=0.0)))
    return Claim(
        "fig6-release",
        "Fig. 6 b",
        "Once the damping is engaged, release no longer exceeds storage",
        ", ".join(_SET_1),
        f"of {cycles} cycles from the first damping on {falls} gave more than they took, {worst_j * 1e6:.2g} uJ "
        "at most",
        cycles > 0 and falls == 0,
        "" if falls == 0 else "The first damping is less than what the wall generates.",
    )


def _falls_j(run: Recording) -> Array:
    """What each cycle gave beyond what it took, of those that began with some damping in force [J]."""
    engaged = np.flatnonzero(run.damping_n_s_per_m > 0.0)
    if not engaged.size:
        return np.empty(0)
    ends = [end for end in run.cycle_ends(2) if end >= engaged[0] - 3]  # the window tells of an end two samples late
    fallen: Array = -np.diff(run.energy_j[ends])
    return fallen
