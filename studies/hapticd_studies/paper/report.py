"""The report: one HTML file that needs nothing else, on a screen or on paper."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence

import numpy as np

from hapticd.offline.outcome import Criterion
from hapticd_studies.paper.claims import Claim, Evidence, millimetres
from hapticd_studies.paper.plates import PLATES, Plate
from hapticd_studies.paper.recording import RunFigures

_CSS = """
:root { --ink: #1f2933; --soft: #52606d; --line: #d9dee4; --yes: #2e7d32; --no: #b3261e; }
* { box-sizing: border-box; }
body { font: 16px/1.5 "Source Sans 3", "Noto Sans", "Helvetica Neue", Arial, sans-serif; color: var(--ink);
  max-width: 62rem; margin: 0 auto; padding: 2.5rem 1.5rem 4rem; background: #fff; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .6rem; }
h2 { font-size: 1.3rem; margin: 3rem 0 .8rem; padding-bottom: .3rem; border-bottom: 2px solid var(--ink); }
p.lead { font-size: 1.1rem; margin: 0 0 1rem; }
code { font: .88em/1.4 "DejaVu Sans Mono", Consolas, monospace; background: #f4f5f7; padding: .1em .3em; }
table { border-collapse: collapse; width: 100%; font-size: .84rem; line-height: 1.4;
  font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .45rem .6rem; border-bottom: 1px solid var(--line); }
thead th { border-bottom: 1.5px solid var(--ink); font-weight: 600; }
td.number, th.number { text-align: right; white-space: nowrap; }
td.remark { color: var(--soft); }
.verdict { font-weight: 700; white-space: nowrap; }
.yes { color: var(--yes); } .no { color: var(--no); }
.source { color: var(--soft); white-space: nowrap; }
figure { margin: 2.2rem 0; break-inside: avoid; }
figure img { width: 100%; height: auto; display: block; }
figcaption { font-size: .9rem; color: var(--soft); margin-top: .5rem; max-width: 52rem; }
figcaption b { color: var(--ink); display: block; }
td .small, th .small { font-size: .94em; color: var(--soft); font-weight: 400; }
.claims td:nth-child(1) { width: 8%; } .claims td:nth-child(2) { width: 31%; } .claims td:nth-child(3) { width: 27%; }
.claims td:nth-child(4) { width: 10%; }
.runs th, .runs td { padding: .4rem .34rem; }
.runs tr.run td { border-bottom: none; padding-bottom: 0; } .runs tr.run { break-after: avoid; }
.wide { overflow-x: auto; }
.small { font-size: .9rem; color: var(--soft); }
@media print {
  @page { size: A4; margin: 16mm 14mm; }
  body { font-size: 10pt; max-width: none; padding: 0; }
  h2 { break-after: avoid; margin-top: 1.6rem; }
  tr, figure { break-inside: avoid; } thead { display: table-header-group; }
  figure { margin: 5mm 0 7mm; } figure img { width: auto; max-width: 100%; max-height: 104mm; margin: 0 auto; }
  #readings img { max-height: 215mm; } figcaption { font-size: 8.6pt; max-width: none; }
  table { font-size: 7.6pt; } .wide { overflow: visible; } .runs { font-size: 6.6pt; }
  .runs th, .runs td { padding: .25rem .3rem; } code { background: none; padding: 0; }
}
"""


def report(evidence: Evidence, claims: Sequence[Claim], pictures: dict[str, bytes], command: str, made: str) -> str:
    """The page.

    Args:
        evidence: what was run.
        claims: what came out of it.
        pictures: the PNG of each plate.
        command: what repeats it.
        made: by what, where and when.
    """
    held = sum(claim.holds for claim in claims)
    body = [
        "<h1>Energy cycles with adaptive damping: what reproduces</h1>",
        f'<p class="lead">Every simulation and experiment of the paper, run again on simulated devices: '
        f"{held} of {len(claims)} claims come out as stated, {len(claims) - held} do not.</p>",
        "<p>The devices are models. The friction of the omega.7 model was chosen so that alone it holds 8 kN/m and no "
        "more, as the paper reports of the real one; everything else follows from that. Hand forces and starts are not "
        "stated in the paper, so claims are judged over many.</p>",
        f'<p class="small">Repeat with <code>{_text(command)}</code>. {_text(made)}</p>',
        "<h2>Claims</h2>",
        _claims(claims),
        f'<p class="small">{_text(Criterion().words()).capitalize()}.</p>',
        "<h2>Figures</h2>",
        *(_figure(plate, pictures[plate.name]) for plate in PLATES),
        "<h2>The runs in numbers</h2>",
        _runs(evidence),
        "<h2>Readings of the method</h2>",
        "<p>The paper leaves choices open; each is an option of the law. What each does to 28 scenarios:</p>",
        _readings(evidence),
        "<h2>What this cannot say</h2>",
        "<ul><li>No real device was touched. Mass and friction of the omega.7 are not published; hands are constant "
        "forces, except where a scenario says otherwise.</li>"
        "<li>Numbers that stand only on the axes of the paper's plots (amplitudes, durations, final damping) cannot be "
        "compared: only what its text and captions state.</li>"
        "<li>TDPA is compared in the form of Hannaford and Ryu 2002, with and without two bounds; later forms of it "
        "are not.</li></ul>",
    ]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Energy cycles: what reproduces</title><style>{_CSS}</style></head>\n<body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _claims(claims: Sequence[Claim]) -> str:
    rows = [
        f'<tr id="{claim.key}"><td class="source">{_text(claim.source)}</td><td>{_text(claim.claim)}'
        f'<br><span class="small">{_text(claim.scenario)}</span></td><td>{_text(claim.measured)}</td>'
        f'<td class="verdict {"yes" if claim.holds else "no"}">{"✓ holds" if claim.holds else "✗ does not"}</td>'
        f'<td class="remark">{_text(claim.remark)}</td></tr>'
        for claim in claims
    ]
    head = "<tr><th>Paper</th><th>Claim, and what was run</th><th>Measured</th><th>Verdict</th><th>Remark</th></tr>"
    return f'<div class="wide"><table class="claims"><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></div>'


def _figure(plate: Plate, picture: bytes) -> str:
    data = base64.b64encode(picture).decode()
    title, scenario, seen = map(_text, (plate.title, plate.scenario, plate.seen))
    return (
        f'<figure id="{plate.name}"><img alt="{title}. {seen}" src="data:image/png;base64,{data}">'
        f"<figcaption><b>{title}</b>{scenario} {seen}</figcaption></figure>"
    )


def _runs(evidence: Evidence) -> str:
    titles = (
        ("outcome", ""),
        ("settled", "s"),
        ("cycles", "to settle, all"),
        ("α", "end, peak; N s/m"),
        ("span", "last 0.5 s"),
        ("peak force", "N"),
        ("injected", "mJ"),
        ("recovered", "mJ"),
        ("generated", "mJ"),
        ("stiffness", "true, error"),
        ("felt", "of threshold; force spans, N"),
        ("coarsely", "still"),
    )
    head = "".join(f'<th class="number">{title}<br><span class="small">{unit}</span></th>' for title, unit in titles)
    rows = [
        f'<tr class="run"><td colspan="{len(titles)}"><b>{_text(name)}</b> '
        f'<span class="small">{_text(evidence.runs[name].scenario.title)}</span></td></tr><tr>'
        + "".join(f'<td class="number">{_text(cell)}</td>' for cell in _cells(figures))
        + "</tr>"
        for name, figures in evidence.figures.items()
    ]
    return (
        f'<div class="wide"><table class="runs"><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
        '<p class="small">Settled: since when the true position stays within 5 % of its depth, or three counts. '
        "Injected and recovered: all energy into the wall and all that came back; generated: what sampling and hold "
        "made of it. Stiffness: mean force over mean true depth of the last 0.5 s; over the measured depth it equals "
        "the wall's own by construction at rest. Felt: how many times the threshold of a hand with a pen the true "
        "position vibrates in the last 0.5 s, band by band, and by how much the force swings then. Coarsely still: it "
        "vibrates by less than two counts or 10 um, the vibration does not grow, and the stiffness is within the 23 % "
        "that people can tell apart (for tens of hertz; near 250 Hz people feel less than a micrometre). "
        "Each run is in <code>scenarios/</code> as a configuration for <code>hapticd simulate</code>.</p>"
    )


def _cells(figures: RunFigures) -> list[str]:
    settled = figures.settled_s is not None
    at_rest = figures.stiffness_error is not None and settled
    return [
        figures.outcome,
        f"{figures.settled_s:.2f}" if settled else "–",
        f"{figures.cycles_to_settle}, {figures.cycles}" if settled else f"–, {figures.cycles}",
        f"{_short(figures.damping_n_s_per_m)}, {_short(figures.peak_damping_n_s_per_m)}",
        millimetres(figures.peak_to_peak_m),
        f"{figures.peak_force_n:.1f}",
        f"{figures.energy_injected_j * 1e3:.1f}",
        f"{figures.energy_recovered_j * 1e3:.1f}",
        f"{figures.generated_j * 1e3:.2f}",
        f"{figures.displayed_stiffness_n_per_m:.0f} N/m, {figures.stiffness_error:+.1%}" if at_rest else "–",
        f"{'–' if figures.felt_index is None else f'{figures.felt_index:.2g}'}; {figures.force_chatter_n:.2g}",
        "yes" if figures.imperceptible else "no",
    ]


def _readings(evidence: Evidence) -> str:
    table = evidence.table
    rows = []
    for at, (reading, passed) in enumerate(zip(table.readings, table.passed, strict=True)):
        failing = table.failing(at)
        shown = ", ".join(failing[:4]) + (f" and {len(failing) - 4} more" if len(failing) > 4 else "")
        spans = table.peak_to_peak_m[at]
        damping = _short(float(np.abs(table.damping_n_s_per_m[at]).max()))
        rows.append(
            f"<tr><td>{_text(reading.name)}</td><td class='number'>{passed}</td>"
            f"<td class='number'>{_text(table.rest(at))}</td>"
            f"<td class='number'>{_text(millimetres(float(spans.max())))}</td><td class='number'>{damping}</td>"
            f"<td class='remark'>{_text(shown)}</td></tr>"
        )
    head = (
        "<tr><th>reading</th><th class='number'>settled of 28</th>"
        "<th class='number'>felt; force spans<br><span class='small'>of those, medians</span></th>"
        "<th class='number'>widest span</th>"
        "<th class='number'>largest α at the end<br><span class='small'>N s/m</span></th><th>not settled</th></tr>"
    )
    return f'<div class="wide"><table><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></div>'


def _short(value: float) -> str:
    return f"{value:.1f}" if abs(value) < 1000.0 else f"{value:.1e}"


def _text(text: str) -> str:
    return html.escape(text.replace(" um", " µm").replace("N s/m", "N s/m"))
