"""The trades as tables, sentences, CSV and JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rich.table import Table

from hapticd.offline.outcome import Criterion
from hapticd.version import __version__
from hapticd_studies.accuracy.continuous import BounceRow
from hapticd_studies.accuracy.control import SETTLING_S, STIFFNESSES_N_PER_M, RateRow, VelocityRow, WindowRow
from hapticd_studies.accuracy.cycles import Detection
from hapticd_studies.accuracy.model import ModelRow, ModelStudy
from hapticd_studies.accuracy.telemetry import BatchRow
from hapticd_studies.accuracy.traps import Trap
from hapticd_studies.grid.output import as_csv, as_json

_ALWAYS = ("exact", "explicit-euler x1", "semi-implicit-euler x1", "velocity-verlet x1", "rk4 x1", "exact, float32")
_ADAPTIVE = ("DOP853 1e-09, runs through", "DOP853 1e-09, stops at")
_WIDE = ("same forces", "no law")
_COLUMNS = (
    "setting", "family", "ns_a_period", "cost_ratio", "operations", "same_forces_m", "position_error_m",
    "energy_error_j", "leak_share", "leak_j_a_cycle", "analytic_leak_j_a_cycle", "linear_loop", "verdict",
    "felt_index", "force_chatter_n", "displayed_n_per_m", "pareto", "default",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class AccuracyReport:
    """Everything that was measured.

    Attributes:
        name: of the configuration.
        duration_s: of each run [s].
        below_m: the error that the sentence is about [m].
        model: settings of the device.
        single_ratio: cost of single over double precision, as machine code.
        traps: the paper's mass under the integrators that mislead.
        bounces: the device on a wall that is felt at all times; none without a wall.
        rates, velocities, windows, batches: the control side.
    """

    name: str
    duration_s: float
    below_m: float
    model: ModelStudy
    single_ratio: float
    traps: Sequence[Trap]
    bounces: Sequence[BounceRow]
    rates: Sequence[RateRow]
    velocities: Sequence[VelocityRow]
    windows: Sequence[WindowRow]
    batches: Sequence[BatchRow]

    @property
    def sentence(self) -> str:
        """What to choose."""
        chosen, default = self.model.choice(self.below_m), self.model.named(self.model.default)
        costs = f"{default.operations / chosen.operations:.2f} times that" if default is not chosen else "the same"
        return (
            f"For an error below {self.below_m:g} m choose {chosen.name}; the default ({default.name}) costs {costs} "
            f"and errs by {default.position_m:.2g} m."
        )

    @property
    def legend(self) -> str:
        """What the marks and units of the table mean."""
        text = "* nothing is both cheaper and more accurate; < the configuration's own"
        found = self.model.rows[0].leak
        if found is None:
            return text
        return f"{text}; leak in units of K T / 2, which is {_si(found.theory_per_cycle_j, 'J')} a cycle"

    def model_table(self, wide: bool = True) -> Table:
        """The settings on the front, the default, and those that everybody asks about.

        Args:
            wide: with the columns that 80 characters have no room for.
        """
        shown = _table("setting", "x cost", "error", *_WIDE[:1] * wide, "J a cycle", "leak", *_WIDE[1:] * wide)
        shown.add_column("run", overflow="fold")
        shown.add_column("N/m", justify="right")
        adaptive = [row.name for row in self.model.rows if row.family == "adaptive"]
        wanted = {*_ALWAYS, self.model.default, adaptive[2] if len(adaptive) > 2 else ""}
        best = self.model.choice(self.below_m).name
        for row in self.model.rows:
            if row.best or row.name in wanted or row.name == best or row.family == "without a term":
                mark = ("*" if row.best else " ") + ("<" if row.name == self.model.default else "")
                shown.add_row(f"{row.name} {mark}", *_model_cells(row, wide))
        return shown

    def control_tables(self) -> Iterator[Table]:
        """The trades on the control side."""
        rates = _table("rate", "x ticks", "KT/2", "error", "alone holds", "law holds")
        rates.add_column("run")
        for rate in self.rates:
            rates.add_row(
                f"{rate.rate_hz:g} Hz",
                f"{rate.cost:g}",
                _plain(rate.leak_n_s_per_m),
                _si(rate.position_m, "m"),
                _stiffness(rate.alone_n_per_m),
                _stiffness(rate.law_n_per_m, STIFFNESSES_N_PER_M[-1]),
                rate.verdict,
            )
        yield rates
        velocities = _table("velocity", "x cost", "rms error", "span", "false / cycles", "missed", "late")
        velocities.add_column("run")
        for one in self.velocities:
            velocities.add_row(
                one.name + (" <" if one.default else ""),
                f"{one.cost.ratio:.1f}",
                _si(one.error_m_per_s, "m/s"),
                _si(one.peak_to_peak_m, "m"),
                *_detection(one.cycles),
                one.verdict,
            )
        yield velocities
        windows = _table("cycle window", "false / cycles", "missed", "late", "law off: false", "missed", "late")
        for row in self.windows:
            windows.add_row(f"{row.window}+{row.window}", *_detection(row.closed), *_detection(row.open))
        yield windows
        batches = _table("telemetry batch", "mean wait", "longest", "cpu a tick", "x cost")
        for batch in self.batches:
            batches.add_row(
                f"{batch.batch_ticks}" + (" <" if batch.default else ""),
                _si(batch.mean_wait_s, "s"),
                _si(batch.longest_wait_s, "s"),
                f"{batch.cpu_us:.1f} us",
                f"{batch.ratio:.2f}",
            )
        yield batches

    def model_tables(self) -> Iterator[Table]:
        """What stands beside the settings."""
        bounces = _table("wall felt at all times", "error", "evaluations")
        for row in self.bounces:
            bounces.add_row(row.name, _si(row.error_m, "m"), str(row.evaluations))
        if self.bounces:
            yield bounces

    def sentences(self) -> Iterator[str]:
        """What the trades say, a line each."""
        yield self.sentence
        exact, explicit, semi = self.traps
        yield (
            f"One Euler step a sample is no model of a wall. The paper's mass and wall, no law, swing after 3 s: "
            f"{1e3 * exact.peak_to_peak_m:.1f} mm in truth (leak {exact.leak_share:.2f} of KT/2), explicit "
            f"{1e3 * explicit.peak_to_peak_m:.0f} mm ({explicit.leak_share:.2f}), semi-implicit "
            f"{1e3 * semi.peak_to_peak_m:.2f} mm ({semi.leak_share:.2f})."
        )
        if self.bounces:
            through, stops = (next(row for row in self.bounces if row.name.startswith(name)) for name in _ADAPTIVE)
            yield (
                f"A sampled wall needs no events; on one that is felt at all times DOP853 at 1e-9 errs by "
                f"{_si(stops.error_m, 'm')} when it stops at contact and by {_si(through.error_m, 'm')} when it does "
                f"not, for {stops.evaluations} and {through.evaluations} evaluations."
            )
        yield f"Compiled, single precision costs {self.single_ratio:.2f} times double."
        held = [row for row in self.rates if row.law_n_per_m is not None]
        if held:
            low, high = held[0], held[-1]
            yield (
                f"From {low.rate_hz:g} to {high.rate_hz:g} Hz ({high.cost / low.cost:g} times the ticks) the stiffest "
                f"wall that settles within {SETTLING_S:g} s goes from {_stiffness(low.law_n_per_m)} to "
                f"{_stiffness(high.law_n_per_m, STIFFNESSES_N_PER_M[-1])} N/m."
            )
        fails = [row.name for row in self.velocities if row.verdict not in ("settled", "runs")]
        if len(fails) == len(self.velocities):
            yield "The wall settles with none of the velocity estimators."
        elif fails:
            yield f"Velocity by {', '.join(fails)}: the wall does not settle."
        clean = min(self.windows, key=lambda row: (row.closed.false + row.closed.missed, row.window))
        if clean.closed.cycles:
            yield (
                f"Of the cycle windows {clean.window}+{clean.window} errs least here: {clean.closed.false} false and "
                f"{clean.closed.missed} missed of {clean.closed.cycles} cycles, late by "
                f"{_plain(clean.closed.late_ticks)} ticks."
            )
        one, own = self.batches[0], next(row for row in self.batches if row.default)
        yield (
            f"Batches of {own.batch_ticks} ticks wait {_si(own.longest_wait_s, 's')} at most and save "
            f"{100.0 * (1.0 - own.cpu_us / one.cpu_us):.0f} % of the processor time of single ticks."
        )

    def csv(self) -> bytes:
        """Every setting of the device."""
        return as_csv(_COLUMNS, (self._cells(row) for row in self.model.rows))

    def json(self) -> bytes:
        """Everything."""
        return as_json(
            {
                "study": "accuracy",
                "hapticd": __version__,
                "config": self.name,
                "duration_s": self.duration_s,
                "criterion": Criterion().declared(),
                "sentences": list(self.sentences()),
                "model": [dict(zip(_COLUMNS, self._cells(row), strict=True)) for row in self.model.rows],
                "single_over_double": self.single_ratio,
                "traps": [asdict(trap) for trap in self.traps],
                "continuous_wall": [asdict(row) for row in self.bounces],
                "rates": [asdict(row) for row in self.rates],
                "velocity": [asdict(row) for row in self.velocities],
                "cycle_windows": [asdict(row) for row in self.windows],
                "telemetry_batches": [asdict(row) for row in self.batches],
            }
        )

    def _cells(self, row: ModelRow) -> list[Any]:
        found = row.leak
        return [
            row.name, row.family, row.cost.ns, row.cost.ratio, row.operations, row.same_forces_m, row.position_m,
            row.energy_j, found.share if found else None, found.per_cycle_j if found else None,
            found.theory_per_cycle_j if found else None, found.words if found else None, row.verdict,
            row.felt_index, row.force_chatter_n, row.displayed_n_per_m, row.best, row.name == self.model.default,
        ]  # fmt: skip


def _model_cells(row: ModelRow, wide: bool) -> list[str]:
    found = row.leak
    return [
        f"{row.cost.ratio:.3g}",
        _si(row.position_m, "m"),
        *[_si(row.same_forces_m, "m")] * wide,
        _si(found.per_cycle_j, "J") if found else "",
        f"{found.share:.2f}" if found else "",
        *[found.words if found else ""] * wide,
        row.verdict,
        f"{row.displayed_n_per_m:.0f}" if math.isfinite(row.displayed_n_per_m) else "",
    ]


def _detection(found: Detection) -> list[str]:
    return [f"{found.false} / {found.cycles}", str(found.missed), _plain(found.late_ticks)]


def _plain(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"


def _stiffness(value: float | None, most: float = math.inf) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if value < most else f"over {most:.0f}"


def _si(value: float, unit: str) -> str:
    if value == 0.0:
        return f"0 {unit}"
    if not math.isfinite(value):
        return "-"
    for factor, prefix in ((1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"), (1e-12, "p")):
        if abs(value) >= 0.9995 * factor:
            return f"{value / factor:.3g} {prefix}{unit}"
    return f"{value:.0e} {unit}"


def _table(*heads: str) -> Table:
    shown = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    shown.add_column(heads[0], no_wrap=True)
    for head in heads[1:]:
        shown.add_column(head, justify="right", no_wrap=True)
    return shown
