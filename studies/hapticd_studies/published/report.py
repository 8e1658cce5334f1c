"""Published rows against the model, as a table and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

from rich.console import Group
from rich.text import Text

from hapticd.version import __version__
from hapticd_studies.grid.output import as_json
from hapticd_studies.published.finding import Finding

_STYLE = {True: "green", False: "red", None: "dim"}


def page(findings: Sequence[Finding]) -> Group:
    """For the terminal: three lines a row, and how many agree."""
    lines = []
    for one in findings:
        lines.append(
            Text.assemble((f"{one.verdict}: ", f"bold {_STYLE[one.agrees]}"), (one.key, "bold"), f"  {one.source}")
        )
        lines.append(Text(f"  published: {one.published}"))
        lines.append(Text(f"  model:     {one.model}\n"))
    told = [one for one in findings if one.agrees is not None]
    agree = sum(bool(one.agrees) for one in told)
    return Group(*lines, Text(f"{agree} of {len(told)} rows agree; {len(findings) - len(told)} can tell nothing."))


def json(findings: Sequence[Finding]) -> bytes:
    """For programs."""
    rows = [{**asdict(one), "verdict": one.verdict} for one in findings]
    return as_json({"study": "devices", "hapticd": __version__, "rows": rows})
