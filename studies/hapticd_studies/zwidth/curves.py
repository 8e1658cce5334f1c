"""The analytic limits as curves in the plane of a map."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from contourpy import contour_generator

from hapticd_studies.boundaries import BOUNDARIES, Boundary, Loop
from hapticd_studies.zwidth.plane import MapAxis, spaced
from hapticd_studies.zwidth.scenario import PressScenario

_POINTS = 201
_CONTOUR_POINTS = 61


@dataclass(frozen=True, slots=True)
class Curve:
    """One limit in the plane.

    Attributes:
        key, label: of the limit.
        lines: its pieces, each a list of (x, y) in the units of the axes.
    """

    key: str
    label: str
    lines: Sequence[Sequence[tuple[float, float]]]


def curves(scenario: PressScenario, x: MapAxis, y: MapAxis) -> list[Curve]:
    """Every limit that says something about this plane."""
    found = []
    for boundary in BOUNDARIES:
        lines = _lines(boundary, scenario, x, y)
        if lines:
            found.append(Curve(boundary.key, boundary.label, lines))
    return found


def limits(
    boundary: Boundary, scenario: PressScenario, x: MapAxis, y: MapAxis
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """The limit over the stiffness that the wall has, for every cell: one row a y; below 1 is beyond the limit."""
    return np.array([[_margin(boundary, put_both(scenario, x, y, at, row)) for at in x.values] for row in y.values])


def put_both(scenario: PressScenario, x: MapAxis, y: MapAxis, at_x: float, at_y: float) -> PressScenario:
    """The scenario of one place in the plane."""
    return x.quantity.put(y.quantity.put(scenario, at_y), at_x)


def _lines(boundary: Boundary, scenario: PressScenario, x: MapAxis, y: MapAxis) -> list[list[tuple[float, float]]]:
    if x.quantity.name == "stiffness":
        return _explicit(lambda at: boundary.limit_n_per_m(_loop(scenario, y, at)), y, lambda at, limit: (limit, at))
    if y.quantity.name == "stiffness":
        return _explicit(lambda at: boundary.limit_n_per_m(_loop(scenario, x, at)), x, lambda at, limit: (at, limit))
    fine_x, fine_y = _finer(x, _CONTOUR_POINTS), _finer(y, _CONTOUR_POINTS)
    if len(fine_x.values) < 2 or len(fine_y.values) < 2:
        return []
    heights = np.log(np.clip(limits(boundary, scenario, fine_x, fine_y), 1e-9, 1e9))
    contours = contour_generator(fine_x.values, fine_y.values, np.ma.masked_invalid(heights))
    found: Any = contours.lines(0.0)
    return [[(float(px), float(py)) for px, py in line] for line in found]


def _explicit(
    limit: Callable[[float], float], axis: MapAxis, place: Callable[[float, float], tuple[float, float]]
) -> list[list[tuple[float, float]]]:
    """A curve that is a function of the other axis; where the limit is no number it breaks."""
    pieces: list[list[tuple[float, float]]] = [[]]
    for at in _finer(axis, _POINTS).values:
        stiffness = limit(at)
        if math.isfinite(stiffness):
            pieces[-1].append(place(at, stiffness))
        elif pieces[-1]:
            pieces.append([])
    return [piece for piece in pieces if piece]


def _loop(scenario: PressScenario, axis: MapAxis, at: float) -> Loop:
    return axis.quantity.put(scenario, at).loop()


def _margin(boundary: Boundary, scenario: PressScenario) -> float:
    return boundary.limit_n_per_m(scenario.loop()) / scenario.wall.stiffness_n_per_m


def _finer(axis: MapAxis, count: int) -> MapAxis:
    whole = axis.quantity.whole
    return MapAxis(
        axis.quantity, spaced(axis.values[0], axis.values[-1], count, axis.logarithmic, whole), axis.logarithmic
    )
