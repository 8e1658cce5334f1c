"""The targets, and what a law reaches of each."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd_studies.robustness.devices import draw as pressed_device
from hapticd_studies.targets.plan import TargetsPlan
from hapticd_studies.transparency.devices import draw
from hapticd_studies.transparency.runs import COLUMNS
from hapticd_studies.transparency.summary import summary

Array = npt.NDArray[np.float64]

CYCLES = 10.0
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
    """

    what: str
    asked: float
    at_least: bool
    reached: float
    of: int

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

    def least(what: str, asked: float, values: npt.NDArray[Any]) -> None:
        share = 100.0 * float(np.mean(values)) if len(values) else math.nan
        found.append(Reached(what, asked, True, share, len(values)))

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
    need = np.maximum(1.5 * dampers["moved"][:, 0], [device.leak_n_s_per_m for device in devices])
    base, asked = tables["based"][:, 0], need[: plan.size.based]
    based = np.isfinite(asked) & np.isfinite(base)
    least("base after ten minutes of hands within need [%]", 95.0, base[based] <= 1.0001 * asked[based])
    kinds = np.array([device.kind for device in devices])[: plan.size.based]
    for at, when in ((1, ""), (2, ", from 10 s on")):
        ratio = tables["based"][:, at] / asked
        for what, kind, asked_ratio in DAMPING:
            chosen = ratio[np.isfinite(ratio) & ((kinds == kind) if kind else True)]
            most(f"damping over need{when}: {what}", asked_ratio, _median(chosen), len(chosen))
    all_ = summary(plan.laws[law].label, devices, dampers["moved"], moved, None, group)
    inside = group & np.isfinite(column["pull_share"])
    most("ticks in contact that pull [%]", 2.0, 100.0 * float(np.mean(column["pull_share"][inside])), int(inside.sum()))
    exits = float(column["exits"][group].sum())
    quiet = 1.0 - float(column["exits_felt"][group].sum()) / exits if exits else math.nan
    found.append(Reached("exits with a pull of at most 7 % [%]", 99.0, True, 100.0 * quiet, int(exits)))
    most("settling over the best damper's, hard arrival", 1.4, all_.settles_hard, int(group.sum()))
    most("settling over the best damper's, gentle arrival", 1.6, all_.settles_gentle, int(group.sum()))

    least("wall 12 -> 2 kN/m: within 5 % of k T / 2 within 1 s [%]", 100.0, tables["softening"][:, 0] <= 1.0)
    taken = tables["taking over"][:, 0] <= CYCLES
    least("another hand: within 5 % of k T / 2 within ten presses [%]", 100.0, taken)
    known, best = tables["known"], dampers["known"]
    omega = len(known) - 6
    least("omega7 model at 12, 18, 20 kN/m held [%]", 100.0, known[:omega, 0])
    unfelt = best[:omega, 1] <= 1.0
    least("of those that a constant damper leaves unfelt, unfelt [%]", 100.0, known[:omega, 1][unfelt] <= 1.0)
    least("Fig. 6 of the paper converges [%]", 100.0, known[omega:, 0])
    return found


def _median(values: Array) -> float:
    return float(np.median(values)) if len(values) else math.nan
