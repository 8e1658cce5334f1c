"""A path in space is drawn in three views, on the solids that it touches."""

from __future__ import annotations

import numpy as np
import pytest

from hapticd.errors import HapticdError
from hapticd.figures.picture import encoded
from hapticd.figures.space import views
from hapticd.shapes.pose import Pose
from hapticd.shapes.solid import Placed, Proxy

BALL = Proxy([Placed("sphere", Pose.of((0.0, 0.0, 0.0)), radius_m=0.012)])
PATH = np.stack([np.linspace(-0.02, 0.02, 50), np.zeros(50), np.full(50, 0.0115)], axis=1)


def held() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    length = np.linalg.norm(PATH, axis=1, keepdims=True)
    return np.where(length < 0.012, 0.012 * PATH / length, np.nan)


def test_three_views_show_path_proxy_and_the_solid_in_millimetres() -> None:
    figure = views(PATH, [BALL], held(), "a stroke")
    assert [(panel.get_xlabel(), panel.get_ylabel()) for panel in figure.axes] == [
        ("x [mm]", "y [mm]"),
        ("x [mm]", "z [mm]"),
        ("y [mm]", "z [mm]"),
    ]
    side = figure.axes[1]
    path, pressed, proxy = (line.get_xydata() for line in side.lines[:3])
    assert np.asarray(path) == pytest.approx(1e3 * PATH[:, [0, 2]])
    assert np.asarray(proxy) == pytest.approx(1e3 * held()[:, [0, 2]], nan_ok=True)
    assert np.isnan(np.asarray(pressed)).any()
    # The outline of the cut is the ball's own circle, to half a cell.
    outline = np.concatenate([path.vertices for each in side.collections for path in each.get_paths()])
    radius = np.hypot(outline[:, 0], outline[:, 1])
    assert np.abs(radius - 12.0).min() < 0.01
    assert radius.max() < 12.3
    assert encoded(figure, ".png").startswith(b"\x89PNG")


def test_a_path_that_touches_nothing_is_drawn_too() -> None:
    figure = views(PATH + 0.1, [BALL])
    assert all(len(panel.lines) == 2 for panel in figure.axes)
    assert not any(panel.collections for panel in figure.axes)


@pytest.mark.parametrize("path", [np.zeros((0, 3)), np.zeros((5, 2)), np.zeros(3)])
def test_what_is_no_path_in_space_is_refused(path: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> None:
    with pytest.raises(HapticdError, match="path_m: must be positions of three axes"):
        views(path, [BALL])


def test_a_proxy_for_other_ticks_is_refused() -> None:
    with pytest.raises(HapticdError, match="proxy_m: has 49 points, and path_m 50"):
        views(PATH, [BALL], PATH[1:])
