"""The results as table, CSV and JSON: shares that settle, bars that must hold, and the reason of every failure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from hapticd.offline.felt import JUST_FELT
from hapticd.offline.outcome import Outcome
from hapticd.version import __version__
from hapticd_studies.grid.output import as_csv, as_json
from hapticd_studies.robustness.devices import DRAWN, DURATION_S, WITHIN_REACH, Device
from hapticd_studies.robustness.readings import PAPER, short
from hapticd_studies.robustness.sweep import COLUMNS, RobustnessPlan

BARS = {"no delay": 0.995, "one sample of delay": 0.99}
"""Least share of the devices within reach that the paper's law must settle with its defaults."""


@dataclass(frozen=True, slots=True)
class Share:
    """How many of a group settled."""

    settled: int
    devices: int

    @property
    def share(self) -> float:
        """Settled ones among them; an empty group has nothing against it."""
        return self.settled / self.devices if self.devices else 1.0


@dataclass(frozen=True, slots=True)
class RobustnessSummary:
    """One reading.

    Attributes:
        reading: its label.
        prompt, late: devices within reach without and with one sample of delay.
        beyond: devices beyond the reach of damping.
        not_felt: of those that settled, the ones whose rest is below the threshold of touch.
        median_felt: median felt index of those that settled; None when none did.
        median_chatter_n: median span of their force over the last second [N].
        median_settled_s: median settling time of those that settled; None when none did [s].
        median_damping_n_s_per_m: median damping at the end.
    """

    reading: str
    prompt: Share
    late: Share
    beyond: Share
    not_felt: Share
    median_felt: float | None
    median_chatter_n: float | None
    median_settled_s: float | None
    median_damping_n_s_per_m: float


@dataclass(frozen=True, slots=True)
class FeltMass:
    """The mass that the law identified over the mass that moved.

    Attributes:
        devices: how many have an estimate.
        unknown: how many have none.
        low, median, high: 5th, 50th and 95th percentile of the ratio; None without any.
    """

    devices: int
    unknown: int
    low: float | None
    median: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Failure:
    """A device that did not settle."""

    device: str
    within_reach: bool
    reason: str
    command: str


@dataclass(frozen=True, slots=True)
class RobustnessReport:
    """A finished study.

    Attributes:
        plan: what was wanted.
        devices: all of them.
        tables: of each reading a row a device.
        summaries: of each reading.
        failures: devices that the paper's law with its defaults did not settle.
        felt_mass: of the paper's law; None when it was not run.
    """

    plan: RobustnessPlan
    devices: Sequence[Device]
    tables: Sequence[np.ndarray[Any, Any]]
    summaries: Sequence[RobustnessSummary]
    failures: Sequence[Failure]
    felt_mass: FeltMass | None

    @property
    def bars(self) -> list[tuple[str, Share, float, bool]]:
        """Name, what was reached, what is asked for, and whether it holds; empty when the law was not run."""
        for one in self.summaries:
            if one.reading == PAPER:
                groups = zip(BARS.items(), (one.prompt, one.late), strict=True)
                return [(name, group, least, group.share >= least) for (name, least), group in groups]
        return []

    def table(self) -> Table:
        """For the terminal: a line a reading."""
        shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        shown.add_column("law, reading", overflow="fold")
        for head in ("no delay", "1 sample late", "beyond", "in", "not felt", "chatter"):
            shown.add_column(head, justify="right", no_wrap=True)
        for one in self.summaries:
            name, values = short(one.reading)
            label = f"  {escape(values)}" if values else f"[bold]{escape(name)}[/]"
            settled = "" if one.median_settled_s is None else f"{one.median_settled_s:.2f} s"
            chatter = "" if one.median_chatter_n is None else f"{one.median_chatter_n:.2g} N"
            beyond = f"{one.beyond.settled}/{one.beyond.devices}"
            shares = [_percent(one.prompt), _percent(one.late), beyond, settled, _percent(one.not_felt), chatter]
            shown.add_row(label, *shares)
        return shown

    def json(self) -> bytes:
        """For programs; the figures of each device are in the CSV file."""
        return as_json(
            {
                "study": "robustness",
                "hapticd": __version__,
                "seed": self.plan.seed,
                "devices": len(self.devices),
                "drawn": DRAWN,
                "duration_s": DURATION_S,
                "within_reach": f"stiffness below {WITHIN_REACH:g} of the damper peak, hand force of the force limit",
                "criterion": self.plan.criterion.declared(),
                "readings": [asdict(one) for one in self.summaries],
                "bars": [
                    {"devices": name, "share": group.share, "least": least, "holds": holds}
                    for name, group, least, holds in self.bars
                ],
                "not_settled": [asdict(one) for one in self.failures],
                "felt_mass_over_true": asdict(self.felt_mass) if self.felt_mass else None,
            }
        )

    def csv(self) -> bytes:
        """One line a device and reading."""
        first = self.devices[0].figures()
        return as_csv(("reading", "device", "within_reach", *first, *COLUMNS), self._rows())

    def _rows(self) -> Iterator[list[Any]]:
        for reading, table in zip(self.plan.readings, self.tables, strict=True):
            for device, (outcome, *figures) in zip(self.devices, table.tolist(), strict=True):
                verdict = Outcome(int(outcome)).name.lower()
                known = device.figures().values()
                yield [reading.label, device.name, int(device.within_reach), *known, verdict, *figures]


def report(plan: RobustnessPlan, tables: Sequence[np.ndarray[Any, Any]]) -> RobustnessReport:
    """Sum up a finished study."""
    devices = plan.devices
    summaries = [_summary(r.label, devices, table) for r, table in zip(plan.readings, tables, strict=True)]
    failures: list[Failure] = []
    felt = None
    for reading, table in zip(plan.readings, tables, strict=True):
        if reading.label == PAPER:
            failures = [
                Failure(device.name, device.within_reach, reason(device, row), replay(device))
                for device, row in zip(devices, table.tolist(), strict=True)
                if row[0] != Outcome.SETTLED
            ]
            felt = felt_mass(devices, table)
    return RobustnessReport(plan, devices, tables, summaries, failures, felt)


def reason(device: Device, row: Sequence[float]) -> str:
    """What a device did instead of settling, and what it asked for."""
    outcome, span_m, deeper_m = Outcome(int(row[0])), row[1], row[2]
    if outcome is Outcome.SETTLED:
        return outcome.words
    if outcome is Outcome.ELSEWHERE:
        did = f"rests {abs(deeper_m) * 1e3:.2g} mm too {'deep' if deeper_m > 0.0 else 'shallow'}"
    else:
        did = f"{outcome.words}, {span_m * 1e3:.2g} mm" if outcome is Outcome.MOVING else outcome.words
    asked = f"wall at {100.0 * device.peak_share:.0f} % of what any damping holds"
    if device.force_share >= WITHIN_REACH:
        asked += f", hand at {100.0 * device.force_share:.0f} % of the force limit"
    return f"{did}; {asked}"


def replay(device: Device) -> str:
    """The command that runs one device again."""
    return f"hapticd study robustness --only {device.name}"


def felt_mass(devices: Sequence[Device], table: np.ndarray[Any, Any]) -> FeltMass:
    """How well the law knew the mass."""
    ratio = table[:, COLUMNS.index("felt_mass_kg")] / np.array([device.mass_kg for device in devices])
    known = ratio[ratio > 0.0]
    if not len(known):
        return FeltMass(0, len(ratio), None, None, None)
    low, median, high = (float(value) for value in np.percentile(known, [5.0, 50.0, 95.0]))
    return FeltMass(len(known), len(ratio) - len(known), low, median, high)


def _summary(label: str, devices: Sequence[Device], table: np.ndarray[Any, Any]) -> RobustnessSummary:
    settled = table[:, 0] == Outcome.SETTLED
    reach = np.array([device.within_reach for device in devices])
    late = np.array([device.delayed for device in devices])
    times = table[settled, COLUMNS.index("settled_s")]
    times = times[~np.isnan(times)]
    prompt, delayed, beyond = (
        Share(int(settled[group].sum()), int(group.sum())) for group in (reach & ~late, reach & late, ~reach)
    )
    felt, chatter_n = (table[settled, COLUMNS.index(name)] for name in ("felt_index", "force_chatter_n"))
    return RobustnessSummary(
        label,
        prompt,
        delayed,
        beyond,
        not_felt=Share(int((felt <= JUST_FELT).sum()), len(felt)),
        median_felt=float(np.median(felt)) if len(felt) else None,
        median_chatter_n=float(np.median(chatter_n)) if len(felt) else None,
        median_settled_s=float(np.median(times)) if len(times) else None,
        median_damping_n_s_per_m=float(np.median(table[:, COLUMNS.index("damping_n_s_per_m")])),
    )


def _percent(group: Share) -> str:
    return f"{100.0 * group.share:.1f} %" if group.devices else ""
