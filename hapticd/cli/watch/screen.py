"""The picture that `hapticd watch` shows: how what is known of a daemon looks on a terminal."""

from __future__ import annotations

import sys
import textwrap
import time
from collections.abc import Sequence

from rich.text import Text

from hapticd.cli.local_time import moment, zone
from hapticd.cli.watch.contacts import count_walls, of_objects
from hapticd.cli.watch.health import health_lines
from hapticd.cli.watch.line import si
from hapticd.cli.watch.plot import LABEL_WIDTH, SLICE_S, bars, plot
from hapticd.cli.watch.ports import port_lines, port_words
from hapticd.cli.watch.space import VIEW_ROWS, contact_lines, views
from hapticd.cli.watch.state import ScreenState
from hapticd.client import Position, Status
from hapticd.telemetry.records import late_ticks

SILENT_S = 2.5
"""After this silence [s] a daemon counts as gone: it says its status every second."""

_AXIS_STYLES = ("cyan", "magenta", "green")
_REQUESTED = "red"
_QUIET = "bright_black"
_NARROW = 64
_CYCLES_WIDTH = 36
_MOST_WALLS = 4


def frame(known: ScreenState, endpoint: str, width: int, height: int, now_s: float) -> list[Text]:
    """The picture: exactly `height` lines of exactly `width` characters.

    Args:
        known: what to show.
        endpoint: where it comes from.
        width: characters of a line.
        height: lines.
        now_s: the clock that `known` was fed with [s].
    """
    if known.status is None:
        lines = waiting(endpoint, width, height)
    else:
        lines = _running(known, known.status, endpoint, width, height, now_s)
    lines = (lines + [Text("")] * height)[:height]
    for line in lines:
        line.no_wrap = True
        line.truncate(width, overflow="ellipsis", pad=True)
    return lines


def waiting(endpoint: str, width: int, height: int) -> list[Text]:
    """The picture while there is no daemon."""
    text = [
        Text("waiting for a daemon", style="bold", justify="center"),
        Text(endpoint, style="cyan"),
        Text(""),
        Text("start one with  hapticd run  or  systemctl start hapticd", style=_QUIET),
        Text("q quits", style=_QUIET),
    ]
    above = [Text("")] * max(0, (height - len(text)) // 2)
    return above + [Text(" " * max(0, (width - line.cell_len) // 2)).append_text(line) for line in text]


def one_line(known: ScreenState) -> str:
    """State and latest tick in one plain line."""
    status = known.status
    assert status is not None
    stamp = known.position.timestamp if known.position else status.timestamp
    parts = [
        moment(stamp),
        f"{_state(status)[0].lower():8}",
        status.law,
        f"{status.measured_rate_hz:.1f} Hz",
        f"late {late_ticks(status.late_histogram)}",
        f"skipped {status.overruns}",
    ]
    if known.position:
        parts += [
            f"{name} {1e3 * x_m:+.3f} mm {force_n:+.2f} N"
            for name, x_m, force_n in zip(
                _axes(status, known.position), known.position.position_m, known.position.force_n, strict=False
            )
        ]
    if known.damping:
        walls = count_walls(known.damping, status)
        parts += [f"damping {damping:.1f} N s/m" for damping in known.damping.damping_n_s_per_m[:walls]]
        parts += port_words(known.pushes, known.damping, status)
    if status.object_name:
        touched = contact_lines(known.trail, status, of_objects(known.damping, status), sys.maxsize)
        parts += [line.plain.strip() for line in touched]
    if known.energy:
        parts += [f"energy {si(known.energy.energy_j, 'J')}", f"generated {si(known.energy.generated_j, 'J')}"]
    return "  ".join(parts)


def _running(known: ScreenState, status: Status, endpoint: str, width: int, height: int, now_s: float) -> list[Text]:
    above = [_header(status, known, width, now_s), *health_lines(status, known.lost, width)]
    middle = [
        *_walls(known, status, width),
        *contact_lines(known.trail, status, of_objects(known.damping, status), width),
        _energy(known, width),
    ]
    footer = _footer(status, endpoint, width)
    room = height - len(above) - len(middle) - 1
    if status.object_name and room >= VIEW_ROWS + 6 and width >= _NARROW:
        left, right = (
            _box(title, Text(axes, style=_QUIET), rows, len(rows[0]) + 4)
            for title, axes, rows in views(known.trail, width)
        )
        middle = [*_side_by_side(left, right), *middle]
        room -= VIEW_ROWS + 2
    log_rows = 0 if room < 9 else min(12, 3 + max(0, (room - 12) // 3))
    plot_height = room - (log_rows + 2 if log_rows else 0)
    plots = _plots(known, status, width, plot_height)
    logs = _logs(known, width, log_rows) if log_rows else []
    return [*above, *plots, *middle, *logs, footer]


def _header(status: Status, known: ScreenState, width: int, now_s: float) -> Text:
    name, style = _state(status)
    silent_s = now_s - known.heard_s
    if silent_s > SILENT_S:
        name, style = f"NO DATA FOR {silent_s:.0f} s", "bold white on red"
    left = Text(" ").append(f" hapticd {status.instance} ", "bold reverse").append(f"  {status.device}", "bold")
    driver = f"  {status.driver}{', simulated' if status.simulated else ''}"
    right = Text(f"law {status.law}  ", style="bold").append(f" {name} ", style).append(" ")
    if left.cell_len + len(driver) + right.cell_len < width:
        left.append(driver, _QUIET)
    return _spread(left, right, width)


def _state(status: Status) -> tuple[str, str]:
    if status.latched:
        return "LATCHED, RELEASING" if status.releasing else "LATCHED", "bold white on red"
    if status.device_lost_timestamp:
        return "NO DEVICE", "bold white on red"
    if status.fallback:
        return "FALLBACK", "bold white on magenta"
    if status.releasing:
        return "RELEASING", "bold black on yellow"
    if status.armed:
        return "ARMED", "bold black on green"
    return "DISARMED", "bold black on yellow"


def _plots(known: ScreenState, status: Status, width: int, height: int) -> list[Text]:
    if height < 4 or known.position is None:
        return []
    if width < _NARROW:
        upper = height // 2
        if upper < 4:
            return _position_box(known, status, width, height)
        return _position_box(known, status, width, upper) + _force_box(known, status, width, height - upper)
    left = width // 2
    return _side_by_side(_position_box(known, status, left, height), _force_box(known, status, width - left, height))


def _position_box(known: ScreenState, status: Status, width: int, height: int) -> list[Text]:
    assert known.position is not None
    axes = _axes(status, known.position)
    titles = _values(axes, [1e3 * value for value in known.position.position_m], 3, width - len("position mm") - 7)
    single = len(axes) == 1  # wherever the scene puts the wall
    walls = [
        1e3 * position
        for axis, position in zip(status.wall_axis, status.wall_position_m, strict=False)
        if single or axis in axes
    ]
    rows = plot(known.positions, width - 4, height - 2, _AXIS_STYLES, scale=1e3, least=0.1, marks=walls)
    return _box("position", _coloured(titles, " mm"), rows, width)


def _force_box(known: ScreenState, status: Status, width: int, height: int) -> list[Text]:
    assert known.position is not None
    axes = _axes(status, known.position)
    titles = _values(axes, known.position.force_n, 2, width - len("force N") - 7)
    # Without forces at all nothing is limited: the state in the first line says it.
    limited = status.armed and known.position.force_n != known.position.force_requested_n
    styles = [_REQUESTED] * len(axes) + [_AXIS_STYLES[index % 3] for index in range(len(axes))]
    rows = plot(known.forces, width - 4, height - 2, styles, least=1.0, ruling=len(axes), marks=(0.0,))
    title = _coloured(titles, " N")
    if limited:
        title = Text("limited ", style=_REQUESTED).append_text(title)
    return _box("force", title, rows, width)


def _axes(status: Status, position: Position) -> tuple[str, ...]:
    """Names of the axes; a device with a single one has it where the first wall is."""
    names = status.axes
    if len(names) == 1 and status.wall_axis:
        names = status.wall_axis[:1]
    return names + tuple(str(index) for index in range(len(names), len(position.position_m)))


def _values(axes: Sequence[str], values: Sequence[float], digits: int, width: int) -> list[str]:
    """A value an axis, with as many digits as there is room for."""
    titles: list[str] = []
    for shown in range(digits, -1, -1):
        titles = [f"{name} {value:+.{shown}f}" for name, value in zip(axes, values, strict=False)]
        if len(" ".join(titles)) <= width:
            break
    return titles


def _coloured(titles: Sequence[str], unit: str) -> Text:
    text = Text("")
    for index, title in enumerate(titles):
        text.append(" " if index else "").append(title, f"bold {_AXIS_STYLES[index % 3]}")
    return text.append(unit, _QUIET)


def _walls(known: ScreenState, status: Status, width: int) -> list[Text]:
    damping = known.damping
    if damping is None:
        return []
    if not damping.damping_n_s_per_m:
        return [Text(" no walls in the scene", style=_QUIET)]
    lines = []
    count = count_walls(known.damping, status)
    for index in range(min(count, _MOST_WALLS)):
        line = _quiet(" wall ").append(f"{index}", "bold")
        if index < len(status.wall_axis):
            line.append(f" {status.wall_axis[index]}")
        if index < len(status.wall_stiffness_n_per_m):
            line.append(f" {si(status.wall_stiffness_n_per_m[index], 'N/m'):>9}")
        line.append(
            "  ● inside " if damping.in_contact[index] else "  ○ outside",
            "bold cyan" if damping.in_contact[index] else _QUIET,
        )
        line.append("  damping ", _QUIET).append(f"{damping.damping_n_s_per_m[index]:6.1f}", "bold").append(" N s/m ")
        line.append(f"{bars([max(0.0, value) for value in known.dampings[index]]):<8}", "green")
        mass = damping.felt_mass_kg[index]
        line.append(" felt mass ", _QUIET)
        line.append(f"{mass:.3f} kg" if mass else "unknown", "bold" if mass else _QUIET)
        lines.append(line)
    if count > _MOST_WALLS:
        lines[-1] = _spread(lines[-1], Text(f"+{count - _MOST_WALLS} walls ", style=_QUIET), width)
    return [*lines, *port_lines(known.pushes, known.damping, status, width)]


def _energy(known: ScreenState, width: int) -> Text:
    energy = known.energy
    line = _quiet(" energy ")
    if energy is None:
        return line
    gap = "  " if width < 90 else "     "
    line.append("in ", _QUIET).append(f"{si(energy.energy_j, 'J'):<8}", "bold")
    line.append(f"{gap}springs ", _QUIET).append(f"{si(energy.spring_energy_j, 'J'):<8}")
    line.append(f"{gap}dissipated ", _QUIET).append(f"{si(energy.dissipated_j, 'J'):<8}")
    made = energy.generated_j > 0.0
    return line.append(f"{gap}generated ", _QUIET).append(si(energy.generated_j, "J"), "bold yellow" if made else "")


def _logs(known: ScreenState, width: int, rows: int) -> list[Text]:
    times = _quiet(f"times {zone(known.events[0].timestamp)}" if known.events else "")
    if width < _NARROW:
        return _box("events", times, _event_rows(known, rows, width - 4), width)
    left = _CYCLES_WIDTH
    cycles = _box("cycles", Text(""), _cycle_rows(known, rows), left)
    return _side_by_side(cycles, _box("events", times, _event_rows(known, rows, width - left - 4), width - left))


def _cycle_rows(known: ScreenState, rows: int) -> list[Text]:
    lines = [Text(f"{'n':>5}{'w':>2}{'time':>8}{'generated':>10}{'N s/m':>7}", style=_QUIET)]
    for cycle in list(known.cycles)[: rows - 1]:
        line = Text(f"{cycle.cycle:>5}{cycle.contact:>2}{si(cycle.duration_s, 's'):>8}")
        line.append(f"{si(cycle.generated_j, 'J'):>10}", "yellow" if cycle.generated_j > 0.0 else "")
        lines.append(line.append(f"{cycle.damping_n_s_per_m:>7.1f}"))
    return (lines + [Text("")] * rows)[:rows]


def _event_rows(known: ScreenState, rows: int, width: int) -> list[Text]:
    """The latest events, each in as many lines as it takes."""
    lines: list[Text] = []
    for event in list(known.events)[:rows]:
        sign, style = (
            ("✗", "bold red") if 200 <= event.code < 300 else ("⚠", "yellow") if event.code >= 300 else ("·", "")
        )
        clock = time.strftime("%H:%M:%S ", time.localtime(event.timestamp))
        first, *others = textwrap.wrap(event.text, max(8, width - len(clock) - 2)) or [""]
        lines.append(_quiet(clock).append(f"{sign} {first}", style))
        lines += [Text(" " * (len(clock) + 2) + part, style) for part in others]
    if not lines:
        lines = [Text("none since this view was opened", style=_QUIET)]
    return (lines + [Text("")] * rows)[:rows]


def _footer(status: Status, endpoint: str, width: int) -> Text:
    cells = (width if width < _NARROW else width // 2) - 4 - LABEL_WIDTH
    right = _quiet(f"{2 * max(1, cells) * SLICE_S:.1f} s shown  ").append("q", "bold").append(" quit ", _QUIET)
    left = _quiet(f" hapticd {status.version}  config {status.config_hash or '-'}  {endpoint}")
    left.truncate(max(0, width - right.cell_len - 1), overflow="ellipsis")
    return _spread(left, right, width)


def _spread(left: Text, right: Text, width: int) -> Text:
    """Both ends of a line; what does not fit is cut from the left part."""
    room = max(0, width - right.cell_len)
    left.truncate(room, overflow="ellipsis", pad=True)
    return left.append_text(right)


def _box(title: str, right: Text, rows: Sequence[Text], width: int) -> list[Text]:
    """Rows in a frame of a given width, with a title at the left and something at the right of its upper edge."""
    edge = _quiet("╭ ").append(title, "default").append(" ", _QUIET)
    if right.cell_len:
        right.truncate(max(0, width - edge.cell_len - 4), overflow="ellipsis")
        right = Text(" ").append_text(right).append(" ")
    edge.append("─" * (width - edge.cell_len - right.cell_len - 1), _QUIET).append_text(right).append("╮", _QUIET)
    lines = [edge]
    for row in rows:
        row.truncate(width - 4, overflow="ellipsis", pad=True)
        lines.append(_quiet("│ ").append_text(row).append(" │", _QUIET))
    lines.append(_quiet("╰" + "─" * (width - 2) + "╯"))
    return lines


def _quiet(text: str) -> Text:
    """The beginning of a line, dim; what is appended is not."""
    return Text("").append(text, _QUIET)


def _side_by_side(left: Sequence[Text], right: Sequence[Text]) -> list[Text]:
    return [Text("").append_text(one).append_text(other) for one, other in zip(left, right, strict=True)]
