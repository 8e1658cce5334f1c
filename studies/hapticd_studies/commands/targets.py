"""`hapticd study targets`: laws against what was asked of the default law, or what settings trade for each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from hapticd.errors import ConfigError
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, write

_TARGETS = ("targets.json", "targets.md", "missed.md")
_FRONT = ("front.json", "front.png")
_MISSED = ("missed.json", "missed.md")


def command(
    laws: Annotated[str, typer.Option(help="Some laws, as ring-damping,damper:damping_n_s_per_m=20.")] = (
        "ring-damping,energy-cycle,damper"
    ),
    seed: Annotated[int, typer.Option(help="Of all devices and hands; 7707 was not looked at.")] = 7707,
    share: Annotated[float, typer.Option(help="Of 2000 presses, 490 hands of 20 s, 140 of 10 min, 540 starts.")] = 1.0,
    front: Annotated[
        bool, typer.Option("--front", help="ring-damping's settings and constant dampers: what excludes what.")
    ] = False,
    missed: Annotated[
        bool,
        typer.Option("--missed", help="What reaches each target that ring-damping misses, and what that loses."),
    ] = False,
    also: Annotated[
        str, typer.Option(help="Words of targets that missed.md has even where the first law reaches them.")
    ] = "tremor,unfelt",
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("targets"),
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file instead of the table.")] = False,
) -> None:
    """Hold laws against the targets of the default law: what holds, what it costs, what is felt.

    With --front, settings of ring-damping and constant dampers over the same moving hands: settling against damping
    and against pulls, with a picture. missed.md has what reaches each target that the first law misses, and what that
    loses: of the other laws, or with --missed of its settings, other laws and dampers chosen for each device.
    Interrupted, the same command goes on where it was.

    Example: hapticd study targets --share 0.15

    Example: hapticd study targets --missed --share 0.05
    """
    require_extra("study", "numpy", "numba", "matplotlib")
    require_cluster(cluster)
    if not 0.01 <= share <= 100.0:
        raise ConfigError(f"--share {share:g}: must be from 0.01 to 100")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    if front and missed:
        raise ConfigError("--front and --missed: one at a time")
    files = _FRONT if front else _MISSED if missed else _TARGETS
    require_folder(output, files)

    from hapticd.offline.outcome import Criterion
    from hapticd_studies.grid.run import kept, run
    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.targets import missed as against
    from hapticd_studies.targets.front import FRONT, draw
    from hapticd_studies.targets.plan import MOVED_ONLY, USUAL, WITH_HINDSIGHT, TargetsPlan, size_of
    from hapticd_studies.targets.report import front_of, front_table, json_of, markdown, table, targets_of
    from hapticd_studies.targets.table import known_beforehand

    words = [word.strip() for word in also.split(",") if word.strip()]
    chosen = parse_laws(FRONT if front else against.LAWS if missed else laws, {})
    only = MOVED_ONLY if front else WITH_HINDSIGHT if missed else USUAL
    plan = TargetsPlan(seed, size_of(share), chosen, Criterion(), only)
    job = plan.job()
    with kept(job, output / "targets.journal", fresh) as journal:
        tables = plan.tables(run(job, journal, "targets", cluster))
        if front:
            points = front_of(plan, tables)
            content = [json_of(plan, points), draw(points)]
            shown: Any = front_table(points)
        elif missed:
            found = targets_of(plan, tables)
            lost = against.missed(found | known_beforehand(plan, tables[0]), words)
            shown = against.markdown(lost)
            content = [json_of(plan, found, lost), shown.encode()]
        else:
            found = targets_of(plan, tables)
            lost = against.missed(found, words)
            content = [json_of(plan, found, lost), markdown(plan, found).encode(), against.markdown(lost).encode()]
            shown = table(plan, found)
        for file, one in zip(files, content, strict=True):
            write(output / file, one)
    if as_json:
        typer.echo((output / files[0]).read_text(), nl=False)
        return
    console = Console(highlight=False)
    console.print(shown, markup=False, soft_wrap=missed)
    console.print(f"{output}: {', '.join(files)}", soft_wrap=True, markup=False)
