"""Signals as text: traces in braille dots, bars in eighths of a block."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from rich.text import Text

SLICE_S = 0.05
"""Time that one column of dots stands for [s]."""

LABEL_WIDTH = 7
"""Characters of a plot's axis."""

_BARS = " ▁▂▃▄▅▆▇█"
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))  # of a braille cell: left column, right column
_KEEP = 2000


class Trace:
    """Lowest and highest value of each series in every slice of time, so that no oscillation is too fast to be seen."""

    def __init__(self, series: int) -> None:
        self.series = series
        self._slices: deque[tuple[int, list[float], list[float]]] = deque(maxlen=_KEEP)

    def add(self, timestamp: float, values: Sequence[float]) -> None:
        """Take one value a series; a clock that has gone back starts the trace anew."""
        key = int(timestamp / SLICE_S)
        if self._slices:
            last, lows, highs = self._slices[-1]
            if last == key:
                for index, value in enumerate(values):
                    if value < lows[index]:
                        lows[index] = value
                    elif value > highs[index]:
                        highs[index] = value
                return
            if key < last:
                self._slices.clear()
        self._slices.append((key, list(values), list(values)))

    def window(self, slices: int) -> list[tuple[list[float], list[float]] | None]:
        """The newest slices, oldest first; None where nothing was known."""
        found: list[tuple[list[float], list[float]] | None] = [None] * slices
        newest = self._slices[-1][0] if self._slices else 0
        for key, lows, highs in reversed(self._slices):
            at = slices - 1 - (newest - key)
            if at < 0:
                break
            found[at] = (lows, highs)
        return found


def plot(
    trace: Trace,
    width: int,
    height: int,
    styles: Sequence[str],
    *,
    scale: float = 1.0,
    least: float = 1.0,
    ruling: int = 0,
    marks: Sequence[float] = (),
) -> list[Text]:
    """A trace as lines of text, its axis at the left.

    Args:
        trace: what to show.
        width: characters of a line.
        height: number of lines.
        styles: one a series; later series are drawn over earlier ones.
        scale: factor from values to what the axis is labelled in.
        least: smallest range of the axis, in its own units.
        ruling: first series that the axis must hold; those before it end at its edges.
        marks: values with a line across, always within the range, in their own units.
    """
    cells = max(1, width - LABEL_WIDTH)
    window = trace.window(2 * cells)
    lows = [scale * min(entry[0][ruling:]) for entry in window if entry]
    highs = [scale * max(entry[1][ruling:]) for entry in window if entry]
    lowest = min([*lows, *marks], default=0.0)
    highest = max([*highs, *marks], default=0.0)
    bottom, top = axis(lowest, highest, least)
    canvas = _Canvas(cells, height, bottom, top)
    for series in range(trace.series):
        canvas.draw(
            [(scale * entry[0][series], scale * entry[1][series]) if entry else None for entry in window],
            styles[series % len(styles)],
        )
    marked = {canvas.row(mark) // 4 for mark in marks}
    lines = []
    for row in range(height):
        value = top if row == 0 else bottom if row == height - 1 else None
        line = Text("").append(f"{'' if value is None else _label(value):>{LABEL_WIDTH - 1}} ", "bright_black")
        line.append_text(canvas.line(row, row in marked))
        lines.append(line)
    return lines


def axis(lowest: float, highest: float, least: float) -> tuple[float, float]:
    """Round ends of an axis that holds both values and spans at least `least`; they change seldom while values do."""
    least = max(least, 1e-6 * max(abs(lowest), abs(highest)))  # what a float still resolves
    span = max(highest - lowest, least)
    step = 10.0 ** math.floor(math.log10(span))
    for finer in (0.2, 0.5):
        if span / (step * finer) <= 5.0:
            step *= finer
            break
    middle = 0.5 * (lowest + highest)
    bottom = math.floor(min(lowest, middle - 0.5 * least) / step + 1e-9) * step
    top = math.ceil(max(highest, middle + 0.5 * least) / step - 1e-9) * step
    return bottom, top


def bars(values: Sequence[float], highest: float | None = None) -> str:
    """One bar a value, each as high as its share of the highest; what is not zero is never invisible."""
    most = max(values, default=0.0) if highest is None else highest
    if most <= 0.0:
        return _BARS[0] * len(values)
    eighths = [min(8, max(1, round(8.0 * value / most))) if value > 0.0 else 0 for value in values]
    return "".join(_BARS[eighth] for eighth in eighths)


class _Canvas:
    """Cells of 2 x 4 braille dots."""

    def __init__(self, cells: int, height: int, bottom: float, top: float) -> None:
        self._rows = height * 4
        self._bottom = bottom
        self._per_dot = (self._rows - 1) / (top - bottom)
        self._dots = [[0] * cells for _ in range(height)]
        self._styles = [[""] * cells for _ in range(height)]

    def row(self, value: float) -> int:
        """Row of dots that a value lies on, counted from the top."""
        return self._rows - 1 - min(self._rows - 1, max(0, round((value - self._bottom) * self._per_dot)))

    def draw(self, columns: Sequence[tuple[float, float] | None], style: str) -> None:
        """A line through the ranges of all columns of dots."""
        before: tuple[int, int] | None = None
        for column, entry in enumerate(columns):
            if entry is None:
                before = None
                continue
            first, last = self.row(entry[1]), self.row(entry[0])
            upper, lower = first, last
            if before is not None:  # reach out to where the line was
                upper, lower = min(upper, before[1]), max(lower, before[0])
            before = (first, last)
            cell, bits = column // 2, _DOTS[column % 2]
            for row in range(upper, lower + 1):
                self._dots[row // 4][cell] |= bits[row % 4]
                self._styles[row // 4][cell] = style

    def line(self, row: int, marked: bool) -> Text:
        """A row of cells; runs of one style stay together."""
        text = Text("")
        run, run_style = "", ""
        for dots, drawn in zip(self._dots[row], self._styles[row], strict=True):
            style = drawn or "bright_black"
            if style != run_style:
                text.append(run, run_style)
                run, run_style = "", style
            run += chr(0x2800 + dots) if dots else "┈" if marked else " "
        text.append(run, run_style)
        return text


def _label(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-12 else value:.4g}"
