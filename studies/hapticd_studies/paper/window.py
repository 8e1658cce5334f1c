"""Claims about the time window: Fig. 7."""

from __future__ import annotations

from hapticd_studies.paper.claims import Claim, Evidence, percent
from hapticd_studies.paper.runs import Array
from hapticd_studies.paper.starts import NOISES_M, WINDOW_DEVICES, WINDOW_READINGS


def claims(evidence: Evidence) -> list[Claim]:
    """All of them."""
    return [_false_cycles(evidence), _shipped(evidence), _spring(evidence), _literal(evidence)]


def _false_cycles(evidence: Evidence) -> Claim:
    run = evidence.runs["fig7"]
    without, with_window = len(run.cycle_ends(1)), len(run.cycle_ends(2))
    return Claim(
        "false-cycles",
        "Fig. 7",
        "Without the time window many false cycles appear",
        "fig7",
        f"{without} changes of sign of the power, of which the window of 2+2 accepts {with_window}",
        without > 2 * with_window,
    )


def _shipped(evidence: Evidence) -> Claim:
    return _needed(
        evidence,
        "window-needed",
        "the shipped reading",
        "shipped",
        "What the shipped reading adds to the print, a bound for cycles of a few counts and one for the damping, makes "
        "false cycles harmless. Without it the claim comes out: see the next two.",
    )


def _spring(evidence: Evidence) -> Claim:
    return _needed(
        evidence,
        "window-needed-spring",
        "energy of the spring, nothing added to the print",
        "spring",
        "Between two counts a false cycle divides what it finds by hardly any motion, and the damping runs away.",
    )


def _literal(evidence: Evidence) -> Claim:
    ends = [evidence.figures[name].damping_n_s_per_m for name in ("fig7-literal", "fig7-literal-window")]
    return _needed(
        evidence,
        "window-needed-literal",
        "E_tot, nothing added to the print",
        "literal",
        "E_tot contains the work of the damping itself; between two counts it says little about the wall, and the "
        "damping that follows from it is beyond what a sampled loop can hold: at the end "
        f"{ends[0]:.0f} N s/m without the window, {ends[1]:.0f} with it.",
    )


def _needed(evidence: Evidence, key: str, reading: str, name: str, remark: str) -> Claim:
    shares = window_shares(evidence)[:, list(WINDOW_READINGS).index(name)]
    parts = []
    for device, noises in zip(WINDOW_DEVICES, shares, strict=True):
        rest = " and ".join(
            f"{percent(float(without))} without, {percent(float(with_window))} with it at {noise * 1e6:g} um"
            for noise, (without, with_window) in zip(NOISES_M, noises, strict=True)
        )
        parts.append(f"{device}: {rest}")
    noisy = shares[:, -1]
    return Claim(
        key,
        "Fig. 7",
        f"Without the window 12 kN/m is usually unstable, with 2+2 it is stable: {reading}",
        f"12 kN/m, 5 N, {len(evidence.shares.drops_m)} starts each; the omega.7 model, and one of 2.1 N s/m without a "
        f"limit of force; sensor noise of {NOISES_M[0] * 1e6:g} and {NOISES_M[1] * 1e6:g} um",
        "come to rest, " + "; ".join(parts),
        bool(noisy[:, 0].max() < 0.5 < noisy[:, 1].min()),
        remark,
    )


def window_shares(evidence: Evidence) -> Array:
    """Share that comes to rest, [device, reading, noise, without or with the window]."""
    window = evidence.shares.window
    return window.shares(window.settled, len(WINDOW_DEVICES), len(WINDOW_READINGS), len(NOISES_M), 2)
