"""What a scene's tables become: which objects are one solid, whose field is read when, and what is refused by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from hapticd.config.objects import MeshObject
from hapticd.errors import ConfigError
from hapticd.tick.contact import RunningLaw
from hapticd.tick.guard import Guard
from hapticd.tick.space.solid import at_once, compile_objects, field_of
from hapticd.tick.space.tick import SpaceTick
from hapticd_controllers import none
from tests.tick.space.rig import INFO, PERIOD_S, ball, ball_field, config, table


def solids(scene: str) -> list[tuple[str, tuple[int, ...]]]:
    """Their names and members."""
    return [
        (solid.name, solid.members) for solid in at_once(compile_objects(config(scene).config.scene.objects, PERIOD_S))
    ]


@pytest.mark.parametrize(
    "other",
    [
        {"stiffness": 4999.0},
        {"damping_n_s_per_m": 1.0},
        {"static_friction": 0.3, "dynamic_friction": 0.2},
        {"static_friction": 0.2, "dynamic_friction": 0.1},
        {"remote": True},
    ],
    ids=str,
)
def test_objects_that_overlap_are_one_solid_where_they_are_alike_in_everything_on_the_surface(
    other: dict[str, Any],
) -> None:
    alike: dict[str, Any] = {"static_friction": 0.2, "dynamic_friction": 0.2} if "static_friction" in other else {}
    beside: dict[str, Any] = {"position_m": (0.02, 0.0, 0.0)}
    assert solids(ball("one", **alike) + ball("two", **beside, **alike)) == [("one", (0, 1))]
    assert solids(ball("one", **alike) + ball("two", **{**beside, **other})) == [("one", (0,)), ("two", (1,))]


def test_solids_stand_in_the_order_of_their_first_objects() -> None:
    far = ball("far", position_m=(0.5, 0.0, 0.0))
    two = ball("one") + far + ball("two", position_m=(0.02, 0.0, 0.0)) + ball("last", position_m=(0.9, 0.0, 0.0))
    assert solids(two) == [("one", (0, 2)), ("far", (1,)), ("last", (3,))]


def mesh(file: Path) -> str:
    return ball("first", position_m=(0.5, 0.0, 0.0)) + table("mesh", "mesh", file=str(file))


def test_a_mesh_that_is_not_there_or_none_is_refused_with_its_name_and_file(tmp_path: Path) -> None:
    missing, place, text = tmp_path / "missing", tmp_path, tmp_path / "text"
    text.write_text("solid ascii\n")
    with pytest.raises(ConfigError, match=r'scene.objects.1. "mesh": file = .*No such file.*; `hapticd mesh` makes it'):
        solids(mesh(missing))
    with pytest.raises(ConfigError, match=r'scene.objects.1. "mesh": file = .*: Is a directory'):
        solids(mesh(place))
    with pytest.raises(ConfigError, match=r'scene.objects.1. "mesh": file = .*text: '):
        solids(mesh(text))


def test_a_field_is_read_once_for_as_long_as_its_file_does_not_change(tmp_path: Path) -> None:
    file = tmp_path / "ball.field"
    file.write_bytes(ball_field(0.01, 0.002).pack())
    os.utime(file, ns=(1, 1))
    first = field_of(file)
    assert field_of(file) is first
    os.utime(file, ns=(1, 2))
    assert field_of(file) is not first, "later"
    again = field_of(file)
    file.write_bytes(ball_field(0.012, 0.002).pack())
    os.utime(file, ns=(1, 2))
    assert field_of(file) is not again, "larger"
    assert isinstance(config(mesh(file)).config.scene.objects[1], MeshObject)


def test_a_tick_that_has_no_remote_objects_refuses_one_by_its_name() -> None:
    """One of a study, which has no clients."""
    loaded = config(ball("still") + ball("moved", position_m=(0.2, 0.0, 0.0), remote=True))
    settings = loaded.config

    def without_clients() -> SpaceTick:
        guard = Guard(settings.safety, INFO)
        law = RunningLaw(none, none.Params())
        return SpaceTick(settings.scene, settings.velocity, guard, INFO, lambda: law, PERIOD_S, 0.05)

    with pytest.raises(ConfigError, match=r'^"moved": this tick has no remote objects$'):
        without_clients()
