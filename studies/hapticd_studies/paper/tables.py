"""The tables of docs/paper.md, as the study writes them into `tables.md`: no figure there is typed by hand."""

from __future__ import annotations

from collections.abc import Sequence

from hapticd_studies.paper.claims import Claim
from hapticd_studies.paper.readings import ReadingTable


def tables(claims: Sequence[Claim], table: ReadingTable) -> str:
    """Both tables, each between the marks by which docs/paper.md holds it."""
    return f"{marked('claims', claims_table(claims))}\n{marked('readings', readings_table(table))}"


def marked(name: str, text: str) -> str:
    """A text between marks that a page does not show."""
    return f"<!-- begin {name} -->\n{text}<!-- end {name} -->\n"


def claims_table(claims: Sequence[Claim]) -> str:
    """A line a claim, then why those do not hold that do not."""
    rows = [
        f"| `{claim.key}` | {claim.source} | {claim.claim} | {claim.measured} | {'yes' if claim.holds else '**no**'} |"
        for claim in claims
    ]
    why = [f"- `{claim.key}`: {claim.remark}" for claim in claims if not claim.holds]
    head = ["| key | paper | claim | measured | holds |", "|---|---|---|---|---|"]
    return "\n".join([*head, *rows, "", "Why not:", "", *why, ""])


def readings_table(table: ReadingTable) -> str:
    """A line a reading that does not settle everything, and the first, which is the shipped one."""
    count = len(table.scenarios)
    rows = [
        f"| {reading.name} | {passed} | {table.rest(at)} |"
        for at, (reading, passed) in enumerate(zip(table.readings, table.passed.tolist(), strict=True))
        if at == 0 or passed < count
    ]
    return "\n".join([f"| reading | settled of {count} | felt; force spans |", "|---|---|---|", *rows, ""])
