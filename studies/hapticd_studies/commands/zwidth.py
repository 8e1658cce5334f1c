"""`hapticd study zwidth`: maps of what is stable."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hapticd.config.loading import load, parse
from hapticd.errors import ConfigError
from hapticd.paths import directory
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, require_memory, write

_FILES = ("zwidth.csv", "zwidth.json", "zwidth.png")
_METHODS = ("grid", "bisect")


def command(
    x: Annotated[str, typer.Option(help="Parameter across, NAME=LOW..HIGH[:log].")] = "stiffness=1e3..40e3",
    y: Annotated[str, typer.Option(help="Parameter upwards, NAME=LOW..HIGH[:log].")] = "mass=0.1..1",
    laws: Annotated[
        str, typer.Option(help="Laws side by side, with parameters where wanted: energy-cycle:cap=none.")
    ] = "none,tdpa,energy-cycle",
    cells: Annotated[str, typer.Option(help="Values across x values upwards.")] = "100x100",
    method: Annotated[
        str, typer.Option(help="grid: every cell; bisect: along x the one edge of each line, to within a cell.")
    ] = "grid",
    duration: Annotated[float, typer.Option(help="Simulated time of a press [s].")] = 5.0,
    starts: Annotated[
        int, typer.Option(min=1, max=1000, help="Presses of a cell, evenly from 0 to 10 mm higher; all must settle.")
    ] = 1,
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", help="Configuration of the press; the shipped omega7 device when not given."),
    ] = None,
    assign: Annotated[
        list[str] | None,
        typer.Option("--set", help="Replace a value of it, KEY=VALUE or NAME=VALUE with a name as of an axis."),
    ] = None,
    still: Annotated[float, typer.Option(help="Largest span of the position that counts as still [m].")] = 5e-5,
    place: Annotated[float, typer.Option(help="Largest error of the depth that counts as in place, a share.")] = 0.1,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("zwidth"),
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Map where laws keep a pressed wall stable, over any two parameters.

    Parameters: stiffness, damping (of the wall), rate, mass, viscous, friction, quantisation, noise, delay, hand-force,
    force-limit, drop, hand-mass, hand-damping, hand-stiffness. Writes a picture with the analytic limits, CSV and JSON.
    Interrupted, the same command goes on where it was.

    Example: hapticd study zwidth --y rate=500..4000 --laws none,energy-cycle
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_cluster(cluster)

    from hapticd.offline.outcome import Criterion
    from hapticd.offline.rehearsal import ticks_in
    from hapticd_studies.grid.run import kept, run
    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.zwidth.plane import QUANTITIES, parse_axis
    from hapticd_studies.zwidth.plot import draw
    from hapticd_studies.zwidth.report import report
    from hapticd_studies.zwidth.scenario import changing, scenario_of, with_values
    from hapticd_studies.zwidth.sweep import ZwidthPlan

    columns, rows = _cells(cells)
    across, upwards = (parse_axis(text, count, name) for text, count, name in ((x, columns, "--x"), (y, rows, "--y")))
    if across.quantity.name == upwards.quantity.name:
        raise ConfigError(f"--y {y}: --x varies {across.quantity.name} already")
    if method not in _METHODS:
        raise ConfigError(f"--method {method}: must be grid or bisect")
    if method == "bisect" and across.quantity.whole:
        raise ConfigError(f"--x {x}: bisection needs a parameter without steps; give {across.quantity.name} to --y")
    _positive("--duration", duration, "s")
    _positive("--still", still, "m")
    _positive("--place", place, "")

    loaded = load(config or directory("config") / "wall-12-energy-cycle.toml")
    name = str(loaded.path)
    text = with_values(loaded.text, name, assign or [], {key: one.key for key, one in QUANTITIES.items()})
    loaded = parse(text, name)
    ticks_in(loaded, duration)  # refuses a time without end
    changed = changing(scenario_of(loaded))
    for axis, option in ((across, f"--x {x}"), (upwards, f"--y {y}")):
        if axis.quantity.key in changed:
            raise ConfigError(f"{option}: {name} changes {axis.quantity.key} over time; take that out")
    readings = parse_laws(laws, {loaded.config.controller.law: loaded.config.controller.params})
    plan = ZwidthPlan(
        text, name, readings, across, upwards, method, duration, starts, Criterion(still_m=still, place_share=place)
    )
    require_folder(output, _FILES)

    job = plan.job()
    with kept(job, output / "zwidth.journal", fresh) as journal:
        blocks = run(job, journal, "zwidth", cluster)
        found = report(plan, plan.tables(blocks))
        for file, content in zip(
            _FILES, (found.csv(), found.json(), draw(plan, found.tables, found.curves)), strict=True
        ):
            write(output / file, content)
    if as_json:
        typer.echo((output / "zwidth.json").read_text(), nl=False)
        return
    console = Console(highlight=False)
    console.print(found.table())
    console.print(f"\n{plan.criterion.words()}", soft_wrap=True, markup=False)
    console.print(f"{output}: {', '.join(_FILES)}", soft_wrap=True, markup=False)


def _cells(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,9})x(\d{1,9})", text)
    columns, rows = (int(found[1]), int(found[2])) if found else (0, 0)
    if columns < 2 or rows < 1:
        raise ConfigError(f"--cells {text}: must be COLUMNSxROWS, at least 2x1, as 100x100")
    # Before any list is made: an axis alone could fill the memory.
    require_memory(400.0 * (columns + rows) + 300.0 * columns * rows, f"--cells {text}")
    return columns, rows


def _positive(option: str, value: float, unit: str) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise ConfigError(f"{option} {value:g}: must be more than 0 {unit}".rstrip())
