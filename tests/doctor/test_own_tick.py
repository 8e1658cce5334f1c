"""The tick that the doctor times is the configuration's own, pressed and without fault for as long as it lasts."""

from __future__ import annotations

from pathlib import Path

import pytest

from hapticd.config.loading import load, parse
from hapticd.doctor.own_tick import own_tick
from hapticd.loop.press import Press
from hapticd.paths import directory
from hapticd.tick.guard import Mode

SHIPPED = sorted(directory("config").glob("*.toml"))


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_every_shipped_configuration_can_be_timed(file: Path) -> None:
    """For 3 s of presses: a tick that stops would be timed as a quick one."""
    tick = own_tick(load(file))
    press = Press(tick)
    pressed = 0
    for _ in range(3000):
        press.step()
        pressed += any(tick.requested_n)
    assert (tick.fault, tick.fault_text, tick.guard.mode) == (0, "", Mode.ARMED)
    assert pressed > 1000


@pytest.mark.parametrize(
    ("device", "axes"),
    [
        ('driver = "loopback"', ("x",)),
        ('driver = "loopback"\n[device.options]\naxes = 3', ("x", "y", "z")),
        ('driver = "omega7"', ("x", "y", "z")),
    ],
)
def test_it_has_as_many_axes_as_can_be_known_of_a_device_that_is_not_open(device: str, axes: tuple[str, ...]) -> None:
    assert own_tick(parse(f"[device]\n{device}\n", "lab.toml")).info.axes == axes


def test_motors_are_axes() -> None:
    assert own_tick(load(directory("config") / "moteus.toml")).info.axes == ("x",)
