"""One place alone, interpreted: what the model makes of it beside what is exact, line by line."""

from __future__ import annotations

import math
from collections.abc import Mapping

from hapticd.simulation.plant import epochs
from hapticd_studies.extremes import exact
from hapticd_studies.extremes.case import LoopCase, refusal
from hapticd_studies.extremes.ceilings import Break
from hapticd_studies.extremes.findings import findings
from hapticd_studies.extremes.report import Line
from hapticd_studies.extremes.sweep import COLUMNS, rows_of
from hapticd_studies.extremes.verdict import Verdict


def replay(place: LoopCase) -> list[Line]:
    """What there is to say about a place."""
    row = dict(zip(COLUMNS, rows_of([place])[0].tolist(), strict=True))
    wrong = {one.kind: one for one in findings(place, row)}
    if row["refused"]:
        return [Line("refused", _refusal(place), row["refused"] == 1.0)]
    lines = [_linear(place, row)]
    for name, bound, title in (
        ("balance", "balance_rounding", "books"),
        ("wall_balance", "wall_rounding", "books of the wall"),
        ("ledger", "wall_rounding", "ledger"),
    ):
        text = f"off by {row[name]:.2g} of what went through; its rounding may reach {row[bound]:.2g}"
        if row[bound] >= 1.0:
            text = "less went through than rounding may make of it"
        lines.append(Line(title, text, title not in wrong or bool(wrong[title].explained)))
    lines.append(Line("run", _run(row), "range" not in wrong and "not a number" not in wrong))
    if not math.isnan(row["law_break"]):
        text = f"{place.law} brings at most {row['damping_n_s_per_m']:.4g} N s/m: {Break(int(row['law_break'])).words}"
        lines.append(Line("law", text, "law" not in wrong))
    explained = [Line(one.kind, f"{one.text}; {one.explained}", True) for one in wrong.values() if one.explained]
    return lines + explained


def _linear(place: LoopCase, row: Mapping[str, float]) -> Line:
    words = Verdict(int(row["exact"])).words
    stepped = "not a number" if math.isnan(row["log_growth"]) else f"{math.exp(min(row['log_growth'], 709.0)):.16g}"
    true = exact.growth(place, 16)
    same = row["stepped"] == row["exact"] and row["same_radius"] == 1.0
    return Line("linear loop", f"{words}; spectral radius stepped {stepped}, exact {true:.16g}", same)


def _run(row: Mapping[str, float]) -> str:
    if row["left_range"]:
        return f"beyond 1e6 m or 1e6 m/s after {row['ticks']:.0f} ticks"
    return f"{row['ticks']:.0f} ticks, {row['cycles']:.0f} energy cycles"


def _refusal(place: LoopCase) -> str:
    try:
        epochs(place.options(), place.period_s)
    except ValueError as error:
        return refusal(error)
    return "not any more"
