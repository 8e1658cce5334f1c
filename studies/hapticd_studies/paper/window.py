"""Claims about the time window: Fig. 7, and what its size does."""

from __future__ import annotations

import numpy as np

from hapticd_studies.paper.claims import Claim, Evidence, percent
from hapticd_studies.paper.runs import Array
from hapticd_studies.paper.starts import (
    HANDS_N,
    NOISES_M,
    WINDOW_DEVICES,
    WINDOW_HANDS_N,
    WINDOW_N_PER_M,
    WINDOW_READINGS,
    WINDOWS,
    WINDOWS_N_PER_M,
)

_STABLE = 0.95
"""Share of all hands, starts and noises that must rest for a reading to be called stable."""

_COUNT_N = WINDOW_N_PER_M * 1e-5
"""Force of one count of the position on that wall [N]."""
_LENGTHS = (len(WINDOW_DEVICES), len(WINDOW_READINGS), len(NOISES_M), 2, len(WINDOW_HANDS_N))


def claims(evidence: Evidence) -> list[Claim]:
    """All of them."""
    return [
        _false_cycles(evidence),
        _needed(
            evidence,
            "window-needed",
            "the shipped reading",
            "shipped",
            "What the shipped reading adds to the print, a bound for cycles of a few counts and one for the damping, "
            "makes false cycles harmless.",
        ),
        _needed(
            evidence,
            "window-needed-spring",
            "energy of the spring, no bounds",
            "spring",
            "Between two counts a false cycle divides what it finds by hardly any motion, and the damping runs away.",
        ),
        _needed(evidence, "window-needed-literal", "E_tot, no bounds", "literal", _literal_remark(evidence)),
        _needed(
            evidence,
            "window-needed-letter",
            "E_tot, and nothing but eqs. 7 to 10 to the letter",
            "letter",
            "A quantised energy often repeats: a window that equal energies break hardly ever accepts a cycle, so that "
            "the wall is as without a law.",
        ),
        _larger(evidence),
    ]


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


def _literal_remark(evidence: Evidence) -> str:
    ends = [evidence.figures[name].damping_n_s_per_m for name in ("fig7-literal", "fig7-literal-window")]
    return (
        "E_tot contains the work of the damping itself; between two counts it says little about the wall, and the "
        "damping that follows from it is beyond what a sampled loop can hold: at the end "
        f"{ends[0]:.0f} N s/m without the window, {ends[1]:.0f} with it."
    )


def _needed(evidence: Evidence, key: str, reading: str, name: str, remark: str) -> Claim:
    at = list(WINDOW_READINGS).index(name)
    shares, window = window_shares(evidence)[:, at], evidence.shares.window
    among = np.zeros((*_LENGTHS, len(evidence.shares.window_drops_m)), dtype=bool)
    among[:, at, :, 1] = True
    without, with_window = float(shares[:, :, 0].mean()), float(shares[:, :, 1].mean())
    return Claim(
        key,
        "Fig. 7",
        f"Without the window 12 kN/m is usually unstable, with 2+2 it is stable: {reading}",
        f"12 kN/m, hands of {-WINDOW_HANDS_N[0]:g} to {-WINDOW_HANDS_N[-1]:g} N, "
        f"{len(evidence.shares.window_drops_m)} starts each; sensor noise of "
        f"{', '.join(f'{noise * 1e6:g}' for noise in NOISES_M)} um; {' and '.join(WINDOW_DEVICES)}",
        f"come to rest: {percent(without)} without the window, {percent(with_window)} with it; with it "
        f"{_decides(shares)}{window.rest(among.ravel())}",
        without < 0.5 and with_window >= _STABLE,
        remark,
    )


def _decides(shares: Array) -> str:
    """The share with the window, by each of what was varied, what matters most first."""
    with_window = shares[:, :, 1]
    whole = np.array([abs(hand / _COUNT_N - round(hand / _COUNT_N)) < 1e-6 for hand in WINDOW_HANDS_N])
    parts = {
        "by noise": [(f"{noise * 1e6:g} um", with_window[:, at].mean()) for at, noise in enumerate(NOISES_M)],
        "by hand": [
            ("whole counts", with_window[:, :, whole].mean()),
            ("others", with_window[:, :, ~whole].mean()),
        ],
        "by device": [(device, with_window[at].mean()) for at, device in enumerate(WINDOW_DEVICES)],
    }
    ranked = sorted(parts, key=lambda name: -float(np.ptp([share for _, share in parts[name]])))
    return "; ".join(
        f"{name}: {', '.join(f'{value} {percent(float(share))}' for value, share in parts[name])}" for name in ranked
    )


def _larger(evidence: Evidence) -> Claim:
    windows = evidence.shares.windows
    settled_s = np.where(windows.settled, windows.settled_s, np.inf)
    medians_s = np.median(settled_s.reshape(len(WINDOWS_N_PER_M), len(WINDOWS), -1), axis=-1)
    rest = windows.shares(windows.settled, len(WINDOWS_N_PER_M), len(WINDOWS))
    parts = [
        f"{k * 1e-3:g} kN/m: "
        + ", ".join(
            f"{size}+{size} {f'{median * 1e3:.0f} ms' if np.isfinite(median) else 'never'} ({percent(float(share))})"
            for size, median, share in zip(WINDOWS, of_wall, of_rest, strict=True)
        )
        for k, of_wall, of_rest in zip(WINDOWS_N_PER_M, medians_s, rest, strict=True)
    ]
    never_sooner = bool((medians_s >= 0.95 * np.maximum.accumulate(medians_s, axis=1)).all())
    return Claim(
        "window-larger",
        "Section III-C",
        "A larger window lengthens convergence",
        f"{' and '.join(f'{k * 1e-3:g}' for k in WINDOWS_N_PER_M)} kN/m, windows of {WINDOWS[0]} to {WINDOWS[-1]} on "
        f"either side, {', '.join(f'{-hand:g}' for hand in HANDS_N)} N, {len(evidence.shares.drops_m)} starts each",
        f"median time to settle, and share that does: {'; '.join(parts)}{windows.rest()}",
        never_sooner and bool((medians_s[:, -1] > 1.1 * medians_s[:, 0]).all()),
        "Small windows cost nothing. One that is about as long as half a swing, 14 ms at 12 kN/m and 11 ms at 20, "
        "hardly sees a cycle.",
    )


def window_shares(evidence: Evidence) -> Array:
    """Share that comes to rest, [device, reading, noise, without or with the window, hand]."""
    window = evidence.shares.window
    return window.shares(window.settled, *_LENGTHS)
