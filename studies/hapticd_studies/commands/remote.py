"""`hapticd study remote`: what stiffness a late client gets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hapticd.config.remote import COME_IN_S
from hapticd.errors import ConfigError
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, write

_FILES = ("remote.csv", "remote.json", "remote.png")
_MOST_CLIENTS = 1_000_000
_QUICK_CLIENTS = 4


def command(
    clients: Annotated[int, typer.Option(help="How many random clients of each kind.")] = 500,
    seed: Annotated[int, typer.Option(help="Of the clients; the same seed gives the same ones anywhere.")] = 1,
    hand: Annotated[str, typer.Option(help="What the hand does to random clients: press, stroke or tap.")] = "press",
    come_in_s: Annotated[float, typer.Option(help="`come_in_s` of the couplings, 0 to 10.")] = COME_IN_S,
    laws: Annotated[str, typer.Option(help="Laws to compare, as none,energy-cycle:window=1.")] = "",
    quick: Annotated[
        bool, typer.Option("--quick", help="A few clients and no ladder: about 20 s on one core.")
    ] = False,
    replay: Annotated[str | None, typer.Option(help="One client again, KIND:SEED:INDEX.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("remote"),
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Press what other programs render, late and unevenly, and say what stiffness they get under each law.

    Two kinds of client on the simulated omega7, in the daemon's own tick: a tool behind a coupling that is pressed on a
    table, and a wall that is sent as a raw force. First a ladder of stiffness at four rates, with and without a delay;
    then random clients of 30 to 1000 Hz with delay, jitter, loss and pauses, held against constant dampers; of what
    the last law does not hold it says which dampers do. Writes a picture, CSV and JSON. Interrupted, the
    same command goes on where it was.

    Example: hapticd study remote --output remote

    Example: hapticd study remote --replay force:1:17
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_cluster(cluster)
    if not 1 <= clients <= _MOST_CLIENTS:
        raise ConfigError(f"--clients {clients}: must be from 1 to {_MOST_CLIENTS}")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    if not 0.0 <= come_in_s <= 10.0:
        raise ConfigError(f"--come-in-s {come_in_s}: must be from 0 to 10")

    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.remote.runs import HANDS
    from hapticd_studies.remote.sweep import DAMPERS, LAWS, WINDOW, RemotePlan

    if hand not in HANDS:
        raise ConfigError(f"--hand {hand}: must be one of {', '.join(HANDS)}")
    chosen, dampers = parse_laws(laws or LAWS, {}), parse_laws(",".join(DAMPERS), {})
    console = Console(highlight=False)
    if replay is not None:
        from hapticd_studies.remote.replay import case_of, figures

        case = case_of(replay, hand, come_in_s)
        for line in case.words():
            console.print(line, markup=False)
        console.print(figures(case, [*chosen, *dampers]))
        return

    from hapticd_studies.grid.run import kept, run
    from hapticd_studies.remote.plot import draw
    from hapticd_studies.remote.report import LADDER_WORDS, RANDOM_WORDS, report
    from hapticd_studies.remote.windows import WINDOW_WORDS, lost_table, windows_table

    require_folder(output, _FILES)
    each = ["none", *(f"damper:damping_n_s_per_m={value}" for value in WINDOW)]
    window = [] if quick else parse_laws(",".join(each), {})
    count = min(clients, _QUICK_CLIENTS) if quick else clients
    plan = RemotePlan(seed, count, chosen, dampers, window, not quick and hand == "press", hand, come_in_s)
    Console(stderr=True, highlight=False).print(f"{plan.runs} runs", soft_wrap=True)
    job = plan.job()
    with kept(job, output / "remote.journal", fresh) as journal:
        found = report(plan, plan.table(run(job, journal, "remote", cluster)))
        for file, content in zip(_FILES, (found.csv(), found.json(), draw(found)), strict=True):
            write(output / file, content)
    if as_json:
        typer.echo((output / "remote.json").read_text(), nl=False)
        return
    if found.reaches:
        console.print("[bold]Stiffness that is felt [N/m][/]", found.ladder(), LADDER_WORDS, "", sep="\n")
    console.print("[bold]Random clients[/]", found.random(), RANDOM_WORDS, sep="\n")
    if found.windows:
        console.print("", "[bold]Windows of constant dampers[/]", windows_table(found.windows), WINDOW_WORDS, sep="\n")
    if found.lost:
        title = f"[bold]Not held by {found.plan.laws[-1].label}, though by a damper, and moving on[/]"
        console.print("", title, lost_table(found.lost), sep="\n")
    console.print(f"\nOne again: hapticd study remote --replay force:{seed}:0", soft_wrap=True)
    console.print(f"{output}: {', '.join(_FILES)}", soft_wrap=True, markup=False)
