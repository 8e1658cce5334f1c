"""What `hapticd watch` shows of a contact in space: which object, how deep, which way, and where."""

from __future__ import annotations

import dataclasses

import pytest

from hapticd.cli.watch.screen import frame, one_line
from hapticd.cli.watch.space import direction, view
from hapticd.cli.watch.state import ScreenState
from hapticd.client import Damping, Position, Status, Touch

STATUS = Status(axes=("x", "y", "z"), armed=True, object_name=("ball", "table"), object_shape=("sphere", "plane"))


def touched() -> ScreenState:
    known = ScreenState()
    known.take([STATUS], 0.0)
    for n in range(100):
        at = (1e-4 * n, 0.0, 0.0298)
        force = (1.2, 0.0, 2.4)
        known.take([Position(0.01 * n, n, at, (0.0,) * 3, force, force)], 0.0)
        known.take([Touch(0.01 * n, n, force, 0, (at[0], 0.0, 0.03), (0.0, 0.0, 1.0), 2e-4, True)], 0.0)
    known.take([Damping(1.0, 99, (20.5, 0.0), (True, False), (0.0, 0.0))], 0.0)
    return known


def test_the_picture_names_the_object_its_depth_force_and_direction() -> None:
    text = "\n".join(line.plain for line in frame(touched(), "ipc://here", 100, 40, 0.0))
    assert "● ball           0.200 mm deep  pushes  2.68 N +z+x  damping 20.5 N s/m  sliding" in text
    assert "from above" in text
    assert "from the side" in text
    assert "ball" in one_line(touched())


def test_what_is_left_is_no_longer_shown() -> None:
    known = touched()
    known.take([Position(1.1, 110, (0.0, 0.0, 0.04), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3)], 0.0)
    assert "free of ball, table" in "\n".join(line.plain for line in frame(known, "ipc://here", 100, 40, 0.0))


def test_a_batch_of_positions_that_comes_first_lets_go_of_nothing() -> None:
    known = touched()
    for n in range(100, 120):
        known.take([Position(0.99 + 1e-3 * (n - 99), n, (0.0, 0.0, 0.0298), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3)], 0.0)
    text = "\n".join(line.plain for line in frame(known, "ipc://here", 100, 40, 0.0))
    assert "free of" not in text
    assert "● ball" in text


@pytest.mark.parametrize("width", [80, 100, 140])
def test_every_axis_is_read_at_any_width(width: int) -> None:
    (line, *_) = [line.plain for line in frame(touched(), "ipc://here", width, 40, 0.0) if " position " in line.plain]
    for axis in "xyz":
        assert line.count(f"{axis} +") == 2, line
    assert "…" not in line


def test_a_view_draws_the_way_and_an_arrow_where_it_pushes() -> None:
    lines = [line.plain for line in view(touched().trail, 0, 2, 40, 9)]
    drawn = "".join(lines)
    assert len(lines) == 9
    assert all(len(line) == 40 for line in lines)
    assert "↗" in drawn
    assert drawn.count("·") > 5


def test_a_view_before_the_first_position_is_empty_but_for_the_device() -> None:
    known = ScreenState()
    known.take([STATUS], 0.0)
    assert "".join(line.plain for line in view(known.trail, 0, 1, 40, 9)).strip() == "●"
    assert frame(known, "ipc://here", 100, 40, 0.0)


def test_a_direction_is_told_by_its_largest_parts() -> None:
    assert direction((0.0, 0.0, 3.0)) == "+z"
    assert direction((-1.0, 0.1, 2.0)) == "+z-x"
    assert direction((0.0, 0.0, 0.0)) == ""


def test_couplings_and_forces_stand_behind_walls_and_objects_under_their_names() -> None:
    known = touched()
    kinds = ("object", "coupling", "force")
    known.take([dataclasses.replace(STATUS, remote_name=("ball", "tool", "field"), remote_kind=kinds)], 0.0)
    values = (7.5, 20.5, 0.0, 3.5, 0.0)
    known.take([Damping(1.0, 99, values, (False, True, False, True, False), (0.0,) * 5)], 0.0)
    ball = Touch(1.0, 100, (0.0, 0.0, 2.4), 0, (0.0, 0.0, 0.03), (0.0, 0.0, 1.0), 2e-4, True, 0, (0,), 0, 17)
    tool = Touch(0.99, 99, (0.3, 0.0, -0.4), remote=1, remote_seq=42, target_m=(0.0, 0.0, 0.01))
    known.take([ball, tool, Touch(0.9, 90, (0.0, 0.0, 1.0), remote=2)], 0.0)
    text = "\n".join(line.plain for line in frame(known, "ipc://here", 100, 40, 0.0))
    assert text.count("wall 0") == 1
    assert "wall 1" not in text
    assert "client's tool  ● held     pushes  0.50 N -z+x  damping   3.5 N s/m  message 42" in text
    assert "client's field  ○ let go   damping   0.0 N s/m" in text
    assert text.count("pushes") == 2
    assert "damping 20.5 N s/m  sliding  message 17" in text
    assert "tool held 0.50 N damping 3.5 N s/m" in one_line(known)
    assert "field let go damping 0.0 N s/m" in one_line(known)
    known.take([Touch(1.0, 100, (0.1, 0.0, 0.0), remote=1)], 0.0)
    text = "\n".join(line.plain for line in frame(known, "ipc://here", 100, 40, 0.0))
    assert "0.10 N +x  damping   3.5 N s/m  fades out" in text


def test_eighty_columns_cut_no_line_of_what_is_touched_or_driven() -> None:
    known = touched()
    kinds = ("object", "coupling")
    known.take([dataclasses.replace(STATUS, remote_name=("ball", "tool"), remote_kind=kinds)], 0.0)
    known.take([Damping(1.0, 99, (7.5, 120.5, 0.0, 150.5), (True, True, False, True), (0.25,) * 4)], 0.0)
    ball = Touch(1.0, 100, (6.0, 5.9, 5.8), 0, (0.0, 0.0, 0.03), (0.0, 0.0, 1.0), 2e-4, True, 0, (0,), 0, 123456)
    known.take([ball, Touch(1.0, 100, (6.0, 5.9, -5.8), remote=1, remote_seq=123456, target_m=(0.0,) * 3)], 0.0)
    lines = [line.plain.rstrip() for line in frame(known, "ipc://here", 80, 40, 0.0)]
    assert " tool  ● held     pushes 10.22 N +x+y-z  damping 150.5 N s/m  message 123456" in lines
    assert " ● ball   0.200 mm deep  pushes 10.22 N +x+y+z  damping 120.5 N s/m  sliding" in lines
    assert not [line for line in lines if "…" in line]
