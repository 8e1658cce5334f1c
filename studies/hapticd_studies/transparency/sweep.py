"""Every device under every law, block by block; constant dampers first, which the laws are held against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.errors import PluginError
from hapticd.offline.outcome import Criterion
from hapticd.simulation.compiler.compile import compiled_step
from hapticd_studies.grid.job import Job, block_cells, block_sizes, in_order
from hapticd_studies.grid.journal import Row
from hapticd_studies.law_spec import LawSpec, parse_laws
from hapticd_studies.transparency.devices import Held, draw, draw_out_of_sample
from hapticd_studies.transparency.references import references
from hapticd_studies.transparency.runs import rows, seconds_of

QUICK = "none,damper,energy-cycle,ring-damping"
_ALSO = {"damper": ("damper:damping_n_s_per_m=20",), "tdpa": ("tdpa:reference=stored",)}
_LAST = ("energy-cycle", "ring-damping")

_MOST_DEVICES = 20  # a block's traces take about 4 MB a device and 20 s


@dataclass(frozen=True, slots=True)
class TransparencyPlan:
    """What is wanted.

    Attributes:
        seed: of all devices.
        count: how many.
        duration_s: of each moving hand [s].
        laws: those that are compared.
        criterion: what still and in place mean.
        out_of_sample: the devices have what no law was made for.
    """

    seed: int
    count: int
    duration_s: float
    laws: Sequence[LawSpec]
    criterion: Criterion
    out_of_sample: bool = False

    @property
    def devices(self) -> list[Held]:
        """The devices, in order."""
        one = draw_out_of_sample if self.out_of_sample else draw
        return [one(self.seed, index) for index in range(self.count)]

    @property
    def ticks(self) -> float:
        """How many ticks of the laws that is; the constant dampers take about as many as three laws."""
        return len(self.laws) * sum(device.rate_hz * seconds_of(self.duration_s) for device in self.devices)

    def job(self) -> Job:
        """Cut into blocks, as many for the constant dampers and for each law."""
        sizes = block_sizes(self.count, _MOST_DEVICES)
        spec = {
            "seed": self.seed,
            "out_of_sample": self.out_of_sample,
            "duration_s": self.duration_s,
            "laws": [{"label": law.label, "name": law.name, "values": dict(law.values)} for law in self.laws],
            "criterion": asdict(self.criterion),
            "sizes": sizes,
        }
        names = tuple(sorted({"damper", *(law.name for law in self.laws)}))
        return Job(_block, spec, sizes * (1 + len(self.laws)), names)

    def tables(self, blocks: Sequence[list[Row]]) -> list[np.ndarray[Any, Any]]:
        """A table of the constant dampers and one of each law, with a row a device."""
        sizes = block_sizes(self.count, _MOST_DEVICES)
        each = [blocks[at : at + len(sizes)] for at in range(0, len(blocks), len(sizes))]
        return [np.array(in_order(sizes, found), dtype=float) for found in each]


def every_law() -> list[LawSpec]:
    """Every installed law with its defaults, none first and the adaptive ones last, and some in a second reading."""
    names = sorted(plugins.names(plugins.CONTROLLERS), key=lambda name: (name != "none", name in _LAST, name))
    labels = []
    for name in names:
        try:
            compiled_step(plugins.law(name))
        except PluginError:
            continue  # somebody else's law, and it is not asked for by name
        labels += [name, *_ALSO.get(name, ())]
    return parse_laws(",".join(labels), {})


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    sizes = spec["sizes"]
    law, block = divmod(block, len(sizes))
    one = draw_out_of_sample if spec["out_of_sample"] else draw
    devices = [one(spec["seed"], index) for index in block_cells(sizes, block)]
    criterion = Criterion(**spec["criterion"])
    if law == 0:
        return references(devices, criterion, threads)
    return rows(devices, LawSpec(**spec["laws"][law - 1]), spec["duration_s"], criterion, threads)
