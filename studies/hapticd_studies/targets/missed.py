"""What stands against each target that the default law misses: settings and laws that reach it, and what they lose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hapticd_studies.targets.table import LATER, Reached

LAWS = ",".join(
    [
        *(
            f"ring-damping{one}"
            for one in (
                "",
                ":hand_half_period_s=0.02",
                ":hand_half_period_s=0.1",
                ":brake_ratio=0:least_brake_ratio=0",
                ":brake_ratio=0.2",
                ":brake_ratio=0.4",
                ":brake_ratio=1",
                ":least_brake_ratio=0.05",
                ":least_brake_ratio=0.6",
                ":pull_after=0",
                ":pull_after=2",
            )
        ),
        "energy-cycle",
        "tdpa",
        "tdpa:reference=stored",
        *(f"damper:damping_n_s_per_m={one}" for one in (5, 10, 20, 50, 80)),
    ]
)
"""What is held against the default law, as `--laws` takes it; the first is the default."""

_SHOWN = 4
_COSTS = 3


@dataclass(frozen=True, slots=True)
class Cost:
    """A target that the default reaches and another setting does not.

    Attributes:
        what: the target.
        default, here: what both reach.
    """

    what: str
    default: float
    here: float


@dataclass(frozen=True, slots=True)
class Other:
    """Another setting or law at a target that the default misses.

    Attributes:
        law: its label.
        reached: of the target.
        met: whether that is enough.
        costs: what it loses, the worst first.
    """

    law: str
    reached: float
    met: bool
    costs: tuple[Cost, ...]


@dataclass(frozen=True, slots=True)
class Missed:
    """A target that the default misses, or that was asked for.

    Attributes:
        target: what the default reaches of it.
        others: those that reach it, the fewest losses first; where none does, the nearest.
        tried: how many there were.
    """

    target: Reached
    others: tuple[Other, ...]
    tried: int

    @property
    def says(self) -> str:
        """What follows."""
        met = [one for one in self.others if one.met]
        free = [one for one in met if not one.costs]
        here = "the default reaches it here; " if self.target.met else ""
        if free:
            return f"{here}{free[0].law} reaches it, and nothing that the default reaches is lost"
        if met:
            return f"{here}{len(met)} of {self.tried} reach it, and each loses what the default reaches"
        return f"{here}none of {self.tried} reaches it"

    def declared(self) -> dict[str, Any]:
        """For a file of results."""
        return {**self.target.declared(), "others": [asdict(one) for one in self.others], "says": self.says}


def missed(found: dict[str, list[Reached]], also: Sequence[str] = ()) -> list[Missed]:
    """Every target that the first law misses, with all others at it.

    Args:
        found: the targets of each law, the default first; those that one cannot tell are left out or NaN.
        also: words in the names of targets that are judged even if few devices let the first law reach them.
    """
    (_, own), *rest = found.items()
    own = [one for one in own if LATER not in one.what]
    kept = [one for one in own if one.met]
    lost = [one for one in own if not one.met or any(word in one.what for word in also)]
    return [_missed(one, kept, [(law, {each.what: each for each in rows}) for law, rows in rest]) for one in lost]


def _missed(target: Reached, kept: Sequence[Reached], rest: Sequence[tuple[str, dict[str, Reached]]]) -> Missed:
    others = []
    for law, rows in rest:
        here = rows.get(target.what)
        if here is None or math.isnan(here.reached):
            continue
        both = [(one, rows[one.what]) for one in kept if one.what in rows and not math.isnan(rows[one.what].reached)]
        both = [(own, other) for own, other in both if own.what != target.what]
        costs = [Cost(own.what, own.reached, other.reached) for own, other in both if not other.met]
        costs.sort(key=lambda cost: -abs(math.log(max(cost.here, 1e-3) / max(cost.default, 1e-3))))
        others.append(Other(law, here.reached, here.met, tuple(costs)))
    others.sort(key=lambda one: (not one.met, len(one.costs) if one.met else 0, _short(target, one.reached)))
    return Missed(target, tuple(others), len(others))


def _short(target: Reached, reached: float) -> float:
    """How far from being enough; negative: more than enough."""
    return target.asked - reached if target.at_least else reached - target.asked


def markdown(found: Sequence[Missed]) -> str:
    """A table a target, of the first few others and of what each loses most."""
    parts = []
    for one in found:
        target = one.target
        asked = f"{'at least' if target.at_least else 'at most'} {target.asked:g}"
        lines = [
            f"**{target.what}**, {asked}: {target.reached:.3g}. {one.says[0].upper()}{one.says[1:]}.",
            "",
            "| | this | loses |",
            "|---|---|---|",
        ]
        lines += [f"| {_name(other.law)} | {other.reached:.3g} | {_losses(other)} |" for other in one.others[:_SHOWN]]
        parts.append("\n".join(lines))
    return "\n\n".join(parts) + "\n"


def _name(law: str) -> str:
    return law if " " in law else f"`{law}`"


def _losses(other: Other) -> str:
    said = [f"{cost.what}: {cost.here:.3g}, not {cost.default:.3g}" for cost in other.costs[:_COSTS]]
    more = len(other.costs) - _COSTS
    return "; ".join(said) + (f"; {more} more" if more > 0 else "") if said else "nothing"
