"""What is wrong with a place, and what is right as far as double precision goes only: by bounds of its own."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hapticd_studies.extremes import exact
from hapticd_studies.extremes.case import LoopCase
from hapticd_studies.extremes.ceilings import Break
from hapticd_studies.extremes.sweep import BALANCE_SHARE
from hapticd_studies.extremes.verdict import MARGIN, Verdict


@dataclass(frozen=True, slots=True)
class ExtremesFinding:
    """Something about a place that does not agree.

    Attributes:
        kind: in a word.
        text: what, in figures.
        explained: by which limit of double precision; empty: by none.
    """

    kind: str
    text: str
    explained: str = ""


def findings(place: LoopCase, row: Mapping[str, float]) -> list[ExtremesFinding]:
    """Everything about a place that does not agree to the letter.

    Args:
        place: the place.
        row: its row, by the names of `sweep.COLUMNS`.
    """
    if row["refused"] == 2.0:
        return [ExtremesFinding("refusal", "refused, but not beyond the limit that is named")]
    if row["refused"] == 1.0:
        return []
    found = []
    if math.isnan(row["log_growth"]) or not row["finite"]:
        found.append(ExtremesFinding("not a number", "a value is not a finite number"))
    elif row["stepped"] != row["exact"]:
        found.append(_verdict(place, row))
    if row["same_radius"] != 1.0:
        found.append(_radius(place, row))
    for name, bound, title in (
        ("balance", "balance_rounding", "books"),
        ("wall_balance", "wall_rounding", "books of the wall"),
        ("ledger", "wall_rounding", "ledger"),
    ):
        off, most = row[name], row[bound]
        if not off <= BALANCE_SHARE:
            text = f"off by {off:.2g} of what went through"
            why = f"rounding of this motion may reach {most:.2g}" if off <= most else ""
            found.append(ExtremesFinding(title, text, why))
    if row["left_range"] == 2.0:
        found.append(
            ExtremesFinding("range", f"ended after {row['ticks']:.0f} ticks, but the exact step is within range")
        )
    if row["law_break"] == Break.FAULT:
        damping = row["damping_n_s_per_m"]
        found.append(
            ExtremesFinding(
                "law", f"{place.law} brings {damping:.4g} N s/m, more than promised or than a ceiling allows"
            )
        )
    return found


def _radius(place: LoopCase, row: Mapping[str, float]) -> ExtremesFinding:
    stepped, true, most = math.exp(min(row["log_growth"], 709.0)), float(exact.growth(place, 17)), exact.rounding(place)
    text = f"spectral radius stepped {stepped:.17g}, exact {true:.17g}"
    return ExtremesFinding("radius", text, f"rounding moves it by {most:.2g}" if abs(stepped - true) <= most else "")


def _verdict(place: LoopCase, row: Mapping[str, float]) -> ExtremesFinding:
    radius, most = exact.growth(place, 17), exact.rounding(place)
    distance = min(abs(float(radius - 1) - MARGIN), abs(float(radius - 1) + MARGIN))
    words = Verdict(int(row["stepped"])).words, Verdict(int(row["exact"])).words
    text = f"stepped {words[0]}, exact {words[1]}; the exact radius is {distance:.2g} from the edge of that"
    return ExtremesFinding("verdict", text, f"rounding moves it by {most:.2g}" if distance <= most else "")
