"""The rehearsal before the first deadline is a healthy press, or what it warms is the way of a fault."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hapticd.config.models import VelocityConfig
from hapticd.config.safety import SafetyConfig
from hapticd.loop.warm_up import TICKS, warm_up
from hapticd.tick.guard import Guard, Mode
from hapticd.tick.tick import ControlTick
from tests.tick.rig import device, law, running, scene, wall


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0, 4000.0, 8000.0])
@pytest.mark.parametrize("kind", [{"has_clock": True}, {"has_sequence": True}, {}], ids=str)
@pytest.mark.parametrize("max_speed_m_per_s", [0.05, 2.0, math.inf])
@pytest.mark.parametrize("workspace_m", [(-0.1, 0.1), (-math.inf, math.inf), (0.02, 0.3)])
def test_it_is_armed_and_without_fault_to_its_end(
    rate_hz: float, kind: dict[str, Any], max_speed_m_per_s: float, workspace_m: tuple[float, float]
) -> None:
    """Time went on by a nanosecond a tick: hands of 5e5 m/s, and a latched guard for half of it."""
    inside: list[bool] = []

    def step(_state: Any, _params: Any, shown: Any) -> float:
        inside.append(shown.in_contact)
        assert abs(shown.velocity_m_per_s) < 1.0
        force_n: float = shown.contact_n
        return force_n

    info = device("xyz", workspace_m=(workspace_m,) * 3, simulated=max_speed_m_per_s == math.inf, **kind)
    safety = SafetyConfig(max_speed_m_per_s=None if max_speed_m_per_s == math.inf else max_speed_m_per_s)
    tick = ControlTick(
        scene(wall(axis="x", position_m=0.05), wall(axis="z", position_m=-0.05)),
        VelocityConfig(),
        Guard(safety, info),
        info,
        running(law(step)),
        1.0 / rate_hz,
        0.05,
    )
    warm_up(tick)
    assert tick.fault == 0, tick.fault_text
    assert tick.guard.mode is Mode.ARMED
    assert len(inside) == 2 * TICKS
    assert sum(inside) > 0.2 * TICKS
    assert not all(inside)
