"""An object in which the device would start is refused before there is any force."""

from __future__ import annotations

import dataclasses

import pytest

from hapticd.errors import ConfigError
from tests.tick.space.rig import INFO, Rig, ball, table


def test_an_object_that_swallows_the_start_is_refused_before_any_force() -> None:
    info = dataclasses.replace(INFO, start_m=(0.0, 0.0, 0.029))
    with pytest.raises(ConfigError) as refused:
        Rig(ball(), info=info)
    assert str(refused.value) == 'bench: scene.objects[0] "ball": swallows the device, which starts 1 mm inside it'


@pytest.mark.parametrize("at", [(0.009, 0.0, 0.0), (0.0, 0.019, 0.0), (0.0, 0.0, -0.029)])
def test_how_far_inside_it_starts_goes_by_where_the_device_is(at: tuple[float, float, float]) -> None:
    info = dataclasses.replace(INFO, start_m=at)
    with pytest.raises(ConfigError, match="starts 1 mm inside it"):
        Rig(table("box", "box", size_m=(0.02, 0.04, 0.06)), info=info)
