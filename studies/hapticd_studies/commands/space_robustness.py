"""`hapticd study space-robustness`: random devices, surfaces and hands in space under some laws."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hapticd.errors import ConfigError
from hapticd_studies.grid.output import require_cluster, require_extra, require_folder, require_memory, write

_FILES = ("space-robustness.csv", "space-robustness.json")
_MOST_CASES = 1_000_000
_LISTED = 8


def command(
    cases: Annotated[int, typer.Option(help="How many devices, each with a surface and a hand of its own.")] = 1000,
    seed: Annotated[int, typer.Option(help="Of these; the same seed gives the same ones anywhere.")] = 1,
    laws: Annotated[
        str | None, typer.Option(help="As energy-cycle:cap=none,tdpa; not given: five that are shipped.")
    ] = None,
    only: Annotated[str | None, typer.Option(help="One case again, SEED:INDEX: prints its configuration.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("space-robustness"),
    cluster: Annotated[str | None, typer.Option(help="Scheduler of dask whose workers do it, tcp://HOST:PORT.")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Forget what an interrupted run has done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the JSON file too.")] = False,
) -> None:
    """Let random hands press, stroke, tap, circle and let go of surfaces in space, and count who is steady.

    The daemon's own tick on the simulated device of three axes, friction included, one process a core. Every case is a
    configuration: --only prints it, for `hapticd simulate`. Writes CSV and JSON. Interrupted, the same command goes on
    where it was.

    Example: hapticd study space-robustness --cases 200

    Example: hapticd study space-robustness --only 1:75 > case.toml
    """
    require_extra("study", "numpy", "numba")
    require_cluster(cluster)
    from hapticd_studies.law_spec import parse_laws
    from hapticd_studies.space_robustness.sweep import LAWS

    readings = parse_laws(laws or LAWS, {})
    if only is not None:
        from hapticd_studies.space_robustness.cases import case_of

        typer.echo(case_of(only).config(readings[-1]), nl=False)
        return
    if not 1 <= cases <= _MOST_CASES:
        raise ConfigError(f"--cases {cases}: must be from 1 to {_MOST_CASES}")
    if not 0 <= seed < 10**18:
        raise ConfigError(f"--seed {seed}: must be 0 or more and less than 1e18")
    require_memory(4000.0 * cases * (len(readings) + 2), f"--cases {cases}")
    require_folder(output, _FILES)

    from hapticd.offline.outcome import Criterion
    from hapticd_studies.grid.run import kept, run
    from hapticd_studies.space_robustness.report import criterion_words, report
    from hapticd_studies.space_robustness.sweep import SpaceRobustnessPlan

    plan = SpaceRobustnessPlan(seed, cases, readings, Criterion())
    job = plan.job()
    with kept(job, output / "space-robustness.journal", fresh) as journal:
        found = report(plan, plan.tables(run(job, journal, "space-robustness", cluster)))
        for file, content in zip(_FILES, (found.csv(), found.json()), strict=True):
            write(output / file, content)
    if as_json:
        typer.echo((output / _FILES[1]).read_text(), nl=False)
        return
    console = Console(highlight=False)
    console.print(found.table())
    for one in found.summaries:
        if one.law in ("energy-cycle", "ring-damping") and one.not_steady:
            listed = ", ".join(one.not_steady[:_LISTED])
            more = f" and {len(one.not_steady) - _LISTED} more" if len(one.not_steady) > _LISTED else ""
            console.print(f"not steady under {one.law}: {listed}{more}", soft_wrap=True, markup=False)
    console.print(criterion_words(plan), soft_wrap=True, markup=False)
    console.print(f"{output}: {', '.join(_FILES)}", soft_wrap=True, markup=False)
