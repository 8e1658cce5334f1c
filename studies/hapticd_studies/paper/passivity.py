"""Claims about time-domain passivity control: Fig. 10 and what the paper says of it.

Three forms, each named: unbounded with the exact observer, unbounded with that of eq. 2 as printed, and bounded.
"""

from __future__ import annotations

import numpy as np

from hapticd_studies.paper.claims import HELD, Claim, Evidence, millimetres, percent
from hapticd_studies.paper.recording import Recording
from hapticd_studies.paper.runs import Asked
from hapticd_studies.paper.starts import HELD_N_PER_M

_CUT_SHARE = 0.1
"""People feel a change of force of about 7 to 10 % (Jones, 1989; Pang, Tan and Durlach, 1991)."""


def claims(evidence: Evidence) -> list[Claim]:
    """All of them."""
    everywhere = evidence.shares.maps["TDPA, unbounded, exact"]
    return [
        _unstable(
            evidence,
            "tdpa-unstable",
            "unbounded, exact observer",
            "fig10",
            evidence.shares.tdpa,
            f"Over the whole map of hand forces and starts {percent(float(everywhere.settled.mean()))} rest.",
        ),
        _unstable(
            evidence,
            "tdpa-unstable-printed",
            "unbounded, observer of eq. 2 as printed",
            "fig10-printed",
            evidence.shares.tdpa_printed,
            f"The printed observer sees no leak: {_acting(evidence.runs['fig10-printed'])}. What moves is the wall "
            "without a law.",
        ),
        _unstable(
            evidence,
            "tdpa-bounded",
            "a cap of 50 N s/m and no damping below 1 mm/s",
            "fig10-bounded",
            evidence.shares.tdpa_bounded,
            "Two bounds, a cap and a least speed, make it hold what the paper's TDPA could not. The paper compares "
            "with the unbounded form.",
        ),
        _energy(evidence),
        _cuts_force(evidence),
        _low_velocity(evidence),
    ]


def _unstable(evidence: Evidence, key: str, form: str, name: str, asked: Asked, remark: str) -> Claim:
    rest = asked.shares(asked.settled, len(HELD_N_PER_M))
    spans_m = asked.peak_to_peak_m.reshape(len(HELD_N_PER_M), -1)
    return Claim(
        key,
        "Fig. 10",
        f"TDPA is not stable at 12 kN/m: {form}",
        f"{name}, and 3 N, {len(evidence.shares.drops_m)} starts",
        f"come to rest: {percent(float(rest[0]))} at 12, {percent(float(rest[1]))} at 18, {percent(float(rest[2]))} at "
        f"20 kN/m; median span at 12 kN/m {millimetres(float(np.median(spans_m[0])))}{asked.rest()}",
        bool(rest[0] < 0.5),
        remark,
    )


def _acting(run: Recording) -> str:
    acting = int((run.damping_n_s_per_m > 0.0).sum())
    return f"it damps in {acting} of {run.ticks} ticks"


def _energy(evidence: Evidence) -> Claim:
    names = ("fig10", "fig10-printed")
    lowest_j = [evidence.figures[name].lowest_energy_j for name in names]
    return Claim(
        "tdpa-energy",
        "Fig. 10 b",
        "TDPA keeps the energy from going below zero",
        ", ".join(names),
        f"lowest energy {lowest_j[0] * 1e3:.1f} mJ with the exact observer, {lowest_j[1] * 1e3:.1f} mJ with the "
        "printed one",
        min(lowest_j) > -1e-3,
        "Near standstill the damping exceeds what a sampled damper can be (2 m/T, 500 N s/m here), and generates more "
        "than it dissipates. The printed observer does not see that the energy falls.",
    )


def cut_share(run: Recording, until_s: float = np.inf) -> float:
    """How much of the spring's force a law takes away, of all that the spring gives; what it adds does not count.

    Args:
        run: the run.
        until_s: only this much of it, from its start [s].
    """
    counted = run.in_contact & (np.asarray(run.t_s) < until_s)
    spring_n = run.spring_n()[counted]
    given_n = float(spring_n.sum())
    taken_n = float((spring_n - np.clip(run.force_n[counted], 0.0, spring_n)).sum())
    return taken_n / given_n if given_n > 0.0 else 0.0


def _cuts_force(evidence: Evidence) -> Claim:
    tdpa = {name: cut_share(evidence.runs[name]) for name in ("fig10", "moving-12-tdpa")}
    ours = {name: cut_share(evidence.runs[name]) for name in ("fig9-12", "moving-12")}
    others = {name: cut_share(evidence.runs[name]) for name in ("fig10-printed", "fig10-bounded")}
    return Claim(
        "tdpa-cuts-force",
        "Section I",
        "TDPA cuts the force that the user feels",
        f"{', '.join((*tdpa, *others, *ours))}",
        "of the spring's force the law takes away: "
        + ", ".join(f"{name} {share:.1%}" for name, share in (tdpa | others | ours).items())
        + f"; in the first half second of fig10 {cut_share(evidence.runs['fig10'], 0.5):.1%}",
        min(tdpa.values()) > _CUT_SHARE,
        f"It is the unbounded form with the exact observer that is judged, by {_CUT_SHARE:.0%} of the force over the "
        "whole contact: its early corrections are few, the late ones take most. The "
        "method cuts less in a press; under a moving hand its damping grows, and cuts too.",
    )


def _low_velocity(evidence: Evidence) -> Claim:
    ours = max(evidence.figures[name].peak_damping_n_s_per_m for name in HELD)
    tdpa = evidence.figures["fig10"].peak_damping_n_s_per_m
    return Claim(
        "low-velocity",
        "Section I",
        "At low velocity TDPA computes very high damping; the method does not",
        f"{', '.join(HELD)}, fig10 (exact observer)",
        f"largest damping {ours:.0f} N s/m with energy cycles, {tdpa:.2g} N s/m with TDPA",
        ours < 100.0 < tdpa,
    )
