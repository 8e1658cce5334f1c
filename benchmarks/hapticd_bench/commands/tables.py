"""How a benchmark's report looks on a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from hapticd import measure
from hapticd.progress import progress_bar

_COLOURS = {"PASS": "green", "FAIL": "red", "INCONCLUSIVE": "yellow"}
_MOST_RIVALS = 3  # named in a report
_WIDTH = 130  # of tables that go into a file


@contextmanager
def measuring(total_s: float) -> Iterator[measure.Progress]:
    """A progress bar; what is yielded advances it by that many seconds."""
    with progress_bar(total_s, "measuring") as tell:
        yield lambda seconds: tell(advance=seconds)


def make_console() -> Console:
    """Where a report goes; tables that go into a file keep their width."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=_WIDTH)


def titled_table(console: Console, title: str, *columns: str) -> Table:
    """Print the title and begin the table that goes under it."""
    console.print(f"[bold]{escape(title)}[/]", soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index == 0 else "right", overflow="fold")
    return table


def show(console: Console, table: Table) -> None:
    """Print a table and an empty line."""
    console.print(table)
    console.print()


def quantile_cells(values: measure.Quantiles) -> list[str]:
    """p50, p99, p99.9 and max for a table."""
    return [f"{value:.1f}" for value in (values.p50, values.p99, values.p999, values.max)]


def print_verdicts(console: Console, bars: Sequence[measure.Bar], conditions: measure.Conditions) -> None:
    """Print what was judged, and what the machine was like during it."""
    print_bars(console, bars)
    for rival in conditions.rivals[:_MOST_RIVALS]:
        console.print(f"[red]another real-time program was running: {escape(rival)}[/]", soft_wrap=True)
    if len(conditions.rivals) > _MOST_RIVALS:
        console.print(f"[red]and {len(conditions.rivals) - _MOST_RIVALS} more[/]")
    console.print(
        f"\n{escape(conditions.machine)}, Linux {escape(conditions.kernel)}, Python {conditions.python}; "
        f"{conditions.seconds:.0f} s, load {conditions.load_before:.2f} to {conditions.load_after:.2f}, other programs "
        f"kept {conditions.others:.2f} processors busy, {conditions.stolen:.3f} stolen by the host",
        soft_wrap=True,
    )


def print_bars(console: Console, bars: Sequence[measure.Bar]) -> None:
    """Print what was judged, a line each."""
    for bar in bars:
        note = f"  ({escape(bar.note)})" if bar.note else ""
        verdict = f"[{_COLOURS[bar.verdict]}]{bar.verdict:12}[/]"
        console.print(
            f"{verdict} {escape(bar.name)}: {bar.measured:.4g}, at most {bar.limit:.4g}{note}", soft_wrap=True
        )
