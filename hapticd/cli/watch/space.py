"""A contact in space as text: what is touched, how deep, which way it pushes, and where, from above and beside."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence

from rich.text import Text

from hapticd.cli.watch.line import fitting
from hapticd.client import Status, Touch

VIEW_ROWS = 9
"""Lines of the two views, their frame not among them."""

MOST_LINES = 4
"""Most objects that have a line at once."""

_QUIET = "bright_black"
_AXES = "xyz"
_LEAST_M = 0.01  # smallest half width of a view
_ARROWS = "→↗↑↖←↙↓↘"
_LEFT_S = 0.1  # positions and touches come in batches of their own: by then a touch is over
_TALL = 2.0  # a character is about twice as high as wide

Point = Sequence[float]


class Trail:
    """Where the device was lately, and what it touches now."""

    def __init__(self) -> None:
        self.points: deque[Point] = deque(maxlen=600)
        self.touches: list[Touch] = []
        self._seq = -1
        self._touched_s = -math.inf
        self._due_s = -math.inf

    def pass_by(self, timestamp: float, position_m: Point) -> None:
        """Take a position; what was touched long before it is no longer."""
        if self.touches and abs(timestamp - self._touched_s) > _LEFT_S:
            self.touches = []
        if abs(timestamp - self._due_s) >= 0.005:
            self._due_s = timestamp
            self.points.append(position_m)

    def touch(self, touch: Touch) -> None:
        """Take what is touched in a tick; those of one tick come together."""
        if touch.seq != self._seq:
            self._seq = touch.seq
            self._touched_s = touch.timestamp
            self.touches = []
        self.touches.append(touch)


def contact_lines(trail: Trail, status: Status, dampings: Sequence[float], width: int) -> list[Text]:
    """A line for each object that is touched, or one that says that none is; the message goes where room is short.

    Args:
        trail: where the device was, and what it touches.
        status: names of the objects.
        dampings: of the law on each object [N s/m].
        width: characters of a line.
    """
    if not status.object_name:
        return []
    if not trail.touches:
        names = ", ".join(status.object_name[:3]) + (" ..." if len(status.object_name) > 3 else "")
        return [Text(" free of ", style=_QUIET).append(names, "default")]
    lines = []
    for touch in trail.touches[:MOST_LINES]:
        at = touch.object if touch.carrier < 0 else touch.carrier
        name = status.object_name[at] if at < len(status.object_name) else str(at)
        message = f"  message {touch.remote_seq}" if touch.remote_seq >= 0 else ""
        choices = ((f"{name:<12}", message), (name, message), (name, ""))
        lines.append(fitting((_touched(first, touch, dampings, last) for first, last in choices), width))
    return lines


def direction(vector: Point) -> str:
    """Which way a vector points, by its largest parts: +z, or +z-x where two are alike."""
    length = math.sqrt(sum(value * value for value in vector))
    if length == 0.0:
        return ""
    parts = sorted(((abs(value), axis) for axis, value in enumerate(vector)), reverse=True)
    return "".join(("+" if vector[axis] > 0.0 else "-") + _AXES[axis] for size, axis in parts if size > 0.38 * length)


def view(trail: Trail, across: int, up: int, width: int, height: int) -> list[Text]:
    """The way of the device and what it touches, seen along the third axis: lines of `width` characters.

    Args:
        trail: where the device was, and what it touches.
        across: axis that points to the right.
        up: axis that points up.
        width: characters of a line.
        height: lines.
    """
    here = trail.points[-1] if trail.points else (0.0, 0.0, 0.0)
    shown = [*trail.points, *(touch.proxy_m for touch in trail.touches)]
    middle = [0.5 * (min(at) + max(at)) for at in _columns(shown or [here], (across, up))]
    aside_m = [abs(point[across] - middle[0]) for point in shown]
    above_m = [abs(point[up] - middle[1]) * width / (_TALL * height) for point in shown]
    reach_m = _rounded(max([_LEAST_M, *aside_m, *above_m]))
    cells = [[(" ", "")] * width for _ in range(height)]

    def put(point: Point, mark: str, style: str) -> None:
        column = round((0.5 + 0.5 * (point[across] - middle[0]) / reach_m) * (width - 1))
        row = round(0.5 * (height - 1) - 0.5 * (point[up] - middle[1]) / reach_m * (width - 1) / _TALL)
        if 0 <= column < width and 0 <= row < height:
            cells[row][column] = (mark, style)

    for point in trail.points:
        put(point, "·", "cyan")
    put(here, "●", "bold cyan")
    for touch in trail.touches:
        put(touch.proxy_m, _arrow(touch.force_n[across], touch.force_n[up]), "bold green")
    lines = []
    for row in cells:
        line = Text("")
        for mark, style in row:
            line.append(mark, style)
        lines.append(line)
    return lines


def views(trail: Trail, width: int) -> list[tuple[str, str, list[Text]]]:
    """Titles and lines of the view from above (x right, y up) and the one beside (x right, z up).

    Args:
        trail: where the device was, and what it touches.
        width: characters of both together.
    """
    half = width // 2
    return [
        ("from above", "x → y ↑", view(trail, 0, 1, half - 4, VIEW_ROWS)),
        ("from the side", "x → z ↑", view(trail, 0, 2, width - half - 4, VIEW_ROWS)),
    ]


def _touched(name: str, touch: Touch, dampings: Sequence[float], message: str) -> Text:
    newton = math.sqrt(sum(value * value for value in touch.force_n))
    line = Text(" ● ", style="bold cyan").append(name, "bold")
    line.append(f" {1e3 * touch.depth_m:7.3f} mm deep", "default").append("  pushes ", _QUIET)
    line.append(f"{newton:5.2f} N", "bold").append(f" {direction(touch.force_n)}", "default")
    if touch.object < len(dampings):
        line.append("  damping ", _QUIET).append(f"{dampings[touch.object]:.1f}").append(" N s/m", _QUIET)
    return line.append("  sliding" if touch.sliding else "", "yellow").append(message, _QUIET)


def _columns(points: Iterable[Point], axes: Sequence[int]) -> list[list[float]]:
    found = list(points)
    return [[point[axis] for point in found] for axis in axes]


def _rounded(reach_m: float) -> float:
    """A little more than that, so that the picture stands still while the device moves."""
    step = 10.0 ** math.floor(math.log10(reach_m))
    return next(step * factor for factor in (1.0, 2.0, 5.0, 10.0) if step * factor >= 0.999 * reach_m)


def _arrow(across: float, up: float) -> str:
    """Which way a force points in a view; one along the line of sight is a dot in a ring."""
    if math.hypot(across, up) < 1e-9:
        return "◉"
    return _ARROWS[round(math.atan2(up, across) / (math.pi / 4.0)) % 8]
