"""The published rows that the model can be asked about.

Of most sources the abstract alone could be read, and of no device in them mass and friction together are known; each
row says what was assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hapticd.config.walls import WallConfig
from hapticd.simulation.options import Flexible
from hapticd_studies.boundaries import Loop, is_stable, linear_limit, spring_limit, stable_limit
from hapticd_studies.published.finding import Finding
from hapticd_studies.published.presses import Settled, felt, points, settled

PERIOD_S = 1e-3
STARTS = 15

PHANTOM: dict[str, Any] = {
    "mass_kg": 0.072,
    "viscous_n_s_per_m": 0.005,
    "coulomb_n": 0.038,
    "resolution_m": 29.5e-6,
    "max_force_n": 8.5,
}
"""PHANToM 1.0 as Diolaiti et al. 2006 identified it."""

DIOLAITI = "Diolaiti, Niemeyer, Barbagli & Salisbury 2006, PHANToM 1.0 (identified values known second hand)"
CHOI = "Choi & Tan 2004, PHANToM 1.0A, largest stiffness that does not buzz (abstract read)"
BROWN = "Brown 1995, thesis, one axis, 16 set-ups (two sections read; plots not seen)"
DIAZ = "Diaz & Gil 2010, LHIfAM and PHANToM, 11-parameter models (abstract read)"
GIL = "Gil 2010, PHANToM 1.0, two modes (abstract read)"
PAPER = "energy-cycle paper, Omega.7 at 1 kHz"

_HANDS = {"X": (380.0, 1.84), "Y": (552.0, 3.61), "Z": (770.0, 0.78)}
"""Spring [N/m] and damping [N s/m] of a pen grip, by axis (Fu & Cavusoglu 2012, known second hand)."""

_MODES = tuple(
    Flexible(frequency_hz=hertz, handle_share=share, damping_ratio=0.02)
    for hertz in (150.0, 200.0)
    for share in (0.3, 0.5)
)
_MODE_WORDS = "0.075 kg with a mode at 150 or 200 Hz, 0.3 or 0.5 of the mass behind the spring, 2 % damping"

_FRICTION_N = (2.0 * PHANTOM["coulomb_n"] / PHANTOM["resolution_m"], 2.0 * PHANTOM["viscous_n_s_per_m"] / PERIOD_S)
_STIFFNESSES = (100.0, 200.0, 500.0, 1000.0, 1500.0, 2000.0, 2300.0, 2576.0, 3000.0, 4000.0)


def friction_limit(hand_n: float = 0.3, stiffnesses: Sequence[float] = _STIFFNESSES) -> Finding:
    """A gently pressed device without damping is held by friction, up to 2 f_c over the sensor's step."""
    counts = _settled_by_stiffness(PHANTOM, hand_n, stiffnesses)
    limit, viscous = _FRICTION_N
    edge = _edge(counts)
    return Finding(
        "friction-limit",
        DIOLAITI,
        f"held by friction up to 2 f_c/step = {limit:.0f} N/m, where viscous friction alone allows {viscous:.0f}",
        f"pressed with {hand_n:g} N all of {STARTS} starts to 2 mm settle up to {edge:.0f} N/m"
        f"{_felt_at(counts, edge)}, {counts[max(k for k in stiffnesses if k <= limit)].count} of them at the limit, "
        f"{counts[stiffnesses[-1]].count} at {stiffnesses[-1]:.0f}",
        10.0 * viscous < edge and 0.5 * limit <= edge <= 1.2 * limit,
        {"limit_n_per_m": limit, "starts": STARTS, "hand_n": hand_n, **_ends(counts, "stiffness_n_per_m")},
    )


def friction_limit_pressed(hand_n: float = 1.0, stiffnesses: Sequence[float] = _STIFFNESSES) -> Finding:
    """Pressed harder the same device arrives with more energy than friction can hold."""
    counts = _settled_by_stiffness(PHANTOM, hand_n, stiffnesses)
    limit, _ = _FRICTION_N
    edge = _edge(counts)
    return Finding(
        "friction-limit-pressed",
        DIOLAITI,
        f"the limit of {limit:.0f} N/m knows no hand force",
        f"pressed with {hand_n:g} N all starts settle up to {edge:.0f} N/m only{_felt_at(counts, edge)}: friction "
        "holds a device near rest and no other",
        0.5 * limit <= edge,
        {"limit_n_per_m": limit, "starts": STARTS, "hand_n": hand_n, **_ends(counts, "stiffness_n_per_m")},
    )


def rate(lag_s: float = 1.10e-3, viscous_n_s_per_m: float = 1.01) -> Finding:
    """How the clean stiffness grows with the rate of the loop."""
    slow_s, fast_s, published = 1.0 / 250.0, 1.0 / 40_000.0, 904.0 / 325.0
    rigid = spring_limit(0.1, viscous_n_s_per_m, fast_s) / spring_limit(0.1, viscous_n_s_per_m, slow_s)
    lagging = (0.5 * slow_s + lag_s) / (0.5 * fast_s + lag_s)
    slow, late = (linear_limit(Loop(0.1, viscous_n_s_per_m, t_s, late_s=lag_s)) for t_s in (slow_s, fast_s))
    return Finding(
        "rate",
        CHOI,
        f"325 N/m at 250 Hz, 904 at 40 kHz: {published:.2f} times",
        f"a rigid device without lag: {rigid:.0f} times, as 1/T. K = b/(T/2 + L) meets both with b 1.01 N s/m and a "
        f"lag of 1.10 ms ({lagging:.2f} times; the loop with that lag: {slow:.0f} and {late:.0f} N/m), but two numbers "
        "that fit two numbers test nothing",
        abs(rigid / published - 1.0) < 0.25,
        {
            "published_ratio": published,
            "rigid_ratio": rigid,
            "lagging_ratio": lagging,
            "late_limit_n_per_m": [slow, late],
        },
    )


def rate_advice(lag_s: float = 1.10e-3, viscous_n_s_per_m: float = 1.01) -> Finding:
    """With the lag that the two stiffnesses ask for, what the rates between them are worth."""
    limits = {
        hz: linear_limit(Loop(0.1, viscous_n_s_per_m, 1.0 / hz, late_s=lag_s)) for hz in (1e3, 5e3, 10e3, 40e3, 160e3)
    }
    five, ten, beyond = (limits[hz] / limits[40e3] for hz in (5e3, 10e3, 160e3))
    return Finding(
        "rate-advice",
        CHOI,
        "their advice for hard surfaces: 5-10 kHz",
        f"a rigid device whose force comes {lag_s * 1e3:.2f} ms late: {limits[1e3]:.0f} N/m at 1 kHz; 5 and 10 kHz "
        f"hold {100.0 * five:.0f} and {100.0 * ten:.0f} % of what 40 kHz does, 160 kHz {100.0 * beyond:.0f} %",
        five > 0.9 and ten > 0.95 and beyond < 1.1,
        {"limit_by_rate_hz": limits, "lag_s": lag_s},
    )


def mode_when_held() -> Finding:
    """What a flexible mode does to the limit of a spring, in a hand and without one."""
    held = {
        axis: [_phantom_limit(mode, damping, spring) for mode in (None, *_MODES)]
        for axis, (spring, damping) in _HANDS.items()
    }
    free = [_phantom_limit(mode) for mode in (None, *_MODES)]
    changes = {axis: max(abs(one / rigid - 1.0) for one in others) for axis, (rigid, *others) in held.items()}
    alone = max(abs(one / free[0] - 1.0) for one in free[1:])
    return Finding(
        "mode-when-held",
        DIAZ,
        "the vibration mode decides the stiffness limit when the device is held",
        f"{_MODE_WORDS}, pen grips: the limit changes by up to "
        + ", ".join(f"{100.0 * change:.0f} % ({axis})" for axis, change in changes.items())
        + f"; without a hand by {100.0 * alone:.1f} %. Mostly upwards, and mass, mode and grip are assumed",
        max(changes.values()) > 0.25 and alone < 0.02,
        {"held_n_per_m": held, "free_n_per_m": free},
    )


def modes_shrink_region(dampings: Sequence[float] = tuple(range(5, 151, 5))) -> Finding:
    """What a flexible mode leaves of the region of stiffness and wall damping."""
    rigid, *others = (
        sum(_phantom_limit(mode, wall=float(damping)) for damping in dampings) for mode in (None, *_MODES)
    )
    shares = [one / rigid for one in others]
    return Finding(
        "modes-shrink-region",
        GIL,
        "vibration modes shrink the stable region of stiffness and damping",
        f"{_MODE_WORDS}, no hand: the region has {100.0 * min(shares):.0f} to {100.0 * max(shares):.0f} % of its area "
        "left; one mode and not two, its values assumed",
        max(shares) < 0.8,
        {"area_shares": shares},
    )


def native_limit() -> Finding:
    """The Omega.7's own limit, to which the shipped model was calibrated."""
    limit = stable_limit(Loop(0.25, 4.4, PERIOD_S))
    return Finding(
        "native-limit",
        PAPER,
        "8 kN/m without a controller",
        f"{limit:.0f} N/m; the model was calibrated to this row, so that it tests nothing",
        None,
        {"limit_n_per_m": limit},
    )


def damper_widens(rates_hz: Sequence[float] = (500.0, 1000.0, 2000.0, 4000.0)) -> Finding:
    """A damper on the device widens the region of stiffness and wall damping, at every rate."""
    bare, damped = ([_limits(b, 1.0 / rate_hz) for rate_hz in rates_hz] for b in (1.0, 4.0))
    widened = [
        sum(more > less for less, more in zip(before, after, strict=True) if after) / sum(1 for more in after if more)
        for before, after in zip(bare, damped, strict=True)
    ]
    alone = [after[0] / before[0] for before, after in zip(bare, damped, strict=True)]
    return Finding(
        "damper-widens",
        BROWN,
        "a damper on the device widens the stable region at every rate",
        "4 instead of 1 N s/m on 0.25 kg: a stiffer wall is stable at "
        + ", ".join(f"{100.0 * share:.0f} %" for share in widened)
        + " of the wall dampings ("
        + ", ".join(f"{rate_hz:g}" for rate_hz in rates_hz)
        + " Hz); without wall damping "
        + ", ".join(f"{ratio:.1f}" for ratio in alone)
        + " times as stiff",
        min(widened) > 0.95,
        {"share_by_rate": dict(zip(rates_hz, widened, strict=True)), "ratio_without_wall_damping": alone},
    )


def rate_gives_stiffness() -> Finding:
    """More stiffness at a higher rate."""
    limits = {
        rate_hz: max(linear_limit(Loop(0.25, 1.0, 1.0 / rate_hz, b)) for b in _dampings()) for rate_hz in (500, 4000)
    }
    return Finding(
        "rate-gives-stiffness",
        BROWN,
        "a higher rate allows more stiffness",
        f"{limits[500] / 1e3:.0f} kN/m at 500 Hz, {limits[4000] / 1e3:.0f} at 4 kHz with the best wall damping",
        limits[4000] > limits[500],
        {"limit_by_rate_hz": limits},
    )


def rate_takes_damping(resolution_m: float = 3e-5) -> Finding:
    """Less wall damping at a higher rate, since the velocity of a coarse sensor gets noisier."""
    felt_by_rate = {}
    linear = {}
    for rate_hz in (500, 4000):
        device = {"mass_kg": 0.25, "viscous_n_s_per_m": 1.0, "resolution_m": resolution_m, "max_force_n": 0.0}
        wall = WallConfig(stiffness_n_per_m=2000.0, damping_n_s_per_m=100.0)
        felt_by_rate[rate_hz] = felt(points(device, wall, 2.03, 5, 1.0 / rate_hz), 4.0)
        loops = ((b, Loop(0.25, 1.0, 1.0 / rate_hz, b)) for b in np.geomspace(1.0, 4000.0, 400))
        linear[rate_hz] = max(float(b) for b, loop in loops if is_stable(loop, 2000.0))
    return Finding(
        "rate-takes-damping",
        BROWN,
        "a higher rate allows less wall damping",
        f"the stable damping grows from {linear[500]:.0f} N s/m at 500 Hz to {linear[4000]:.0f} at 4 kHz, and with "
        f"steps of {resolution_m * 1e6:.0f} um 100 N s/m is felt {felt_by_rate[500]:.0f} and {felt_by_rate[4000]:.0f} "
        "times the threshold; a current loop or a flexible handle may be what he met",
        linear[4000] < linear[500] or felt_by_rate[4000] > felt_by_rate[500],
        {"stable_damping_by_rate_hz": linear, "felt_by_rate_hz": felt_by_rate},
    )


def encoder_keeps_limit() -> Finding:
    """The step of the sensor leaves the stiffness limit where it is; coarse ones feel gritty."""
    limits, grit, ends = {}, {}, {}
    for step_m in (1e-6, 1e-5, 1e-4):
        device = {"mass_kg": 0.25, "viscous_n_s_per_m": 4.0, "resolution_m": step_m, "max_force_n": 0.0}
        counts = _settled_by_stiffness(device, 30.0, (500.0, 1000.0, 2000.0, 4000.0, 6000.0, 7000.0, 7600.0, 8400.0))
        limits[step_m] = _edge(counts)
        ends[step_m] = counts[limits[step_m]]
        wall = WallConfig(stiffness_n_per_m=2000.0, damping_n_s_per_m=50.0)
        grit[step_m] = felt(points(device, wall, 2.03, 5, PERIOD_S), 4.0)
    kept = max(limits.values()) <= 1.2 * min(limits.values())
    return Finding(
        "encoder",
        BROWN,
        "the encoder's step leaves the limit where it is; coarse ones feel gritty",
        "steps of 1, 10, 100 um: all starts settle up to "
        + ", ".join(f"{limit / 1e3:.1f}" for limit in limits.values())
        + " kN/m ("
        + "; ".join(one.words for one in ends.values())
        + "); felt at 50 N s/m "
        + ", ".join(f"{index:.1f}" for index in grit.values())
        + " times the threshold; without friction a coarse step keeps a swing of some steps alive that the rule of two "
        "steps calls unsettled",
        kept and grit[1e-4] > 3.0 * max(1.0, grit[1e-6]),
        {"limit_by_step_m": limits, "gritty_by_step_m": grit, **_ends(ends, "step_m")},
    )


def velocity_filter() -> Finding:
    """Filtering the velocity changes the region."""
    device = {"mass_kg": 0.25, "viscous_n_s_per_m": 4.0, "resolution_m": 0.0, "max_force_n": 0.0}
    limits, ends = {}, {}
    for samples in (1, 8):
        counts = {
            b: settled(points(device, _wall(2000.0, b), 2.03, 3, PERIOD_S, samples), 4.0)
            for b in (40.0, 80.0, 160.0, 320.0)
        }
        limits[samples] = max((b for b, one in counts.items() if one.count == 3), default=0.0)
        ends[samples] = counts.get(limits[samples], Settled(0, None, None))
    return Finding(
        "velocity-filter",
        BROWN,
        "filtering the velocity changes the stable region",
        f"the largest wall damping that settles is {limits[1]:.0f} N s/m with a difference over one sample "
        f"({ends[1].words}) and {limits[8]:.0f} over eight ({ends[8].words})",
        limits[1] != limits[8],
        {"damping_by_samples": limits, **_ends(ends, "samples")},
    )


ROWS = (
    friction_limit,
    friction_limit_pressed,
    rate,
    rate_advice,
    mode_when_held,
    modes_shrink_region,
    native_limit,
    damper_widens,
    rate_gives_stiffness,
    rate_takes_damping,
    encoder_keeps_limit,
    velocity_filter,
)


def _phantom_limit(mode: Flexible | None, hand: float = 0.0, spring: float = 0.0, wall: float = 0.0) -> float:
    """The stiffest wall that a device of the PHANToM's kind holds [N/m]."""
    loop = Loop(0.075, 0.005, PERIOD_S, wall, hand_n_per_m=spring, hand_n_s_per_m=hand, flexible=mode)
    return stable_limit(loop)


def _settled_by_stiffness(device: dict[str, Any], hand_n: float, stiffnesses: Sequence[float]) -> dict[float, Settled]:
    return {k: settled(points(device, _wall(k), hand_n, STARTS, PERIOD_S), 20.0) for k in stiffnesses}


def _felt_at(counts: dict[float, Settled], edge: float) -> str:
    return f" ({counts[edge].words})" if edge in counts else ""


def _ends(counts: dict[Any, Settled], by: str) -> dict[str, object]:
    """As figures: how many settle, and what of them is felt and chatters."""
    return {
        f"settled_by_{by}": {at: one.count for at, one in counts.items()},
        f"felt_by_{by}": {at: one.felt for at, one in counts.items()},
        f"chatter_n_by_{by}": {at: one.chatter_n for at, one in counts.items()},
    }


def _edge(counts: dict[float, Settled]) -> float:
    """The stiffest wall up to which all starts settle; 0 when not even on the softest."""
    edge = 0.0
    for stiffness, one in counts.items():
        if one.count < STARTS:
            break
        edge = stiffness
    return edge


def _dampings() -> list[float]:
    return [float(b) for b in np.geomspace(1.0, 4000.0, 60)]


def _limits(viscous_n_s_per_m: float, period_s: float) -> list[float]:
    """The largest stiffness without and with each wall damping [N/m]."""
    return [linear_limit(Loop(0.25, viscous_n_s_per_m, period_s, b)) for b in (0.0, *_dampings())]


def _wall(stiffness_n_per_m: float, damping_n_s_per_m: float = 0.0) -> WallConfig:
    return WallConfig(stiffness_n_per_m=stiffness_n_per_m, damping_n_s_per_m=damping_n_s_per_m)
