"""Claims that rest on the paper's argument: eqs. 11-16, and that nothing has to be known."""

from __future__ import annotations

import numpy as np

from hapticd_studies.paper.claims import HELD, Claim, Evidence, millimetres, percent
from hapticd_studies.paper.recording import Recording
from hapticd_studies.paper.starts import MODELS

_MORE_J = 1e-6
"""Generation over the second half of a long contact that counts as none [J]."""

_CONVERGED_SHARE = 0.2
"""How close to kT/2 a damping must be to have converged to it."""

_CONVERGING = ("fig6-set1", "fig6-set1-drop", "fig9-18-continuous", "fig9-20-continuous")


def claims(evidence: Evidence) -> list[Claim]:
    """All of them."""
    return [
        _converges(evidence),
        _bounded(evidence, continuous=True),
        _bounded(evidence, continuous=False),
        _no_parameter(evidence),
    ]


def _converges(evidence: Evidence) -> Claim:
    parts = []
    holds = True
    for name in _CONVERGING:
        run = evidence.runs[name]
        leak = 0.5 * run.scenario.stiffness_n_per_m * run.period_s
        damping = float(run.damping_n_s_per_m[-1])
        parts.append(f"{name} {damping:.3g} of {leak:.3g}")
        holds = holds and run.settled and abs(damping / leak - 1.0) <= _CONVERGED_SHARE
    total, start = evidence.runs["fig6-total"], evidence.runs["fig6-start"]
    return Claim(
        "alpha-max",
        "eq. 15",
        "The damping converges to the largest that is needed, for the hold's leak kT/2",
        ", ".join(_CONVERGING),
        f"damping at the end of what kT/2 is [N s/m]: {', '.join(parts)}",
        holds,
        "The spring's work shows a leak of kT/2 in every cycle, whatever damping already pays for it: each cycle that "
        "gives more than it took adds as much again, until the energy that the pressed spring keeps hides the leak. "
        f"Summed from the start (fig6-start) the damping ends at {start.damping_n_s_per_m[-1]:.2g}. What does converge "
        f"to kT/2 is eq. 7 of the complete force (fig6-total, {total.damping_n_s_per_m[-1]:.3g}): there the leak is "
        f"balanced and no more, and the oscillation stays, {millimetres(total.peak_to_peak_m)} peak to peak.",
    )


def _bounded(evidence: Evidence, continuous: bool) -> Claim:
    names = ("fig9-18-continuous", "fig9-20-continuous") if continuous else ("fig9-12-off", *HELD)
    more_j = {name: _later_fall_j(evidence.long[name]) for name in names}
    worst = max(more_j, key=lambda name: more_j[name])
    lowest_j = min(float(evidence.long[name].energy_j.min()) for name in names)
    holds = more_j[worst] < _MORE_J
    long_s = len(evidence.long[worst].t_s) * evidence.long[worst].period_s
    return Claim(
        "bounded-generation" if continuous else "bounded-generation-quantised",
        "eqs. 11-16",
        "The energy that the wall generates stays within a finite bound"
        + (", position not quantised" if continuous else ", position in steps of 10 um as on the device"),
        f"{', '.join(names)}, {long_s:g} s",
        f"lowest energy {lowest_j * 1e3:.3g} mJ; from {long_s / 2:g} to {long_s:g} s it falls by up to "
        f"{more_j[worst] * 1e3:.2g} mJ",
        holds,
        ""
        if holds
        else f"At rest the position still toggles between neighbouring steps ({worst}: "
        f"{millimetres(float(np.ptp(evidence.long[worst].x_m[-500:])))} peak to peak). Each toggle generates a little "
        "that the device's friction takes, for ever. The argument of eqs. 11-16 needs a largest damping that would "
        "dissipate every leak; under quantisation there is none, since the leak over v^2 has no bound as v goes to 0.",
    )


def _later_fall_j(run: Recording) -> float:
    half = len(run.energy_j) // 2
    return max(0.0, float(run.energy_j[half] - run.energy_j[-1]))


def _no_parameter(evidence: Evidence) -> Claim:
    shares = evidence.shares.models.shares(evidence.shares.models.settled, len(MODELS))
    alone = evidence.shares.models_alone.shares(evidence.shares.models_alone.settled, len(MODELS))
    parts = [
        f"{model} at {k * 1e-3:g} kN/m {percent(share)} (alone {percent(single)})"
        for (model, (_, k)), share, single in zip(MODELS.items(), shares, alone, strict=True)
    ]
    return Claim(
        "no-parameter",
        "Section III",
        "No parameter of device, human or wall has to be known",
        f"three device models of 0.08 to 0.5 kg, {len(evidence.shares.drops_m)} starts each, the same parameters",
        "come to rest: " + ", ".join(parts) + evidence.shares.models.rest(),
        bool(shares.min() > 0.95),
        "The law identifies the mass that it feels, to bound its damping, and is told the step of the position sensor.",
    )
