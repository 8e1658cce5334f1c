"""`hapticd study robustness`: random devices under every law."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from hapticd.errors import ConfigError
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, require_memory, write

if TYPE_CHECKING:  # it needs the extra `study`
    from hapticd_studies.robustness.report import RobustnessReport

_FILES = ("robustness.csv", "robustness.json", "robustness.png")
_MOST_DEVICES = 10_000_000
_LISTED = 8


def command(
    devices: Annotated[int, typer.Option(help="How many devices.")] = 1000,
    seed: Annotated[int, typer.Option(help="Of the devices; the same seed gives the same ones anywhere.")] = 1,
    laws: Annotated[
        str, typer.Option(help="all: every law and every reading of the paper; or some, as energy-cycle:cap=none,tdpa.")
    ] = "all",
    only: Annotated[str | None, typer.Option(help="One device again, SEED:INDEX.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder of the results; `robustness`, and with --only none, when not given."
        ),
    ] = None,
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Press random devices into random walls under every law, and count which settle.

    Settled means still and in place. Devices whose wall or hand asks for more than damping can give are counted apart.
    Every device that energy-cycle does not settle is listed with the reason and the command that replays it. Writes a
    picture, CSV and JSON. Interrupted, the same command goes on where it was.

    Example: hapticd study robustness --seed 7 --output robust

    Example: hapticd study robustness --only 7:57 --output robust
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_cluster(cluster)
    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.robustness.readings import every_reading

    if only is not None:
        _replay(only, laws, output)
        return
    if not 1 <= devices <= _MOST_DEVICES:
        raise ConfigError(f"--devices {devices}: must be from 1 to {_MOST_DEVICES}")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    readings = every_reading() if laws == "all" else parse_laws(laws, {})
    require_memory(2000.0 * devices * (len(readings) + 2), f"--devices {devices}")
    folder = output or Path("robustness")
    require_folder(folder, _FILES)

    from hapticd.offline.outcome import Criterion
    from hapticd_studies.grid.run import kept, run
    from hapticd_studies.robustness.plot import draw
    from hapticd_studies.robustness.report import report
    from hapticd_studies.robustness.sweep import RobustnessPlan

    plan = RobustnessPlan(seed, devices, readings, Criterion())
    job = plan.job()
    with kept(job, folder / "robustness.journal", fresh) as journal:
        found = report(plan, plan.tables(run(job, journal, "robustness", cluster)))
        for file, content in zip(_FILES, (found.csv(), found.json(), draw(found)), strict=True):
            write(folder / file, content)
    if as_json:
        typer.echo((folder / "robustness.json").read_text(), nl=False)
        return
    _show(found, folder / _FILES[1])
    console = Console(highlight=False)
    console.print(f"{plan.criterion.words()}", soft_wrap=True, markup=False)
    console.print(f"{folder}: {', '.join(_FILES)}", soft_wrap=True, markup=False)


def _show(found: RobustnessReport, file: Path) -> None:
    from hapticd_studies.robustness.readings import SHORT, short

    console = Console(highlight=False)
    console.print(found.table())
    used = [word for word in SHORT if any(word in short(reading.label)[1] for reading in found.plan.readings)]
    console.print(*(f"{word}: {SHORT[word]}" for word in used), sep="; ", markup=False, soft_wrap=True)
    console.print()
    for name, group, least, holds in found.bars:
        verdict = "[green]PASS[/]" if holds else "[red]FAIL[/]"
        console.print(
            f"{verdict} energy-cycle, {name}: {group.settled} of {group.devices}, at least {100.0 * least:g} %"
        )
    mass = found.felt_mass
    if mass and mass.median is not None:
        console.print(
            f"felt mass / true mass: median {mass.median:.2f}, 5-95 % {mass.low:.2f} to {mass.high:.2f}, unknown on "
            f"{mass.unknown} devices",
            soft_wrap=True,
        )
    near = [one for one in found.failures if one.within_reach]
    for one in near[:_LISTED]:
        console.print(f"{one.device}: {one.reason}: {one.command}", soft_wrap=True, markup=False)
    unlisted = len(found.failures) - len(near[:_LISTED])
    if unlisted:
        beyond = len(found.failures) - len(near)
        console.print(
            f"{unlisted} more do not settle, {beyond} of them beyond the reach of damping; each with its reason and "
            f"the command that replays it: {file}, not_settled",
            soft_wrap=True,
        )


def _replay(only: str, laws: str, output: Path | None) -> None:
    from hapticd.offline.outcome import Criterion
    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.robustness.devices import DURATION_S
    from hapticd_studies.robustness.readings import PAPER, every_reading
    from hapticd_studies.robustness.replay import device_of, outcomes, write_files

    device = device_of(only)
    readings = every_reading() if laws == "all" else parse_laws(laws, {})
    if output is not None:
        require_folder(output, ())
    console = Console(highlight=False)
    console.print(device.config(PAPER, {}), markup=False, soft_wrap=True)
    reach = "within reach" if device.within_reach else "beyond reach"
    console.print(
        f"# {reach}: wall at {100.0 * device.peak_share:.0f} % of what any damping holds, hand at "
        f"{100.0 * device.force_share:.0f} % of the force limit; {DURATION_S:g} s\n",
        soft_wrap=True,
    )
    console.print(outcomes(device, readings, Criterion()))
    if output is not None:
        drawn = parse_laws(f"none,{PAPER}", {}) if laws == "all" else readings
        for file in write_files(device, drawn, Criterion(), output):
            console.print(str(file), soft_wrap=True, markup=False)
