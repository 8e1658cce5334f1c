"""A report as one HTML page: no script, nothing from outside; whatever a recording holds stays text."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import groupby
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

from hapticd.figures.picture import encoded
from hapticd.figures.sheets import draw
from hapticd.offline.outcome import Criterion
from hapticd.version import __version__
from hapticd_views.recording import Recording
from hapticd_views.report.statement import Statement
from hapticd_views.report.timeline import Happening, timeline
from hapticd_views.source import Source

MOST_LINES = 1000
"""More lines of what happened are left to the file."""

FIGURES = {
    "run": "Position, force, energy with the ends of its cycles, and damping",
    "stiffness": "Displayed stiffness: force over depth",
    "loop": "Force over depth; the area between the ways in and out is energy",
    "lateness": "How late ticks started",
}

_SIGNS = {"good": "✓", "bad": "✗", "unknown": "?"}

_RECEIPT = (
    "version", "instance", "driver", "device", "serial", "simulated", "axes", "rate_hz", "every_ticks", "law",
    "realtime", "warnings", "max_force_n", "wall_axis", "wall_position_m", "wall_stiffness_n_per_m", "config_file",
    "config_hash", "kernel", "machine", "python", "recorder_version",
)  # fmt: skip

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: 0; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
.under { color: #6b7684; margin-top: 0.2rem; }
dl.verdict { display: grid; grid-template-columns: 2rem 13rem 1fr; gap: 0.7rem 0.4rem; }
dl.verdict dt { font-weight: 600; } dl.verdict dd { margin: 0; }
.mark { font-weight: 700; text-align: center; } .good { color: #0a7a60; } .bad { color: #a3300f; }
.unknown { color: #6b7684; }
.figures { columns: 2 24rem; column-gap: 1.5rem; }
figure { margin: 0 0 1.2rem; break-inside: avoid; } figure img { width: 100%; }
figcaption { color: #6b7684; font-size: 0.85rem; }
table { border-collapse: collapse; font-size: 0.9rem; }
th, td { text-align: left; vertical-align: top; padding: 0.2rem 0.9rem 0.2rem 0; border-bottom: 1px solid #d9dde2; }
td { overflow-wrap: anywhere; } td.time { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.fault td { color: #a3300f; font-weight: 600; } tr.marker td { color: #1f5f99; }
pre { background: #eceff2; padding: 0.8rem; overflow-x: auto; font-size: 0.8rem; }
@media print { details { display: none; } }
"""


def page(source: Source, told: Sequence[Statement]) -> bytes:
    """The page.

    Args:
        source: of the run.
        told: `statements` of it.
    """
    root = Element("html", lang="en")
    head = SubElement(root, "head")
    SubElement(head, "meta", charset="utf-8")
    policy = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
    SubElement(head, "meta", {"http-equiv": "Content-Security-Policy", "content": policy})
    SubElement(head, "meta", name="viewport", content="width=device-width, initial-scale=1")
    _text(head, "title", f"{source.name}: report")
    SubElement(head, "style").text = _STYLE
    body = SubElement(root, "body")
    _text(body, "h1", source.name)
    _text(body, "p", _subtitle(source)).set("class", "under")
    _verdict(body, told)
    _figures(body, source)
    if source.recording is not None:
        _happenings(body, timeline(source.recording))
        _receipts(body, source.recording)
    else:
        _text(body, "h2", "Receipt")
        _text(body, "p", "None: a file of hapticd simulate holds the columns alone. A recording has its receipt.")
    _text(body, "h2", "How it was judged")
    _text(
        body,
        "p",
        "Every touch is looked at half a second after its arrival and on, in windows of "
        f"{Criterion().window_s:g} s. What a moving mean of 50 ms follows is the hand's own motion; what is left may "
        "span as much as the studies call still. A touch may ring as it arrives; once it is still it must stay so.",
    )
    _text(body, "p", f"Made by hapticd {__version__}.").set("class", "under")
    html: bytes = tostring(root, encoding="utf-8", method="html")
    return b"<!DOCTYPE html>\n" + html


def _verdict(body: Element, told: Sequence[Statement]) -> None:
    verdict = SubElement(body, "dl", {"class": "verdict"})
    for one in told:
        _text(verdict, "dd", _SIGNS[one.mark]).set("class", f"mark {one.mark}")
        _text(verdict, "dt", one.question)
        _text(verdict, "dd", one.text)


def _figures(body: Element, source: Source) -> None:
    _text(body, "h2", "What happened")
    shown = SubElement(body, "div", {"class": "figures"})
    for name, caption in FIGURES.items():
        if name == "lateness" and "late_us" not in source.curves[0]:
            continue
        content = base64.b64encode(encoded(draw(name, source.curves), ".svg")).decode("ascii")
        figure = SubElement(shown, "figure")
        SubElement(figure, "img", alt=caption, src=f"data:image/svg+xml;base64,{content}")
        _text(figure, "figcaption", caption)


def _happenings(body: Element, found: Sequence[Happening]) -> None:
    _text(body, "h2", "In order of time")
    if not found:
        _text(body, "p", "No event, marker, fault or gap.")
        return
    table = _table(body, ("time [s]", "", "what"))
    for one in found[:MOST_LINES]:
        row = SubElement(table, "tr", {"class": one.kind})
        _text(row, "td", f"{one.time_s:.3f}").set("class", "time")
        _text(row, "td", one.kind)
        _text(row, "td", one.text)
    if len(found) > MOST_LINES:
        _text(body, "p", f"{len(found) - MOST_LINES} more are in the recording.")


def _receipts(body: Element, recording: Recording) -> None:
    _text(body, "h2", "Receipt")
    before: Mapping[str, Any] = {}
    for number, receipt in enumerate(recording.receipts):
        if number:
            since_s = receipt["timestamp"] - recording.ticks["timestamp"][0]
            _text(body, "h3", f"After the reload or restart before {since_s:.3f} s")
        _receipt(body, receipt, [key for key in _RECEIPT if not number or receipt.get(key) != before.get(key)])
        before = receipt


def _receipt(body: Element, receipt: Mapping[str, Any], keys: Sequence[str]) -> None:
    table = _table(body, ())
    for key in keys:
        value = receipt.get(key, "")
        row = SubElement(table, "tr")
        _text(row, "th", key)
        _text(row, "td", ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value))
    details = SubElement(body, "details")
    _text(details, "summary", "The configuration")
    missing = f"not in the recording: {receipt.get('config_missing', '')}"
    _text(details, "pre", str(receipt.get("config_text") or missing))


def _subtitle(source: Source) -> str:
    curves = source.curves[0]
    seconds = f"{curves['t_s'][-1] - curves['t_s'][0] + curves.period_s:.3g} s"
    if source.recording is None:
        return f"{seconds}, {len(curves['t_s'])} ticks, simulated"
    receipt = source.recording.receipt
    began = datetime.fromtimestamp(source.recording.ticks["timestamp"][0], UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    laws = ", then ".join(law for law, _ in groupby(one["law"] for one in source.recording.receipts))
    return f"{seconds}, {len(curves['t_s'])} ticks, {receipt['device']} with {laws}, {began}"


def _table(body: Element, heads: Sequence[str]) -> Element:
    table = SubElement(body, "table")
    if heads:
        row = SubElement(table, "tr")
        for head in heads:
            _text(row, "th", head)
    return table


def _text(parent: Element, tag: str, text: str) -> Element:
    """An element with a text, which the writer of the page escapes; what HTML cannot hold is replaced."""
    element = SubElement(parent, tag)
    element.text = _UNFIT.sub("\N{REPLACEMENT CHARACTER}", text)
    return element


_UNFIT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Controls, halves of characters, and what turns the direction of text."""
