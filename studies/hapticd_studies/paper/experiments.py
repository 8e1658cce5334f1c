"""Claims that rest on the paper's experiments: Figs. 8 to 11 and the text around them."""

from __future__ import annotations

import numpy as np

from hapticd_studies.paper.claims import HELD, Claim, Evidence, millimetres, percent
from hapticd_studies.paper.recording import Recording
from hapticd_studies.paper.starts import HANDS_N, HELD_N_PER_M, NATIVE_N_PER_M, OSCILLATES_M

_CALIBRATED = (
    "The friction of the omega.7 model was chosen so that this comes out: it is where the model starts from, and no "
    "evidence about the device."
)
_HANDS = ", ".join(f"{-hand:g}" for hand in HANDS_N) + " N"


def claims(evidence: Evidence) -> list[Claim]:
    """All of them."""
    return [
        _native_limit(evidence),
        _unstable_alone(evidence),
        _held(evidence),
        _gain(evidence),
        _below_zero(evidence),
        _tdpa_unstable(evidence),
        _tdpa_bounded(evidence),
        _tdpa_energy(evidence),
        _stiffness(evidence),
        _low_velocity(evidence),
        _chattering(evidence),
        _credit(evidence),
    ]


def _oscillating(evidence: Evidence) -> dict[float, np.ndarray]:
    """Share of starts that oscillate without a law, hand by hand, at each stiffness."""
    native = evidence.shares.native
    shares = native.shares(native.peak_to_peak_m > OSCILLATES_M, len(NATIVE_N_PER_M), len(HANDS_N))
    return dict(zip(NATIVE_N_PER_M, shares, strict=True))


def _native_limit(evidence: Evidence) -> Claim:
    shares = _oscillating(evidence)
    parts = [f"{k * 1e-3:g} kN/m {percent(float(share.mean()))}" for k, share in shares.items()]
    holds = all(share.max() == 0.0 if k <= 8e3 else share.min() > 0.8 for k, share in shares.items())
    return Claim(
        "native-limit",
        "Section V",
        "The device alone renders 8 kN/m and no more",
        f"no law, {_HANDS}, {len(evidence.shares.drops_m)} starts each",
        f"oscillate by more than {OSCILLATES_M * 1e3:g} mm: " + ", ".join(parts),
        holds,
        _CALIBRATED,
    )


def _unstable_alone(evidence: Evidence) -> Claim:
    share = _oscillating(evidence)[12e3]
    return Claim(
        "unstable-alone",
        "Fig. 8",
        "Without a controller stable contact with 12 kN/m is impossible",
        f"fig8, and no law under {_HANDS}, {len(evidence.shares.drops_m)} starts each",
        f"{millimetres(evidence.figures['fig8'].peak_to_peak_m)} peak to peak in fig8; "
        f"starts that oscillate: {percent(float(share.mean()))}",
        bool(share.min() > 0.8),
    )


def _held(evidence: Evidence) -> Claim:
    held = evidence.shares.held
    shares = held.shares(held.settled, len(HELD_N_PER_M), len(HANDS_N))
    parts = [f"{k * 1e-3:g} kN/m {percent(float(share.mean()))}" for k, share in zip(HELD_N_PER_M, shares, strict=True)]
    return Claim(
        "held",
        "Fig. 9",
        "With the method 12, 18 and 20 kN/m are stable",
        f"{', '.join(HELD)}, and {_HANDS}, {len(evidence.shares.drops_m)} starts each",
        "come to rest in place: " + ", ".join(parts) + f"; all within {np.nanmax(held.settled_s):.2f} s, widest span "
        f"{millimetres(float(held.peak_to_peak_m.max()))}",
        bool(shares.min() > 0.99),
    )


def _gain(evidence: Evidence) -> Claim:
    held = evidence.shares.held
    at_20 = float(held.shares(held.settled, len(HELD_N_PER_M), len(HANDS_N))[-1].min())
    alone = max(k for k, share in _oscillating(evidence).items() if share.max() == 0.0)
    return Claim(
        "gain",
        "Section V",
        "The method raises the stiffness that can be displayed from 8 to 20 kN/m",
        "as native-limit and held",
        f"{20e3 / alone:.3g} times: {percent(at_20)} of the starts rest at 20 kN/m, none oscillates alone at "
        f"{alone * 1e-3:g} kN/m",
        at_20 > 0.99 and alone == 8e3,
        "20 kN/m is the highest that the paper reports; where the model's own limit is, hapticd study zwidth shows.",
    )


def _below_zero(evidence: Evidence) -> Claim:
    lowest = [evidence.figures[name].lowest_energy_j * 1e3 for name in HELD]
    return Claim(
        "energy-below-zero",
        "Fig. 9 d-f",
        "The contact is stable although its energy goes below zero",
        ", ".join(HELD),
        "lowest energy " + ", ".join(f"{energy:.2f}" for energy in lowest) + " mJ",
        max(lowest) < 0.0,
        "That it stays bounded is another matter: see bounded-generation.",
    )


def _tdpa_unstable(evidence: Evidence) -> Claim:
    tdpa = evidence.shares.tdpa
    rest = tdpa.shares(tdpa.settled, len(HELD_N_PER_M))
    spans = tdpa.peak_to_peak_m.reshape(len(HELD_N_PER_M), -1)
    return Claim(
        "tdpa-unstable",
        "Fig. 10",
        "TDPA is not stable at 12 kN/m: as published, without bounds",
        f"fig10, and 3 N, {len(evidence.shares.drops_m)} starts",
        f"come to rest: {percent(float(rest[0]))} at 12, {percent(float(rest[1]))} at 18, {percent(float(rest[2]))} at "
        f"20 kN/m; median span at 12 kN/m {millimetres(float(np.median(spans[0])))}",
        bool(rest[0] < 0.5),
        "It depends on hand force and start (see the map): one experiment, as in the paper, decides little.",
    )


def _tdpa_bounded(evidence: Evidence) -> Claim:
    tdpa = evidence.shares.tdpa_bounded
    rest = tdpa.shares(tdpa.settled, len(HELD_N_PER_M))
    return Claim(
        "tdpa-bounded",
        "Fig. 10",
        "TDPA is not stable at 12 kN/m: with a cap of 50 N s/m and no damping below 1 mm/s",
        f"fig10-bounded, and 3 N, {len(evidence.shares.drops_m)} starts",
        f"come to rest: {percent(float(rest[0]))} at 12, {percent(float(rest[1]))} at 18, {percent(float(rest[2]))} at "
        "20 kN/m",
        bool(rest[0] < 0.5),
        "Two bounds, a cap and a least speed, make it hold what the paper's TDPA could not. The paper compares with "
        "the unbounded form.",
    )


def _tdpa_energy(evidence: Evidence) -> Claim:
    lowest_j = evidence.figures["fig10"].lowest_energy_j
    return Claim(
        "tdpa-energy",
        "Fig. 10 b",
        "TDPA keeps the energy from going below zero",
        "fig10",
        f"lowest energy {lowest_j * 1e3:.1f} mJ",
        lowest_j > -1e-3,
        "Near standstill the damping exceeds what a sampled damper can be (2 m/T, 500 N s/m here), and generates more "
        "than it dissipates.",
    )


def _stiffness(evidence: Evidence) -> Claim:
    parts = []
    holds = True
    for name in HELD:
        figures = evidence.figures[name]
        error = figures.stiffness_error
        measured = figures.measured_stiffness_n_per_m
        parts.append(
            f"{evidence.runs[name].scenario.stiffness_n_per_m * 1e-3:g} kN/m: "
            + ("no contact" if error is None else f"{error:+.2%} of +-{figures.stiffness_tolerance:.1%}")
            + (f" (over measured position {measured:.0f} N/m)" if measured is not None else "")
        )
        holds = holds and error is not None and abs(error) <= figures.stiffness_tolerance
    return Claim(
        "displayed-stiffness",
        "Fig. 11",
        "The displayed stiffness converges to the commanded one",
        ", ".join(HELD),
        "; ".join(parts),
        holds,
        "Over the measured position it equals the wall's by construction at rest; the true position is known to half a "
        "count only, which is why the tolerance is the larger of 1 % and half a count over the depth.",
    )


def _low_velocity(evidence: Evidence) -> Claim:
    ours = max(evidence.figures[name].peak_damping_n_s_per_m for name in HELD)
    tdpa = evidence.figures["fig10"].peak_damping_n_s_per_m
    return Claim(
        "low-velocity",
        "Section I",
        "At low velocity TDPA computes very high damping; the method does not",
        f"{', '.join(HELD)}, fig10",
        f"largest damping {ours:.0f} N s/m with energy cycles, {tdpa:.2g} N s/m with TDPA",
        ours < 100.0 < tdpa,
    )


def _jumps_n(run: Recording) -> float:
    """How much the law's part of the force changes from tick to tick at the end, root mean square [N]."""
    return float(np.sqrt(np.mean(np.diff(run.damping_force_n()[-500:]) ** 2)))


def _chattering(evidence: Evidence) -> Claim:
    ours = {name: _jumps_n(evidence.runs[name]) for name in HELD}
    step_n = {name: evidence.runs[name].scenario.stiffness_n_per_m * evidence.runs[name].resolution_m for name in HELD}
    held = evidence.shares.held
    still = float((held.peak_to_peak_m < 1e-7).mean())
    holds = all(ours[name] < 0.1 * step_n[name] for name in HELD)
    return Claim(
        "chattering",
        "Section III",
        "The method does not chatter, TDPA does",
        f"{', '.join(HELD)}, fig10, and the starts of held",
        "force of the law changes from tick to tick at the end by "
        + ", ".join(f"{jump:.2f}" for jump in ours.values())
        + f" N rms with energy cycles, {_jumps_n(evidence.runs['fig10']):.0f} N with TDPA; {percent(still)} of the "
        f"starts of held come to rest without any motion, the widest moves by "
        f"{millimetres(float(held.peak_to_peak_m.max()))}",
        holds,
        ""
        if holds
        else "Far less than TDPA, but not none: one count of the position is a velocity of 10 mm/s to a one-sample "
        "difference, and the damping makes a force of it. Without steps of the sensor it is gone.",
    )


def _credit(evidence: Evidence) -> Claim:
    delays = {name: _acts_after_s(evidence.runs[name]) for name in ("credit-tdpa", "credit-tdpa-none")}
    settles = {name: _settles_after_s(evidence.runs[name]) for name in ("credit", "credit-none")}
    credit_j = float(evidence.runs["credit-tdpa"].energy_j[1000])
    return Claim(
        "no-credit",
        "Section III",
        "TDPA's observer accumulates credit during passive stretches; the method accumulates none",
        "credit, credit-none, credit-tdpa, credit-tdpa-none",
        f"a credit of {credit_j * 1e3:.0f} mJ keeps TDPA from damping for {delays['credit-tdpa'] * 1e3:.0f} ms after "
        f"the hand has moved, without one it waits {delays['credit-tdpa-none'] * 1e3:.0f} ms; energy cycles settle in "
        f"{settles['credit'] * 1e3:.0f} ms, {settles['credit-none'] * 1e3:.0f} ms without the passive stretch",
        bool(delays["credit-tdpa"] > 2.0 * delays["credit-tdpa-none"])
        and bool(settles["credit"] <= settles["credit-none"] + 0.05),
    )


def _acts_after_s(run: Recording) -> float:
    acting = np.flatnonzero(run.damping_n_s_per_m[1000:] > 0.0)
    return float(acting[0]) * run.period_s if acting.size else np.inf


def _settles_after_s(run: Recording) -> float:
    settled = run.settled_tick
    return np.inf if settled is None else settled * run.period_s - 1.0
