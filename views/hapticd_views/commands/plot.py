"""`hapticd plot`: figures of recordings, of simulated runs, and of a daemon that runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from hapticd.errors import ConfigError
from hapticd.paths import DEFAULT_INSTANCE

LIVE = "live"
SCENE = "scene"


def plot(
    runs: Annotated[
        list[str],
        typer.Argument(metavar="FILE...|live", help="A .mcap, .csv or .npz; live: a running daemon, from now on."),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="A .png, .svg or .pdf file.")],
    figure: Annotated[
        str,
        typer.Option(
            "--figure",
            "-f",
            help="run, position, force, energy, damping, stiffness, loop, lateness, fig9 (the paper's), or scene: the "
            "path of one run in space among its objects.",
        ),
    ] = "run",
    from_s: Annotated[float | None, typer.Option("--from", help="Begin here [s].")] = None,
    to_s: Annotated[float | None, typer.Option("--to", help="End here [s].")] = None,
    contact: Annotated[
        bool, typer.Option("--contact", help="Count time from each run's first contact, not from its first tick.")
    ] = False,
    title: Annotated[str | None, typer.Option("--title", help="Above it; the file's name when not given.")] = None,
    config: Annotated[
        Path | None, typer.Option("--config", "-c", help="For --figure scene of a .csv or .npz: what was simulated.")
    ] = None,
    duration: Annotated[float, typer.Option("--duration", "-d", min=0.05, help="How long to listen [s].")] = 5.0,
    instance: Annotated[str, typer.Option("--instance", "-i", help="Name of the daemon.")] = DEFAULT_INSTANCE,
    connect: Annotated[
        str | None, typer.Option("--connect", metavar="ENDPOINT", help="A daemon's telemetry.tcp, elsewhere.")
    ] = None,
    control: Annotated[
        str | None, typer.Option("--control", metavar="ENDPOINT", help="Its control.tcp, for its configuration.")
    ] = None,
    keys: Annotated[
        Path | None, typer.Option("--keys", metavar="FILE", help="Your key file for it; $HAPTICD_KEYS when not given.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the output file if it exists.")] = False,
) -> None:
    """Plot a run, or several over each other: recorded, simulated, or live.

    Position and force are along the first wall's normal, negative positions inside it.

    Example: hapticd plot before.mcap after.mcap -f stiffness -o both.pdf

    Example: hapticd plot run.csv -f scene -c config/table-edge.toml -o run.png
    """
    from hapticd_views.commands.needs import record_and_figures

    with record_and_figures():
        from hapticd.figures.picture import SUFFIXES, save
        from hapticd.figures.sheets import NAMES, draw
        from hapticd_views.commands.live import heard
        from hapticd_views.recording.output import place
        from hapticd_views.scene import scene
        from hapticd_views.source import open_source
    if output.suffix not in SUFFIXES:
        raise ConfigError(f"{output}: must end in {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
    if figure not in (*NAMES, SCENE):
        raise ConfigError(f"--figure {figure}: there are {', '.join(NAMES)}, {SCENE}")
    if figure == SCENE and (len(runs) != 1 or contact):
        raise ConfigError(f"--figure {SCENE}: draws one run, from --from to --to")
    if config is not None and figure != SCENE:
        raise ConfigError(f"--config: is for --figure {SCENE}")
    place(output, overwrite)
    if runs.count(LIVE) > 1:
        raise ConfigError("live: there is one daemon to listen to, name it once")
    sources = [
        heard(duration, instance, connect, control, keys) if run == LIVE else open_source(Path(run)) for run in runs
    ]
    alone = sources[0].name if len(sources) == 1 else ""
    first_s, last_s = -math.inf if from_s is None else from_s, math.inf if to_s is None else to_s
    if figure == SCENE:
        drawn = scene(sources[0], Path(runs[0]), config, first_s, last_s, alone if title is None else title)
        save(drawn, output)
        typer.echo(f"{output}: {figure} of {alone}")
        return
    curves = [one for source in sources for one in source.curves]
    if contact:
        curves = [one.from_contact() for one in curves]
    if from_s is not None or to_s is not None:
        curves = [one.between(first_s, last_s) for one in curves]
    save(draw(figure, curves, alone if title is None else title), output)
    typer.echo(f"{output}: {figure} of {', '.join(source.name for source in sources)}")
