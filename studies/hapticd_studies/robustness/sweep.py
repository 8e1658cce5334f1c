"""Every device under every reading, judged, block by block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd.offline.felt import WINDOW_S
from hapticd.offline.outcome import Criterion
from hapticd.offline.presses import balance_m, judge, misplaced_m
from hapticd.simulation.batch import Batch
from hapticd_studies.felt_ends import felt_ends
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec
from hapticd_studies.robustness.devices import DURATION_S, Device, draw
from hapticd_studies.robustness.readings import params_on

COLUMNS = (
    "outcome",
    "peak_to_peak_m",
    "misplaced_m",
    "settled_s",
    "damping_n_s_per_m",
    "felt_mass_kg",
    "peak_force_n",
    "felt_index",
    "force_chatter_n",
    "misplaced_share",
)
"""Of each device: positive `misplaced_m` is too deep, `misplaced_share` the same of the depth where it should rest,
`settled_s` counts from the last change of the wall, `felt_index` and `force_chatter_n` are of the last second."""

_MOST_DEVICES = 250


@dataclass(frozen=True, slots=True)
class RobustnessPlan:
    """What is wanted.

    Attributes:
        seed: of all devices.
        count: how many.
        readings: laws and readings.
        criterion: what settled means.
    """

    seed: int
    count: int
    readings: Sequence[LawSpec]
    criterion: Criterion

    @property
    def devices(self) -> list[Device]:
        """The devices, in order."""
        return [draw(self.seed, index) for index in range(self.count)]

    def job(self) -> Job:
        """Cut into blocks, as many for each reading."""
        sizes = block_sizes(self.count, _MOST_DEVICES)
        spec = {
            "seed": self.seed,
            "laws": [{"label": r.label, "name": r.name, "values": dict(r.values)} for r in self.readings],
            "criterion": asdict(self.criterion),
            "sizes": sizes,
        }
        return Job(_block, spec, sizes * len(self.readings), tuple(sorted({r.name for r in self.readings})))

    def tables(self, blocks: Sequence[list[Row]]) -> list[np.ndarray[Any, Any]]:
        """Of each reading a table with a row a device."""
        sizes = block_sizes(self.count, _MOST_DEVICES)
        each = [blocks[at : at + len(sizes)] for at in range(0, len(blocks), len(sizes))]
        return [np.array(in_order(sizes, found)) for found in each]


def pressed(devices: Sequence[Device], reading: LawSpec, criterion: Criterion, threads: int | None = None) -> list[Row]:
    """The row of each device under a reading."""
    points = [device.point(params_on(reading, device), criterion) for device in devices]
    result = Batch(
        reading.law, points, DURATION_S, criterion.window_s, trace_every=1, ledger=False, trace_last_s=WINDOW_S
    ).run(threads)
    felt, chatter_n = felt_ends(points, result)
    misplaced = misplaced_m(points, result)
    rows: list[Row] = np.array(
        [
            judge(criterion, points, result),
            result.peak_to_peak_m,
            misplaced,
            result.settled_s - [device.last_change_s for device in devices],
            result.damping_n_s_per_m,
            result.felt_mass_kg,
            result.peak_force_n,
            felt,
            chatter_n,
            misplaced / np.abs([balance_m(point) for point in points]),
        ]
    ).T.tolist()
    return rows


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    sizes = spec["sizes"]
    devices = [draw(spec["seed"], index) for index in block_cells(sizes, block % len(sizes))]
    return pressed(devices, LawSpec(**spec["laws"][block // len(sizes)]), Criterion(**spec["criterion"]), threads)
