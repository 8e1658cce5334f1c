"""What a law's damping would do to a stable loop if it were held: what a sampled damper may is bounded by ceilings."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

from hapticd_studies.extremes import exact
from hapticd_studies.extremes.case import LoopCase
from hapticd_studies.extremes.verdict import Verdict


class Break(IntEnum):
    """What the damping of a law, held, makes of a loop that is stable without it."""

    NONE = 0
    CEILING = 1
    HELD = 2
    FAULT = 3

    @property
    def words(self) -> str:
        """For people."""
        return (
            "would be stable with that damping held",
            "would be unstable with that damping held, beyond a published ceiling",
            "would be unstable with that damping held, on a spring: no ceiling is published",
            "is promised less, or would be unstable with that damping held though no ceiling allows it",
        )[self]


def law_breaks(place: LoopCase, damping_n_s_per_m: float) -> Break:
    """What the damping of a law, held, makes of a loop that is stable without it.

    A law may bring it for a few ticks only, and its loop may stay as stable as it was. A damper on the difference of
    two samples shakes a bare mass beyond 2, 0.83, 0.54 ... m/T with 0, 1, 2 ... samples of delay, and below that
    carries a spring up to a stiffness that depends on it; without delay K < (2B/T) (1 - u) / (1 + u), u = BT/2m. The
    exact eigenvalues of the bare mass say whether wall and damping are beyond that.

    Args:
        place: the loop.
        damping_n_s_per_m: the most damping that the law brought in contact [N s/m].
    """
    if damping_n_s_per_m <= 0.0:
        return Break.NONE
    damped = replace(place, wall_damping_n_s_per_m=place.wall_damping_n_s_per_m + damping_n_s_per_m)
    if exact.verdict(damped) is not Verdict.UNSTABLE:
        return Break.NONE
    if place.hand_stiffness_n_per_m > 0.0:
        return Break.HELD
    bare = replace(damped, viscous_n_s_per_m=0.0)
    return Break.CEILING if exact.verdict(bare) is Verdict.UNSTABLE else Break.FAULT
