"""The report as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence

from hapticd_studies.extremes.case import DRAWN
from hapticd_studies.extremes.report import ExtremesReport

_CSS = """
body { font: 16px/1.5 "Source Sans 3", "Noto Sans", "Helvetica Neue", Arial, sans-serif; color: #1f2933;
  max-width: 62rem; margin: 0 auto; padding: 2.5rem 1.5rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; } h2 { font-size: 1.3rem; margin-top: 2.5rem; }
table { border-collapse: collapse; width: 100%; font-size: .88rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .45rem .6rem; border-bottom: 1px solid #d9dee4; }
code { font: .88em/1.4 "DejaVu Sans Mono", Consolas, monospace; background: #f4f5f7; padding: .1em .3em; }
img { width: 100%; height: auto; } .yes { color: #2e7d32; } .no { color: #b3261e; } .small { font-size: .9rem; }
@media print { @page { size: A4; margin: 16mm 14mm; } body { font-size: 10pt; padding: 0; }
  tr { break-inside: avoid; } }
"""
_MOST = 200


def page(report: ExtremesReport, picture: bytes, command: str) -> bytes:
    """The page.

    Args:
        report: the study.
        picture: its PNG file.
        command: what repeats it.
    """
    wrong = [(index, one.kind, one.text, "") for index, one in report.disagreements]
    fine = [
        (at, one.kind, one.text, one.explained) for at, all_ in report.found.items() for one in all_ if one.explained
    ]
    data = base64.b64encode(picture).decode()
    summary = [
        [f'<span class="{"yes" if line.holds else "no"}">{"✓" if line.holds else "✗"}</span>', *map(_text, line_of)]
        for line in report.lines()
        for line_of in [(line.name, line.text)]
    ]
    laws = [[_text(law), *(str(count) for count in counts.values())] for law, counts in report.law_counts().items()]
    heads = list(next(iter(report.law_counts().values())))
    body = [
        "<h1>Numerical stability at the extremes</h1>",
        f"<p>{report.plan.count} places: {_text(DRAWN)}.</p>",
        f'<p class="small">Repeat with <code>{_text(command)}</code>.</p>',
        _table(["", "what", "found"], summary),
        f'<figure><img alt="Map of the places and residuals of the books" src="data:image/png;base64,{data}"></figure>',
        "<h2>Disagreements</h2>",
        _findings(report, wrong) if wrong else "<p>None.</p>",
        "<h2>As far as double precision goes</h2>",
        f"<p>{len(fine)} findings are within a bound that the run itself gives.</p>",
        _findings(report, fine) if fine else "",
        "<h2>Stable loops, with the most damping that their law brought</h2>",
        _table(["law", *heads], laws),
    ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>Extremes</title>'
        f"<style>{_CSS}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    ).encode()


def _findings(report: ExtremesReport, rows: Sequence[tuple[int, str, str, str]]) -> str:
    cells = [
        [_text(kind), _text(text), _text(why), f"<code>{_text(report.command(index))}</code>"]
        for index, kind, text, why in rows[:_MOST]
    ]
    more = f'<p class="small">{len(rows) - _MOST} more are in the JSON file.</p>' if len(rows) > _MOST else ""
    return _table(["what", "how far", "explained by", "alone"], cells) + more


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{_text(one)}</th>" for one in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _text(text: str) -> str:
    return html.escape(text)
