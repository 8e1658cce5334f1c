"""Places by the block: each place's linear loop judged twice, and its run against the wall booked twice."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hapticd import plugins
from hapticd.simulation.batch import TRACE_COLUMNS, Batch, Point
from hapticd.simulation.options import SimulationOptions
from hapticd.simulation.plant import epochs
from hapticd_studies.extremes import energy_check, exact
from hapticd_studies.extremes.case import LAWS, RATES_HZ, LoopCase, draw, refusal
from hapticd_studies.extremes.ceilings import Break, law_breaks
from hapticd_studies.extremes.energy_check import TINIEST
from hapticd_studies.extremes.refusals import is_due
from hapticd_studies.extremes.step_map import growths, log_growth_in_decimals, stepped_map
from hapticd_studies.extremes.verdict import Verdict, verdict_of
from hapticd_studies.grid.job import Job, block_cells, in_order
from hapticd_studies.grid.journal import Row

TICKS = 1000
"""Ticks of a run against the wall."""

VALUE_SHARE = 1e-9
"""How close the two spectral radii should be, relative to the radius or to 1."""

BALANCE_SHARE = 1e-9
"""How close the books should be, relative to what went through them."""

COLUMNS = (
    "refused",
    "log_growth",
    "stepped",
    "exact",
    "same_radius",
    "in_decimals",
    "ticks",
    "left_range",
    "balance",
    "balance_rounding",
    "wall_balance",
    "wall_rounding",
    "ledger",
    "cycles",
    "damping_n_s_per_m",
    "law_break",
    "finite",
)
"""Of each place, NaN where it does not apply.

refused: 1: by a limit that was due, 2: by one that was not, 0: not. log_growth: logarithm of the spectral radius,
stepped. stepped, exact: `Verdict`. same_radius: 1 where the exact radius is the stepped one. in_decimals: 1 where
double precision did not suffice to square the map. ticks, left_range, finite, cycles: of the run. damping_n_s_per_m:
the most that the law brought in contact. balance, wall_balance: residual of all books and of the wall's own, over what
went through them; ledger: the same of the largest difference to the ledger; *_rounding: a bound of what rounding can do
to each. law_break: a `Break`, where the loop is stable without its law.
"""

_PLACES_A_BLOCK = 1250
_FEW = 200
_PROMISED = (0.6, 0.35)
"""What `energy-cycle` promises, told the mass: damping at most this many m/T, without and with delay."""


@dataclass(frozen=True, slots=True)
class ExtremesPlan:
    """What is wanted.

    Attributes:
        seed: of all places.
        count: how many.
    """

    seed: int
    count: int

    @property
    def sizes(self) -> tuple[int, ...]:
        """Places of each block; those of one block have one rate, since rates take turns."""
        rounds = -(-self.count // (_PLACES_A_BLOCK * len(RATES_HZ)))
        blocks = min(self.count, rounds * len(RATES_HZ))
        return tuple(len(range(block, self.count, blocks)) for block in range(blocks))

    def job(self) -> Job:
        """Cut into blocks."""
        spec = {"seed": self.seed, "count": self.count}
        return Job(_block, spec, self.sizes, tuple(sorted({law.partition(":")[0] for law in LAWS})))

    def table(self, blocks: Sequence[list[Row]]) -> np.ndarray[Any, Any]:
        """A row a place, in their order."""
        return np.array(in_order(self.sizes, blocks))


def rows_of(places: Sequence[LoopCase], threads: int | None = None) -> np.ndarray[Any, Any]:
    """The row of each place; all must have the same rate."""
    found = np.full((len(places), len(COLUMNS)), np.nan)
    column = {name: found[:, at] for at, name in enumerate(COLUMNS)}
    column["refused"][:] = column["in_decimals"][:] = 0.0
    taken: list[int] = []
    devices: list[SimulationOptions] = []
    for at, place in enumerate(places):
        try:
            options = place.options()
            epochs(options, place.period_s)
        except ValueError as error:
            column["refused"][at] = 1.0 if is_due(place, refusal(error)) else 2.0
            continue
        taken.append(at)
        devices.append(options)
    if not taken:
        return found
    kept = [places[at] for at in taken]
    linear = [device.model_copy(update={"resolution_m": 0.0, "max_force_n": 0.0}) for device in devices]
    for at, place, log_growth in zip(taken, kept, growths(kept, linear), strict=True):
        found[at, 1:5] = judge(place, float(log_growth))
        if math.isfinite(log_growth) and not (found[at, 2] == found[at, 3] and found[at, 4] == 1.0):
            # Powers of a map with close eigenvalues cancel: the map is judged, and not the arithmetic of squaring it.
            found[at, 1:5] = judge(place, log_growth_in_decimals(stepped_map(place)))
            column["in_decimals"][at] = 1.0
    for law in LAWS:
        group = [(at, device) for at, device in zip(taken, devices, strict=True) if places[at].law == law]
        if group:
            _press(places, group, found, threads)
    return found


def judge(place: LoopCase, log_growth: float) -> tuple[float, float, float, float]:
    """Logarithm of the spectral radius, both verdicts, and whether both radii are the same."""
    if math.isnan(log_growth):
        return log_growth, math.nan, float(exact.verdict(place)), 0.0
    stepped = verdict_of(log_growth)
    if -600.0 < log_growth < 600.0:
        radius = math.exp(log_growth)
        off = VALUE_SHARE * max(1.0, radius)
        if exact.between(place, radius - off, radius + off):
            # What encloses the exact radius decides, unless the edge of a verdict runs through it.
            verdicts = {verdict_of(math.log(max(end, TINIEST))) for end in (radius - off, radius + off)}
            truth = verdicts.pop() if len(verdicts) == 1 else exact.verdict(place)
            return log_growth, float(stepped), float(truth), 1.0
    return log_growth, float(stepped), float(exact.verdict(place)), 0.0


def _press(
    places: Sequence[LoopCase],
    group: Sequence[tuple[int, SimulationOptions]],
    found: np.ndarray[Any, Any],
    threads: int | None,
) -> None:
    """Run places with one law against their walls, and keep the books."""
    column = {name: found[:, at] for at, name in enumerate(COLUMNS)}
    chosen = [places[at] for at, _ in group]
    law = plugins.law(chosen[0].law_params()[0])
    points = [
        Point(device, place.wall(), law.Params.model_validate(place.law_params()[1]), place.period_s)
        for (_, device), place in zip(group, chosen, strict=True)
    ]
    batch = Batch(law, points, TICKS * points[0].period_s, trace_every=1)
    # A few places are not worth a compilation; both give the same to the last bit.
    result = batch.run(threads) if len(points) > _FEW else batch.run_interpreted()
    ended = zip(chosen, result.ticks.tolist(), result.finite.tolist(), strict=True)
    runs = [energy_check.run_of(place, ticks, finite) for place, ticks, finite in ended]
    booked = energy_check.balances(result.trace, runs)
    book = {name: booked[:, at] for at, name in enumerate(energy_check.FOUND)}
    at = [at for at, _ in group]
    turnover, wall_turnover = (np.maximum(book[name], TINIEST) for name in ("turnover_j", "wall_turnover_j"))
    off = np.abs(result.energy_j - book["wall_energy_j"])
    off = np.maximum(off, np.abs(result.generated_j - book["wall_generated_j"]))
    off = np.maximum(off, np.abs(result.dissipated_j - book["wall_dissipated_j"]))
    column["ticks"][at] = result.ticks
    column["left_range"][at] = np.where(result.finite, 0.0, np.where(book["left_range"] > 0.0, 1.0, 2.0))
    column["balance"][at] = np.abs(book["residual_j"]) / turnover
    column["balance_rounding"][at] = book["rounding_j"] / turnover
    column["wall_balance"][at] = np.abs(book["wall_residual_j"]) / wall_turnover
    column["wall_rounding"][at] = book["wall_rounding_j"] / wall_turnover
    column["ledger"][at] = off / wall_turnover
    column["cycles"][at] = result.cycles
    brought = _most_damping(result.trace)
    column["damping_n_s_per_m"][at] = brought
    finite = (book["finite"] > 0.0) & ~np.isnan(off)
    column["finite"][at] = finite
    for here, place, most in zip(at, chosen, brought.tolist(), strict=True):
        if column["exact"][here] == Verdict.STABLE:
            promised = _PROMISED[min(place.force_delay_samples, 1)] * place.mass_kg / place.period_s
            over = place.law.endswith("known-mass") and most > promised * (1.0 + 1e-9)
            column["law_break"][here] = Break.FAULT if over else law_breaks(place, most)


def _most_damping(traces: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """The largest damping of each run that acted: outside the wall a law sends nothing [N s/m]."""
    measured_m, damping = (traces[:, :, TRACE_COLUMNS.index(name)] for name in ("x_measured_m", "damping_n_s_per_m"))
    most: np.ndarray[Any, Any] = np.where(measured_m < 0.0, damping, 0.0).max(axis=1)
    return most


def _block(spec: dict[str, Any], block: int, threads: int | None) -> list[Row]:
    sizes = ExtremesPlan(spec["seed"], spec["count"]).sizes
    rows: list[Row] = rows_of([draw(spec["seed"], index) for index in block_cells(sizes, block)], threads).tolist()
    return rows
