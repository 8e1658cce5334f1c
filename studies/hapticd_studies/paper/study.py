"""The whole study: first all runs, then claims, figures and report, into one folder."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hapticd.figures.picture import encoded
from hapticd.offline.outcome import Criterion
from hapticd.version import __version__
from hapticd_studies.grid.output import as_json, write
from hapticd_studies.paper import readings, starts, style
from hapticd_studies.paper.claims import HELD, Claim, Evidence
from hapticd_studies.paper.judge import judge
from hapticd_studies.paper.plates import PLATES
from hapticd_studies.paper.recording import record
from hapticd_studies.paper.report import report
from hapticd_studies.paper.runs import Runs
from hapticd_studies.paper.scenarios import SCENARIOS
from hapticd_studies.paper.tables import tables

LONG_RUNS = ("fig9-12-off", *HELD, "fig9-18-continuous", "fig9-20-continuous")
"""Watched for a bound on what they generate."""

Progress = Callable[[str, float], None]
"""Told what is being done, and what share of it all has just been."""


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is run.

    Attributes:
        size: of the studies over many starts.
        long_s: how long a long contact is [s].
        dots_per_inch: of the figures.
        all_readings: whether every reading is tried.
    """

    size: starts.Size
    long_s: float
    dots_per_inch: int
    all_readings: bool


FULL = Extent(starts.FULL, 60.0, 200, all_readings=True)
QUICK = Extent(starts.QUICK, 15.0, 80, all_readings=False)


def gather(extent: Extent, progress: Progress) -> Evidence:
    """Run everything."""
    runs = Runs()
    shares = starts.ask(runs, extent.size)
    table = readings.ask(runs, quick=not extent.all_readings)
    recordings = {}
    for name, scenario in SCENARIOS.items():
        recordings[name] = record(scenario)
        progress(f"running {name}", 0.1 / len(SCENARIOS))
    long = {}
    for name in LONG_RUNS:
        long[name] = record(SCENARIOS[name], extent.long_s)
        progress(f"watching {name}", 0.1 / len(LONG_RUNS))
    progress("compiling the laws", 0.0)
    runs.run(starts.DURATION_S, lambda done: progress(f"{runs.count} runs", 0.6 * done / runs.count))
    return Evidence(recordings, {name: run.figures() for name, run in recordings.items()}, long, shares, table)


def publish(evidence: Evidence, folder: Path, dots_per_inch: int, command: str, progress: Progress) -> list[Claim]:
    """Judge, draw and write.

    Args:
        evidence: what was run.
        folder: where to; it and its `scenarios` must exist.
        dots_per_inch: of the figures.
        command: what repeats it, for the report.
        progress: hears of it.
    """
    claims = judge(evidence)
    pictures: dict[str, bytes] = {}
    with style.look(dots_per_inch):
        for plate in PLATES:
            progress(f"drawing {plate.name}", 0.0)
            pictures[plate.name] = encoded(plate.draw(evidence), ".png")
            write(folder / f"{plate.name}.png", pictures[plate.name])
            progress(f"drawing {plate.name}", 0.2 / len(PLATES))
    made = f"hapticd {__version__}, Python {platform.python_version()}, {len(evidence.shares.drops_m)} starts a share."
    for name, scenario in SCENARIOS.items():
        write(folder / "scenarios" / f"{name}.toml", scenario.text().encode())
    write(folder / "claims.json", as_json(_results(evidence, claims, command, made)))
    write(folder / "readings.json", as_json(evidence.table.declared()))
    write(folder / "tables.md", tables(claims, evidence.table).encode())
    write(folder / "report.html", report(evidence, claims, pictures, command, made).encode())
    return claims


def _results(evidence: Evidence, claims: list[Claim], command: str, made: str) -> dict[str, Any]:
    return {
        "command": command,
        "made": made,
        "criterion": Criterion().declared(),
        "claims": [claim.declared() for claim in claims],
        "runs": {name: figures.declared() for name, figures in evidence.figures.items()},
    }
