"""What the rows of a law come to: shares and medians over a group of devices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hapticd.offline.outcome import Outcome
from hapticd_studies.transparency.devices import Held
from hapticd_studies.transparency.hands import KINDS
from hapticd_studies.transparency.runs import COLUMNS, PROBES_HZ

Array = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

FELT = 1.0
ROOM = 1.5
"""Need is this many times the least constant damper, or k T / 2 where that is more."""
_SAMPLE_S = 1e-3  # of settling times: none is known better


@dataclass(frozen=True, slots=True)
class LawSummary:
    """One law over a group of devices; NaN where it has nothing to say.

    Attributes:
        law: its label.
        devices: how many.
        held: share that is still and in place after a hard and after a gentle arrival.
        still: the same, whether in place or not.
        unfelt: share that is held and whose rest after a gentle arrival has a felt index of at most 1.
        felt: median of that index over the held ones.
        chatter_n: median span of the force at that rest, over the held ones [N].
        misplaced: largest error of the depth at that rest, over the held ones, a share.
        settles_hard, settles_gentle: median settling time over that of the best constant damper; infinite: never.
        hardness: median rate-hardness of the hard arrival over the stiffness of the wall.
        over_need: median of the damping, weighted by its work, over need; of all hands and of each.
        base_fits: share whose base is within need after the moving hand.
        work_over_leak: median of the law's work over the leak.
        error: median force error while the hand presses more, stays, and eases.
        pull_share: mean share of the ticks in contact with a pull.
        pull_worst_n: the largest pull [N].
        exits_felt: mean over the devices of the share of exits with a pull of more than 7 % of the push before.
        leaving: median time from letting go to leaving, over that without a law, on walls that need none.
        shown: median displayed stiffness over that of the wall, at each frequency of the probes.
        shown_damping: median displayed damping over k T / 2, at each of them.
        buzz: mean share of the seconds in contact, under moving hands, that are felt from 40 Hz up.
    """

    law: str
    devices: int
    held: float
    still: float
    unfelt: float
    felt: float
    chatter_n: float
    misplaced: float
    settles_hard: float
    settles_gentle: float
    hardness: float
    over_need: dict[str, float]
    base_fits: float
    work_over_leak: float
    error: tuple[float, float, float]
    pull_share: float
    pull_worst_n: float
    exits_felt: float
    leaving: float
    shown: tuple[float, ...]
    shown_damping: tuple[float, ...]
    buzz: float

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return asdict(self)


def summary(
    law: str, devices: Sequence[Held], dampers: Array, table: Array, undamped: Array | None, group: Bools
) -> LawSummary:
    """Sum up the rows of a law.

    Args:
        law: its label.
        devices: all of them.
        dampers: the rows of the constant dampers.
        table: those of the law.
        undamped: those without a law, if there are any.
        group: which devices count.
    """
    column = {name: table[:, at] for at, name in enumerate(COLUMNS)}
    kinds = np.array([device.kind for device in devices])
    leak = np.array([device.leak_n_s_per_m for device in devices])
    need = np.maximum(ROOM * dampers[:, 0], leak)
    over = column["weighted_n_s_per_m"] / need
    ended = column["hard_outcome"], column["gentle_outcome"]
    held = np.maximum(*ended) == Outcome.SETTLED
    resting = group & held
    based = group & np.isfinite(column["base_n_s_per_m"])
    left = group & (column["exits"] > 0.0)
    shown = [f"{hz:g}hz" for together in PROBES_HZ for hz in together]
    return LawSummary(
        law,
        int(group.sum()),
        held=_share(held[group]),
        still=_share((np.maximum(*ended) <= Outcome.ELSEWHERE)[group]),
        unfelt=_share((held & (column["gentle_felt"] <= FELT))[group]),
        felt=_median(column["gentle_felt"][resting]),
        chatter_n=_median(column["gentle_chatter_n"][resting]),
        misplaced=float(np.abs(column["gentle_misplaced_share"][resting]).max()) if resting.any() else math.nan,
        settles_hard=_ratio(column["hard_settled_s"], dampers[:, 1], group),
        settles_gentle=_ratio(column["gentle_settled_s"], dampers[:, 2], group),
        hardness=_median(column["hard_hardness_share"][group]),
        over_need={"all": _median(over[group])} | {kind: _median(over[group & (kinds == kind)]) for kind in KINDS},
        base_fits=_share(column["base_n_s_per_m"][based] <= 1.0001 * need[based]),
        work_over_leak=_median(column["work_over_leak"][group]),
        error=(
            _median(column["error_in"][group]),
            _median(column["error_hold"][group]),
            _median(column["error_out"][group]),
        ),
        pull_share=_mean(column["pull_share"][group]),
        pull_worst_n=float(np.nanmax(column["pull_worst_n"][group], initial=0.0)),
        exits_felt=_mean(column["exits_felt"][left] / column["exits"][left]),
        leaving=math.nan if undamped is None else _leaving(devices, table, undamped, group),
        shown=tuple(_median(column[f"shown_share_{hz}"][group]) for hz in shown),
        shown_damping=tuple(_median((column[f"shown_n_s_per_m_{hz}"] / leak)[group]) for hz in shown),
        buzz=_mean(column["buzz_share"][group]),
    )


def _leaving(devices: Sequence[Held], table: Array, undamped: Array, group: Bools) -> float:
    easy = group & np.array([device.own_share < 1.0 for device in devices])
    at = COLUMNS.index("leave_s")
    return _median((table[:, at] / undamped[:, at])[easy])


def _ratio(settled_s: Array, best_s: Array, group: Bools) -> float:
    """Median over the devices that some damper settles; a law that never settles counts as infinite."""
    known = group & np.isfinite(best_s)
    if not known.any():
        return math.nan
    took_s = np.where(np.isnan(settled_s[known]), math.inf, settled_s[known])
    ratios = np.sort((took_s + _SAMPLE_S) / (best_s[known] + _SAMPLE_S))
    return float(ratios[len(ratios) // 2])


def _median(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else math.nan


def _mean(values: Array) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan


def _share(which: Bools) -> float:
    return float(which.mean()) if len(which) else math.nan
