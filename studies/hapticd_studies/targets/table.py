"""The targets, and what a law reaches of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd_studies.robustness.devices import draw as pressed_device
from hapticd_studies.targets import hindsight
from hapticd_studies.targets.plan import TargetsPlan
from hapticd_studies.transparency.devices import Held, draw
from hapticd_studies.transparency.runs import COLUMNS
from hapticd_studies.transparency.summary import ROOM, summary

Array = npt.NDArray[np.float64]

CYCLES = 10.0
BASE = "base after ten minutes of hands within need [%]"
NEED = "damping over need"
LATER = ", from 10 s on"
"""In the name of what stands in the table beside a target, and is none."""
_SURE = 1.96  # standard deviations of a 95 % interval
DAMPING = (("all hands", "", 1.1), ("presses", "press", 1.5), ("taps", "tap", 1.5), ("tremor", "tremor", 1.05))


@dataclass(frozen=True, slots=True)
class Reached:
    """What a law reaches of one target.

    Attributes:
        what: the target in words.
        asked: what it asks for, and whether at least or at most.
        at_least: whether more is better.
        reached: what was measured; NaN: the law has nothing to say.
        of: how many cases.
        low, high: 95 % interval of a share of random devices (Wilson 1927) [%]; NaN: it is none.
    """

    what: str
    asked: float
    at_least: bool
    reached: float
    of: int
    low: float = math.nan
    high: float = math.nan

    @property
    def met(self) -> bool:
        """Whether the target is reached."""
        return self.reached >= self.asked if self.at_least else self.reached <= self.asked

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return {**asdict(self), "met": self.met}


def reached(plan: TargetsPlan, dampers: dict[str, Array], law: int, tables: dict[str, Array]) -> list[Reached]:
    """Every target of a law.

    Args:
        plan: what was run.
        dampers: the tables of the constant dampers.
        law: which of the plan's.
        tables: those of the law.
    """
    found = []

    def least(what: str, asked: float, values: npt.NDArray[Any], random: bool = True) -> None:
        share = float(np.mean(values)) if len(values) else math.nan
        ends = interval(share, len(values)) if random and len(values) else (math.nan, math.nan)
        found.append(Reached(what, asked, True, 100.0 * share, len(values), *(100.0 * end for end in ends)))

    def most(what: str, asked: float, value: float, of: int) -> None:
        found.append(Reached(what, asked, False, value, of))

    holdable = dampers["pressed"][:, 0] > 0.0
    late = np.array([pressed_device(plan.seed, index).delayed for index in range(plan.size.pressed)])
    prompt = holdable & ~late
    least("pressed devices held, no delay [%]", 99.8, tables["pressed"][prompt, 0])
    least("pressed devices held, one sample late [%]", 99.5, tables["pressed"][holdable & late, 0])
    least("pressed devices held, sensor noise of 4 um [%]", 99.0, tables["noisy"][dampers["noisy"][:, 0] > 0.0, 0])
    least("at rest below 2 counts, no delay [%]", 99.0, tables["pressed"][prompt, 1])
    least("at rest below 2 counts, one sample late [%]", 97.0, tables["pressed"][holdable & late, 1])

    devices = [draw(plan.seed, index) for index in range(plan.size.moved)]
    group = np.isfinite(dampers["moved"][:, 0])
    moved = tables["moved"]
    column = {name: moved[:, at] for at, name in enumerate(COLUMNS)}
    arrived = (np.maximum(column["hard_outcome"], column["gentle_outcome"]) == 0.0) & (tables["stiffened"][:, 0] > 0.0)
    least("0.02-5 kg, 0-2 samples, lag, noise, hands that stiffen: held [%]", 99.5, arrived[group])
    need = np.maximum(ROOM * dampers["moved"][:, 0], [device.leak_n_s_per_m for device in devices])
    base, asked = tables["based"][:, 0], need[: plan.size.based]
    based = np.isfinite(asked) & np.isfinite(base)
    least(BASE, 95.0, base[based] <= 1.0001 * asked[based])
    kinds = np.array([device.kind for device in devices])[: plan.size.based]
    for at, when in ((1, ""), (2, LATER)):
        ratio = tables["based"][:, at] / asked
        for what, kind, asked_ratio in DAMPING:
            chosen = ratio[np.isfinite(ratio) & ((kinds == kind) if kind else True)]
            most(f"{NEED}{when}: {what}", asked_ratio, _median(chosen), len(chosen))
    found += _of_hands(devices, dampers["moved"], moved, group)
    soft = tables["softening"][:, 0] <= 1.0
    least("wall 12 -> 2 kN/m: within 5 % of k T / 2 within 1 s [%]", 100.0, soft, False)
    taken = tables["taking over"][:, 0] <= CYCLES
    least("another hand: within 5 % of k T / 2 within ten presses [%]", 100.0, taken, False)
    known, best = tables["known"], dampers["known"]
    omega = len(known) - 6
    least("omega7 model at 12, 18, 20 kN/m held [%]", 100.0, known[:omega, 0], False)
    unfelt = best[:omega, 1] <= 1.0
    least("of those that a constant damper leaves unfelt, unfelt [%]", 100.0, known[:omega, 1][unfelt] <= 1.0, False)
    least("Fig. 6 of the paper converges [%]", 100.0, known[omega:, 0], False)
    return found


def known_beforehand(plan: TargetsPlan, dampers: dict[str, Array]) -> dict[str, list[Reached]]:
    """What constant dampers chosen for each device reach, of the targets that a moving hand can tell."""
    devices = [draw(plan.seed, index) for index in range(plan.size.moved)]
    group = np.array([bool(np.isfinite(row).all()) for row in dampers["moved"]])
    need = np.maximum(ROOM * dampers["moved"][:, 0], [device.leak_n_s_per_m for device in devices])
    kinds = np.array([device.kind for device in devices])
    found = {}
    for label, part in zip(hindsight.LABELS, np.split(dampers["hindsight"], 2, axis=1), strict=True):
        over = part[:, 0] / need
        fits = 100.0 * float(np.mean(over[group] <= 1.0001))
        rows = [Reached(BASE, 95.0, True, fits, int(group.sum()))]
        for what, kind, asked in DAMPING:
            chosen = over[group & (kinds == kind)] if kind else over[group]
            rows.append(Reached(f"{NEED}: {what}", asked, False, _median(chosen), len(chosen)))
        found[label] = [*rows, *_of_hands(devices, dampers["moved"], part[:, 1:], group)]
    return found


def interval(share: float, of: int) -> tuple[float, float]:
    """The shares that a true one is likely to be within, 95 %, after Wilson 1927."""
    square = _SURE * _SURE / of
    middle = (share + 0.5 * square) / (1.0 + square)
    half = math.sqrt(share * (1.0 - share) * square + 0.25 * square * square) / (1.0 + square)
    return max(0.0, middle - half), min(1.0, middle + half)


def _of_hands(devices: Sequence[Held], dampers: Array, moved: Array, group: npt.NDArray[np.bool_]) -> list[Reached]:
    """Pulls and settling, of the devices of a group."""
    column = {name: moved[:, at] for at, name in enumerate(COLUMNS)}
    inside = group & np.isfinite(column["pull_share"])
    pulled = 100.0 * float(np.mean(column["pull_share"][inside])) if inside.any() else math.nan
    exits = float(column["exits"][group].sum())
    quiet = 1.0 - float(column["exits_felt"][group].sum()) / exits if exits else math.nan
    all_ = summary("", devices, dampers, moved, None, group)
    of = int(group.sum())
    return [
        Reached("ticks in contact that pull [%]", 2.0, False, pulled, int(inside.sum())),
        Reached("exits with a pull of at most 7 % [%]", 99.0, True, 100.0 * quiet, int(exits)),
        Reached("settling over the best damper's, hard arrival", 1.4, False, all_.settles_hard, of),
        Reached("settling over the best damper's, gentle arrival", 1.6, False, all_.settles_gentle, of),
    ]


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else math.nan
