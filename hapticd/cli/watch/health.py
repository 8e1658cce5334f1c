"""How a daemon is, as text: what should be known, how its loop keeps time, what its driver counts."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator

from rich.text import Text

from hapticd.cli.watch.line import fitting, si
from hapticd.cli.watch.plot import bars
from hapticd.client import Status
from hapticd.telemetry.records import LATE_EDGES_US, LATE_US, late_ticks

_QUIET = "bright_black"
_MOST_WARNINGS = 2
_MOST_DEVICE_LINES = 2


def health_lines(status: Status, lost: int, width: int) -> list[Text]:
    """Standing warnings, the loop, the device and its model; each in as many lines as it takes.

    Args:
        status: of the daemon.
        lost: ticks that did not reach this view.
        width: characters of a line.
    """
    model = [Text(f" {line}", style=_QUIET) for line in textwrap.wrap(status.accuracy, max(20, width - 2))]
    return [*_warnings(status, width), _loop(status, lost, width), *_device(status, width), *model]


def _warnings(status: Status, width: int) -> Iterator[Text]:
    """Standing warnings, at most two, and what a latched fault asks for."""
    said = list(status.warnings)
    if not status.calibrated and not status.device_lost_timestamp:
        said.insert(0, "not calibrated, so without force: clear its workspace, then  hapticd calibrate")
    if status.latched:
        fault = f"fault {status.fault_code}: {status.fault_text}" if status.fault_code else "a fault"
        said.insert(0, f"stopped by {fault}; then  hapticd clear")
    if len(said) > _MOST_WARNINGS:
        said = [said[0], f"{said[1]}  (and {len(said) - 2} more: hapticd status)"]
    for one in said:
        for number, part in enumerate(textwrap.wrap(one, max(20, width - 3))):
            yield Text(f"   {part}" if number else f" ⚠ {part}", style="yellow")


def _loop(status: Status, lost: int, width: int) -> Text:
    choices = ((True, True), (True, False), (False, True), (False, False))
    return fitting((_timing(status, lost, with_bars, with_busy) for with_bars, with_busy in choices), width)


def _timing(status: Status, lost: int, with_bars: bool, with_busy: bool) -> Text:
    line = Text("").append(" loop ", _QUIET)
    rate_hz = status.measured_rate_hz  # 0: not known yet
    off = rate_hz and abs(rate_hz - status.rate_hz) > 0.01 * status.rate_hz
    line.append(f"{rate_hz:.1f}" if rate_hz else "?", "bold yellow" if off else "bold")
    line.append(f" of {status.rate_hz:g} Hz")
    if status.late_histogram:
        line.append("  late ", _QUIET)
        if with_bars:
            line.append_text(_late_bars(status)).append(" ")
        line.append_text(_count(late_ticks(status.late_histogram), "yellow")).append(" ticks", _QUIET)
        line.append("  max ", _QUIET).append(si(status.late_max_us * 1e-6, "s"))
    line.append("  skipped ", _QUIET).append_text(_count(status.overruns, "yellow"))
    if status.ring_drops + lost:
        line.append("  lost ", _QUIET).append_text(_count(status.ring_drops + lost, "red"))
    if with_busy:
        line.append("  busy max ", _QUIET).append(si(status.busy_max_us * 1e-6, "s"))
    return line


def _device(status: Status, width: int) -> list[Text]:
    """What the driver counts, where it counts anything; what is 0 comes last, and goes where room is short."""
    ordered = sorted(status.device_metrics.items(), key=lambda item: item[1] == 0.0)
    lines = [Text("").append(" device", _QUIET)] if ordered else []
    for number, (name, value) in enumerate(ordered):
        shown = (
            Text("").append(f"  {name} ", _QUIET).append(f"{value:.0f}" if 1e3 <= abs(value) < 1e15 else f"{value:.4g}")
        )
        left = f"  +{len(ordered) - number} more"
        last = len(lines) == _MOST_DEVICE_LINES
        if lines[-1].cell_len + shown.cell_len + (len(left) if last else 0) > width:
            if last:
                lines[-1].append(left, _QUIET)
                break
            lines.append(Text(" " * len(" device")))
        lines[-1].append_text(shown)
    return lines


def _late_bars(status: Status) -> Text:
    """Ticks by lateness, 10 us to 10 ms, counts on a logarithmic scale; red is a period of 1 kHz and more."""
    heights = [math.log10(1.0 + count) for count in status.late_histogram]
    text = Text("")
    for index, bar in enumerate(bars(heights)):
        lower_us = LATE_EDGES_US[index - 1] if index else 0
        text.append(
            bar if bar != " " else "·", "green" if lower_us < LATE_US else "yellow" if lower_us < 1280 else "red"
        )
        if bar == " ":
            text.stylize(_QUIET, len(text) - 1)
    return text


def _count(count: int, alarm: str) -> Text:
    return Text(f"{count}", style=f"bold {alarm}" if count else "default")
