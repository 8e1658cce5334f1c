"""Constant dampers chosen for each device with its own runs at hand: what no law can know, under the same hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from hapticd.law import LawParams
from hapticd.offline.outcome import Criterion
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.transparency.arrivals import HARD
from hapticd_studies.transparency.devices import Held
from hapticd_studies.transparency.references import fastest_damping, least_damping
from hapticd_studies.transparency.runs import COLUMNS, Row, rows

Array = npt.NDArray[np.float64]

LABELS = ("the least damper of each device", "the damper of each device that settles it soonest")
"""The two choices: the least that keeps presses still, and that of the quickest hard arrival."""
WIDTH = 1 + len(COLUMNS)
"""Of a choice in a row: its damping [N s/m], and the figures of `rows`."""


@dataclass(frozen=True)
class Damped(Held):
    """A device whose constant damper is given.

    Attributes:
        damping_n_s_per_m: that damper [N s/m].
    """

    damping_n_s_per_m: float = 0.0

    def params(self, law: LawSpec) -> LawParams:
        """The damper, whatever the law's values say."""
        params: LawParams = law.law.Params(damping_n_s_per_m=self.damping_n_s_per_m)
        return params


def chosen(devices: Sequence[Held], duration_s: float, criterion: Criterion, threads: int | None) -> list[Row]:
    """A row a device: of each choice its damping and its figures; a damping of NaN is no choice, and 0 was run."""
    law = LawSpec("damper", "damper", {})
    found: list[Row] = [[] for _ in devices]
    for damping in (
        least_damping(devices, criterion, threads),
        fastest_damping(devices, HARD, criterion, threads),
    ):
        given = [_with(device, float(value)) for device, value in zip(devices, np.nan_to_num(damping), strict=True)]
        for row, value, figures in zip(found, damping, rows(given, law, duration_s, criterion, threads), strict=True):
            row += [float(value), *figures]
    return found


def _with(device: Held, damping_n_s_per_m: float) -> Damped:
    return Damped(
        **{field.name: getattr(device, field.name) for field in fields(Held)}, damping_n_s_per_m=damping_n_s_per_m
    )
