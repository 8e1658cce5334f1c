"""How many objects a scene may have: as many as it says, and one more is refused in one line before any force."""

from __future__ import annotations

import pytest

from hapticd.config.loading import parse
from hapticd.errors import ConfigError

MOST = 64


def scene(count: int) -> str:
    """A scene of some number of balls."""
    ball = '[[scene.objects]]\nname = "ball {}"\nshape = "sphere"\nradius_m = 0.01\nstiffness_n_per_m = 1000.0\n'
    return '[device.options]\nmodel = "omega7"\naxes = 3\n' + "".join(ball.format(at) for at in range(count))


def test_sixty_four_objects_are_a_scene() -> None:
    assert len(parse(scene(MOST), "lab.toml").config.scene.objects) == MOST


def test_one_more_is_one_clear_line() -> None:
    with pytest.raises(ConfigError) as refused:
        parse(scene(MOST + 1), "lab.toml")
    assert str(refused.value).startswith("lab.toml: scene.objects")
    assert "64" in str(refused.value)
    assert "\n" not in str(refused.value)
