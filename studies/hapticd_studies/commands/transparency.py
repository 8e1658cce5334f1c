"""`hapticd study transparency`: hands that move, under every law."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from hapticd.errors import ConfigError
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, require_memory, write

if TYPE_CHECKING:  # they need the extra `study`
    from hapticd_studies.law_spec import LawSpec
    from hapticd_studies.transparency.report import TransparencyReport

_FILES = ("transparency.csv", "transparency.json", "transparency.png")
_MOST_DEVICES = 1_000_000
_MOST_SECONDS = 3600.0
_QUICK_DEVICES, _QUICK_SECONDS = 14, 6.0


def command(
    devices: Annotated[int, typer.Option(help="How many devices; the hands take turns.")] = 490,
    seconds: Annotated[float, typer.Option(help="How long each hand moves [s].")] = 20.0,
    seed: Annotated[int, typer.Option(help="Of the devices; the same seed gives the same ones anywhere.")] = 1,
    laws: Annotated[
        str, typer.Option(help="all: every law; or some, as ring-damping,damper:damping_n_s_per_m=20.")
    ] = "all",
    quick: Annotated[bool, typer.Option("--quick", help="14 devices, 6 s, four laws: about 20 s on one core.")] = False,
    out_of_sample: Annotated[
        bool,
        typer.Option(
            "--out-of-sample",
            help="Devices that no law was made for: forces any part of a sample late, flexible handles.",
        ),
    ] = False,
    replay: Annotated[str | None, typer.Option(help="One device again, SEED:INDEX.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Folder of the results; `transparency`, and with --replay none, if not given."
        ),
    ] = None,
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Let hands move on random devices under every law, and score what they are given and what they feel.

    They press, tap, stroke, tremble, hold, regrip and let go, on walls of 0.2 to 5 times what a device holds by itself.
    Force errors, pulls, work over the leak,
    damping over the least that holds (by bisection), settling over the best constant damper, displayed stiffness, and
    what of the rest is felt. Writes a picture, CSV and JSON. Interrupted, the same command goes on where it was.

    Example: hapticd study transparency --seed 7 --output hands

    Example: hapticd study transparency --replay 7:57
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_cluster(cluster)
    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.transparency.sweep import QUICK, TransparencyPlan, every_law

    if quick:
        devices, seconds = min(devices, _QUICK_DEVICES), min(seconds, _QUICK_SECONDS)
    if not 1 <= devices <= _MOST_DEVICES:
        raise ConfigError(f"--devices {devices}: must be from 1 to {_MOST_DEVICES}")
    if not 1.0 <= seconds <= _MOST_SECONDS:
        raise ConfigError(f"--seconds {seconds:g}: must be from 1 to {_MOST_SECONDS:g}")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    if quick and laws == "all":
        laws = QUICK
    chosen = every_law() if laws == "all" else parse_laws(laws, {})

    if replay is not None:
        drawn = parse_laws(QUICK, {}) if laws == "all" else chosen
        _replay(replay, out_of_sample, chosen, drawn, seconds, output)
        return

    require_memory(1000.0 * devices * (len(chosen) + 1) + 4e7 * seconds, f"--devices {devices}")
    folder = output or Path("transparency")
    require_folder(folder, _FILES)

    from hapticd.offline.outcome import Criterion
    from hapticd_studies.grid.run import kept, run
    from hapticd_studies.transparency.plot import draw
    from hapticd_studies.transparency.report import report

    plan = TransparencyPlan(seed, devices, seconds, chosen, Criterion(), out_of_sample)
    Console(stderr=True, highlight=False).print(
        f"{devices} devices, {len(chosen)} laws, hands of {seconds:g} s: {plan.ticks / 1e6:.0f} million ticks and the "
        "constant dampers",
        soft_wrap=True,
    )
    job = plan.job()
    with kept(job, folder / "transparency.journal", fresh) as journal:
        found = report(plan, plan.tables(run(job, journal, "transparency", cluster)))
        for file, content in zip(_FILES, (found.csv(), found.json(), draw(found)), strict=True):
            write(folder / file, content)
    if as_json:
        typer.echo((folder / "transparency.json").read_text(), nl=False)
        return
    _show(found)
    Console(highlight=False).print(f"{folder}: {', '.join(_FILES)}", soft_wrap=True, markup=False)


def _show(found: TransparencyReport) -> None:
    from hapticd_studies.transparency.devices import OUT_OF_SAMPLE
    from hapticd_studies.transparency.report import AT_REST_WORDS, MOVING_WORDS

    plan = found.plan
    console = Console(highlight=False)
    console.print(
        f"{found.summaries['all'][0].devices} of {plan.count} devices are held by some constant damper; of them:"
    )
    for head, table, words in (
        ("Hands that come to stay", found.at_rest(), AT_REST_WORDS),
        ("Hands that move", found.moving(), MOVING_WORDS),
    ):
        console.print(f"\n[bold]{head}[/]", table, words, sep="\n")
    if plan.out_of_sample:
        console.print("\n[bold]By what they have[/]", found.parts(), f"Out of sample: {OUT_OF_SAMPLE}", sep="\n")
    asked = " --out-of-sample" if plan.out_of_sample else ""
    console.print(
        f"\nOne again: hapticd study transparency{asked} --seconds {plan.duration_s:g} --replay {plan.seed}:0",
        soft_wrap=True,
    )
    console.print(f"{plan.criterion.words()}", soft_wrap=True, markup=False)


def _replay(
    text: str,
    out_of_sample: bool,
    laws: Sequence[LawSpec],
    drawn: Sequence[LawSpec],
    duration_s: float,
    output: Path | None,
) -> None:
    from hapticd.offline.outcome import Criterion
    from hapticd_studies.transparency.replay import device_of, figures, write_files

    device = device_of(text, out_of_sample)
    if output is not None:
        require_folder(output, ())
    console = Console(highlight=False)
    for name, value in device.figures().items():
        console.print(f"{name} = {value}", markup=False)
    console.print()
    console.print(figures(device, laws, duration_s, Criterion()))
    if output is not None:
        for path in write_files(device, drawn, duration_s, Criterion(), output):
            console.print(str(path), soft_wrap=True, markup=False)
